"""Plans are good, keep their limits, and bad questions are refused before anything flies."""

from dataclasses import replace

import numpy as np
import pytest
from plan_cases import AROUND, CENTRE, CONE, REGION, VEHICLE, model, problem
from pydantic import ValidationError

from wakewise.control.velocity_reference import scaled_tracking
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler
from wakewise.core.interfaces import Goal
from wakewise.planning import check_start
from wakewise.planning.obstacles import Surroundings
from wakewise.planning.planner import Planner, compile_plan
from wakewise.planning.problem import PlanSettings, reference_of, shifted
from wakewise.scene.targets import Region

START = np.zeros((20, 8))


@pytest.mark.parametrize("weight_N", [-1.5, 3.0])
def test_a_plan_is_a_local_minimum(weight_N):
    """No random small change within limits makes the cost of a converged plan lower by more than a millionth."""
    planner = Planner(model(iterations=50, tolerance=1e-6))
    plan = planner.plan(problem(weight_N=weight_N), START)
    assert plan.converged
    rng = np.random.default_rng(0)
    for size in (1e-3, 1e-2, 0.1):
        for _ in range(20):
            assert planner.cost(plan.commands_N + size * rng.normal(size=START.shape)) > plan.cost * (1.0 - 1e-6)


def test_iterations_only_improve():
    """More iterations never cost more, and one from a shifted plan is nearly as good as many."""
    case = problem()
    costs = [
        Planner(model(iterations=k, second_start_every=0, tolerance=1e-9)).plan(case, START).cost for k in (1, 2, 3, 10)
    ]
    assert costs == sorted(costs, reverse=True)
    fast = Planner(model(iterations=1))
    plan = fast.plan(case, START)
    for _ in range(6):
        plan = fast.plan(case, plan.commands_N)
    assert plan.cost < 1.02 * costs[-1]


def test_hard_limits_hold_where_they_bind():
    """With thrusters of 1.2 N the plan rides on its limits and never breaks them, whichever solver answers."""
    small = {"lower_N": np.full(8, -1.2), "upper_N": np.full(8, 1.2)}
    plan = Planner(model(iterations=20, **small)).plan(problem(weight_N=3.0, away=0.1), START)
    assert np.abs(plan.commands_N).max() <= 1.2 + 1e-9
    assert np.sum(np.abs(plan.commands_N) > 1.2 - 1e-6) > 10
    assert plan.solver in ("daqp", "piqp")


def test_a_failed_thruster_gets_nothing():
    """Limits of zero keep a thruster at zero, and the others still hold the vehicle."""
    lower, upper = np.array(VEHICLE.thrust_lower_N), np.array(VEHICLE.thrust_upper_N)
    lower[2] = upper[2] = 0.0
    plan = Planner(model(iterations=20, lower_N=lower, upper_N=upper)).plan(problem(), START)
    assert np.all(plan.commands_N[:, 2] == 0.0)
    assert np.linalg.norm(plan.states[-1, :3] - problem().reference[-1, :3]) < 0.02


def test_the_disturbance_is_what_the_weight_buys():
    """With the wake term there is less disturbance than without, and the target is still tracked."""
    case = problem(weight_N=1.5)
    aware, unaware = Planner(model(iterations=20)), Planner(model(iterations=20, w_disturbance=0.0))
    gentle, blunt = aware.plan(case, START), unaware.plan(case, START)
    aware.load(case)
    aware.cost(blunt.commands_N)
    assert gentle.disturbance < 0.7 * float(np.mean(aware._work.D))
    assert np.linalg.norm(gentle.states[-1, :3] - case.reference[-1, :3]) < 0.03


def test_change_of_commands_can_be_penalised():
    """`w_change` makes the commands' steps smaller: the rival `mpc-smooth`."""
    case = problem()
    rough, smooth = (Planner(model(iterations=20, w_disturbance=0.0, w_change=w)).plan(case, START) for w in (0.0, 0.5))
    assert np.sum(np.diff(smooth.commands_N, axis=0) ** 2) < 0.5 * np.sum(np.diff(rough.commands_N, axis=0) ** 2)


def test_the_barrier_keeps_the_hull_off_the_floor():
    """Asked to fly 5 cm into the floor, the plan stops above it."""
    case = problem(away=0.0)
    deep = np.array(case.reference)
    deep[:, 2] = 1.5 - 0.09
    planner, plan = Planner(model(iterations=10)), None
    for _ in range(6):
        plan = planner.plan(replace(case, reference=deep), START if plan is None else plan.commands_N)
    assert plan.states[:, 2].max() + 0.5 * VEHICLE.size_m[2] < 1.5


def test_the_reference_of_a_turning_goal_is_an_arc():
    """A goal on an orbit, carried on by its own twist, stays on that orbit and looks at its middle."""
    goal = Goal(
        X_WB=Pose(np.array([0.5, 0.0, 1.0]), quat_from_euler(0.0, 0.0, np.pi)),
        nu_B=np.array([0.0, -0.1, 0.0, 0.0, 0.0, 0.2]),
    )
    for row in reference_of(goal, 20, 0.1):
        X_WB = Pose(row[:3], row[3:7])
        assert np.linalg.norm(row[:2]) == pytest.approx(0.5, abs=1e-9)
        np.testing.assert_allclose(X_WB.R[:, 0], [-row[0] / 0.5, -row[1] / 0.5, 0.0], atol=1e-9)


