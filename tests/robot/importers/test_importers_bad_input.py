"""What cannot be a vehicle is refused with file and line, and no file whatever raises anything but InputError."""

import math
import random
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_importers_formats import FORWARD, SDF, STONEFISH, THRUSTERS, URDF

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft, draft_yaml

SDF_WHOLE = SDF.replace("PLUGINS", THRUSTERS)
URDF_WHOLE = URDF.replace("AXIS", '<axis xyz="0 0 1"/>')
SCN_WHOLE = STONEFISH.replace("THRUSTER", FORWARD.replace("RIGHT", "true"))
YAML_WHOLE = """thrusters: {num: 2}
thruster_positions: [0, 1, 0, 2, 0, 3]
thruster_directions: [1, 0, 0, 1, 0, 0]
max_force: 10
min_force: -5
mass: 4
inertial: {ixx: 1, iyy: 1, izz: 1, ixy: 0, ixz: 0, iyz: 0}
cog: [0, 0, 0]
added_mass: [1, 2, 3, 4, 5, 6]
"""
XACRO_WHOLE = """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:property name="d" value="${pi/180}"/>
<xacro:macro name="t" params="id *origin w:=1"><link name="thruster_${id}"/><joint name="j${id}" type="continuous">
<xacro:insert_block name="origin"/><parent link="base_link"/><child link="thruster_${id}"/>
<axis xyz="${w} 0 0"/></joint>
</xacro:macro><link name="base_link"><inertial><mass value="${2*3}"/>
<inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<xacro:t id="1"><origin xyz="1 0 0" rpy="0 0 ${45*d}"/></xacro:t><xacro:if value="${1 &lt; 2}">
<xacro:t id="2" w="-1"><origin xyz="-1 0 0" rpy="0 0 ${-45*d}"/></xacro:t></xacro:if></robot>"""
WHOLE = {"a.sdf": SDF_WHOLE, "a.urdf": URDF_WHOLE, "a.scn": SCN_WHOLE, "a.yaml": YAML_WHOLE, "a.xacro": XACRO_WHOLE}


@pytest.mark.parametrize("name", list(WHOLE))
def test_the_unbroken_files_load(tmp_path: Path, name: str) -> None:
    """So that the refusals below are of what was broken."""
    (tmp_path / name).write_text(WHOLE[name])
    assert len(import_vehicle(tmp_path / name).thrusters) == 2


