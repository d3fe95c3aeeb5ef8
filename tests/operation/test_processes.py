"""Determinism: a flight's record does not know how many processes ran beside it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from wakewise.operation import fly, load_scenario

SHORT = {
    "world": "tank",
    "mission.elevations_deg": [40],
    "mission.views": [3],
    "mission.speed_m_s": 0.5,
    "mission.acceleration_m_s2": 0.5,
    "mission.settle_s": 0.5,
    "mission.approach_m": 0.0,
    "tank.waves.amplitude_m": 0.01,
    "tank.current.turbulence_m_s": 0.005,
    "tank.jets.inflow_loss": True,
    "target.points": 60,
    "method": "dp",
}
FLIGHT = """
import json, sys
from pathlib import Path
from wakewise.operation import fly, load_scenario
folder = Path(sys.argv[1])
folder.mkdir()
fly(load_scenario("quick", None, json.loads(sys.argv[2])).parts(), duration_s=3.0).write(folder)
"""


def _start(folder: Path) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", FLIGHT, str(folder), json.dumps(SHORT)], stdout=subprocess.DEVNULL)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_on_one_and_on_two_processes(tmp_path):
    """One flight alone, here, then two at once: all three leave the same steps.parquet, byte for byte."""
    (tmp_path / "alone").mkdir()
    fly(load_scenario("quick", None, SHORT).parts(), duration_s=3.0).write(tmp_path / "alone")
    both = [_start(tmp_path / name) for name in ("one", "two")]
    assert [process.wait() for process in both] == [0, 0]
    records = {name: (tmp_path / name / "steps.parquet").read_bytes() for name in ("alone", "one", "two")}
    assert len(records["alone"]) > 10_000
    assert records["alone"] == records["one"] == records["two"]
