"""Files: whole or not there."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from PIL import Image

from wakewise.api import compare as compare_flights
from wakewise.core.errors import FileFailure, InputError, is_full
from wakewise.core.files import child_path, whole_file, whole_folder, write_bytes, write_json
from wakewise.experiments.campaigns.definition import check_campaign
from wakewise.experiments.trials import compare_methods
from wakewise.operation import Scenario
from wakewise.operation.telemetry import write_mcap
from wakewise.scene.targets import Mesh, write_mesh
from wakewise.ui.film.encode import film_writer


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


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system in memory with room for a few pages."""
    place = tmp_path / "disk"
    place.mkdir()
    told = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(place)], capture_output=True, text=True, check=False
    ) if shutil.which("mount") else None  # fmt: skip
    if told is None or told.returncode:
        pytest.skip("file systems can be mounted by root alone")
    yield place
    subprocess.run(["umount", "--lazy", str(place)], check=True)


NOISE = np.random.default_rng(1).normal(size=60_000)
PICTURE = np.random.default_rng(1).integers(0, 255, (240, 320, 3), dtype=np.uint8)


def _film(path: Path) -> None:
    with film_writer(path, 10.0, (320, 240)) as sink:
        for k in range(12):
            sink.add(np.roll(PICTURE, 7 * k))


def _mcap(path: Path) -> None:
    poses = {
        f"{who}_{axis}": NOISE
        for who in ("true", "est", "goal")
        for axis in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
    }
    write_mcap(pl.DataFrame({"time_s": 0.02 * np.arange(len(NOISE)), "disturbance": NOISE, **poses}), path, every=20)


def _whole(write: Callable[[Path], object]) -> Callable[[Path], None]:
    def work(path: Path) -> None:
        with whole_file(path) as temporary:
            write(temporary)

    return work


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.parquet", _whole(pl.DataFrame({"a": NOISE}).write_parquet)),
        ("lazy.parquet", _whole(pl.LazyFrame({"a": NOISE}).sink_parquet)),
        ("a.csv", _whole(pl.DataFrame({"a": NOISE}).write_csv)),
        ("a.npz", _whole(lambda path: np.savez_compressed(path, a=NOISE))),
        ("a.png", _whole(Image.fromarray(PICTURE).save)),
        ("a.json", lambda path: write_json(path, NOISE.tolist())),
        ("a.bin", lambda path: write_bytes(path, NOISE.tobytes())),
        ("a.ply", lambda path: write_mesh(path, Mesh(NOISE.reshape(-1, 3), np.arange(60_000).reshape(-1, 3) % 20_000))),
        ("a.mcap", _mcap),
        ("a.webm", _film),
        ("a.mp4", _film),
        ("a.webp", _film),
    ],
)
def test_a_full_disk_leaves_no_part_of_a_file_whichever_library_writes(
    name: str, write: Callable[[Path], None], full_disk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Tables, arrays, pictures, meshes, logs and films: one exception that says so, and nothing beside it."""
    with pytest.raises(FileFailure) as told:
        write(full_disk / name)
    capfd.readouterr()  # what libraries print
    assert is_full(told.value)
    assert str(told.value) == f"{full_disk / name}: the disk is full"
    assert not list(full_disk.iterdir())


BAD_NAMES = ("../../evil", "/etc/x", "a/b", "a\\b", "..", ".", ".hidden", "", " a", "a ", "a\nb", "a\0b", "x" * 201)


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_name_stands_for_a_place_in_its_folder_and_nowhere_else(name: str, tmp_path: Path) -> None:
    """Whatever is named: a campaign, a scenario, what is compared. One rule refuses, before anything is made."""
    with pytest.raises(InputError, match="names a folder, so"):
        child_path(tmp_path, name, "compare")
    for refuse in (lambda: Scenario.preset("quick", name=name), lambda: check_campaign({"name": name})):
        with pytest.raises(InputError, match="name: found"):
            refuse()
    flights = dict.fromkeys((name, "dp"), Scenario.preset("quick"))
    for compare in (compare_flights, compare_methods):
        with pytest.raises(InputError, match=r"compare: .* names a folder"):
            compare(flights, tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["dp", "package.module:make", "first comparison", "Äxt-1", "a..b"])
def test_names_as_people_give_them_are_places(name: str, tmp_path: Path) -> None:
    """Spaces within, letters of any script, and the colon of a plug-in."""
    assert child_path(tmp_path, name, "x").parent == tmp_path


def test_a_place_that_cannot_be_written_is_told_by_its_own_name(tmp_path: Path) -> None:
    """Not by that of a temporary file."""
    (tmp_path / "file").touch()
    for block in (whole_file, whole_folder):
        with pytest.raises(FileFailure, match=r"Not a directory|File exists") as told, block(tmp_path / "file" / "x"):
            pass
        assert str(told.value).startswith(f"{tmp_path / 'file'}")
        assert ".w" not in str(told.value)
