"""The planner `mm`: sequential quadratic programming with a majorised Hessian, condensed to the commands.

Gauss-Newton of D has half the curvature that bounds |T|: from T its step lands at -T, a built-in chatter. Doubling the
block thrust by thrust gives the majoriser (as in iteratively reweighted least squares): from T the step lands at 0. One
iteration per plan is the real-time mode; more are done while they promise anything, with a line search on the true
cost.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.allocation.allocate import Layout, Weights, compile_layout, min_wash_allocation
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.planning import kernels
from wakewise.planning.finite_difference import add_numeric, numeric_wake
from wakewise.planning.kernels import CLOSEST, RATE_N, W_DISTURBANCE, PlanCase, PlanTable, horizon, plan_work, set_reach
from wakewise.planning.obstacles import Surroundings
from wakewise.planning.problem import (
    BARRIER_REACH_M,
    CLEARANCE_M,
    EDGE_DEG,
    RATE_LIMIT_N_S,
    RATE_PENALTY,
    SMOOTH_N,
    Horizon,
    PlanProblem,
    PlanSettings,
    PlanTerms,
)
from wakewise.planning.qp import BoxQP, add_commands, add_rate_gradient, condense, condensed_room, motion_gradient
from wakewise.robot.vehicles import Vehicle, compile_body
from wakewise.scene.targets import Region
from wakewise.wake import PaperJet, gram
from wakewise.wake.finite_difference import FiniteDifferenceWake
from wakewise.wake.plan_disturbance import PackedWakeModel, is_compiled, wake_scratch, wake_table, with_smooth_edge

BARRIER_RANGE = (0.02, 20.0)
"""Least and largest mu of the clearance barrier: it grows from plan to plan while the plan comes too close."""
TRACKING = [kernels.W_TRACK, kernels.W_PATH, kernels.W_TWIST]
"""Places of the weights that grow with the tracking weight."""


@dataclass(frozen=True, eq=False)
class PlanModel:
    """Tables of the kernels for one vehicle, region, wake model and settings; make one with `compile_plan`."""

    vehicle: Vehicle
    region: Region
    wake: WakeModel
    settings: PlanSettings
    terms: PlanTerms
    table: PlanTable
    wake_table: PackedWakeModel
    layout: Layout
    numeric: FiniteDifferenceWake | None = None

    @property
    def thrusters(self) -> int:
        """Number of thrusters n."""
        return len(self.table.lower)

    @cached_property
    def total_weight(self) -> float:
        """Sum of the region's weights."""
        return float(np.sum(self.region.weights))


