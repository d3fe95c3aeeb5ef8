"""What a method watches follows the current as the estimate has it."""

import numpy as np
import pytest

from wakewise.control import ControlSettings, LeverSettings, make_controller
from wakewise.control.levers import DRIFT_POINTS
from wakewise.control.watch import MOVED_M_S, Watch
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Goal
from wakewise.targets import Region
from wakewise.vehicles import load_vehicle
from wakewise.wake import RoundJet, WakeView

VEHICLE = load_vehicle("paper")
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)


def watch(**levers):
    """Eyes on the points ahead."""
    view = WakeView.of(VEHICLE, AHEAD, RoundJet())
    return Watch(region=AHEAD, view=view, levers=LeverSettings(**levers))


def estimate(*current_m_s, **of):
    """An estimate at the origin with a current, or none."""
    return BodyState(X_WB=Pose(np.zeros(3)), current_W_m_s=np.array(current_m_s) if current_m_s else None, **of)


def test_an_unknown_current_adds_no_points():
    """None, or the lever off: the view is the very same."""
    eyes = watch()
    assert eyes.at(None, estimate()).view is eyes.view
    assert not watch(drift=False).at(None, estimate(0.05, 0.0, 0.0)).current_W_m_s.any()


def test_points_lie_upstream_of_the_target_as_the_estimate_says():
    """A current that runs north brings what is south; one that turns round, what is north."""
    eyes, middle = watch(), AHEAD.points_W_m.mean(axis=0)
    north = eyes.at(None, estimate(0.05, 0.0, 0.0))
    south = eyes.at(north, estimate(-0.05, 0.0, 0.0))
    for seen, sign in ((north, -1.0), (south, 1.0)):
        drifting = seen.view.points_W_m[len(AHEAD.weights) :]
        assert len(drifting) == DRIFT_POINTS
        assert sign * (drifting[:, 0].mean() - middle[0]) > 0.3


def test_points_stay_while_the_current_hardly_changes():
    """Below the threshold it is the same object; above, another."""
    eyes = watch()
    seen = eyes.at(None, estimate(0.03, 0.0, 0.0))
    assert eyes.at(seen, estimate(0.03 + 0.9 * MOVED_M_S, 0.0, 0.0)) is seen
    assert eyes.at(seen, estimate(0.03 + 1.1 * MOVED_M_S, 0.0, 0.0)) is not seen


def test_a_stated_current_is_believed_against_the_estimate():
    """What a user states stands, whatever the estimator finds."""
    seen = watch(drift_m_s=(0.0, 0.02, 0.0)).at(None, estimate(0.05, 0.0, 0.0))
    np.testing.assert_array_equal(seen.current_W_m_s, [0.0, 0.02, 0.0])


@pytest.mark.parametrize("method", ["instant", "wake-aware"])
def test_thrusts_follow_the_estimates_current(method):
    """The same estimate with a current from the bow and from the stern shares the same load out differently."""
    controller = make_controller(method, VEHICLE, AHEAD, RoundJet(), ControlSettings())
    load = np.array([0.4, 0.1, 0.3, 0.0, 0.02, 0.0])
    thrusts = []
    for current in ((), (0.06, 0.0, 0.0), (-0.06, 0.0, 0.0)):
        state, here = controller.init(), estimate(*current, load_B=load)
        for _ in range(60):
            state, command = controller.step(state, 0.02, here, Goal(X_WB=here.X_WB))
        assert command.fallback is None
        thrusts.append(command.thrusts_N)
    blind, ahead, astern = thrusts
    assert np.abs(blind - ahead).max() > 0.01
    assert np.abs(ahead - astern).max() > 0.01
