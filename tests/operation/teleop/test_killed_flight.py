"""A flight by hand whose process ends under it."""

import signal
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.operation import LiveFlight, read_exposures, read_scenario
from wakewise.operation.flight_log import PARTS
from wakewise.operation.teleop.live import collect_flight

pytestmark = pytest.mark.slow

FLY = """
import os, signal, sys, time
from pathlib import Path
from wakewise.operation import LiveFlight, load_scenario

def watch(step, truth_provider):
    k = round(step.time_s * 50)
    if k in (5, 20):
        flight.capture()
    if k == 30:
        os.kill(os.getpid(), int(sys.argv[2]))

flight = LiveFlight(
    load_scenario("quick", None, {"method": "dp"}).parts(), folder=Path(sys.argv[1]), paced=False, watch=watch
)
flight.start()
while True:
    time.sleep(0.1)
"""


def flown(folder: Path, how: signal.Signals) -> int:
    """How a process ends that flies into a folder and is sent a signal at its thirtieth step."""
    command = [sys.executable, "-c", FLY, str(folder), str(int(how))]
    done = subprocess.run(command, check=False, capture_output=True, timeout=300)
    return done.returncode


def test_ctrl_c_writes_the_whole_folder(tmp_path: Path) -> None:
    """The program ends, and its flight with it: in order, as if it had been told to stop."""
    assert flown(tmp_path / "hand", signal.SIGINT) != 0
    steps = pl.read_parquet(tmp_path / "hand/steps.parquet")
    assert steps.height >= 31 and len(read_exposures(tmp_path / "hand/exposures.npz")) == 2
    assert not (tmp_path / "hand" / PARTS).exists()


def test_a_killed_flight_keeps_its_photographs(tmp_path: Path) -> None:
    """Killed between two parts: what was written is put together, once, and a new flight does not lie over it."""
    folder = tmp_path / "hand"
    assert flown(folder, signal.SIGKILL) == -signal.SIGKILL
    assert not (folder / "steps.parquet").exists()
    parts = read_scenario(folder / "scenario.yaml").parts()
    with pytest.raises(InputError, match="scan --resume"):
        LiveFlight(parts, folder=folder)
    assert collect_flight(parts, folder)
    steps, exposures = pl.read_parquet(folder / "steps.parquet"), read_exposures(folder / "exposures.npz")
    assert [e.time_s for e in exposures] == pytest.approx([0.12, 0.42]) and steps["time_s"][-1] == pytest.approx(0.42)
    assert int(steps["exposing"].sum()) == 2 and pl.read_csv(folder / "planned.csv").height == 2
    assert not collect_flight(parts, folder) and not (folder / PARTS).exists()
