"""The methods by name: what they share, and what each of them weighs."""

import numpy as np
import pytest

from wakewise.control import ControlSettings, make_controller
from wakewise.control.ballast_advice import ballasted
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal
from wakewise.planning import PlanSettings
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body, load_vehicle, step_rk4
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel, disturbance, wake_model

VEHICLE = load_vehicle("paper")
CENTRE = np.array([0.0, 0.0, 1.4])
WAKE = wake_model("paper-calibrated")
OFF = {"null_space": False, "merging_jets": False, "advection": False}
SETTINGS = ControlSettings(plan=PlanSettings(iterations=3), allocation=OFF)
PLANNING = ("pseudo-inverse", "mpc", "mpc-smooth", "linear", "wake-aware")


def small_region() -> Region:
    rng = np.random.default_rng(0)
    points = CENTRE + rng.uniform(-0.1, 0.1, size=(80, 3))
    distance = rng.uniform(0.0, 0.1, 80)
    return Region(points_W_m=points, weights=np.exp(-distance / 0.05), distance_m=distance)


REGION = small_region()
HOVER = Pose(CENTRE + np.array([-0.2, 0.08, -0.45]))
"""Level, above the target and beside it: some thrusters blow down at it, others past it."""


def flown(method: str, settings: ControlSettings = SETTINGS, steps: int = 30):
    """Commands of a short hover 3 cm off its goal, 2 N too heavy; the estimate stays where it is."""
    controller = make_controller(method, VEHICLE, REGION, WAKE, settings)
    estimate = BodyState(X_WB=HOVER, load_B=np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    goal = Goal(X_WB=Pose(HOVER.p_m + np.array([0.03, 0.0, 0.0]), HOVER.q))
    state, commands = controller.init(), []
    for _ in range(steps):
        state, command = controller.step(state, 0.02, estimate, goal)
        commands.append(command)
    return commands


@pytest.mark.parametrize("method", PLANNING)
def test_a_planning_method_flies_within_limits_and_under_its_own_name(method):
    """Each method answers every step with finite thrusts within limits, and does not fall back."""
    controller = make_controller(method, VEHICLE, REGION, WAKE, SETTINGS)
    assert controller.name == method
    for command in flown(method, steps=12):
        assert np.all(np.isfinite(command.thrusts_N))
        assert np.all(command.thrusts_N >= VEHICLE.thrust_lower_N) and np.all(
            command.thrusts_N <= VEHICLE.thrust_upper_N
        )
        assert command.fallback is None


def mean_D(method: str, seconds: float = 4.0) -> tuple[float, float]:
    """Mean D and rms distance from the goal while a vehicle 2 N too heavy, known to it, hovers; no noise."""
    controller = make_controller(method, VEHICLE, REGION, WAKE, SETTINGS)
    body = compile_body(ballasted(VEHICLE, -2.0), 1000.0, 9.80665)
    goal, state = Goal(X_WB=HOVER), controller.init()
    p, q, nu, thrusts = HOVER.p_m, HOVER.q, np.zeros(6), np.zeros(8)
    values, away = [], []
    for k in range(round(seconds / 0.02)):
        load_B = np.concatenate([Pose(p, q).R.T @ [0.0, 0.0, 2.0], np.zeros(3)])
        state, command = controller.step(state, 0.02, BodyState(X_WB=Pose(p, q), nu_B=nu, load_B=load_B), goal)
        thrusts = thruster_lag(thrusts, command.thrusts_N, VEHICLE.time_constants_s, 0.02)
        p, q, nu = step_rk4(body, p, q, nu, VEHICLE.allocation_matrix @ thrusts, np.zeros(3), 0.02)
        if k * 0.02 > 1.0:
            values.append(disturbance(InfluenceModel.of(VEHICLE, REGION, WAKE).gram(Pose(p, q)), thrusts))
            away.append(np.linalg.norm(p - HOVER.p_m))
    return float(np.mean(values)), float(np.sqrt(np.mean(np.square(away))))


def test_the_disturbance_term_is_what_makes_wake_aware_gentle():
    """In closed loop at equal load, `wake-aware` has less D than `mpc`, and stays within 5 cm of its goal."""
    gentle, away = mean_D("wake-aware")
    careless, _ = mean_D("mpc")
    assert gentle < 0.9 * careless
    assert away < 0.05


def test_pseudo_inverse_makes_the_wrench_of_wake_aware_with_the_least_thrusts():
    """Equal wrench, no thruster force that another distribution could save."""
    for command in flown("pseudo-inverse", steps=8):
        np.testing.assert_allclose(VEHICLE.allocation_matrix @ command.thrusts_N, command.wrench_B, atol=1e-8)
        np.testing.assert_allclose(VEHICLE.null_space.T @ command.thrusts_N, 0.0, atol=1e-8)


def test_smooth_changes_its_commands_less():
    """The largest change of thrust between steps is smaller than that of `mpc`."""
    jumps = {
        method: np.abs(np.diff([c.thrusts_N for c in flown(method)], axis=0)).max() for method in ("mpc", "mpc-smooth")
    }
    assert jumps["mpc-smooth"] <= jumps["mpc"] * 1.01


def test_the_linear_ablation_believes_in_its_own_model():
    """`linear` does not change with the wake model of the settings."""
    one = flown("linear", steps=6)[-1].thrusts_N
    other = ControlSettings(plan=SETTINGS.plan, allocation=OFF, wake={"model": "jet"})
    np.testing.assert_allclose(flown("linear", other, steps=6)[-1].thrusts_N, one)