def compile_plan(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: PlanSettings,
    surroundings: Surroundings | None = None,
    terms: PlanTerms | None = None,
    *,
    lower_N: Array | None = None,
    upper_N: Array | None = None,
    majorise: float = 2.0,
) -> PlanModel:
    """Tables for a nominal vehicle.

    `lower_N`, `upper_N` replace the vehicle's thrust limits (zeros for a thruster that failed); `majorise` is the
    factor of the block thrust by thrust, 2 for the majoriser and 1 for Gauss-Newton.

    Raises
    ------
    InputError
        Limits with min > max or not finite, no points, weights that are negative or NaN.
    """
    lower = np.array(vehicle.thrust_lower_N if lower_N is None else lower_N, dtype=np.float64)
    upper = np.array(vehicle.thrust_upper_N if upper_N is None else upper_N, dtype=np.float64)
    n, N, h = len(vehicle.thrusters), settings.stages, settings.stage_s
    if lower.shape != (n,) or upper.shape != (n,) or not np.all(np.isfinite(lower) & np.isfinite(upper)):
        raise InputError(f"thrust limits: must be {n} finite numbers each")
    if np.any(lower > upper):
        worst = int(np.argmax(lower - upper))
        raise InputError(
            f"thruster {worst + 1}: limits {lower[worst]:g} to {upper[worst]:g} N, the least must not exceed the most"
        )
    around, terms = surroundings or Surroundings(), terms or PlanTerms()
    tau = np.maximum(vehicle.time_constants_s, 1e-6)
    keep = np.exp(-h / tau)
    mean = (1.0 - keep) * tau / h
    mean_map = np.zeros((N, N, n))
    for k in range(N):
        mean_map[k, k] = 1.0 - mean
        for j in range(k):
            mean_map[k, j] = mean * keep ** (k - 1 - j) * (1.0 - keep)
    weights = [
        terms.w_effort,
        settings.w_change,
        settings.w_track,
        settings.w_path,
        settings.w_attitude,
        settings.w_twist,
        settings.attitude_tolerance_rad,
        RATE_LIMIT_N_S * h,
        RATE_PENALTY,
        BARRIER_REACH_M,
        CLEARANCE_M,
        terms.w_disturbance,
    ]
    table = PlanTable(
        packed=np.array(compile_body(vehicle).packed),
        allocation=np.array(vehicle.allocation_matrix),
        lower=lower,
        upper=upper,
        keep=keep,
        mean=mean,
        mean_map=mean_map.reshape(N, N * n),
        half_size=0.5 * np.array(vehicle.size_m),
        planes=np.array(around.planes),
        spheres=np.array(around.spheres),
        weights=np.array(weights),
        stage_s=h,
        majorise=majorise,
    )
    smooth = with_smooth_edge(wake, float(np.radians(EDGE_DEG)))
    numeric = None if is_compiled(smooth) else numeric_wake(smooth, region, vehicle, terms)
    if numeric is not None:
        # The kernels leave D out; `Planner` adds it stage by stage.
        table.weights[W_DISTURBANCE] = 0.0
    view = wake_table(
        smooth if numeric is None else PaperJet(),
        region.points_W_m,
        region.weights,
        vehicle.thruster_positions_B_m,
        vehicle.thruster_axes_B,
        vehicle.disk_areas_m2,
        superposition=terms.superposition,
        smooth_N=SMOOTH_N,
    )
    layout = compile_layout(vehicle.allocation_matrix, np.minimum(lower, 0.0), np.maximum(upper, 0.0))
    return PlanModel(vehicle, region, smooth, settings, terms, table, view, layout, numeric)


