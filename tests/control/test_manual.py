"""Flown by hand: direct allocation, an autopilot that holds what the sticks leave, and a person who sees estimates."""

import numpy as np
import pytest

from wakewise.control import ControlSettings, make_controller
from wakewise.core.geometry import Pose, look_at, quat_from_euler, quat_multiply
from wakewise.core.interfaces import BodyState, Goal
from wakewise.operation import Scenario, fly
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import wake_model

VEHICLE = load_vehicle("paper")
CENTRE = np.array([0.0, 0.0, 1.4])
EYE = np.array([-0.7, 0.0, 1.4])


def controller(seed=1, shift=(0.0, 0.0, 0.0), method="manual"):
    points = CENTRE + np.array(shift) + np.random.default_rng(0).uniform(-0.1, 0.1, (60, 3))
    region = Region(points_W_m=points, weights=np.ones(60), distance_m=np.zeros(60))
    return make_controller(method, VEHICLE, region, wake_model("jet"), ControlSettings(operator_seed=seed))


def commands(hand, estimates, goals):
    state, out = hand.init(), []
    for estimate, goal in zip(estimates, goals, strict=True):
        state, command = hand.step(state, 0.02, estimate, goal)
        out.append(command)
    return out


def wandering(n, shift=(0.0, 0.0, 0.0)):
    """Estimates that wander about a place, the goal at rest there."""
    rng = np.random.default_rng(3)
    q = Pose.from_matrix(look_at(EYE, CENTRE), EYE).q
    steps = 0.002 * rng.normal(size=(n, 3)).cumsum(axis=0)
    estimates = [BodyState(X_WB=Pose(EYE + step + shift, q), nu_B=np.zeros(6)) for step in steps]
    return estimates, [Goal(X_WB=Pose(EYE + np.array(shift), q))] * n


def test_thrusts_are_those_of_direct_allocation():
    """The wrench is shared out by the pseudo-inverse: the least thrusts, whatever they do to the water."""
    least = np.linalg.pinv(VEHICLE.allocation_matrix)
    for command in commands(controller(), *wandering(60)):
        np.testing.assert_allclose(command.thrusts_N, least @ command.wrench_B, atol=1e-9)
        assert command.disturbance is not None


def test_the_autopilot_holds_depth_heading_and_level():
    """Sunk, it pushes up; turned, back; tilted, upright; and along the two axes of the free stick not at all."""
    hand, level = controller(), np.array([1.0, 0.0, 0.0, 0.0])
    goal = Goal(X_WB=Pose(EYE, level))
    start = BodyState(X_WB=Pose(EYE, level))
    state, first = hand.step(hand.init(), 0.02, start, goal)
    for moved, axis in (
        (Pose(EYE + np.array([0.0, 0.0, 0.03]), level), 2),
        (Pose(EYE, quat_from_euler(0.05, 0.0, 0.0)), 3),
        (Pose(EYE, quat_from_euler(0.0, 0.05, 0.0)), 4),
        (Pose(EYE, quat_from_euler(0.0, 0.0, 0.05)), 5),
    ):
        _, command = hand.step(state, 0.02, BodyState(X_WB=moved), goal)
        assert command.wrench_B[axis] - first.wrench_B[axis] < -0.01
    _, drifting = hand.step(state, 0.02, BodyState(X_WB=Pose(EYE + np.array([0.05, 0.05, 0.0]), level)), goal)
    np.testing.assert_allclose(drifting.wrench_B[:2], 0.0, atol=1e-12)


def test_the_person_sees_nothing_but_the_estimate():
    """Estimate, goal and region moved together: the same pushes. Neither truth nor the world's origin enters."""
    shift = np.array([2.0, -1.0, 0.0])
    here = commands(controller(), *wandering(150))
    there = commands(controller(shift=shift), *wandering(150, shift))
    for a, b in zip(here, there, strict=True):
        np.testing.assert_allclose(a.thrusts_N, b.thrusts_N, atol=1e-6)
    assert max(np.abs(c.wrench_B[:2]).max() for c in here) > 0.1


def test_the_world_may_be_turned():
    """Heading is all that the compass knows: turned with the whole mission, the person flies the same."""
    turn = quat_from_euler(0.0, 0.0, 1.0)
    R = Pose(np.zeros(3), turn).R
    estimates, goals = wandering(150)

    def turned(X):
        return Pose(CENTRE + R @ (X.p_m - CENTRE), quat_multiply(turn, X.q))

    there = commands(
        controller(), [BodyState(X_WB=turned(e.X_WB)) for e in estimates], [Goal(X_WB=turned(g.X_WB)) for g in goals]
    )
    for a, b in zip(commands(controller(), estimates, goals), there, strict=True):
        np.testing.assert_allclose(a.thrusts_N, b.thrusts_N, atol=0.02)


def test_a_seed_flies_alike_and_another_does_not():
    """Every push follows from the seed of the trial."""
    flights = [np.array([c.thrusts_N for c in commands(controller(seed), *wandering(200))]) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(flights[0], flights[1])
    assert not np.array_equal(flights[0], flights[2])


@pytest.mark.slow
def test_a_hover_is_flown_by_hand():
    """In the tank, with estimator and all: no collision, centimetres off where `dp` is millimetres off."""
    short = {"mission.settle_s": 16.0, "target.points": 60}
    off = {}
    for method in ("manual", "dp"):
        flight = fly(Scenario.preset("quick", method=method, **short), duration_s=16.0, water_every_s=np.inf)
        assert flight.figures["collisions"] == 0 and flight.figures["fallbacks"] == 0
        off[method] = flight.figures["position_rmse_mm"]
    assert off["dp"] < 20.0 < off["manual"] < 200.0


def test_a_careful_pilot_is_the_same_person_at_a_survey_pilots_gain():
    """Seed by seed all but the gain is the same; the gain is 0.2 to 0.3, and the finest push goes with it."""
    for seed in range(1, 6):
        usual, careful = (controller(seed, method=name).motion.person for name in ("manual", "manual-careful"))
        assert 0.25 <= usual.gain <= 0.5 and 0.2 <= careful.gain <= 0.3
        assert careful.gain * careful.stick_step <= usual.gain * usual.stick_step
        for name in ("delay_s", "video_s", "remnant", "attended", "pace", "trim_s", "stick_step", "drift_s"):
            assert getattr(careful, name) == getattr(usual, name), name
        np.testing.assert_array_equal(careful.crossover_rad_s, usual.crossover_rad_s)


def test_the_pipeline_of_a_careful_pilot_has_its_name():
    """Tables tell the two apart."""
    assert controller(method="manual-careful").name == "manual-careful"