@pytest.mark.parametrize(
    ("name", "old", "new", "match"),
    [
        ("a.sdf", "<xyz>1 0 0</xyz>", "<xyz>0 0 0</xyz>", r"a.sdf:\d+: joint left_joint: axis .* length 0"),
        ("a.urdf", 'axis xyz="0 0 1"', 'axis xyz="0 0 0"', r"a.urdf:\d+: joint j1: axis .* length 0"),
        ("a.yaml", "[1, 0, 0, 1, 0, 0]", "[1, 0, 0, 0, 0, 0]", r"a.yaml:3: thruster1: axis .* length 0"),
        ("a.sdf", "<mass>10</mass>", "<mass>NaN</mass>", r"a.sdf:\d+: mass of link base_link is 'NaN', must be finite"),
        ("a.sdf", "<mass>10</mass>", "<mass>-1</mass>", r"a.sdf:\d+: mass of link base_link is -1"),
        ("a.sdf", "<mass>10</mass>", "<mass>0</mass>", r"a.sdf:\d+: masses of the links add up to 0 kg"),
        (
            "a.sdf",
            "<mass>10</mass>",
            "<mass>ten</mass>",
            r"a.sdf:\d+: mass of link base_link is 'ten', must be a number",
        ),
        ("a.urdf", 'mass value="20"', 'mass value="-20"', r"a.urdf:\d+: mass of link rov/base_link is -20"),
        ("a.yaml", "mass: 4", "mass: 0", r"a.yaml:6: mass is 0, must be more than 0"),
        ("a.scn", 'mass value="30"', 'mass value="inf"', r"a.scn:\d+: mass of link Hull is 'inf'"),
        ("a.sdf", "<ixx>1</ixx>", "<ixx>-1</ixx>", r"a.sdf:\d+: inertia of link base_link .* positive definite"),
        ("a.urdf", 'ixx="1"', 'ixx="0"', r"a.urdf:\d+: inertia of link rov/base_link .* positive definite"),
        (
            "a.scn",
            'inertia xyz="1 2 3"',
            'inertia xyz="1 -2 3"',
            r"a.scn:\d+: inertia of link Hull .* positive definite",
        ),
        ("a.yaml", "ixx: 1", "ixx: -1", r"a.yaml:7: inertia has smallest eigenvalue -1"),
        ("a.sdf", "0 -0.3 0 0 0 0", "0 -300 0 0 0 0", r"a.sdf:\d+: thruster right: 300 m .*at most 10 m"),
        ("a.urdf", 'xyz="-0.5 0.1 0"', 'xyz="-500 0.1 0"', r"a.urdf:\d+: thruster thruster_1: 500 m"),
        ("a.scn", 'xyz="-0.5 0.3 0.1"', 'xyz="-50 0.3 0.1"', r"a.scn:\d+: thruster Fwd: 50.001 m"),
        ("a.yaml", "[0, 1, 0, 2, 0, 3]", "[0, 1, 0, 2, 0, 30]", r"a.yaml:3: thruster thruster1: 30.0\d* m"),
        ("a.sdf", "0 -0.3 0 0 0 0", "0 -0.3 0 0 0", r"a.sdf:\d+: pose has 5 numbers, must have 6"),
        ("a.urdf", 'xyz="-0.5 0.1 0"', 'xyz="-0.5 0.1"', r"a.urdf:\d+: origin xyz has 2 numbers, must have 3"),
        ("a.sdf", 'relative_to="mount"', 'relative_to="nowhere"', "frame nowhere is not defined"),
        ("a.sdf", 'attached_to="base_link"', 'attached_to="left"', "is defined relative to itself"),
        (
            "a.sdf",
            "<joint_name>left_joint",
            "<joint_name>none",
            r"a.sdf:\d+: thruster plugin: joint none is not in the file",
        ),
        ("a.urdf", "<fluid_density>1000", "<fluid_density>0", r"fluid_density is 0"),
        ("a.urdf", "-1 -2 -3 -4 -5 -6", "-1 -2 -3", r"a.urdf:\d+: linear_damping has 3 numbers, must have 6 or 36"),
        ("a.urdf", '<child link="rov/thruster_0"/>', '<child link="rov/thruster_1"/>', "already has a parent"),
        ("a.yaml", "num: 2", "num: 3", r"a.yaml:2: 2 positions, but num says 3"),
        ("a.yaml", "[1, 0, 0, 1, 0, 0]", "[1, 0, 0]", r"a.yaml:3: 1 directions for 2 thruster positions"),
        ("a.yaml", "[1, 0, 0, 1, 0, 0]", "[1, 0]", r"a.yaml:3: directions hold 2 numbers"),
        ("a.yaml", "thruster_directions:", "other:", r"a.yaml:2: thruster positions without directions"),
        ("a.yaml", "[1, 2, 3, 4, 5, 6]", "[1, 2, 3]", r"a.yaml:9: Ma has 3 numbers, must have 6 or 36"),
        ("a.xacro", "${2*3}", "${2*x}", r"a.xacro:5: in \$\{2\*x\}: x is not defined"),
        ("a.scn", '<link name="Hull"/><origin xyz="-', '<link name="No"/><origin xyz="-', "thruster Fwd is on no link"),
    ],
)
def test_values_no_vehicle_has_are_refused_where_they_stand(
    tmp_path: Path, name: str, old: str, new: str, match: str
) -> None:
    """File, line, what was found and what is allowed, in one line."""
    assert old in WHOLE[name]
    (tmp_path / name).write_text(WHOLE[name].replace(old, new, 1))
    with pytest.raises(InputError, match=match) as fault:
        import_vehicle(tmp_path / name)
    assert "\n" not in str(fault.value) and name in str(fault.value)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("tam: [[1,0],[0,1],[0,0]]", r"m.yaml:1: tam has shape \(3, 2\), must be \(6, n\)"),
        ("x: 1\ntam: [[1,0],[0,1],[0,0],[0],[0,0],[0,0]]", r"m.yaml:2: tam has rows of \[1, 2\] numbers"),
        ("tam: [1,2,3,4,5]", "tam has 5 numbers, must be 6 rows"),
        ("tam: [[1],[0],[0],[0],[0],[.nan]]", "must be finite|must be a number"),
        ("tam: [[1],[0],[0],[0],[0],[abc]]", r"m.yaml:1: a row of tam is 'abc', must be a number"),
        ("tam: {x: [1], y: [0], z: [0], rx: [0], ry: [0], rz: [0, 1]}", r"tam has rows of \[1, 2\] numbers"),
        ("just: words", "no allocation matrix"),
        ("title: a\ndoes_not_claim: b\nthruster_layout: {}", "is already a Wakewise vehicle file"),
    ],
)
def test_matrices_of_the_wrong_shape_are_refused(tmp_path: Path, text: str, match: str) -> None:
    """Six rows, all of one length, of numbers."""
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(InputError, match=match):
        import_vehicle(tmp_path / "m.yaml")


