"""Every derivative of a plan's cost against differences, and every fast kernel against a slow twin."""

import numpy as np
import pytest
from plan_cases import CONE, REGION, SHARES, VEHICLE, model, problem

from wakewise.core.geometry import Pose, quat_from_euler, quat_from_rotvec, quat_multiply
from wakewise.planning.kernels import barrier_value, plane_gap, rotation, sphere_gap
from wakewise.planning.planner import Planner
from wakewise.planning.qp import BoxQP, condense
from wakewise.robot.vehicles import step_rk4
from wakewise.wake import gauss_newton, wake_model
from wakewise.wake.plan_disturbance import stage_disturbance, wake_scratch, wake_table


def table_of(wake, superposition):
    return wake_table(
        wake,
        REGION.points_W_m,
        REGION.weights,
        VEHICLE.thruster_positions_B_m,
        VEHICLE.thruster_axes_B,
        VEHICLE.disk_areas_m2,
        superposition=superposition,
        smooth_N=0.5,
    )


@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
@pytest.mark.parametrize("wake", [CONE, wake_model("paper"), wake_model("jet"), wake_model("fitted")])
def test_the_stage_kernel_equals_its_twin(wake, superposition):
    """D, gradient and Gauss-Newton matrix are those of `wakewise.wake.gauss_newton`, at places all round the target."""
    table, scratch = table_of(wake, superposition), wake_scratch(len(REGION.weights), 8)
    rng = np.random.default_rng(0)
    for angle in np.linspace(0.0, 6.0, 5):
        place = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 1.1])
        X_WB = Pose(place, quat_from_euler(0.1, -0.2, angle + np.pi))
        T, g, H = rng.normal(size=8), np.empty(14), np.empty((14, 14))
        D = stage_disturbance(table, scratch, place, X_WB.q.copy(), X_WB.R.copy(), T, True, g, H)
        twin = gauss_newton(
            wake,
            REGION.points_W_m,
            SHARES,
            X_WB,
            VEHICLE.thruster_positions_B_m,
            VEHICLE.thruster_axes_B,
            VEHICLE.disk_areas_m2,
            T,
            superposition=superposition,
        )
        np.testing.assert_allclose(D, twin.value, rtol=1e-11, atol=1e-20)
        np.testing.assert_allclose(g, twin.gradient, rtol=1e-9, atol=1e-11 * abs(twin.gradient).max() + 1e-20)
        np.testing.assert_allclose(H, twin.hessian, rtol=1e-9, atol=1e-11 * abs(twin.hessian).max() + 1e-20)


@pytest.mark.parametrize(
    "mechanisms",
    [
        {},
        {"superposition": "incoherent"},
        {"w_change": 0.05},
        {"attitude_tolerance_rad": 0.03},
        {"w_disturbance": 0.0},
    ],
)
def test_the_gradient_is_that_of_the_cost(mechanisms):
    """Commands to cost, through lag, motion, wake, barrier and tracking: central differences agree to 1e-6."""
    planner = Planner(model(**mechanisms))
    planner.load(problem())
    rng = np.random.default_rng(1)
    # Steps of some 20 N break the rate limit here and there, so that its hinges take part.
    U = rng.normal(0.0, 7.0, (20, 8))
    gradient = planner.gradient(U).copy()
    for _ in range(12):
        d = rng.normal(size=U.shape)
        d /= np.linalg.norm(d)
        slope = (planner.cost(U + 1e-5 * d) - planner.cost(U - 1e-5 * d)) / 2e-5
        assert abs(slope - gradient @ d.ravel()) < 1e-6 * np.linalg.norm(gradient)


def test_the_floor_and_its_wall_jets_take_part():
    """With a wake model that knows the floor, gradients still agree with differences."""
    from wakewise.wake import ImpingingJet

    planner = Planner(model(wake=ImpingingJet(jet=wake_model("jet"), bed_z_m=1.5), stages=4))
    planner.load(problem(stages=4))
    rng = np.random.default_rng(1)
    U, d = rng.normal(0.0, 2.0, (4, 8)), rng.normal(size=(4, 8))
    slope = (planner.cost(U + 1e-5 * d) - planner.cost(U - 1e-5 * d)) / 2e-5
    assert slope == pytest.approx(planner.gradient(U) @ d.ravel(), rel=1e-5)


