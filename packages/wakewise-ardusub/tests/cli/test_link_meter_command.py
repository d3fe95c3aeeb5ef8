"""`wakewise link wash-meter` says in one line what it cannot use, writes craft files, and runs until it is told to
stop.
"""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")

import made_logs
from loopback_vehicle import Vehicle, free_ends
from wakewise.ui.cli.main import run
from wakewise_ardusub.vehicle_summary import read_vehicle_summary

Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "--connection: missing"),
        (["--connection", "udpin:127.0.0.1"], "a port is missing at the end"),
        (["--connection", "tcp:127.0.0.1:5777"], "a meter listens by UDP"),
        (["--connection", "udpin:127.0.0.1:14660", "--vehicle", "bluerov3"], "bluerov3"),
        (["--connection", "udpin:127.0.0.1:14660", "--ahead", "0"], "--ahead 0"),
        (["--connection", "udpin:127.0.0.1:14660", "--points", "nowhere.csv"], "--points nowhere.csv"),
        (["--connection", "udpin:127.0.0.1:14660", "--wake-model", "wind"], "wind"),
        (["--connection", "udpin:127.0.0.1:14660", "--params", "nowhere.params"], "nowhere.params"),
        (["--connection", "udpin:127.0.0.1:14660", "--out", "file"], "--out file: a file is there"),
        (["--write", "craft.json", "--vehicle", "rexrov"], "needs a 64-bit computer"),
        (["--write", "craft.json", "--wake-model", "learned"], "a small computer has free jets only"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(
    arguments: list[str], said: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, and nothing is left behind."""
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert run(["link", "wash-meter", *arguments]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert len(told.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_craft_file_is_written_for_a_small_computer(capsys: Capture, tmp_path: Path) -> None:
    """Any vehicle and model of ours that it can judge."""
    path = tmp_path / "six.json"
    assert run(["link", "wash-meter", "--vehicle", "bluerov2", "--wake-model", "fitted", "--write", str(path)]) == 0
    assert "written to" in capsys.readouterr().err
    craft = read_vehicle_summary(path)
    assert (craft.name, craft.wake.name, craft.count) == ("bluerov2", "fitted", 6)


def test_a_meter_ends_with_its_figures(capsys: Capture, tmp_path: Path) -> None:
    """Ctrl-C is how it ends: what it came to goes out as JSON and into the folder."""
    ends = free_ends()
    over = threading.Event()

    def dive() -> None:
        with Vehicle(int(ends.rpartition(":")[2])) as vehicle:
            for step in range(200):
                vehicle.say(*made_logs.pulses(made_logs.ASTERN_S * made_logs.RATE_HZ)[:8])
                if over.wait(0.05):
                    return
                if step >= 20 and (tmp_path / "meter.csv").is_file():
                    if len((tmp_path / "meter.csv").read_text().splitlines()) > 5:
                        break
                    time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    diving = threading.Thread(target=dive)
    diving.start()
    try:
        arguments = ["--connection", ends, "--port", "0", "--out", str(tmp_path), "--json"]
        assert run(["link", "wash-meter", *arguments]) == 0
    finally:
        over.set()
        diving.join()
    assert signal.getsignal(signal.SIGINT) == before
    told = json.loads(capsys.readouterr().out)
    assert told["running_instants"] >= 5
    assert told["vehicle"] == "bluerov2-heavy"
    assert json.loads((tmp_path / "meter.json").read_text())["running_instants"] == told["running_instants"]