def test_loops_of_links_end(tmp_path: Path) -> None:
    """A URDF whose links are one another's parents has no root."""
    loop = "".join(
        f'<link name="{a}"/><joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
        for a, b in ("xy", "yz", "zx")
    )
    (tmp_path / "loop.urdf").write_text(f'<robot name="r">{loop}</robot>')
    with pytest.raises(InputError, match="the links form a loop"):
        import_vehicle(tmp_path / "loop.urdf")


def loaded(path: Path, data: bytes) -> VehicleDraft | None:
    """Read bytes as a vehicle file; whatever loads must also be written."""
    path.write_bytes(data)
    try:
        draft = import_vehicle(path, skip_missing=True)
    except InputError as fault:
        assert len(str(fault)) < 1000
        return None
    assert draft_yaml(draft)
    return draft


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(
        st.binary(max_size=300),
        st.text(max_size=300).map(str.encode),
        st.text(alphabet="<>/=\"' abcrobtlinksdf{}$()[]:,-&*!|#\n0123456789.e", max_size=300).map(str.encode),
    )
)
def test_random_bytes_raise_nothing_but_input_errors(tmp_path: Path, data: bytes) -> None:
    """Noise, words and near-syntax."""
    assert loaded(tmp_path / "noise", data) is None or data


TOKENS = ("NaN", "-1", "0", "1e308", "1e999", "", "${", "$(find x)", "}", "]", "[", "<", ">", "&", "base_link", "0 0 0")
NUMBER = re.compile(r"-?\d+\.?\d*")


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(WHOLE)), st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_mutated_files_raise_nothing_but_input_errors(tmp_path: Path, name: str, seed: int, times: int) -> None:
    """Numbers replaced, pieces cut out, tokens put in, pieces repeated."""
    rng, text = random.Random(seed), WHOLE[name]
    for _ in range(times):
        at = rng.randrange(len(text))
        kind = rng.randrange(4)
        if kind == 0 and (matches := list(NUMBER.finditer(text))):
            match = rng.choice(matches)
            text = text[: match.start()] + rng.choice(TOKENS) + text[match.end() :]
        elif kind == 1:
            text = text[:at] + text[at + rng.choice((1, 10, 100)) :]
        elif kind == 2:
            text = text[:at] + text[at : at + 60] + text[at:]
        else:
            text = text[:at] + rng.choice(TOKENS) + text[at:]
        text = text or " "
    draft = loaded(tmp_path / name, text.encode())
    if draft is not None and draft.mass_kg is not None:
        assert draft.mass_kg > 0 and math.isfinite(draft.mass_kg)
