"""XML and YAML of strangers are data: bombs, doors and nonsense are refused with file and line."""

from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.importers.safe_yaml_nodes import parse_yaml
from wakewise.robot.importers.xml import MAX_BYTES, parse_xml, read_text


def refused(path: Path, text: str | bytes, match: str) -> None:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=match) as fault:
        import_vehicle(path)
    assert "\n" not in str(fault.value)
    assert path.name in str(fault.value)


def test_every_element_knows_its_line() -> None:
    """The third line's element says line 3."""
    root = parse_xml("<robot>\n<link name='a'/>\n<link name='b'><inertial/>\n</link></robot>", Path("x.urdf"))
    assert [element.place.line for element in root.walk()] == [1, 2, 3, 3]
    assert str(root.children[1].place) == "x.urdf:3"


def test_entity_bombs_are_refused_before_they_expand(tmp_path: Path) -> None:
    """Billion laughs stop at the document type, on its line."""
    entities = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">\n' for i in range(1, 10))
    bomb = f'<?xml version="1.0"?>\n<!DOCTYPE r [\n<!ENTITY l0 "lol">\n{entities}]>\n<robot>&l9;</robot>'
    refused(tmp_path / "bomb.urdf", bomb, r"bomb.urdf:[234]: declares a document type or entity")


@pytest.mark.parametrize("secret", ["file:///etc/passwd", "http://127.0.0.1/x"])
def test_external_entities_and_document_types_are_refused(tmp_path: Path, secret: str) -> None:
    """Nothing outside the file is opened by its entities."""
    door = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "{secret}">]><robot name="a">&x;</robot>'
    refused(tmp_path / "door.urdf", door, "document type or entity")
    refused(tmp_path / "type.urdf", f'<!DOCTYPE robot SYSTEM "{secret}"><robot/>', "document type or entity")


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "holds nothing"),
        (b"   \n", "holds nothing"),
        (b"<robot><link></robot>", r"bad.urdf:1: not well-formed XML \(mismatched tag\)"),
        (b"<robot>\n&nothing;</robot>", r"bad.urdf:2: not well-formed"),
        (b"<mujoco/>", r"bad.urdf:1: root element <mujoco> is not read"),
        (b"solid cube\n facet normal", "bad.urdf:1: holds no table of values"),
        (b"<robot name='caf\xe9'/>", "bad.urdf:1: not utf-8 text"),
        (b"<?xml version='1.0' encoding='utf-7'?><robot/>", "encoding utf-7, allowed"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "not utf-8 text"),
        (b"abc\ndef\x00", "bad.urdf:2: holds a NUL"),
        (b"<a>" * 200, "nested more than 80 deep"),
        (b"<robot>" + b"<link/>" * 100_001 + b"</robot>", "more than 100000 elements"),
        (b"[" * 1000, "nested too deeply|neither XML nor YAML"),
        (b"a: &a [*a, *a]\n", "nested more than"),
        (b"a: [1, 2\nb: {", "neither XML nor YAML"),
        (b"tam: !!python/object/apply:os.system ['true']", "tam|no allocation matrix"),
    ],
)
def test_what_is_no_vehicle_file_is_refused_in_one_line(tmp_path: Path, data: bytes, match: str) -> None:
    """Every fault is one line with the file's name."""
    refused(tmp_path / "bad.urdf", data, match)


def test_yaml_aliases_cannot_multiply_without_end() -> None:
    """A bomb of aliases stops at the limit on values."""
    lines = ["a: &a [1,1,1,1,1,1,1,1,1,1]"]
    lines += [f"{chr(97 + i)}: &{chr(97 + i)} [{','.join([f'*{chr(96 + i)}'] * 10)}]" for i in range(1, 8)]
    with pytest.raises(InputError, match="more than 100000 values"):
        parse_yaml("\n".join(lines), Path("bomb.yaml"))


def test_files_of_absurd_size_are_not_read(tmp_path: Path) -> None:
    """The size is looked at before the bytes."""
    path = tmp_path / "large.urdf"
    with path.open("wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    with pytest.raises(InputError, match=r"large.urdf: \d+ bytes, vehicle files of at most"):
        import_vehicle(path)
    (tmp_path / "long.yaml").write_text("a: " + "x" * 700_000)
    with pytest.raises(InputError, match="characters, YAML of at most"):
        import_vehicle(tmp_path / "long.yaml")


def test_folders_and_absent_files_are_refused(tmp_path: Path) -> None:
    """A folder is not a vehicle file."""
    for path in (tmp_path, tmp_path / "none.urdf", tmp_path / ("n" * 400)):
        with pytest.raises(InputError, match=r"not found or not a file|cannot be read"):
            import_vehicle(path)


def test_declared_encodings_and_byte_order_marks_are_read(tmp_path: Path) -> None:
    """Latin-1 with a declaration, and UTF-16 with a mark, give the same text as UTF-8."""
    text = "<robot name='café'/>"
    (tmp_path / "a").write_bytes(b"<?xml version='1.0' encoding='ISO-8859-1'?>" + text.encode("latin-1"))
    (tmp_path / "b").write_bytes(text.encode("utf-16"))
    (tmp_path / "c").write_bytes(b"\xef\xbb\xbf" + text.encode())
    names = {parse_xml(read_text(tmp_path / n), tmp_path / n).attributes["name"] for n in "abc"}
    assert names == {"café"}
