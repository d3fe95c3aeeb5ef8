"""The planner: control steps as they are flown; then plans against the paper's recipe and IPOPT, on the same problems.

`flown` is the control step of a default flight, 50 steps a second, with the vehicle 3 N heavy, free jets in the plan,
wall jets and merging jets in the allocation. The plant has 15 % more drag than is believed and tells its true state.
Times are the thread's CPU after a second of warm-up; a `planning` step is one in ten that also plans or searches.

The rest is the planner alone in the paper's own wake model. Scenario A floats (1.5 N), B sinks (3 N): an orbit of 0.35
m radius at 0.2 m/s with the body 0.2 m above the top of a coral, in a current of 0.25 m/s, wake model
`paper-calibrated` with a smooth edge of 3 deg. The plant flies the commands of `mm_quality` with 15 % more drag and 10
% more current than the planner believes. Every solver starts from its own last plan. Times are the thread's CPU per
plan after the first three. IPOPT solves the planner's own objective (needs casadi, a development dependency). The
deadline is measured on the wall's clock while every core is busy with something else.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from wakewise.control import ControlSettings, make_controller
from wakewise.control.failsafe import PlanFailsafe
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.planning.obstacles import Surroundings
from wakewise.planning.planner import PlanModel, Planner, compile_plan
from wakewise.planning.problem import PLAN_EVERY_S, Horizon, PlanProblem, PlanSettings, PlanTerms, reference_of, shifted
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body
from wakewise.robot.vehicles.kernels import rk4_kernel
from wakewise.wake import WakeSettings, wake_model
from wakewise_benchmarks.paper_planner import PaperPlanner
from wakewise_benchmarks.registry import VEHICLE, bench_region, bench_target

METHODS = ("wake-aware", "allocation-only", "mpc", "dp")
SECONDS, WARM_UP_S, DT_S = 11.0, 1.0, 0.02
ESTIMATED_CURRENT_M_S = np.array([0.05, 0.02, 0.0])
"""What the estimate says of the water, so that points upstream are watched, too."""


def flown_step(method: str, goal_at: Callable[[float], Goal], weight_N: float) -> dict[str, Any]:
    """Times of a method's control steps in ms: median, 99th percentile, and that of the slowest tenth's median."""
    settings = ControlSettings()
    wake = wake_model(settings.wake, bench_target().bed_z_m)
    controller = make_controller(method, VEHICLE, bench_region(), wake, settings)
    plant = np.array(compile_body(VEHICLE).packed)
    plant[12:19] *= 1.15
    goal = goal_at(0.0)
    x, thrusts = np.concatenate([goal.X_WB.p_m, goal.X_WB.q, goal.nu_B]), np.zeros(len(VEHICLE.thrusters))
    state, spans = controller.init(), []
    for k in range(round(SECONDS / DT_S)):
        goal, X_WB = goal_at(k * DT_S), Pose(x[:3], x[3:7])
        load_B = np.concatenate([X_WB.R.T @ [0.0, 0.0, weight_N], np.zeros(3)])
        estimate = BodyState(X_WB=X_WB, nu_B=x[7:], load_B=load_B, current_W_m_s=ESTIMATED_CURRENT_M_S)
        began = time.thread_time_ns()
        state, command = controller.step(state, DT_S, estimate, goal)
        spans.append((time.thread_time_ns() - began) / 1e6)
        thrusts = thruster_lag(thrusts, command.thrusts_N, VEHICLE.time_constants_s, DT_S)
        wrench = VEHICLE.allocation_matrix @ thrusts
        wrench += load_B
        rk4_kernel(plant, x, np.concatenate([wrench, ESTIMATED_CURRENT_M_S]), DT_S)
    late = np.array(spans[round(WARM_UP_S / DT_S) :])
    slow = np.sort(late)[-len(late) // 10 :]
    return {
        "ms_median": float(np.median(late)),
        "ms_p99": float(np.percentile(late, 99)),
        "ms_planning_median": float(np.median(slow)),
    }


PLANS = 100


def deadline_misses(model: PlanModel, problem: PlanProblem) -> tuple[int, float]:
    """Late plans of `PLANS`, ten per second, and the longest time in ms, with one busy process per core."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        failsafe = PlanFailsafe(planner=Planner(model), deadline_s=PLAN_EVERY_S)
        plan, longest = None, 0.0
        failsafe.ask(lambda: problem, None, 0.0)
        failsafe.incidents.counts.clear()
        for _ in range(PLANS):
            began = time.perf_counter()
            plan = failsafe.ask(lambda: problem, plan, model.settings.stage_s).plan
            longest = max(longest, time.perf_counter() - began)
            time.sleep(max(0.02 - (time.perf_counter() - began), 0.0))
        return failsafe.incidents.counts.get("late", 0), float(np.round(1e3 * longest, 2))
    finally:
        for process in busy:
            process.kill()
            process.wait()


