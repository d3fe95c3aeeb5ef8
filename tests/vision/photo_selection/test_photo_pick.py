"""Photographs and films are picked along a dive, whole or not at all, and the originals stay as they are."""

from __future__ import annotations

import csv
import json
import shutil
import struct
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_dive import START_S, Dive, dive, write_photos, write_table
from PIL import Image

from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run
from wakewise.vision.photo_selection import pick
from wakewise.vision.photo_selection.dive_track import read_track, read_track_table
from wakewise.vision.photo_selection.pick import PickRequest, pick_photos
from wakewise.vision.reconstruction import read_reference_cameras

OFFSET_S = 7204.3


@pytest.fixture(scope="module")
def made() -> Dive:
    """One dive of a minute and a half."""
    return dive(11, 90.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, made: Dive) -> Path:
    """Photographs in PHOTOS and the log dive.csv."""
    path = tmp_path_factory.mktemp("pick")
    write_photos(path / "PHOTOS", made, OFFSET_S)
    write_table(path / "dive.csv", made)
    return path


@pytest.fixture(scope="module", autouse=True)
def looked_at_once() -> Iterator[None]:
    """The same photographs are looked at once: what is found in them hangs on the files alone."""
    known: dict[Any, Any] = {}
    look = pick.photo_statistics

    def once(files: list[Path], *more: Any) -> Any:
        key = tuple((path.resolve(), path.stat().st_mtime_ns, path.stat().st_size) for path in files)
        if key not in known:
            known[key] = look(files, *more)
        statistics, indices = known[key]
        return statistics, list(indices)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pick, "photo_statistics", once)
        yield


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder as the working folder, without results of other tests."""
    monkeypatch.chdir(folder)
    shutil.rmtree(folder / "out", ignore_errors=True)
    return folder


def _refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one line of a refused command, which leaves nothing."""
    assert run(["photos", "pick", *words, "--out", "out"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("✓")]
    assert len(lines) == 1, lines
    assert not Path("out").exists()
    return lines[0]


def test_a_photograph_for_each_metre_is_picked_with_its_pose(
    here: Path, made: Dive, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sharp ones, 1.5 m apart at most, with poses that are true within 2 cm; the originals are unchanged."""
    before = {path.name: path.read_bytes() for path in (here / "PHOTOS").iterdir()}
    assert run(["photos", "pick", "PHOTOS", "--log", "dive.csv", "--every", "1.0", "--out", "out", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["offset"]["offset_s"] == pytest.approx(OFFSET_S, abs=0.1)
    assert told["counts"]["dark"] == 2
    assert told["spacing_max_m"] <= 1.5
    rows = list(csv.DictReader((here / "out" / "cameras.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == sorted(path.name for path in (here / "out" / "photos").iterdir())
    numbers = [int(row["name"][1:5]) for row in rows]
    assert sum(k % 5 == 2 for k in numbers) <= 1, "blurred ones are picked"
    assert not {10, 11} & set(numbers)
    for row in rows:
        at = float(row["time_s"])
        truth = [np.interp(at, made.track.time_s, column) for column in made.track.position_W_m.T]
        assert np.allclose([float(row[k]) for k in ("x_m", "y_m", "z_m")], truth, atol=0.02)
        assert float(row["sigma_x_m"]) >= 0.1
    assert read_reference_cameras(here / "out" / "cameras.csv").keys() == {row["name"] for row in rows}
    assert {path.name: path.read_bytes() for path in (here / "PHOTOS").iterdir()} == before
    picture = cv2.imread(str(here / "out" / "track.png"))
    assert picture is not None and min(picture.shape[:2]) > 400


def test_an_overlap_comes_from_altitude_and_field_of_view(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """60 % of a footprint of 0.86 m, whose focal length is found from motion: a photograph every 0.34 m or so."""
    assert run(["photos", "pick", "PHOTOS", "--log", "dive.csv", "--overlap", "60", "--out", "out", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert 0.25 <= told["spacing_median_m"] <= 0.45
    assert told["offset"]["focal_widths"] == pytest.approx(280 / 320, rel=0.05)


def test_links_point_at_the_photographs(here: Path) -> None:
    """--link copies nothing, and a stated offset needs no motion."""
    words = ["photos", "pick", "PHOTOS", "--log", "dive.csv", "--offset", str(OFFSET_S), "--link", "--out", "out"]
    assert run(words) == 0
    links = sorted((here / "out" / "photos").iterdir())
    assert links and all(path.is_symlink() and path.is_file() for path in links)
    assert run(words) == 0, "the same folder is written again"


def test_frames_of_a_film_are_picked(here: Path, made: Dive, capsys: pytest.CaptureFixture[str]) -> None:
    """A film without any clock: the time of its first frame in the log is found within 0.1 s."""
    film = cv2.VideoWriter("dive.avi", cv2.VideoWriter_fourcc(*"MJPG"), 8.0, (320, 240))
    for k in range(8 * 50):
        film.write(cv2.cvtColor(made.picture(21.35 + k / 8.0), cv2.COLOR_GRAY2BGR))
    film.release()
    assert run(["photos", "pick", "dive.avi", "--log", "dive.csv", "--out", "out", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["offset"]["offset_s"] == pytest.approx(21.35, abs=0.1)
    assert told["film"] and told["times_from"] == "frame" and told["spacing_max_m"] <= 1.5
    frames = sorted(path.name for path in (here / "out" / "photos").iterdir())
    assert frames == [row["name"] for row in csv.DictReader((here / "out" / "cameras.csv").read_text().splitlines())]


@pytest.mark.slow
def test_photographs_without_a_time_need_an_interval(
    here: Path, made: Dive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without EXIF and names one line asks for --interval; with it the first photograph's time is found."""
    true_s = write_photos(tmp_path / "bare", made, 0.0, exif=False)
    assert "--interval" in _refused(capsys, str(tmp_path / "bare"), "--log", "dive.csv")
    words = [
        "photos",
        "pick",
        str(tmp_path / "bare"),
        "--log",
        "dive.csv",
        "--interval",
        "1.0",
        "--out",
        "out",
        "--json",
    ]
    assert run(words) == 0
    assert json.loads(capsys.readouterr().out)["offset"]["offset_s"] == pytest.approx(true_s[0], abs=0.2)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["PHOTOS", "--log", "none.tlog"], "is no file"),
        (["PHOTOS", "--log", "dive.csv", "--offset", "99999"], "do not overlap"),
        (["PHOTOS", "--log", "dive.csv", "--window", "5"], "do not overlap"),
        (["PHOTOS", "--log", "dive.csv", "--every", "0"], "--every 0"),
        (["PHOTOS", "--log", "dive.csv", "--every", "1", "--overlap", "50"], "one of them"),
        (["PHOTOS", "--log", "dive.csv", "--overlap", "99"], "--overlap 99"),
        (["PHOTOS", "--log", "dive.csv", "--tilt", "120"], "--tilt 120"),
        (["PHOTOS", "--log", "dive.csv", "--interval", "-1"], "--interval -1"),
        (["PHOTOS", "--log", "qgc.csv"], ".tlog"),
        (["PHOTOS", "--log", "short.csv"], "at least 2"),
        (["PHOTOS", "--log", "words.csv"], "must be numbers"),
        (["nothing", "--log", "dive.csv"], "is no folder of photos"),
        (["empty", "--log", "dive.csv"], "at least 2"),
        (["dark", "--log", "dive.csv", "--offset", "7204.3"], "dark"),
        (["few", "--log", "dive.csv"], "--offset"),
        (["PHOTOS", "--log", "mm.csv"], "must be in metres"),
        (["PHOTOS", "--log", "ms.csv"], "must be in seconds"),
        (["PHOTOS", "--log", "up.csv"], "z_m must rise with depth"),
        (["PHOTOS", "--log", "below.csv"], "line 2: altitude_m -1"),
        (["PHOTOS", "--log", "still.csv"], "holds no motion"),
        (["PHOTOS", "--log", "dive.csv", "--every", "50"], "shorter than a step"),
        (["PHOTOS", "--log", "dive.csv", "--camera-at", "nan", "0", "0"], "--camera-at nan 0 0"),
        (["PHOTOS", "--log", "dive.csv", "--interval", "1.05"], "--interval or the camera's clock is wrong"),
    ],
)
def test_bad_input_is_told_in_one_line(
    here: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line that says what would be right, and nothing written."""
    (here / "empty").mkdir(exist_ok=True)
    header = (here / "dive.csv").read_text().splitlines()[0]
    (here / "short.csv").write_text(header + "\n")
    _bad_tables(here)
    (here / "words.csv").write_text(f"{header}\n0,a,0,0,0,0,0,\n")
    (here / "qgc.csv").write_text('Timestamp,roll,pitch,heading,altitudeRelative\n"2022-08-15 10:16:17.386",1,2,3,4\n')
    for name, numbers in (("few", range(5)), ("dark", (10, 11))):
        (here / name).mkdir(exist_ok=True)
        for k in numbers:
            shutil.copy(here / "PHOTOS" / f"P{k:04d}.jpg", here / name)
    assert told in _refused(capsys, *words)


def _bad_tables(here: Path) -> None:
    """The dive in millimetres, in milliseconds, with z up, with an altitude below 0, and without motion."""
    with (here / "dive.csv").open() as file:
        header, *rows = list(csv.reader(file))
    changes = {
        "mm": lambda t, x, y, z, *rest: [t, 1e3 * x, 1e3 * y, 1e3 * z, *rest],
        "ms": lambda t, *rest: [1e3 * t, *rest],
        "up": lambda t, x, y, z, *rest: [t, x, y, -z, *rest],
        "below": lambda *row: [*row[:-1], -1.0],
        "still": lambda t, *rest: [t, 0, 0, 0, 0, 0, 0, 1],
    }
    for name, change in changes.items():
        lines = [",".join(f"{value:.6f}" for value in change(*map(float, row))) for row in rows]
        (here / f"{name}.csv").write_text("\n".join([",".join(header), *lines]))


def test_positions_in_another_unit_have_a_warning(here: Path, made: Dive) -> None:
    """Feet make a field of view of 122 deg of 59; a stated one must agree; steps that no photograph fills are told."""
    feet = replace(made.track, position_W_m=3.2808 * made.track.position_W_m)
    for track, request, told in (
        (made.track, PickRequest(), []),
        (made.track, PickRequest(field_of_view_deg=60.0), []),
        (made.track, PickRequest(field_of_view_deg=100.0), ["--fov states 100 deg"]),
        (feet, PickRequest(), ["in another unit"]),
        (feet, PickRequest(field_of_view_deg=60.0, every_m=0.5), ["--fov states 60 deg", "steps apart (median)"]),
        (replace(feet, altitude_m=np.nan * feet.altitude_m), PickRequest(), []),
    ):
        found = pick_photos(here / "PHOTOS", track, request).figures["warnings"]
        assert len(found) == len(told) and all(map(str.__contains__, found, told)), (told, found)


def test_photographs_of_a_kind_that_is_not_read_are_counted(
    here: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """HEIC and RAW beside JPEG are left out by name; a folder that holds nothing else says what to do."""
    (tmp_path / "phone").mkdir()
    (tmp_path / "raw").mkdir()
    for path in (here / "PHOTOS").iterdir():
        (tmp_path / "phone" / path.name).symlink_to(path)
    for name in ("phone/a.HEIC", "phone/b.HEIC", "phone/c.dng", "phone/notes.txt", "raw/d.CR2"):
        (tmp_path / name).write_bytes(b"")
    figures = pick_photos(tmp_path / "phone", read_track(here / "dive.csv"), PickRequest()).figures
    assert figures["counts"]["not_read"] == 3
    assert figures["counts"]["photos"] == len(list((here / "PHOTOS").iterdir())) + 3
    assert {"name": "a.HEIC", "why": "not read"} in figures["left_out"]
    assert "2 .HEIC are not read: convert them to JPEG" in figures["warnings"]
    assert "1 .CR2 are not read: convert them to JPEG" in _refused(capsys, str(tmp_path / "raw"), "--log", "dive.csv")


@pytest.mark.slow
def test_a_clock_that_was_set_in_the_dive_is_named(here: Path, made: Dive, capsys: pytest.CaptureFixture[str]) -> None:
    """Summer time begins in the photographs' names: a warning counts those outside the log, and says since when."""
    (here / "summer").mkdir(exist_ok=True)
    for k, path in enumerate(sorted((here / "PHOTOS").iterdir())):
        at = datetime.fromtimestamp(START_S + 3.0 + k + (3600.0 if k >= 50 else 0.0), tz=UTC)
        shutil.copy(path, here / "summer" / at.strftime("%Y-%m-%d %H.%M.%S.jpg"))
    for path in (here / "summer").iterdir():
        Image.open(path).convert("RGB").save(path, exif=b"")
    assert run(["photos", "pick", "summer", "--log", "dive.csv", "--out", "out"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    last = datetime.fromtimestamp(START_S + 52.0, tz=UTC).strftime("%H.%M.%S.jpg")
    assert "warning: 34 photos lie outside the log" in told and last in told


def test_a_film_of_variable_frame_rate_keeps_its_own_times(here: Path, made: Dive) -> None:
    """After 20 s every second frame is missing, which only the file's table of times says; the begin is found."""
    times = [*np.arange(21.0, 41.0, 0.1), *np.arange(41.0, 61.0, 0.2)]
    film = cv2.VideoWriter("vfr.mp4", cv2.VideoWriter_fourcc(*"mp4v"), 10.0, (320, 240))
    for at in times:
        film.write(cv2.cvtColor(made.picture(float(at)), cv2.COLOR_GRAY2BGR))
    film.release()
    data = bytearray((here / "vfr.mp4").read_bytes())
    at = data.index(b"stts")
    entries, count, ticks = struct.unpack(">III", data[at + 8 : at + 20])
    assert (entries, count) == (1, 300)
    data[at + 8 : at + 20] = struct.pack(">IIIII", 2, 200, ticks, 100, 2 * ticks)
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts"):
        at = data.index(box) - 4
        data[at : at + 4] = struct.pack(">I", struct.unpack(">I", data[at : at + 4])[0] + 8)
    (here / "vfr.mp4").write_bytes(data)
    found = pick_photos(here / "vfr.mp4", read_track(here / "dive.csv"), PickRequest())
    assert found.figures["offset"]["offset_s"] == pytest.approx(21.0, abs=0.1)


def test_a_folder_with_other_files_is_left_alone(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--out may be neither the folder of the photographs, nor one above or in it, nor one that holds anything else."""
    (here / "other").mkdir(exist_ok=True)
    (here / "other" / "thesis.txt").write_text("years of work")
    for out in ("PHOTOS", ".", "PHOTOS/picked", "other", "dive.csv"):
        assert run(["photos", "pick", "PHOTOS", "--log", "dive.csv", "--out", out]) == 2
        assert f"--out {out}" in capsys.readouterr().err
    assert (here / "other" / "thesis.txt").read_text() == "years of work"


def test_a_table_of_poses_may_state_its_uncertainty(tmp_path: Path, made: Dive) -> None:
    """Columns sigma_x_m, sigma_y_m and sigma_z_m are read; times since 1970 are a calendar, others are not."""
    lines = write_table(tmp_path / "dive.csv", made).read_text().splitlines()
    rows = [f"{line},0.3,0.2,0.1" for line in lines[1:]]
    (tmp_path / "more.csv").write_text("\n".join([f"{lines[0]},sigma_x_m,sigma_y_m,sigma_z_m", *rows]))
    track = read_track_table(tmp_path / "more.csv")
    assert track.sigma_m is not None and np.allclose(track.sigma_m, [0.3, 0.2, 0.1])
    assert track.started_s is not None
    (tmp_path / "bare.csv").write_text("\n".join([lines[0], *(f"{k},{k},0,0,0,0,0," for k in range(3))]))
    assert read_track(tmp_path / "bare.csv").started_s is None
    (tmp_path / "blanks.csv").write_text("\n".join([lines[0].replace(",", ", "), *lines[1:]]))
    assert np.array_equal(read_track(tmp_path / "blanks.csv").position_W_m, track.position_W_m)
    (tmp_path / "back.csv").write_text("\n".join([lines[0], "1,0,0,0,0,0,0,", "0,0,0,0,0,0,0,"]))
    with pytest.raises(InputError, match=r"line 3: time_s 0 after 1: times must rise"):
        read_track(tmp_path / "back.csv")
