"""Spare thrusts shared out anew, and the controllers that use them."""

import numpy as np
import pytest

from wakewise.allocation import Weights, min_wash_allocation
from wakewise.control import ControlSettings, make_controller, vehicle_layout
from wakewise.control.levers import LeverSettings
from wakewise.control.meeting import meeting_view
from wakewise.control.spare import Respared, SpareState
from wakewise.control.thrift import Sharer
from wakewise.control.watch import Watch
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel, RoundJet

VEHICLE = load_vehicle("paper")
LAYOUT = vehicle_layout(VEHICLE)
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)
"""Points ahead of a vehicle at the origin that looks north, where its camera looks."""


def watching(view, previous=1e-3):
    """What is seen through a view, in still water."""
    weights = Weights(disturbance=150.0, effort=1e-3, previous=previous)
    return Watch(view=view, levers=LeverSettings(drift=False), sharer=Sharer(layout=LAYOUT), weights=weights)


class Asks:
    """A controller that asks for a wrench with the least thrusts; falls back when told to."""

    name = "asks"

    def __init__(self):
        self.wrench, self.words = np.zeros(6), None

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        thrusts = LAYOUT.inverse @ self.wrench
        return state + 1, Command(thrusts_N=thrusts, wrench_B=self.wrench, disturbance=0.0, fallback=self.words)


def test_respared_thrusts_make_the_same_wrench_and_a_fallback_is_left_alone():
    """At each step, between searches ten times a second, too; a step of trouble is flown as the other wants it."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    view = meeting_view(InfluenceModel.of(VEHICLE, AHEAD, RoundJet()), LAYOUT)
    spared = Respared(
        name="x",
        inner=inner,
        watch=watching(view),
    )
    state, rng, searches = spared.init(), np.random.default_rng(1), []
    for k in range(12):
        inner.wrench = np.array([-0.3, 0.1, 0.2, 0.0, 0.05, 0.02]) + 0.02 * rng.normal(size=6)
        inner.words = "late" if k == 9 else None
        state, command = spared.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        searches.append(round(state.age_s, 6) == 0.02)
        np.testing.assert_allclose(LAYOUT.B @ command.thrusts_N, inner.wrench, atol=1e-9)
        assert command.fallback == inner.words
        if k == 9:
            np.testing.assert_allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
        else:
            assert not np.allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
    # The searches at the start and after the trouble are made at once, the others between two plans.
    assert [k for k, found in enumerate(searches) if found] == [2, 7]


def test_shares_leave_a_poor_minimum_within_two_seconds():
    """From the mirror image of the best shares, which change is priced to hold, they are at the best after 2 s."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    inner.wrench = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0])
    below = Region(
        points_W_m=np.array([[0.085, 0.14, 0.6], [-0.085, -0.14, 0.6]]), weights=np.ones(2), distance_m=np.zeros(2)
    )
    view = InfluenceModel.of(VEHICLE, below, RoundJet())
    spared = Respared(name="x", inner=inner, watch=watching(view, previous=1e5))
    best = min_wash_allocation(LAYOUT, inner.wrench, view.gram(body.X_WB), Weights(disturbance=150.0, effort=1e-3))
    poor = LAYOUT.inverse @ inner.wrench
    state = SpareState(inner=0, thrusts_N=poor, free_age_s=0.0)
    shares = []
    for _ in range(110):
        state, command = spared.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        shares.append(float(np.abs(command.thrusts_N - best.thrusts_N).max()))
    assert np.abs(poor - best.thrusts_N).max() > 0.2
    assert shares[40] > 0.1 and shares[-1] < 0.05


@pytest.mark.parametrize("method", ["instant", "wake-aware"])
def test_the_noise_of_a_wrench_does_not_blow_ahead(method):
    """Astern push with noise of 0.1 N, a slow current ahead: the bow pair blows ahead with less than 3 mN in the mean.

    With the least changes between searches it was a tenth of a newton, and the tank's water remembers that.
    """
    controller = make_controller(
        method, VEHICLE, AHEAD, RoundJet(), ControlSettings(levers=LeverSettings(thrift=False))
    )
    rng, state, ahead = np.random.default_rng(3), controller.init(), []
    for _ in range(100):
        load = np.array([1.2, 0.0, 0.3, 0.0, 0.02, 0.0]) + 0.1 * rng.normal(size=6) * [1, 1, 0, 0, 0, 0.15]
        here = BodyState(X_WB=Pose(np.zeros(3)), load_B=load, current_W_m_s=np.array([0.01, 0.0, 0.0]))
        state, command = controller.step(state, 0.02, here, Goal(X_WB=here.X_WB))
        ahead.append(np.maximum(command.thrusts_N[:2], 0.0))
    assert np.mean(ahead[20:]) < 0.003


@pytest.mark.parametrize("method", ["instant", "wake-aware"])
def test_levers_reach_the_controllers(method):
    """With the levers on, a hover that pushes astern does so from the rear; the name stays."""
    settings = ControlSettings(levers=LeverSettings(drift_m_s=(0.03, 0.0, 0.0)))
    off = ControlSettings(levers=LeverSettings(spare=False, meet=False, drift=False))
    X_WB = Pose(np.zeros(3))
    estimate = BodyState(X_WB=X_WB, load_B=np.array([0.4, 0.0, 0.0, 0.0, 0.02, 0.0]))
    front = {}
    for name, chosen in (("off", off), ("on", settings)):
        controller = make_controller(method, VEHICLE, AHEAD, RoundJet(), chosen)
        state = controller.init()
        for _ in range(60):
            state, command = controller.step(state, 0.02, estimate, Goal(X_WB=X_WB))
        assert command.fallback is None and controller.name == method
        front[name] = float(command.thrusts_N[:2].max())
    assert front["off"] > 0.05 and front["on"] < 0.6 * front["off"]