class IpoptReference:
    """Minimises the cost of commands within their limits, from any start, with exact gradients and their differences.

    IPOPT: A. Waechter and L. T. Biegler, Mathematical Programming 106 (2006) 25, doi 10.1007/s10107-004-0559-y.

    Raises
    ------
    ImportError
        Where casadi is not installed.
    """

    def __init__(self, planner: Planner, iterations: int = 20) -> None:
        casadi: Any = import_module("casadi")

        table, stages = planner.model.table, planner.model.settings.stages
        self._shape = (stages, planner.model.thrusters)
        size = stages * planner.model.thrusters
        shape = self._shape

        if TYPE_CHECKING:  # casadi, which is optional, has no types

            class Callback:
                """Base of the three functions that IPOPT asks for."""

                def construct(self, name: str, options: dict[str, object]) -> None: ...

                def __call__(self, *arguments: object) -> Any: ...
        else:
            Callback = casadi.Callback

        class Gradient(Callback):
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self.construct("gradient", {})

            def get_n_in(self) -> int:
                return 2

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, i: int) -> object:
                return casadi.Sparsity.dense(size if i == 0 else 1, 1)

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.dense(1, size)

            def eval(self, args: list[Any]) -> list[object]:
                U = np.array(args[0]).reshape(shape)
                return [casadi.DM(planner.gradient(U)).T]

        class Cost(Callback):
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self._gradient = Gradient()
                self.construct("cost", {})

            def get_n_in(self) -> int:
                return 1

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, _: int) -> object:
                return casadi.Sparsity.dense(size, 1)

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.dense(1, 1)

            def eval(self, args: list[Any]) -> list[object]:
                return [planner.cost(np.array(args[0]).reshape(shape))]

            def has_jacobian(self) -> bool:
                return True

            def get_jacobian(self, *_: object) -> object:
                return self._gradient

        class Hessian(Callback):
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self.construct("hessian", {})

            def get_n_in(self) -> int:
                return 4

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, i: int) -> object:
                return casadi.Sparsity.dense(*((size, 1), (0, 1), (1, 1), (0, 1))[i])

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.upper(size)

            def eval(self, args: list[Any]) -> list[object]:
                z, scale = np.array(args[0]).reshape(-1), float(args[2])
                H = np.empty((size, size))
                here = planner.gradient(z.reshape(shape)).copy()
                for i in range(size):
                    moved = z.copy()
                    moved[i] += 1e-6
                    H[i] = (planner.gradient(moved.reshape(shape)) - here) / 1e-6
                return [casadi.triu(casadi.DM(0.5 * scale * (H + H.T)))]

        self._cost, self._hessian = Cost(), Hessian()
        z = casadi.MX.sym("z", size)
        options = {
            "hess_lag": self._hessian,
            "ipopt.max_iter": iterations,
            "ipopt.tol": 1e-4,
            "ipopt.acceptable_iter": 0,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
        }
        self._solver = casadi.nlpsol("plan", "ipopt", {"x": z, "f": self._cost(z)}, options)
        self._bounds = {"lbx": np.tile(table.lower, stages), "ubx": np.tile(table.upper, stages)}

    def solve(self, start_N: Array) -> tuple[Array, float]:
        """Commands, shape (N, n), and their cost, for the problem last loaded into the planner."""
        found = self._solver(x0=start_N.reshape(-1), **self._bounds)
        return np.array(found["x"]).reshape(self._shape), float(found["f"])


SCENARIOS = {"A": -1.5, "B": 3.0}
"""Net weight in N, positive sinks."""
RADIUS_M, ABOVE_M, SPEED_M_S = 0.35, 0.2, 0.2
CURRENT_M_S = np.array([0.25, 0.0, 0.0])
INSTANTS, WARM_UP = 100, 3
REFERENCE_AT = (6, 18, 30, 42, 54, 66, 78, 90)
"""Instants of the comparison with IPOPT."""
RESTARTS = 20