@pytest.mark.parametrize("bad", [{"w_path": -1.0}, {"w_track": float("nan")}, {"stages": 0}, {"w_change": -1.0}])
def test_bad_weights_are_refused(bad):
    """Negative or NaN weights never reach a planner."""
    with pytest.raises(ValidationError):
        PlanSettings(**bad)


def test_bad_limits_and_empty_targets_are_refused():
    """Limits with min > max, no points, weights negative or NaN."""
    with pytest.raises(InputError, match="least must not exceed"):
        model(lower_N=np.full(8, 1.0), upper_N=np.full(8, -1.0))
    with pytest.raises(InputError, match="limits"):
        model(upper_N=np.full(8, np.nan))
    empty = Region(points_W_m=np.zeros((0, 3)), weights=np.zeros(0), distance_m=np.zeros(0))
    with pytest.raises(InputError, match="region"):
        compile_plan(VEHICLE, empty, CONE, PlanSettings(), AROUND)
    negative = Region(points_W_m=REGION.points_W_m, weights=-REGION.weights, distance_m=REGION.distance_m)
    with pytest.raises(InputError, match="region"):
        compile_plan(VEHICLE, negative, CONE, PlanSettings(), AROUND)


def test_infeasible_starts_are_refused():
    """Target inside the hull, a hull in the floor or in an obstacle, a state that is not finite."""
    good = problem().state
    surface = Region(points_W_m=REGION.points_W_m, weights=REGION.weights, distance_m=np.zeros(len(REGION.weights)))
    check_start(VEHICLE, surface, good, AROUND)
    inside = np.array(good)
    inside[:3] = CENTRE
    with pytest.raises(InputError, match="inside the vehicle"):
        check_start(VEHICLE, surface, inside, Surroundings())
    low = np.array(good)
    low[2] = 1.45
    with pytest.raises(InputError, match="the floor"):
        check_start(VEHICLE, REGION, low, AROUND)
    with pytest.raises(InputError, match="sphere"):
        check_start(VEHICLE, REGION, inside, Surroundings(spheres=AROUND.spheres))
    with pytest.raises(InputError, match="finite"):
        check_start(VEHICLE, REGION, np.full(13, np.nan), AROUND)


def test_obedience_is_the_dial_of_the_tracking_weights():
    """A problem that is to be obeyed four times as closely is planned as by settings of w_track 20, and 1 as ever."""
    asked, strict = problem(), Planner(model(**scaled_tracking(PlanSettings(), 20.0).model_dump()))
    dial, usual = Planner(model()), Planner(model())
    for obedience, other in ((4.0, strict), (1.0, usual)):
        asked = replace(asked, tracking_weight_scale=obedience)
        dial.load(asked)
        other.load(replace(asked, tracking_weight_scale=1.0))
        assert dial.cost(START) == other.cost(START)
    turned = Planner(model()).plan(replace(asked, tracking_weight_scale=4.0), START)
    desired = asked.reference[-1, :3]
    off = [np.linalg.norm(plan.states[-1, :3] - desired) for plan in (turned, usual.plan(asked, START))]
    assert off[0] < off[1]


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_an_obedience_that_means_nothing_is_refused_before_it_is_planned(bad):
    """Zero, negative, not finite; the planner's guard then falls back and says so."""
    with pytest.raises(InputError, match="tracking_weight_scale"):
        replace(problem(), tracking_weight_scale=bad)


def test_a_start_that_tumbles_is_not_where_a_plan_ends():
    """Thrusts that pitch the vehicle faster than a stage can follow give way to those that hold it."""
    planner, case = Planner(model()), problem()
    pitch = VEHICLE.allocation_matrix[4]
    tumbling = np.tile(np.where(pitch > 0.0, VEHICLE.thrust_upper_N, VEHICLE.thrust_lower_N) * (pitch != 0.0), (20, 1))
    planner.load(case)
    with np.errstate(all="ignore"):
        assert not np.isfinite(planner.cost(tumbling))
    plan = planner.plan(case, tumbling)
    assert np.isfinite(plan.cost) and np.isfinite(plan.states).all()
    assert plan.cost < 2.0 * planner.plan(case, START).cost


def test_shifting_drops_stages_and_holds_the_last():
    """Two stages on, the third command comes first and the last is repeated."""
    plan = Planner(model(iterations=1)).plan(problem(), START)
    moved = shifted(plan, 2)
    np.testing.assert_array_equal(moved[:18], plan.commands_N[2:])
    np.testing.assert_array_equal(moved[18:], plan.commands_N[[-1, -1]])


def test_thrusts_that_hold_carry_the_load():
    """3 N heavy: the same in every stage, and their wrench is the load's, turned into the body, with the other sign."""
    case = problem(weight_N=3.0)
    held = Planner(model()).holding(case)
    assert held.shape == START.shape and (held == held[0]).all()
    force_B = matrix_from_quat(case.state[3:7]).T @ case.force_W_N
    wanted = -np.concatenate([force_B, case.moment_B_Nm])
    np.testing.assert_allclose(VEHICLE.allocation_matrix @ held[0], wanted, atol=1e-9)
