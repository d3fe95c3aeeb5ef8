"""The planner `paper`: the recipe as printed, with what it needs to work.

Sequential quadratic programming with the second-order Taylor expansion of D, OSQP warm-started with at most 50
iterations and tolerances of 1e-4, at most 5 quadratic problems per plan. Soft rate limits are slack variables with
the weight rho. Two additions, without which it ends in NaN: the Taylor Hessian is indefinite, so each stage's block
is brought to the nearest positive semidefinite one, and a step is halved until the true cost falls. OSQP (B.
Stellato et al., Mathematical Programming Computation 12 (2020) 637, doi 10.1007/s12532-020-00179-2) looks for
termination every 25 iterations by default, which at 50 leaves two looks; here it looks every 5.

Two ways of coding it, for a fair race: as one writes it from the recipe (Taylor blocks by central differences of the
compiled gradient in a loop, a new OSQP problem every time), and as well as `mm` is (compiled differences that skip jets
which miss, one OSQP problem whose numbers are updated).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.planning.kernels import RATE_N, horizon, rotation
from wakewise.planning.planner import PlanModel, Planner
from wakewise.planning.problem import RATE_PENALTY, Horizon, PlanProblem
from wakewise.planning.qp import add_commands, condense
from wakewise.wake.plan_disturbance import stage_disturbance

if TYPE_CHECKING:
    import osqp

SQP_STEPS, QP_ITERATIONS, TOLERANCE = 5, 50, 1e-4
"""The paper's limits."""
_STEP = 1e-5


@njit
def _turned(state: Array, axis: int, step: float, moved: Array) -> None:
    """State moved by `step` along position (0 to 2) or rotation vector (3 to 5)."""
    moved[:] = state
    if axis < 3:
        moved[axis] += step
        return
    w, x, y, z = state[3], state[4], state[5], state[6]
    h = 0.5 * step
    if axis == 3:
        moved[3], moved[4], moved[5], moved[6] = w - h * x, x + h * w, y + h * z, z - h * y
    elif axis == 4:
        moved[3], moved[4], moved[5], moved[6] = w - h * y, x - h * z, y + h * w, z + h * x
    else:
        moved[3], moved[4], moved[5], moved[6] = w - h * z, x + h * y, y - h * x, z + h * w
    size = np.sqrt(moved[3] ** 2 + moved[4] ** 2 + moved[5] ** 2 + moved[6] ** 2)
    for r in range(3, 7):
        moved[r] /= size


@njit
def taylor_block(wake: Any, scratch: Any, state: Array, thrusts: Array, central: bool, block: Array) -> None:
    """Second derivatives of D of one stage by differences of its gradient: position, rotation vector, thrusts."""
    n = thrusts.shape[0]
    size = 6 + n
    moved, R, T = state.copy(), np.empty((3, 3)), thrusts.copy()
    base, ahead, behind, H = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((size, size))
    rotation(state, R)
    stage_disturbance(wake, scratch, state[:3], state[3:7], R, thrusts, True, base, H)
    idle = np.zeros(size, np.bool_)
    for i in range(n):
        idle[6 + i] = H[6 + i, 6 + i] == 0.0
    for axis in range(size):
        if idle[axis] and not central:
            block[axis] = 0.0
            continue
        for side in range(2 if central else 1):
            step = _STEP if side == 0 else -_STEP
            if axis < 6:
                _turned(state, axis, step, moved)
            else:
                moved[:] = state
                T[axis - 6] = thrusts[axis - 6] + step
            rotation(moved, R)
            stage_disturbance(wake, scratch, moved[:3], moved[3:7], R, T, True, ahead if side == 0 else behind, H)
            if axis >= 6:
                T[axis - 6] = thrusts[axis - 6]
        for r in range(size):
            block[axis, r] = (ahead[r] - behind[r]) / (2.0 * _STEP) if central else (ahead[r] - base[r]) / _STEP


@njit
def taylor_blocks(wake: Any, scratch: Any, states: Array, thrusts: Array, blocks: Array) -> None:
    """One-sided `taylor_block` of every stage."""
    for k in range(thrusts.shape[0]):
        taylor_block(wake, scratch, states[k], thrusts[k], False, blocks[k])