def run(options: BenchOptions) -> dict[str, Any]:
    """Times of the step that flies; times, convergence and gaps of `paper` and `mm` in both scenarios."""
    flown = {method: flown_step(method, goal_at, SCENARIOS["B"]) for method in METHODS}
    answer: dict[str, Any] = {"flown": flown, "scenarios": {}, "why": {}}
    for number, (name, weight_N) in enumerate(SCENARIOS.items()):
        options.progress(number, len(SCENARIOS) + 1, f"scenario {name}")
        answer["scenarios"][name] = _scenario(weight_N, answer["why"])
    both = list(answer["scenarios"].values())

    def ratio(slow: str) -> float:
        return float(np.median([s[slow]["ms_median"] / s["mm_fast"]["ms_median"] for s in both]))

    answer["speedup_fast"] = ratio("paper")
    answer["speedup_fast_well_coded"] = ratio("paper_well_coded")
    answer["restart_spread_pct"] = max(s["restart_spread_pct"] for s in both)
    options.progress(len(SCENARIOS), len(SCENARIOS) + 1, "deadline under load")
    answer["deadline_misses"], answer["deadline_ms_max"] = deadline_misses(plan_model(5), problem_at(0.0, 3.0))
    return answer


def plan_model(iterations: int, second_start_every: int = 10, tolerance: float = 1e-3) -> PlanModel:
    """What the planner of this bench believes."""
    terms = PlanTerms(second_start_every=second_start_every, tolerance=tolerance)
    around = Surroundings(
        planes=np.array([[0.0, 0.0, -1.0, -bench_target().bed_z_m]]),
        spheres=np.array([[*bench_target().centre_W_m, bench_target().radius_m]]),
    )
    wake = wake_model(WakeSettings(model="paper-calibrated", edge_width_deg=3.0, floor=False))
    return compile_plan(VEHICLE, bench_region(), wake, PlanSettings(iterations=iterations), around, terms)


def goal_at(time_s: float) -> Goal:
    """Place on the orbit, looking at its axis."""
    rate = SPEED_M_S / RADIUS_M
    angle = rate * time_s
    top_z = float(bench_region().points_W_m[bench_region().distance_m == 0.0, 2].min())
    place = np.array([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), 0.0])
    place[:2] += bench_target().centre_W_m[:2]
    place[2] = top_z - ABOVE_M
    twist = np.array([0.0, -SPEED_M_S, 0.0, 0.0, 0.0, rate])
    return Goal(X_WB=Pose(place, quat_from_euler(0.0, 0.0, angle + np.pi)), nu_B=twist)


def problem_at(
    time_s: float,
    weight_N: float,
    state: Array | None = None,
    thrusts_N: Array | None = None,
    before: Array | None = None,
) -> PlanProblem:
    """Problem of an instant; without a state, on the orbit itself."""
    n, goal = len(VEHICLE.thrusters), goal_at(time_s)
    settings = PlanSettings()
    return PlanProblem(
        state=np.concatenate([goal.X_WB.p_m, goal.X_WB.q, goal.nu_B]) if state is None else state,
        thrusts_N=np.zeros(n) if thrusts_N is None else thrusts_N,
        command_N=np.zeros(n) if before is None else before,
        reference=reference_of(goal, settings.stages, settings.stage_s),
        force_W_N=np.array([0.0, 0.0, weight_N]),
        current_W_m_s=CURRENT_M_S,
    )


class MismatchedPlant:
    """Carries problems on by what was planned: its drag is 15 % and its current 10 % above what planners believe."""

    def __init__(self, weight_N: float) -> None:
        self._weight_N, self._steps = weight_N, 0
        self._body = np.array(compile_body(VEHICLE).packed)
        self._body[12:19] *= 1.15
        self.problem = problem_at(0.0, weight_N)
        self._state, self._thrusts_N = np.array(self.problem.state), np.zeros(len(VEHICLE.thrusters))

    def flown(self, command_N: Array) -> PlanProblem:
        """The problem after a control step of .1 s with this command, shape (n,)."""
        state = self._state
        for _ in range(5):
            self._thrusts_N = thruster_lag(self._thrusts_N, command_N, VEHICLE.time_constants_s, 0.02)
            wrench = VEHICLE.allocation_matrix @ self._thrusts_N
            wrench[:3] += Pose(state[:3], state[3:7]).R.T @ self.problem.force_W_N
            rk4_kernel(self._body, state, np.concatenate([wrench, 1.1 * CURRENT_M_S]), 0.02)
        self._steps += 1
        self.problem = problem_at(0.1 * self._steps, self._weight_N, state, self._thrusts_N, command_N)
        return self.problem


