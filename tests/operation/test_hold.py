"""In the tank: let go at 0.3 m/s the vehicle stops where it is held, and a record of hands flies the same flight."""

import numpy as np
import polars as pl
import pytest

from wakewise.operation import Scenario, fly
from wakewise.operation.assisted import assisted
from wakewise.operation.desk import Desk, DeskState
from wakewise.pilot.script import script_of
from wakewise.pilot.trace import TRACE_FILE, Trace, read_trace

OVERSHOOT_M = 0.1
GO_S, LET_GO_S, END_S = 1.0, 3.1, 5.6


@pytest.mark.parametrize("trim_N", [0.0, -5.0], ids=["neutral", "heavy"])
@pytest.mark.parametrize("method", ["wake-aware", "direct"])
def test_a_vehicle_stops_where_it_is_held(method, trim_N):
    """Released at 0.3 m/s sideways it goes less than 0.1 m beyond the place that is held, and comes back to it."""
    begin = DeskState(mode="operator", method=method, gain=0.6, watch_target=False)
    sticks = script_of([{"at_s": GO_S, "right": 1.0}, {"at_s": LET_GO_S}])
    parts = assisted(Scenario.preset("quick", **{"tank.mismatch.trim_N": trim_N}).parts(), sticks, Desk(begin))
    rows = []
    fly(
        parts,
        duration_s=END_S,
        checked=False,
        watch=lambda step, _: rows.append((step.time_s, *step.goal.X_WB.p_m, *step.truth.state.X_WB.p_m)),
    )
    table = np.array(rows)
    goals, true = table[:, 1:4], table[:, 4:7]
    after = table[:, 0] >= LET_GO_S
    held = goals[-1]
    way = held - goals[after][0]
    assert np.linalg.norm(way) == pytest.approx(0.3**2 / (2.0 * 0.2), rel=0.05)
    beyond = (true[after] - held) @ (way / np.linalg.norm(way))
    assert beyond.max() < OVERSHOOT_M
    assert np.linalg.norm(true[-1] - held) < 0.06


@pytest.fixture(scope="module")
def tank():
    return Scenario.preset("quick").parts()


def test_a_record_of_hands_flies_the_same_flight(tank, tmp_path):
    """Sticks, buttons, dials, methods, and hands that go away: written, read, and flown again to the bit."""
    desk = Desk(DeskState(gain=0.6))
    entries = [
        {"at_s": 0.4, "right": 0.7, "pressed": ["operator"]},
        {"at_s": 1.2, "forward": -0.3, "turn": 0.4, "pressed": ["precise", "capture"]},
        {"at_s": 1.8, "gone": True},
        {"at_s": 2.1, "down": -0.5, "pressed": ["scan"]},
    ]

    def meddle(step, _):  # as a page would, between two steps
        if round(step.time_s / 0.02) == 40:
            desk.set(method="direct", w_track=20.0)
        if round(step.time_s / 0.02) == 70:
            desk.set(method="wake-aware", orbit=True)

    parts = assisted(tank, script_of(entries), desk)
    flown = fly(parts, duration_s=2.6, checked=False, watch=meddle)
    parts.pilot.trace.write(tmp_path / TRACE_FILE)
    trace = read_trace(tmp_path / TRACE_FILE)
    again = assisted(tank, trace, Desk())
    replayed = fly(again, duration_s=2.6, checked=False)
    assert flown.steps.drop("leg").equals(replayed.steps.drop("leg"))
    assert again.pilot.taken() == parts.pilot.taken() == ("capture",)
    assert trace.end_s == pytest.approx(2.58) and isinstance(trace, Trace)
    columns = pl.read_parquet(tmp_path / TRACE_FILE).columns
    assert columns == ["time_s", "forward", "right", "down", "turn", "tilt", "pressed", "desk"]
