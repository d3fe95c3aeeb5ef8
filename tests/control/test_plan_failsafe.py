"""Whatever the planner, the estimate or the thrusters do, the loop goes on, says so, and counts it."""

from dataclasses import replace

import numpy as np
import pytest
from plan_cases import AROUND, CONE, REGION, VEHICLE, model, problem

from wakewise.control import ControlSettings, make_controller
from wakewise.control.failsafe import SPIN_RAD_S, PlanFailsafe
from wakewise.control.mpc_controller import mpc_pipeline
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.planning import PlanSettings
from wakewise.planning.planner import Planner
from wakewise.planning.problem import reference_of
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body, perturbed, step_rk4

PLACE = Pose(np.array([0.45, 0.0, 1.05]), quat_from_euler(0.0, 0.0, np.pi))
GOAL = Goal(X_WB=PLACE)


@pytest.fixture(scope="module")
def controller():
    settings = ControlSettings(plan=PlanSettings(iterations=2))
    return mpc_pipeline(VEHICLE, REGION, CONE, settings, surroundings=AROUND)


class Failing(Planner):
    """Fails as told: an exception, a NaN, a slow answer on a clock of its own, or a vehicle that spins."""

    trouble = None
    now = 0.0

    def plan(self, problem, start_N, **how):
        if isinstance(self.trouble, Exception):
            raise self.trouble
        plan = super().plan(problem, start_N, **how)
        if self.trouble == "nan":
            return replace_unchecked(plan, cost=float("nan"))
        if self.trouble == "late":
            self.now += 0.2
        if self.trouble == "spin":
            states = np.array(plan.states)
            states[-1, 11] = -1.01 * SPIN_RAD_S
            return replace_unchecked(plan, states=states)
        return plan


def replace_unchecked(record, **fields):
    copy = object.__new__(type(record))
    copy.__dict__.update({**record.__dict__, **fields})
    return copy


@pytest.fixture(scope="module")
def failing():
    planner = Failing(model(iterations=1))
    return planner, PlanFailsafe(planner=planner, deadline_s=0.1, clock=lambda: planner.now)


@pytest.mark.parametrize(
    ("trouble", "kind"),
    [
        (ValueError("boom"), "failed"),
        (np.linalg.LinAlgError("singular"), "failed"),
        (InputError("bad question"), "refused"),
        ("nan", "not finite"),
        ("late", "late"),
        ("spin", "spin"),
    ],
)
def test_a_planner_that_fails_leaves_the_previous_plan(failing, trouble, kind):
    """The old plan goes on with its own clock while it is fresh, is dropped when it is not, and both are counted."""
    planner, failsafe = failing
    planner.trouble = None
    good = failsafe.ask(problem, None, 0.0)
    assert good.plan is not None and good.trouble is None
    planner.trouble, before = trouble, failsafe.incidents.counts.get(kind, 0)
    kept = failsafe.ask(problem, good.plan, 0.4)
    assert kept.plan is good.plan and kept.age_s == 0.4 and "previous plan" in kept.trouble
    dropped = failsafe.ask(problem, good.plan, 1.5)
    assert dropped.plan is None and "PID" in dropped.trouble
    assert failsafe.incidents.counts[kind] == before + 2


def test_a_question_that_cannot_be_stated_is_a_refusal(failing):
    """Stating the problem is inside the failsafe, too."""
    planner, failsafe = failing
    planner.trouble = None

    def bad():
        return replace(problem(), force_W_N=np.full(3, np.nan))

    assert "refused" in failsafe.ask(bad, None, 0.0).trouble


def test_an_estimate_or_goal_that_is_not_finite_fades_the_thrusts(controller):
    """NaN in, finite thrusts out, fading; afterwards the planner takes up again."""
    state = controller.init()
    state, first = controller.step(state, 0.02, BodyState(X_WB=PLACE, load_B=np.array([0, 0, 2.0, 0, 0, 0])), GOAL)
    assert first.fallback is None
    lost = replace_unchecked(BodyState(X_WB=PLACE), nu_B=np.full(6, np.nan))
    state, second = controller.step(state, 0.02, lost, GOAL)
    assert "estimate not finite" in second.fallback
    assert np.abs(second.thrusts_N).max() < np.abs(first.thrusts_N).max()
    _, third = controller.step(state, 0.02, BodyState(X_WB=PLACE), GOAL)
    assert third.fallback is None


def test_a_lost_pose_is_noticed_by_its_covariance(controller):
    """A metre of doubt is not a place to plan from."""
    unsure = BodyState(X_WB=PLACE, covariance=np.eye(12))
    _, command = controller.step(controller.init(), 0.02, unsure, GOAL)
    assert "pose lost" in command.fallback


def test_without_a_plan_pid_and_allocator_fly(controller):
    """A planner that always fails: thrusts still push towards the goal, and the reason is given."""
    planner = Failing(controller.motion.model)
    planner.trouble = ValueError("boom")
    motion = replace(controller.motion, planner=PlanFailsafe(planner=planner, deadline_s=0.1))
    broken = replace(controller, motion=motion)
    start = BodyState(X_WB=Pose(PLACE.p_m + np.array([0.0, 0.0, 0.1]), PLACE.q))
    state = broken.init()
    for _ in range(5):
        state, command = broken.step(state, 0.02, start, GOAL)
    assert "failed" in command.fallback and "PID" in command.fallback
    assert (VEHICLE.allocation_matrix @ command.thrusts_N)[2] < 0.0
    assert motion.planner.incidents.counts["failed"] == 5


