"""Every room's door says what lives there and where to start reading, and what it says is true."""

import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "wakewise"
ROOMS = sorted(path.parent for path in SOURCE.glob("*/__init__.py"))
SHARE_PCT = 11.0


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_a_door_names_only_files_that_are_there(room: Path) -> None:
    """File names in the door's text exist, and every file of the room but its settings and kernels is named."""
    text = (room / "__init__.py").read_text(encoding="utf-8").split('"""')[1]
    named = re.findall(r"`([\w*/]+(?:\.py|/))`", text)
    for name in named:
        assert list(room.rglob(name.rstrip("/"))), f"{room.name}: {name} is not there"
    if room.name in {"cli", "benches"}:  # a file per command, a file per bench
        return
    here = {path.name for path in room.glob("*.py")} - {"__init__.py", "settings.py"}
    told = {path.name for name in named for path in room.glob(name.rstrip("/"))}
    assert here - told == set(), f"{room.name}: its door does not name {sorted(here - told)}"


def test_no_room_is_larger_than_about_a_tenth() -> None:
    """A room above a ninth of the lines wants a wall."""
    lines = {room.name: sum(_lines(path) for path in room.rglob("*.py")) for room in ROOMS}
    whole = sum(lines.values())
    largest = max(lines, key=lambda name: lines[name])
    assert 100.0 * lines[largest] / whole <= SHARE_PCT, f"{largest} holds {100.0 * lines[largest] / whole:.1f} %"


def test_no_file_is_longer_than_400_lines() -> None:
    """A module fits on a few screens."""
    long = {str(path.relative_to(SOURCE)): _lines(path) for path in SOURCE.rglob("*.py") if _lines(path) > 400}
    assert long == {}


def _lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())