class Planner:
    """Solves one `PlanProblem` after another, each from the plan before; `plan` is the whole interface."""

    def __init__(self, model: PlanModel) -> None:
        self.model = model
        n, N = model.thrusters, model.settings.stages
        self._scratch = wake_scratch(model.wake_table.points.shape[1], n)
        self._work = plan_work(N, n)
        self._room = condensed_room(N, n)
        self._steps = np.zeros(N * n)
        self._qp = BoxQP(N * n, n, float(model.table.weights[RATE_N]), RATE_PENALTY)
        self._case = PlanCase(
            state=np.zeros(13),
            thrusts=np.zeros(n),
            command=np.zeros(n),
            force_W=np.zeros(3),
            moment_B=np.zeros(3),
            current_W=np.zeros(3),
            reference=np.zeros((N + 1, 13)),
            barrier=np.array([BARRIER_RANGE[0], BARRIER_REACH_M]),
        )
        self._lower = np.tile(model.table.lower, N)
        self._upper = np.tile(model.table.upper, N)
        self._predicted: Array | None = None
        self._since_second = model.terms.second_start_every
        self._late: Callable[[], bool] = lambda: False

    def cost(self, U: Array) -> float:
        """Objective of commands, shape (N, n), for the problem last loaded; fills the prediction."""
        self._predicted = U
        return self._roll(U, slopes=False)

    def gradient(self, U: Array) -> Array:
        """Gradient of the objective, shape (N n,), a view that the next call overwrites."""
        table = self.model.table
        self._roll(U, slopes=True)
        motion_gradient(table, self._work, self._room.g)
        add_commands(table, self._case.command, U, self._room, self._steps)
        add_rate_gradient(table, self._steps, U.shape[1], self._room.g)
        return self._room.g

    def derivatives(self, U: Array) -> tuple[float, Array, Array]:
        """Objective, and gradient (N n,) and Hessian (N n, N n) (lower triangle) without the hinges of rate; views."""
        table = self.model.table
        self._predicted = U
        J = self._roll(U, slopes=True)
        condense(table, self._work, self._room)
        add_commands(table, self._case.command, U, self._room, self._steps)
        return float(J), self._room.g, self._room.H

    def _roll(self, U: Array, *, slopes: bool) -> float:
        """Objective of commands; fills the work, with derivatives if asked."""
        model, work = self.model, self._work
        J = float(horizon(model.table, model.wake_table, self._scratch, self._case, U, work, slopes))
        if model.numeric is None or model.terms.w_disturbance == 0.0:
            return J
        weight = model.table.stage_s * model.terms.w_disturbance
        return J + add_numeric(model.numeric, weight, model.table.majorise, work, slopes=slopes)

    def load(self, problem: PlanProblem) -> None:
        """Take a problem in."""
        case, settings = self._case, self.model.settings
        if problem.reference.shape != case.reference.shape or problem.thrusts_N.shape != case.thrusts.shape:
            raise InputError(
                f"plan: {len(problem.reference) - 1} stages and {len(problem.thrusts_N)} thrusters, "
                f"allowed: {settings.stages} and {self.model.thrusters}"
            )
        case.state[:] = problem.state
        case.thrusts[:] = problem.thrusts_N
        case.command[:] = problem.command_N
        case.force_W[:] = problem.force_W_N
        case.moment_B[:] = problem.moment_B_Nm
        case.current_W[:] = problem.current_W_m_s
        case.reference[:] = problem.reference
        # The kernels read the weights at each call, so a live dial compiles nothing.
        tracking = np.array([settings.w_track, settings.w_path, settings.w_twist])
        self.model.table.weights[TRACKING] = problem.tracking_weight_scale * tracking
        set_reach(self.model.table, case)

    def plan(
        self,
        problem: PlanProblem,
        start_N: Array,
        *,
        deadline: float = float("inf"),
        clock: Callable[[], float] = time.perf_counter,
    ) -> Horizon:
        """Improve on commands `start_N`, shape (N, n), until converged, out of iterations, or past `deadline`.

        `deadline` is a time on `clock`; an iteration under way is finished.
        """
        self._late = lambda: clock() > deadline
        self.load(problem)
        settings = self.model.settings
        U = np.clip(start_N, self.model.table.lower, self.model.table.upper)
        U, J, done, converged, solver = self._descend(U, settings.iterations)
        if not np.isfinite(J):
            # Thrusts that were planned from elsewhere can make the vehicle tumble, faster than stages can follow.
            U, J, done, converged, solver = self._descend(self.holding(problem), settings.iterations)
        self._since_second += 1
        for other, iterations in self._other_starts(problem, U, J, done):
            V, J_other, more, other_converged, other_solver = self._descend(other, iterations, J)
            done += more
            if J_other < J:
                U, J, converged, solver = V, J_other, other_converged, other_solver
        return self._answer(U, J, done, converged, solver)

    def holding(self, problem: PlanProblem) -> Array:
        """Least thrusts that carry the load where the vehicle is, in every stage, shape (N, n): a first guess."""
        q, table = problem.state[3:7], self.model.table
        t = 2.0 * np.cross(-q[1:], problem.force_W_N)
        force_B = problem.force_W_N + q[0] * t + np.cross(-q[1:], t)
        wanted = -np.concatenate([force_B, problem.moment_B_Nm])
        least = np.clip(self.model.layout.inverse @ wanted, table.lower, table.upper)
        return np.tile(least, (self.model.settings.stages, 1))

    def _other_starts(self, problem: PlanProblem, U: Array, J: float, done: int) -> Iterator[tuple[Array, int]]:
        """Starts that may lead to a better minimum than U, and how many iterations each may take.

        Another sign pattern now and then, with the iterations that the plan has left over. And the thrusts that hold
        the load, where the plan would touch something: it is caught behind the target, as no push of the barrier's
        brings it back through.
        """
        settings, every = self.model.settings, self.model.terms.second_start_every
        if every == 0 or settings.iterations == 1 or self._late():
            return
        if self._predicted is not U:
            self.cost(U)
        if self._work.parts[CLOSEST] < 0.0:
            yield self.holding(problem), max(settings.iterations, 3)
        elif self._since_second >= every and done + 2 <= settings.iterations:
            self._since_second = 0
            other = self._other_pattern(U)
            if other is not None and self.cost(other) < 2.0 * J:
                yield other, settings.iterations - done

    def _descend(self, U: Array, iterations: int, rival: float = float("inf")) -> tuple[Array, float, int, bool, str]:
        """Iterate from U; gives up where an iteration leaves it a fifth worse than a `rival` cost."""
        tolerance, solver = self.model.terms.tolerance, "none"
        J, g, H = self.derivatives(U)
        converged = False
        for done in range(1, iterations + 1):
            flat = U.reshape(-1)
            answer = self._qp.solve(H, g, self._lower - flat, self._upper - flat, self._steps)
            solver = answer.solver
            if not answer.solved:
                return U, J, done, False, solver
            step = answer.z.reshape(U.shape)
            promise = answer.promise
            if done > 1 and promise <= tolerance * J * 0.1:
                return U, J, done, True, solver
            last = done == iterations
            trial, J_trial, H_fresh = self._search(U, step, J, promise, last)
            fell = J - J_trial
            if fell <= 0.0:
                return U, J, done, promise <= tolerance * J, solver
            U, J = trial, J_trial
            # A short step that gains little is not convergence while the model still promises much.
            converged = (fell <= tolerance * J and promise <= 10.0 * tolerance * J) or iterations == 1
            if converged or last or self._late() or 1.2 * rival < J:
                return U, J, done, converged, solver
            if not H_fresh:
                J, g, H = self.derivatives(U)
        return U, J, iterations, converged, solver

    def _search(self, U: Array, step: Array, J: float, promise: float, last: bool) -> tuple[Array, float, bool]:
        """Full step if the cost falls, else halves of it; derivatives come along with a full step that is not the
        last.
        """
        table = self.model.table
        share = 1.0
        for attempt in range(6):
            trial = np.clip(U + share * step, table.lower, table.upper)
            if attempt == 0 and not last:
                J_trial, _, _ = self.derivatives(trial)
            else:
                J_trial = self.cost(trial)
            if J_trial < J - 1e-4 * share * promise:
                return trial, J_trial, attempt == 0 and not last
            share *= 0.5
        return U, J, False

    def _other_pattern(self, U: Array) -> Array | None:
        """The same wrenches by the spare thrusts that are best stage by stage; None if that is no news."""
        model = self.model
        if model.layout.k == 0 or model.terms.w_disturbance == 0.0:
            return None
        if self._predicted is not U:
            self.cost(U)
        vehicle, null = model.vehicle, model.layout.null
        weights = Weights(disturbance=model.terms.w_disturbance, effort=max(model.terms.w_effort, 1e-6))
        shifts, before = np.zeros_like(U), None
        for k, mean in enumerate(np.array(self._work.T)):
            # Every fourth stage is enough: poses of neighbours are alike.
            if k % 4:
                shifts[k] = shifts[k - 1]
                continue
            X_WB = Pose(self._work.X[k, :3], self._work.X[k, 3:7])
            G = gram(
                model.wake,
                model.region.points_W_m,
                model.wake_table.weights,
                X_WB.apply(vehicle.thruster_positions_B_m),
                vehicle.thruster_axes_B @ X_WB.R.T,
                vehicle.disk_areas_m2,
                model.terms.superposition,
            )
            best = min_wash_allocation(model.layout, vehicle.allocation_matrix @ mean, G, weights, before)
            before = best.thrusts_N
            shifts[k] = null @ (null.T @ (best.thrusts_N - mean))
        if np.abs(shifts).max() < 0.2 * SMOOTH_N:
            return None
        return np.asarray(np.clip(U + shifts, model.table.lower, model.table.upper))

    @property
    def crowded(self) -> bool:
        """Whether the last problem's goal lay nearer to something than the clearance, so that its plan stays off it."""
        return bool(self._case.barrier[1] <= CLEARANCE_M)

    def _answer(self, U: Array, J: float, done: int, converged: bool, solver: str) -> Horizon:
        if self._predicted is not U:
            self.cost(U)
        closest, mu = self._work.parts[CLOSEST], self._case.barrier
        factor = 4.0 if closest < CLEARANCE_M else 0.7
        mu[0] = min(max(factor * mu[0], BARRIER_RANGE[0]), BARRIER_RANGE[1])
        return Horizon(
            states=self._work.X.copy(),
            commands_N=U,
            thrusts_N=self._work.T.copy(),
            cost=J,
            disturbance=float(np.mean(self._work.D)),
            iterations=done,
            converged=converged,
            solver=solver,
            curvature=self._work.R[0].copy(),
        )
