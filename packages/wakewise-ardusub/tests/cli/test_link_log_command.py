"""`wakewise link log` reads a log, leaves a folder, and says in one line what it cannot use."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("mcap", reason="the extra `links` is not installed")

import made_logs
from wakewise.ui.cli.main import run

Capture = pytest.CaptureFixture[str]


def test_a_log_becomes_a_folder(capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Table, figures, parameters and a page that names no host; figures as JSON, or in words where no page can be."""
    file = tmp_path / "dive.tlog"
    file.write_bytes(made_logs.tlog(8.0, 1e6))
    out = tmp_path / "out"
    assert run(["link", "log", str(file), "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["format"], said["bad_records"], said["records"]) == ("tlog", 0, 1077)
    assert said["clock_jumps"][0]["step_s"] == pytest.approx(1e6, abs=0.2)
    assert said["directions"] == list(made_logs.DIRECTIONS)
    assert said["saved_pct"] > 50.0
    rows = pl.read_parquet(out / "steps.parquet")
    assert {"time_s", "stick_forward", "servo_1_us", "depth_m", "thrust_1_N", "gentle_8_N", "saved_pct"} <= set(
        rows.columns
    )
    assert json.loads((out / "log.json").read_text())["rows"] == len(rows)
    assert "MOT_1_DIRECTION,-1" in (out / "parameters.csv").read_text()
    page = (out / "report.html").read_text()
    assert "What gentler thrusts would have done" in page
    assert "http" not in page
    monkeypatch.setattr("wakewise.core.optional_dependencies.has", lambda _: False)
    assert run(["link", "log", str(file), "--out", str(tmp_path / "other")]) == 0
    told = capsys.readouterr().out
    assert "saved" in told
    assert "no page: pip install -e '.[reports]'" in told
    assert not (tmp_path / "other" / "report.html").exists()


@pytest.mark.slow
def test_a_logs_folder_goes_where_a_trials_goes(capsys: Capture, tmp_path: Path) -> None:
    """Poses as TUM files and a ROS 2 bag with thrusts; of a log without places the bag holds thrusts, and no pose."""
    pytest.importorskip("rosbags", reason="the extra `ros` is not installed")
    for name, position in (("placed", True), ("blind", False)):
        (tmp_path / f"{name}.tlog").write_bytes(made_logs.tlog(position=position))
        assert run(["link", "log", str(tmp_path / f"{name}.tlog"), "--out", str(tmp_path / name), "--json"]) == 0
    capsys.readouterr()
    rows = pl.read_parquet(tmp_path / "placed" / "steps.parquet")
    assert rows["est_x_m"][100] == pytest.approx(1.0, abs=1e-3)
    assert rows["est_y_m"][100] == pytest.approx(-2.0, abs=1e-3)
    blind = pl.read_parquet(tmp_path / "blind" / "steps.parquet")
    assert blind["est_x_m"].null_count() == len(blind)
    assert blind["est_z_m"][100] == pytest.approx(5.0, abs=1e-3)
    assert run(["export", str(tmp_path / "placed"), "--to", "tum", "--json"]) == 0
    poses = json.loads(capsys.readouterr().out)["poses"]
    assert poses > 150
    told = {}
    for name in ("placed", "blind"):
        assert run(["export", str(tmp_path / name), "--to", "rosbag2", "--json"]) == 0
        told[name] = json.loads(capsys.readouterr().out)["messages"]
    assert told["placed"] > told["blind"] > 300
    assert run(["export", str(tmp_path / "blind"), "--to", "tum"]) == 2
    assert "poses" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.tlog"], "cannot be read"),
        (["."], "a folder (give one of its files, such as dive.tlog)"),
        (["text.tlog"], "not one record found"),
        (["dive.tlog", "--ahead", "-1"], "--ahead"),
        (["dive.tlog", "--vehicle", "no-such"], "no-such"),
        (["dive.tlog", "--vehicle", "bluerov2"], "drives motors"),
        (["dive.tlog", "--wake-model", "magic"], "magic"),
        (["dive.tlog", "--points", "text.tlog"], "--points"),
        (["dive.tlog", "--out", "text.tlog"], "a folder is needed"),
    ],
)
def test_bad_input_is_one_line(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    """Exit code 2, and nothing is left behind."""
    monkeypatch.chdir(tmp_path)
    Path("text.tlog").write_text("no log " * 40)
    Path("dive.tlog").write_bytes(made_logs.tlog())
    assert run(["link", "log", *arguments]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("✓")]
    assert len(lines) == 1
    assert said in lines[0]
    assert not Path("runs").exists()
