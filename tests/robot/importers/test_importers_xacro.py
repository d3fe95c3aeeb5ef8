"""Xacro expands as its users expect, never runs Python, and never leaves its folders."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.importers.expressions import evaluate
from wakewise.robot.importers.packages import PackagePaths
from wakewise.robot.importers.xacro import XacroExpander
from wakewise.robot.importers.xacro_text import literal, parse_parameters
from wakewise.robot.importers.xml import Element, SourceLocation, parse_xml

HEAD = '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">'


def expand(folder: Path, body: str, *, skip_missing: bool = False, **arguments: str) -> Element:
    path = folder / "main.xacro"
    path.write_text(f"{HEAD}\n{body}\n</robot>")
    return XacroExpander(PackagePaths(path), arguments, skip_missing=skip_missing).expand(
        parse_xml(path.read_text(), path)
    )


def nothing(name: str) -> float:
    raise KeyError(name)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2*3", 7),
        ("-74.53*pi/180", -74.53 * math.pi / 180),
        ("radians(90) + math.pi", 1.5 * math.pi),
        ("2**3 - pow(2, 3)", 0),
        ("1 if 2 > 1 and not False else 0", 1),
        ("'a' + 'b'", "ab"),
        ("max([1, 5, 2])", 5),
        ("'front_left'.startswith('front')", True),
        ("[10, 20][1]", 20),
        ("1 < 2 < 3", True),
    ],
)
def test_expressions_have_the_values_of_arithmetic(text: str, value: object) -> None:
    """Numbers, words, comparisons and functions."""
    assert evaluate(text, nothing) == value


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__.__bases__",
        "open('/etc/passwd')",
        "(lambda: 1)()",
        "[x for x in [1]]",
        "'a'.format(1)",
        "9**9**9",
        "10**64**2",
        "'a' * 10",
        "f'{1}'",
        "exec('1')",
        "1/0",
        "sqrt(-1)",
        "(-1)**0.5",
        "'%1000000d' % 1",
        "undefined",
        "",
        "1 +",
        "(" * 900,
        "x" * 3000,
        "{'a': 1}",
        "globals()",
        "str.__init__",
        "a := 1",
    ],
)
def test_expressions_are_not_python(text: str) -> None:
    """What is not arithmetic is refused, and nothing runs."""
    with pytest.raises(InputError):
        evaluate(text, nothing)


@given(st.text(max_size=60))
def test_no_expression_raises_anything_else(text: str) -> None:
    """Random text is a value or an InputError."""
    try:
        evaluate(text, nothing)
    except InputError:
        pass
    else:
        assert text.strip()


def test_macros_blocks_conditions_and_scopes(tmp_path: Path) -> None:
    """A macro takes parameters, defaults, forwarded names and blocks; conditions choose; properties are lazy."""
    body = """
    <xacro:arg name="ns" default="sub"/>
    <xacro:property name="b" value="${a * 2}"/>
    <xacro:property name="a" value="3"/>
    <xacro:property name="side" value="left"/>
    <xacro:macro name="thruster" params="id *origin ccw:=^|false size:=${b} side:=^">
      <xacro:if value="${ccw}"><ccw/></xacro:if>
      <xacro:unless value="${ccw}"><cw/></xacro:unless>
      <joint name="$(arg ns)/t${id}" size="${size}" side="${side}"><xacro:insert_block name="origin"/></joint>
    </xacro:macro>
    <xacro:thruster id="1"><origin xyz="0 ${a} 0"/></xacro:thruster>
    <xacro:thruster id="2" ccw="true" size="1.5"><origin xyz="1 2 3"/></xacro:thruster>
    """
    root = expand(tmp_path, body, ns="rov")
    assert [e.tag for e in root.children] == ["cw", "joint", "ccw", "joint"]
    first, second = root.all("joint")
    assert first.attributes == {"name": "rov/t1", "size": "6", "side": "left"}
    assert first.children[0].attributes["xyz"] == "0 3 0"
    assert second.attributes["size"] == "1.5"


def test_includes_bring_macros_and_properties(tmp_path: Path) -> None:
    """A package is found by its package.xml above the file, and a relative include beside it."""
    package = tmp_path / "checkout"
    (package / "urdf").mkdir(parents=True)
    (package / "robots").mkdir()
    (package / "package.xml").write_text("<package><name>my_rov</name></package>")
    (package / "urdf" / "a.xacro").write_text(f'{HEAD}<xacro:property name="m" value="4"/></robot>')
    (package / "urdf" / "b.xacro").write_text(f"{HEAD}<link name='b'/></robot>")
    (package / "urdf" / "c.yaml").write_text("mass: {base: 12.5}")
    body = """<xacro:include filename="$(find my_rov)/urdf/a.xacro"/><xacro:include filename="../urdf/b.xacro"/>
    <xacro:property name="p" value="${load_yaml('$(find my_rov)/urdf/c.yaml')}"/>
    <mass value="${m + p['mass']['base'] + p.mass.base}"/>"""
    root = expand(package / "robots", body)
    assert [e.tag for e in root.children] == ["link", "mass"]
    assert root.children[1].attributes["value"] == "29.0"


def test_a_missing_include_is_refused_with_its_line(tmp_path: Path) -> None:
    """The message names file, line and what to do."""
    with pytest.raises(InputError, match=r"main.xacro:3: include gone.xacro: no such file \(--skip-missing"):
        expand(tmp_path, '\n<xacro:include filename="gone.xacro"/>')
    with pytest.raises(InputError, match=r"main.xacro:2: package nowhere_x not found .* --package nowhere_x=DIR"):
        expand(tmp_path, '<xacro:include filename="$(find nowhere_x)/urdf/a.xacro"/>')
    assert expand(tmp_path, '<xacro:include filename="gone.xacro" optional="true"/><a/>').all("a")


def test_a_missing_include_can_be_left_out_and_is_told(tmp_path: Path) -> None:
    """Calls of the macros that it held are left out too, and both are noted."""
    path = tmp_path / "main.xacro"
    path.write_text(f'{HEAD}<xacro:include filename="gone.xacro"/><xacro:sonar x="1"/><link name="a"/></robot>')
    xacro = XacroExpander(PackagePaths(path), {}, skip_missing=True)
    assert [e.tag for e in xacro.expand(parse_xml(path.read_text(), path)).children] == ["link"]
    assert any("gone.xacro" in note for note in xacro.notes)
    assert any("sonar" in note for note in xacro.notes)
    with pytest.raises(InputError, match=r"d2r is not defined \(perhaps in .*gone.xacro, which was left out\)"):
        expand(tmp_path, '<xacro:include filename="gone.xacro"/><x v="${45*d2r}"/>', skip_missing=True)


@pytest.mark.parametrize("way", ["../../outside.xacro", "{out}/outside.xacro", "file://{out}/outside.xacro", "link/x"])
def test_includes_may_not_climb_out(tmp_path: Path, way: str) -> None:
    """Neither dots, nor absolute paths, nor links lead out of the file's folder."""
    inside = tmp_path / "a" / "b"
    inside.mkdir(parents=True)
    (tmp_path / "outside.xacro").write_text(f"{HEAD}<secret/></robot>")
    (tmp_path / "x").write_text(f"{HEAD}<secret/></robot>")
    (inside / "link").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"main.xacro:2: path .* climbs out of"):
        expand(inside, f'<xacro:include filename="{way.format(out=tmp_path)}"/>')


