"""In the tank: let go at 0.3 m/s the vehicle stops where it is held."""

import numpy as np
import pytest

from wakewise.operation import Scenario, fly
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.script import script_of
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState

OVERSHOOT_M = 0.1
GO_S, LET_GO_S, END_S = 1.0, 3.1, 5.6


@pytest.mark.slow
@pytest.mark.parametrize("trim_N", [0.0, -5.0], ids=["neutral", "heavy"])
@pytest.mark.parametrize("method", ["wake-aware", "direct"])
def test_a_vehicle_stops_where_it_is_held(method, trim_N):
    """Released at 0.3 m/s sideways it goes less than 0.1 m beyond the place that is held, and comes back to it."""
    begin = OperatorSettings(mode="operator", method=method, gain=0.6, watch_target=False)
    sticks = script_of([{"at_s": GO_S, "right": 1.0}, {"at_s": LET_GO_S}])
    parts = assisted(Scenario.preset("quick", **{"tank.mismatch.trim_N": trim_N}).parts(), sticks, OperatorState(begin))
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