def test_saturation_is_said_and_limits_hold(controller):
    """A correction beyond the thrusters is cut off at their limits, and said."""
    state = controller.init()
    state, _ = controller.step(state, 0.02, BodyState(X_WB=PLACE), GOAL)
    fast = BodyState(X_WB=PLACE, nu_B=np.array([0.0, 0.0, 8.0, 0.0, 0.0, 0.0]))
    _, command = controller.step(state, 0.02, fast, GOAL)
    assert "saturated" in command.fallback
    assert np.all(command.thrusts_N >= VEHICLE.thrust_lower_N) and np.all(command.thrusts_N <= VEHICLE.thrust_upper_N)


def test_far_from_the_path_the_plan_begins_anew(controller):
    """A push of 30 cm is farther than the tube: planned from the estimate, and counted."""
    state = controller.init()
    for _ in range(5):
        state, _ = controller.step(state, 0.02, BodyState(X_WB=PLACE), GOAL)
    before = controller.motion.planner.incidents.counts.get("off the path", 0)
    pushed = BodyState(X_WB=Pose(PLACE.p_m + np.array([0.3, 0.0, 0.0]), PLACE.q))
    state, _ = controller.step(state, 0.02, pushed, GOAL)
    assert controller.motion.planner.incidents.counts["off the path"] == before + 1
    np.testing.assert_allclose(state.plan.states[0, :3], pushed.X_WB.p_m, atol=1e-12)


def fly(controller, goal_at, seconds=12.0, trim_N=1.0):
    """Position errors over the second half, shape (n, 3), of a vehicle 10 % off, known load and state."""
    plant = perturbed(
        VEHICLE,
        np.random.default_rng(4),
        mass_pct=10,
        damping_pct=20,
        added_mass_pct=20,
        thrust_pct=10,
        trim_N=trim_N,
    )
    body, start = compile_body(plant), goal_at(0.0)
    p, q, nu, thrusts = start.X_WB.p_m, start.X_WB.q, start.nu_B, np.zeros(8)
    state, errors = controller.init(), []
    for k in range(round(seconds / 0.02)):
        load = np.concatenate([Pose(p, q).R.T @ np.array([0.0, 0.0, -trim_N]), np.zeros(3)])
        estimate = BodyState(X_WB=Pose(p, q), nu_B=nu, load_B=load)
        state, command = controller.step(state, 0.02, estimate, goal_at(0.02 * k))
        thrusts = thruster_lag(thrusts, command.thrusts_N, plant.time_constants_s, 0.02)
        wrench = VEHICLE.allocation_matrix @ (plant.thrust_gains * thrusts)
        p, q, nu = step_rk4(body, p, q, nu, wrench, np.zeros(3), 0.02)
        errors.append(p - goal_at(0.02 * (k + 1)).X_WB.p_m)
    return np.array(errors)[len(errors) // 2 :]


def rms(errors):
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


@pytest.mark.parametrize("speed_m_s", [0.0, 0.05])
def test_it_flies_at_least_as_true_as_dp(controller, speed_m_s):
    """Hover and slow orbit, vehicle 10 to 20 % off, 1 N of trim: no worse place than `dp`, nothing grows."""

    def goal_at(time_s):
        angle = speed_m_s / 0.45 * time_s
        place = np.array([0.45 * np.cos(angle), 0.45 * np.sin(angle), 1.05])
        twist = np.array([0.0, -speed_m_s, 0.0, 0.0, 0.0, speed_m_s / 0.45])
        return Goal(X_WB=Pose(place, quat_from_euler(0.0, 0.0, angle + np.pi)), nu_B=twist)

    ours = fly(controller, goal_at)
    dp = fly(make_controller("dp", VEHICLE, REGION, CONE, ControlSettings()), goal_at)
    assert rms(ours) < max(rms(dp), 0.002)
    half = len(ours) // 2
    assert rms(ours[half:]) < 1.5 * rms(ours[:half]) + 1e-3


def test_a_world_that_waits_counts_a_late_plan_and_flies_it():
    """Where the deadline is not enforced a busy machine changes no flight, and the count still tells."""
    planner = Failing(model(iterations=1))
    failsafe = PlanFailsafe(planner=planner, deadline_s=0.1, clock=lambda: planner.now, enforce=False)
    planner.trouble = "late"
    found = failsafe.ask(problem, None, 0.0)
    assert found.plan is not None
    assert found.trouble is None
    assert failsafe.incidents.counts == {"late": 1}


def test_a_goal_inside_the_clearance_is_counted_though_it_is_planned_for():
    """A goal 2 cm over the floor: the plan keeps off it, which is no trouble, but said; one farther off is not."""
    failsafe = PlanFailsafe(planner=Planner(model(iterations=1)), deadline_s=10.0)
    near = np.array([1.0, 1.0, 1.5 - 0.5 * VEHICLE.size_m[2] - 0.02])
    low = reference_of(Goal(X_WB=Pose(near, quat_from_euler(0.0, 0.0, 0.0))), 20, 0.1)
    found = failsafe.ask(lambda: replace(problem(), state=low[0], reference=low), None, 0.0)
    assert (
        found.plan is not None and found.trouble is None and failsafe.incidents.counts == {"goal inside clearance": 1}
    )
    failsafe.incidents.counts.clear()
    high = reference_of(Goal(X_WB=Pose(near - np.array([0.0, 0.0, 0.4]))), 20, 0.1)
    failsafe.ask(lambda: replace(problem(), state=high[0], reference=high), None, 0.0)
    assert failsafe.incidents.counts == {}
