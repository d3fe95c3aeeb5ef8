"""Null-space allocation step by step, and the methods that use it."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.allocation import PowerBoundedAllocator, Weights, min_wash_allocation
from wakewise.control import ControlSettings, make_controller, vehicle_layout
from wakewise.control.null_space_allocation import SEARCH_S, STAGGER_S, AllocationContext, Allocator
from wakewise.control.pipeline import Demand, MotionStage, Pipeline
from wakewise.control.settings import AllocationSettings
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel, RoundJet
from wakewise.wake.influence import with_merging_jets

VEHICLE = load_vehicle("paper")
LAYOUT = vehicle_layout(VEHICLE)
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)
"""Points ahead of a vehicle at the origin that looks north, where its camera looks."""


def context_of(view, previous=1e-3):
    """Thrusts seen through a view, in still water."""
    weights = Weights(disturbance=150.0, effort=1e-3, previous=previous)
    bounded = PowerBoundedAllocator(layout=LAYOUT)
    return AllocationContext(
        view=view, settings=AllocationSettings(advection=False), allocator=bounded, weights=weights
    )


class Asks(MotionStage):
    """Asks for a wrench, for which it has the least thrusts; says that it is in trouble when told to."""

    def __init__(self):
        self.wrench, self.words = np.zeros(6), None

    def step(self, state, dt_s, estimate, goal):
        thrusts = LAYOUT.inverse @ self.wrench
        return state, Demand(wrench_B=self.wrench, thrusts_N=thrusts, disturbance=0.0, trouble=self.words)

    def allocated(self, state, found, dt_s):
        return state


def pipeline_round(stage, context):
    allocator = Allocator(layout=LAYOUT, context=context, first_age_s=SEARCH_S - STAGGER_S)
    return Pipeline(name="x", layout=LAYOUT, motion=stage, allocator=allocator)


def test_thrusts_make_the_same_wrench_and_a_step_of_trouble_is_left_alone():
    """At each step, between searches ten times a second, too; a step of trouble is flown as the stage wants it."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    view = with_merging_jets(InfluenceModel.of(VEHICLE, AHEAD, RoundJet()), LAYOUT)
    pipeline = pipeline_round(inner, context_of(view))
    state, rng, searches = pipeline.init(), np.random.default_rng(1), []
    for k in range(12):
        inner.wrench = np.array([-0.3, 0.1, 0.2, 0.0, 0.05, 0.02]) + 0.02 * rng.normal(size=6)
        inner.words = "late" if k == 9 else None
        state, command = pipeline.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        searches.append(state.search_age_s == 0.0)
        np.testing.assert_allclose(LAYOUT.B @ command.thrusts_N, inner.wrench, atol=1e-9)
        assert command.fallback == inner.words
        if k == 9:
            np.testing.assert_allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
            assert state.influence is None
        else:
            assert not np.allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
    # The searches at the start and after the trouble are made at once, the others between two plans.
    assert [k for k, found in enumerate(searches) if found] == [2, 7]


def test_thrusts_leave_a_poor_minimum_within_two_seconds():
    """From the mirror image of the best thrusts, which change is priced to hold, they are at the best after 2 s."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    inner.wrench = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0])
    below = Region(
        points_W_m=np.array([[0.085, 0.14, 0.6], [-0.085, -0.14, 0.6]]), weights=np.ones(2), distance_m=np.zeros(2)
    )
    view = InfluenceModel.of(VEHICLE, below, RoundJet())
    pipeline = pipeline_round(inner, context_of(view, previous=1e5))
    best = min_wash_allocation(LAYOUT, inner.wrench, view.gram(body.X_WB), Weights(disturbance=150.0, effort=1e-3))
    poor = LAYOUT.inverse @ inner.wrench
    state = replace(pipeline.init(), thrusts_N=poor, restart_age_s=0.0)
    away = []
    for _ in range(110):
        state, command = pipeline.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        away.append(float(np.abs(command.thrusts_N - best.thrusts_N).max()))
    assert np.abs(poor - best.thrusts_N).max() > 0.2
    assert away[40] > 0.1 and away[-1] < 0.05


def test_a_wake_model_that_fails_leaves_the_stage_its_own_thrusts():
    """They are flown and said, and the search begins anew at the next step."""

    class Broken:
        name = "broken"

        def unit_velocity(self, points, origins, directions, area):
            return np.full((len(origins), len(points), 3), np.nan)

    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    inner.wrench = np.array([-0.3, 0.1, 0.2, 0.0, 0.05, 0.02])
    pipeline = pipeline_round(inner, context_of(InfluenceModel.of(VEHICLE, AHEAD, Broken())))
    state, command = pipeline.step(pipeline.init(), 0.02, body, Goal(X_WB=body.X_WB))
    np.testing.assert_array_equal(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
    assert command.fallback == "wake model not finite: thrusts of the plan" and state.influence is None


@pytest.mark.parametrize("method", ["allocation-only", "wake-aware"])
def test_the_noise_of_a_wrench_does_not_blow_ahead(method):
    """Astern push with noise of 0.1 N, a slow current ahead: the bow pair blows ahead with less than 3 mN in the mean.

    With the least changes between searches it was a tenth of a newton, and the tank's water remembers that.
    """
    controller = make_controller(
        method, VEHICLE, AHEAD, RoundJet(), ControlSettings(allocation=AllocationSettings(power_limit=False))
    )
    rng, state, ahead = np.random.default_rng(3), controller.init(), []
    for _ in range(100):
        load = np.array([1.2, 0.0, 0.3, 0.0, 0.02, 0.0]) + 0.1 * rng.normal(size=6) * [1, 1, 0, 0, 0, 0.15]
        here = BodyState(X_WB=Pose(np.zeros(3)), load_B=load, current_W_m_s=np.array([0.01, 0.0, 0.0]))
        state, command = controller.step(state, 0.02, here, Goal(X_WB=here.X_WB))
        ahead.append(np.maximum(command.thrusts_N[:2], 0.0))
    assert np.mean(ahead[20:]) < 0.003


@pytest.mark.parametrize("method", ["allocation-only", "wake-aware"])
def test_levers_reach_the_controllers(method):
    """With the mechanisms on, a hover that pushes astern does so from the rear; the name stays."""
    settings = ControlSettings(allocation=AllocationSettings(current_m_s=(0.03, 0.0, 0.0)))
    off = ControlSettings(allocation=AllocationSettings(null_space=False, merging_jets=False, advection=False))
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
