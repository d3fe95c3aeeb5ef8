"""Files: whole or not there."""

import os
from pathlib import Path

import pytest

from wakewise.files import whole_file, whole_folder, write_json


def test_a_block_that_fails_leaves_nothing(tmp_path: Path) -> None:
    """If writing is cut short, the old file stays as it was and no temporary file remains."""
    path = tmp_path / "figures.json"
    write_json(path, {"rmse_mm": 1.5})
    with pytest.raises(KeyboardInterrupt), whole_file(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == '{\n  "rmse_mm": 1.5\n}\n'
    assert list(tmp_path.iterdir()) == [path]


def test_what_lasts_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """First the file's content is settled, then it is named, then the folder that holds the name is settled."""
    told: list[str] = []
    replace, settle = Path.replace, os.fsync

    def replaced(path: Path, target: Path) -> Path:
        told.append("named")
        return replace(path, target)

    def settled(handle: int) -> None:
        there = Path(f"/proc/self/fd/{handle}").resolve() if Path("/proc/self/fd").is_dir() else None
        told.append("settled" if there is None else "folder" if there.is_dir() else f"file of {there.stat().st_size}")
        settle(handle)

    monkeypatch.setattr(Path, "replace", replaced)
    monkeypatch.setattr(os, "fsync", settled)
    write_json(tmp_path / "figures.json", 1.5, lasting=True)
    if "settled" in told:  # no /proc: only the order is seen
        assert told == ["settled", "named", "settled"]
    else:
        assert told == ["file of 4", "named", "folder"]


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    """A folder is there with all its files or not at all, and replaces an older one."""
    path = tmp_path / "images"
    with pytest.raises(RuntimeError), whole_folder(path) as temporary:
        (temporary / "a").write_text("x")
        raise RuntimeError
    assert not path.exists()
    for content in ("first", "second"):
        with whole_folder(path) as temporary:
            (temporary / content).write_text(content)
    assert [p.name for p in path.iterdir()] == ["second"]
    assert list(tmp_path.iterdir()) == [path]


def test_json_refuses_what_json_cannot_hold(tmp_path: Path) -> None:
    """NaN is refused rather than written as a word no reader knows."""
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "x.json", {"rmse_mm": float("nan")})
    assert not (tmp_path / "x.json").exists()