class PaperPlanner(Planner):
    """Plans as the paper says; `well_coded` chooses the faster of the two ways to write it down."""

    def __init__(self, model: PlanModel, *, well_coded: bool = False) -> None:
        super().__init__(model)
        self._well_coded = well_coded
        n, N = model.thrusters, model.settings.stages
        size = N * n
        self._blocks = np.zeros((N, 6 + n, 6 + n))
        E = sparse.eye(size) - sparse.eye(size, k=-n)
        one, none = sparse.eye(size), sparse.csc_matrix((size, size))
        self._A = sparse.csc_matrix(sparse.vstack([sparse.hstack(r) for r in ([one, none], [E, -one], [E, one])]))
        dense = sparse.csc_matrix(np.triu(np.ones((size, size))))
        self._rows, self._columns = dense.indices, np.repeat(np.arange(size), np.diff(dense.indptr))
        self._P = sparse.csc_matrix(sparse.block_diag([dense, sparse.eye(size)]))
        self._solver: osqp.OSQP | None = None
        self._answer_before = np.zeros(2 * size)

    def plan(self, problem: PlanProblem, start_N: Array, **_: object) -> Horizon:
        """Plan from commands `start_N`, shape (N, n); see `Planner.plan`."""
        self.load(problem)
        table = self.model.table
        U = np.clip(start_N, table.lower, table.upper)
        converged, done, J = False, 0, self.cost(U)
        while done < SQP_STEPS:
            done += 1
            H, g = self._taylor(U)
            z, solved = self._osqp(H, g, U)
            step, before = z.reshape(U.shape), J
            U, J = self._halve(U, step, J)
            converged = solved and before - J <= 1e-3 * abs(J)
            if before - J <= 1e-3 * abs(J):
                break
        return self._answer(U, J, done, converged, "osqp")

    def _taylor(self, U: Array) -> tuple[Array, Array]:
        """Hessian (lower triangle) with Taylor blocks of D, and gradient without the slacks."""
        table, work, case = self.model.table, self._work, self._case
        horizon(table, self.model.wake_table, self._scratch, case, U, work, True)
        if self._well_coded:
            taylor_blocks(self.model.wake_table, self._scratch, work.X, work.T, self._blocks)
        else:
            for k in range(len(U)):
                taylor_block(self.model.wake_table, self._scratch, work.X[k], work.T[k], True, self._blocks[k])
        blocks = 0.5 * (self._blocks + np.swapaxes(self._blocks, 1, 2))
        values, vectors = np.linalg.eigh(blocks)
        blocks = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        weight = table.stage_s * self.model.terms.w_disturbance
        blocks *= weight
        # `horizon` left Gauss-Newton (and tracking) in the pose blocks: exchange the part that is D's.
        self._exchange(blocks, weight)
        condense(table, work, self._room)
        add_commands(table, case.command, U, self._room, self._steps)
        return self._room.H, self._room.g

    def _exchange(self, blocks: Array, weight: float) -> None:
        work = self._work
        n = self.model.thrusters
        R, g, H = np.empty((3, 3)), np.zeros(6 + n), np.zeros((6 + n, 6 + n))
        if weight == 0.0:
            return
        for k in range(len(blocks)):
            state = work.X[k]
            rotation(state, R)
            stage_disturbance(self.model.wake_table, self._scratch, state[:3], state[3:7], R, work.T[k], True, g, H)
            work.Q[k] += blocks[k, :6, :6] - weight * H[:6, :6]
            work.S[k], work.R[k] = blocks[k, 6:, :6], blocks[k, 6:, 6:]

    def _osqp(self, H: Array, g: Array, U: Array) -> tuple[Array, bool]:
        import osqp

        size, table, rho = U.size, self.model.table, RATE_PENALTY
        limit = float(table.weights[RATE_N])
        q = np.concatenate([g, np.zeros(size)])
        flat = U.reshape(-1)
        far = np.full(size, 1e20)
        low = np.concatenate([self._lower - flat, -far, -limit - self._steps])
        high = np.concatenate([self._upper - flat, limit - self._steps, far])
        values = np.concatenate([H[self._columns, self._rows], np.full(size, 2.0 * rho)])
        if self._solver is None or not self._well_coded:
            self._P.data = values
            self._solver = osqp.OSQP()
            self._solver.setup(
                self._P,
                q,
                self._A,
                low,
                high,
                eps_abs=TOLERANCE,
                eps_rel=TOLERANCE,
                max_iter=QP_ITERATIONS,
                check_termination=5,
                verbose=False,
            )
            self._solver.warm_start(x=self._answer_before)
        else:
            self._solver.update(q=q, l=low, u=high, Px=values)
        found = self._solver.solve(raise_error=False)
        x = np.asarray(found.x)
        if not np.isfinite(x).all():
            self._solver = None
            return np.zeros(size), False
        self._answer_before = x
        return x[:size], int(found.info.status_val) == 1

    def _halve(self, U: Array, step: Array, J: float) -> tuple[Array, float]:
        share, table = 1.0, self.model.table
        for _ in range(6):
            trial = np.clip(U + share * step, table.lower, table.upper)
            found = self.cost(trial)
            if found < J:
                return trial, found
            share *= 0.5
        return U, J
