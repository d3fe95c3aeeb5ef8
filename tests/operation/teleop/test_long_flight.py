"""An hour by hand holds no more than a minute: rows and photographs lie in parts until the flight is whole."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from wakewise.core.interfaces import BodyState, Command, Goal, Measurement, ScalarGrid, Truth, TruthProvider, WaterTruth
from wakewise.operation import LiveFlight, load_scenario, read_exposures
from wakewise.operation.flight_log import PARTS, FlightLog
from wakewise.operation.loop import Step

MINUTE = 3000


class Light:
    """World, truth provider, estimator and controller of no weight: it stands where it was put."""

    name = "light"

    def __init__(self, start: BodyState) -> None:
        self.state = start

    def begin(self) -> tuple[Any, Any]:
        return self, self

    def init(self, start: BodyState | None = None) -> int:
        return 0

    def step(self, *given: object) -> Any:
        if len(given) == 2:
            return (Measurement(time_s=0.0),)
        if isinstance(given[-1], Goal):
            return 0, Command(thrusts_N=np.zeros(8), wrench_B=np.zeros(6))
        return 0, self.state

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        return Goal(X_WB=estimate.X_WB)

    def observe(self) -> Truth:
        return Truth(state=self.state, thrusts_N=np.zeros(8), power_W=1.0, collision=False)

    def water(self) -> WaterTruth:
        return WaterTruth(
            target_speed_mean_m_s=0.1, target_speed_p95_m_s=0.2, bed_speed_p95_m_s=0.3, turbidity_per_m=0.4
        )

    def silt(self) -> ScalarGrid:
        return ScalarGrid(origin_W_m=np.zeros(3), spacing_m=0.05, values=np.random.default_rng(0).random((30, 30, 20)))


@pytest.mark.slow
def test_memory_does_not_grow_with_the_flight(tmp_path: Path) -> None:
    """A photograph a second: from the second minute to the fifth less is added than half a minute of rows would take;
    kept in memory they would take some 20 MB. All of it is in the folder in the end.
    """
    parts = load_scenario("quick", None, {"method": "dp"}).parts()
    light = Light(parts.start)
    held: list[int] = []

    def watch(step: Step, truth_provider: TruthProvider | None) -> None:
        k = round(step.time_s * 50)
        if k % 50 == 25:
            flight.capture()
        if k == 500:
            tracemalloc.start()
        if k in (1000, 1000 + MINUTE):
            held.append(tracemalloc.get_traced_memory()[0])
        if k == 1000 + MINUTE:
            tracemalloc.stop()
            flight.stop()

    flown = parts.replace(world=light, controller=light, estimator=light, pilot=light)
    flight = LiveFlight(flown, folder=tmp_path / "hand", paced=False, watch=watch)
    flight.start()
    flight.join(120.0)
    if flight.fault is not None:
        raise flight.fault
    row = 8 * len(pl.read_parquet_schema(tmp_path / "hand/steps.parquet"))
    assert held[1] - held[0] < 0.2 * MINUTE * row
    steps = pl.read_parquet(tmp_path / "hand/steps.parquet")
    assert steps.height == 1001 + MINUTE and np.allclose(np.diff(steps["time_s"]), 0.02)
    assert len(read_exposures(tmp_path / "hand/exposures.npz")) == int(steps["exposing"].sum()) == 80
    assert not (tmp_path / "hand" / PARTS).exists()


def test_a_flight_that_keeps_nothing_has_a_log_of_a_few_rows() -> None:
    """Without a folder rows are dropped after a while, exposures at once."""
    log = FlightLog(keep=False, chunk_rows=10, names=["time_s"])
    tags = {"exposing": False, "collision": False, "fallback": "", "leg": "by hand"}
    for k in range(25):
        log.add(np.array([float(k)]), tags, 1.0)
        log.timed(0.0, 0.0)
    assert log.count == 25 and log.frame()["time_s"].to_list() == [20.0, 21.0, 22.0, 23.0, 24.0]


def test_parts_together_are_what_memory_would_have_kept(tmp_path: Path) -> None:
    """Rows, tags and timings in order, a part ending with each photograph, timings that came late included."""
    tags = {"exposing": False, "collision": False, "fallback": "", "leg": "by hand"}
    logs = [FlightLog(folder=tmp_path / PARTS, chunk_rows=7, names=["time_s"]), FlightLog(names=["time_s"])]
    for log in logs:
        for k in range(20):
            log.add(np.array([float(k)]), tags | {"leg": str(k)}, 0.5 * k)
            log.timed(0.001 * k, 0.002)
        log.flush()
    found = pl.read_parquet(tmp_path / PARTS / "steps-*.parquet")
    assert found.equals(logs[1].frame()) and found["behind_ms"][19] == pytest.approx(19.0)
    assert len(list((tmp_path / PARTS).iterdir())) == 3