def test_condensing_equals_products_of_whole_matrices():
    """The recursion gives sum G'QG with G and the lag's map written out as matrices."""
    planner = Planner(model())
    planner.load(problem())
    planner.derivatives(np.random.default_rng(0).normal(size=(20, 8)))
    table, work, room = planner.model.table, planner._work, planner._room
    M = np.zeros((20, 8, 160))
    for k in range(20):
        for i in range(8):
            M[k, i, i::8] = table.mean_map[k, i::8]
    G, H = np.zeros((12, 160)), np.zeros((160, 160))
    for k in range(21):
        Q = np.zeros((12, 12))
        Q[:6, :6] = work.Q[k]
        if k > 0:
            Q[6:, 6:] = 2.0 * 0.1 * np.eye(6)
        H += G.T @ Q @ G
        if k < 20:
            cross = M[k].T @ work.S[k] @ G[:6]
            H += cross + cross.T + M[k].T @ work.R[k] @ M[k]
            G = work.A[k] @ G + work.B[k] @ M[k]
    condense(table, work, room)
    lower = np.tril(np.ones((160, 160), dtype=bool))
    np.testing.assert_allclose(room.H[lower], H[lower], rtol=0.0, atol=1e-12 * abs(H).max())


def test_the_prediction_is_the_vehicle_s_own_motion():
    """States are Runge-Kutta steps under mean thrusts and the load, and means are integrals of the exact lag."""
    planner, case = Planner(model()), problem()
    planner.load(case)
    U = np.random.default_rng(2).normal(size=(20, 8))
    planner.cost(U)
    X, means, tau = planner._work.X, planner._work.T, VEHICLE.time_constants_s
    fine = (np.arange(2000) + 0.5) * 0.1 / 2000
    T0 = case.thrusts_N
    for k in range(3):
        course = U[k] + (T0 - U[k]) * np.exp(-fine[:, None] / tau)
        np.testing.assert_allclose(means[k], course.mean(axis=0), rtol=1e-6, atol=1e-8)
        T0 = U[k] + (T0 - U[k]) * np.exp(-0.1 / tau)
        wrench = VEHICLE.allocation_matrix @ means[k]
        wrench[:3] += Pose(X[k, :3], X[k, 3:7]).R.T @ case.force_W_N
        wrench[3:] += case.moment_B_Nm
        from wakewise.robot.vehicles import compile_body

        p, q, nu = step_rk4(compile_body(VEHICLE), X[k, :3], X[k, 3:7], X[k, 7:], wrench, case.current_W_m_s, 0.1)
        np.testing.assert_allclose(X[k + 1], np.concatenate([p, q, nu]), atol=1e-12)


@pytest.mark.parametrize(("gap", "row"), [(plane_gap, [0.6, 0.0, -0.8, -1.5]), (sphere_gap, [0.2, 0.1, 1.4, 0.08])])
def test_slopes_of_clearance_are_those_of_the_clearance(gap, row):
    """By position and by turn, at a tilted pose and near level, where corners are rounded off."""
    half, row = np.array([0.22, 0.17, 0.14]), np.array(row)

    def at(p, q):
        R, unused = np.empty((3, 3)), np.empty(6)
        rotation(np.concatenate([p, q, np.zeros(6)]), R)
        return gap(p, R, half, row, unused), unused

    level = quat_from_euler(0.0, np.arctan2(0.6, 0.8), 0.0)  # an axis of the box along the plane's normal
    p = np.array([0.3, -0.5, 1.0])
    for q in (quat_from_euler(0.2, -0.1, 0.7), quat_multiply(level, quat_from_rotvec(np.array([0.02, -0.03, 0.0])))):
        _, slope = at(p, q)
        for i in range(6):
            e = np.zeros(6)
            e[i] = 1e-6
            ahead, _ = at(p + e[:3], quat_multiply(q, quat_from_rotvec(e[3:])))
            behind, _ = at(p - e[:3], quat_multiply(q, quat_from_rotvec(-e[3:])))
            assert (ahead - behind) / 2e-6 == pytest.approx(slope[i], abs=1e-6)


def test_clearance_to_a_plane_is_that_of_the_nearest_corner():
    """Exact where level and beyond the rounded tilts, too large by at most 0.0074 of the half sizes in between."""
    half, floor, rng = np.array([0.22, 0.17, 0.14]), np.array([0.0, 0.0, -1.0, -2.0]), np.random.default_rng(4)
    corners = half * np.stack(np.meshgrid(*3 * [[-1.0, 1.0]]), axis=-1).reshape(-1, 3)
    for tilt, most in ((0.0, 0.0), (0.02, 0.0074), (0.06, 0.0074), (0.6, 0.0)):
        for heading in rng.uniform(-np.pi, np.pi, 8):
            R = np.empty((3, 3))
            # Roll and pitch alike: neither axis is within the rounded tilts at 0.6 rad.
            rotation(np.concatenate([np.zeros(3), quat_from_euler(tilt, tilt, heading), np.zeros(6)]), R)
            gap = plane_gap(np.array([0.1, 0.2, 1.5]), R, half, floor, np.empty(6))
            over = gap - (2.0 - 1.5 - (corners @ R.T)[:, 2].max())
            assert -1e-12 < over <= most * half.sum() + 1e-12