def test_system_folders_are_no_packages(tmp_path: Path) -> None:
    """`$(find etc)` does not find /etc."""
    folders = PackagePaths(tmp_path / "x.xacro")
    assert [folders.package(name) for name in ("etc", "tmp", "..", ".", "", "a/b")] == [None] * 6


@pytest.mark.parametrize(
    ("body", "match"),
    [
        ('<xacro:include filename="main.xacro"/>', r"main.xacro:2: include main.xacro: includes itself"),
        ('<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>', "more than 60 deep"),
        ('<xacro:property name="a" value="${a}"/><x v="${a}"/>', "refers to itself"),
        (
            '<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/><x v="${a}"/>',
            "refers to itself",
        ),
        ('<x v="${nope}"/>', r"main.xacro:2: in \$\{nope\}: nope is not defined"),
        ("<xacro:nope/>", r"main.xacro:2: macro nope is not defined"),
        ('<x v="$(arg nope)"/>', r"argument nope has no value; give --arg nope:=VALUE"),
        ('<x v="$(anon HOME)"/>', r"\$\(anon HOME\) is not read"),
        ('<xacro:include filename="$(env HOME)/a.xacro"/>', r"include \$\(env HOME\)/a.xacro: no such file"),
        ('<xacro:if value="maybe"><x/></xacro:if>', "neither true nor false"),
        ('<xacro:macro name="m" params="a"><x/></xacro:macro><xacro:m/>', "macro m needs the parameter a"),
        ('<xacro:macro name="m" params="a"><x/></xacro:macro><xacro:m a="1" b="2"/>', "macro m has no parameter b"),
        ('<xacro:macro name="m" params="*o"><x/></xacro:macro><xacro:m/>', "macro m needs a block o"),
        ('<xacro:insert_block name="o"/>', "block o is not defined"),
        ('<xacro:include filename="*.xacro"/>', "patterns are not read"),
    ],
)
def test_faults_say_where(tmp_path: Path, body: str, match: str) -> None:
    """Each fault names file and line, in one line."""
    with pytest.raises(InputError, match=match) as fault:
        expand(tmp_path, body)
    assert "main.xacro:2" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_text_and_elements_cannot_multiply_without_end(tmp_path: Path) -> None:
    """Doubling properties and doubling macros stop at the limits."""
    doubled = "".join(f'<xacro:property name="p{i}" value="${{p{i - 1}}}${{p{i - 1}}}"/>' for i in range(1, 50))
    with pytest.raises(InputError, match=r"more text than is read|more than 60 deep"):
        expand(tmp_path, f'<xacro:property name="p0" value="x"/>{doubled}<x v="${{p49}}"/>')
    macros = "".join(
        f'<xacro:macro name="m{i}" params=""><xacro:m{i - 1}/><xacro:m{i - 1}/></xacro:macro>' for i in range(1, 40)
    )
    with pytest.raises(InputError, match="expands to more than 100000 elements"):
        expand(tmp_path, f'<xacro:macro name="m0" params=""><x/></xacro:macro>{macros}<xacro:m39/>')