def _scenario(weight_N: float, why: dict[str, str]) -> dict[str, Any]:
    planners: dict[str, Planner] = {
        "paper": PaperPlanner(plan_model(5)),
        "paper_well_coded": PaperPlanner(plan_model(5), well_coded=True),
        "mm_fast": Planner(plan_model(1)),
        "mm_quality": Planner(plan_model(5)),
    }
    shape = (20, len(VEHICLE.thrusters))
    plans: dict[str, Horizon] = {}
    spans: dict[str, list[float]] = {name: [] for name in planners}
    converged: dict[str, list[bool]] = {name: [] for name in planners}
    gaps: dict[str, list[float]] = {name: [] for name in planners}
    reference = _reference(why)
    plant = MismatchedPlant(weight_N)
    problem = plant.problem
    best, spreads = None, []
    for instant in range(INSTANTS):
        for name, planner in planners.items():
            start = shifted(plans[name], 1) if name in plans else np.zeros(shape)
            began = time.thread_time_ns()
            plans[name] = planner.plan(problem, start)
            spans[name].append((time.thread_time_ns() - began) / 1e6)
            converged[name].append(plans[name].converged)
        if reference is not None and instant in REFERENCE_AT:
            judge, ipopt = reference
            judge.load(problem)
            starts = [plans["mm_quality"].commands_N] + ([] if best is None else [best])
            best, least = min((ipopt.solve(start) for start in starts), key=lambda found: found[1])
            for name in planners:
                gaps[name].append(100.0 * (plans[name].cost / least - 1.0))
        elif best is not None:
            best = np.vstack([best[1:], best[-1:]])
        if instant in (20, 60):
            spreads.append(restart_spread(problem))
        problem = plant.flown(plans["mm_quality"].commands_N[0])
    rows: dict[str, Any] = {}
    for name in planners:
        late = np.array(spans[name][WARM_UP:])
        rows[name] = {
            "ms_median": float(np.median(late)),
            "ms_p99": float(np.percentile(late, 99)),
            "converged_pct": 100.0 * float(np.mean(converged[name][WARM_UP:])),
            "gap_median_pct": float(np.median(gaps[name])) if gaps[name] else None,
            "gap_p95_pct": float(np.percentile(gaps[name], 95)) if gaps[name] else None,
        }
    rows["restart_spread_pct"] = max(spread[0] for spread in spreads)
    rows["restart_cost_spread_pct"] = max(spread[1] for spread in spreads)
    rows["path_error_mm"] = float(1e3 * np.linalg.norm(problem.state[:3] - problem.reference[0, :3]))
    return rows


def _reference(why: dict[str, str]) -> tuple[Planner, IpoptReference] | None:
    judge = Planner(plan_model(1))
    try:
        return judge, IpoptReference(judge)
    except ImportError:
        why["gap_median_pct"] = why["gap_p95_pct"] = "casadi is not installed; it is a development dependency"
        return None


def restart_spread(problem: PlanProblem) -> tuple[float, float]:
    """Spread over plans from random starts, (q95 - q5) / (2 median), in percent: of D, and of the cost.

    A start is 1 N of noise on every command of every stage; plans that did not converge are left out.
    """
    rng = np.random.default_rng(0)
    shape = (len(problem.reference) - 1, len(problem.thrusts_N))
    model = plan_model(50, second_start_every=1, tolerance=1e-5)
    found = [Planner(model).plan(problem, rng.normal(0.0, 1.0, shape)) for _ in range(RESTARTS)]
    spreads = []
    for values in ([p.disturbance for p in found if p.converged], [p.cost for p in found if p.converged]):
        low, middle, high = np.percentile(values, [5, 50, 95])
        spreads.append(float(50.0 * (high - low) / middle))
    return spreads[0], spreads[1]