def test_the_barrier_is_smooth_falls_to_zero_and_stands_at_contact():
    """Value and slope are continuous at the reach and at the least clearance; slopes are exact."""
    for h in (-0.1, 0.0499999, 0.0500001, 0.1, 0.2499999, 0.3):
        value, slope, _ = barrier_value(h, 0.25, 0.05)
        ahead, behind = barrier_value(h + 1e-7, 0.25, 0.05)[0], barrier_value(h - 1e-7, 0.25, 0.05)[0]
        assert (ahead - behind) / 2e-7 == pytest.approx(slope, abs=1e-4)
        assert value >= 0.0
    assert barrier_value(-0.2, 0.25, 0.05)[0] > barrier_value(0.0, 0.25, 0.05)[0] > 1.0


def majorant_gap(superposition, seed):
    """Least of model - D over random other thrusts of equal signs, with the doubled block, roots hardly rounded."""
    wake = CONE
    table = wake_table(
        wake,
        REGION.points_W_m,
        REGION.weights,
        VEHICLE.thruster_positions_B_m,
        VEHICLE.thruster_axes_B,
        VEHICLE.disk_areas_m2,
        superposition=superposition,
        smooth_N=1e-6,
    )
    scratch, rng = wake_scratch(len(REGION.weights), 8), np.random.default_rng(seed)
    p, X_WB = np.array([0.2, 0.05, 1.1]), quat_from_euler(0.0, 0.0, 3.0)
    R = Pose(p, X_WB).R.copy()
    g, H, unused_g, unused_H = np.empty(14), np.empty((14, 14)), np.empty(14), np.empty((14, 14))
    least = np.inf
    for _ in range(40):
        T = rng.normal(size=8)
        other = np.sign(T) * np.abs(rng.normal(size=8))
        D = stage_disturbance(table, scratch, p, X_WB, R, T, True, g, H)
        d = other - T
        bound = D + g[6:] @ d + 0.5 * d @ (2.0 * H[6:, 6:]) @ d
        true = stage_disturbance(table, scratch, p, X_WB, R, other, False, unused_g, unused_H)
        least = min(least, bound - true)
    return least


def test_the_doubled_block_majorises_where_jets_do_not_cancel():
    """Incoherent sum: the model with twice 2 J'J thrust by thrust lies above D at equal signs."""
    assert majorant_gap("incoherent", 0) > -1e-12


def test_from_one_jet_the_majoriser_steps_to_zero_and_gauss_newton_to_minus_itself():
    """One thruster alone: D = c |T|; the two models' minima are 0 and -T."""
    table = table_of(CONE, "coherent")._replace(smooth_N=1e-12)
    scratch = wake_scratch(len(REGION.weights), 8)
    p, q = np.array([0.2, 0.0, 1.1]), quat_from_euler(0.0, 0.0, np.pi)
    R, g, H = Pose(p, q).R.copy(), np.empty(14), np.empty((14, 14))
    hit = -1
    for i in range(8):
        T = np.zeros(8)
        T[i] = -1.2
        stage_disturbance(table, scratch, p, q, R, T, True, g, H)
        if H[6 + i, 6 + i] > 0.0:
            hit = i
            assert T[i] - g[6 + i] / (2.0 * H[6 + i, 6 + i]) == pytest.approx(0.0, abs=1e-3)
            assert T[i] - g[6 + i] / H[6 + i, 6 + i] == pytest.approx(1.2, abs=1e-3)
    assert hit >= 0


@pytest.mark.parametrize("bound", [50.0, 1.0, 0.2])
def test_the_quadratic_problem_is_solved(bound):
    """Bounds kept, and the projected gradient of the whole function (hinges of rate included) vanishes."""
    rng = np.random.default_rng(0)
    size, n, limit, rho = 48, 8, 0.6, 100.0
    A = rng.normal(size=(size, size))
    H, g, steps = A @ A.T + np.eye(size), 5.0 * rng.normal(size=size), rng.normal(size=size)
    qp = BoxQP(size, n, limit, rho)
    low, high = np.full(size, -bound), np.full(size, bound)
    for _ in range(2):
        answer = qp.solve(H, g, low, high, steps)
        z = answer.z
        E = np.eye(size) - np.eye(size, k=-n)
        s = steps + E @ z
        over = np.sign(s) * np.maximum(np.abs(s) - limit, 0.0)
        slope = H @ z + g + E.T @ (2.0 * rho * over)
        free = (z > low + 1e-6) & (z < high - 1e-6)
        assert answer.solved
        assert np.all((z >= low - 1e-9) & (z <= high + 1e-9))
        assert np.abs(slope[free]).max(initial=0.0) < 1e-3 * np.abs(g).max()
        assert np.all(slope[z <= low + 1e-6] >= -1e-3) and np.all(slope[z >= high - 1e-6] <= 1e-3)
        start = rho * np.sum(np.maximum(np.abs(steps) - limit, 0.0) ** 2)
        fall = start - (0.5 * z @ H @ z + g @ z + rho * np.sum(over**2))
        assert answer.promise == pytest.approx(fall, rel=1e-6)