def test_parameters_and_literals() -> None:
    """Defaults in quotes, with expressions, forwarded with and without a fallback."""
    place = SourceLocation(Path("x"), 1)
    names = parse_parameters("a *b **c d:=1 e:='x y' f:=^ g:=^|2 h:=^false i:=${1 + 2} j=5", place)
    assert [(p.name, p.block, p.forward, p.default) for p in names] == [
        ("a", "", False, None),
        ("b", "*", False, None),
        ("c", "**", False, None),
        ("d", "", False, "1"),
        ("e", "", False, "x y"),
        ("f", "", True, None),
        ("g", "", True, "2"),
        ("h", "", True, "false"),
        ("i", "", False, "${1 + 2}"),
        ("j", "", False, "5"),
    ]
    assert [literal(t) for t in ("1", "1.5", "true", "1_000", "'1'", "a b")] == [1, 1.5, True, "1_000", "1", "a b"]


def test_a_macro_of_a_namesake_says_where_it_is_from(tmp_path: Path) -> None:
    """A package found by its name may be another project's: a macro that does not fit names it and the option."""
    for name in ("mine", "other"):
        (tmp_path / name / "urdf").mkdir(parents=True)
        (tmp_path / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
    head = '<robot xmlns:xacro="http://ros.org/wiki/xacro">'
    (tmp_path / "other/urdf/parts.xacro").write_text(
        f'{head}<xacro:macro name="part" params="namespace"><link name="l"/></xacro:macro></robot>'
    )
    path = tmp_path / "mine/urdf/mine.xacro"
    for call, fault in (("", "needs the parameter namespace"), (' namespace="a" foo="1"', "has no parameter foo")):
        path.write_text(f'{head}<xacro:include filename="$(find other)/urdf/parts.xacro"/><xacro:part{call}/></robot>')
        with pytest.raises(
            InputError, match=rf"macro part {fault} \(defined in parts.xacro:1; package other .*--package other=DIR"
        ):
            import_vehicle(path)
