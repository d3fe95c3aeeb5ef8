"""The gentle allocation: speed, exactness against a dense grid, what it saves, and two peers on the same problems."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import daqp
import numpy as np
from scipy.optimize import LinearConstraint, minimize

from wakewise.allocation import Layout, Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.allocation.allocate import COUPLING_LIMIT
from wakewise.allocation.line_search import box_range, cost, coupling, split_allocation
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, look_at, quat_from_matrix
from wakewise.core.jit.njit import njit
from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise.wake import WakeSettings, disturbance, wake_model
from wakewise.wake.influence import InfluenceModel
from wakewise_benchmarks.registry import VEHICLE, bench_region, bench_target, cases

GRID = 1201
PROBLEMS = 1000
CLASSES = {"in front": 0.0, "30 deg below": np.deg2rad(30.0), "directly below": np.deg2rad(90.0)}
"""Where the target is, seen from a level vehicle: angle below the horizon."""

_PEERS = 60
_POTENTIAL = 200

Problem = tuple[Array, Array]
"""Gram matrix and wrench."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Search, Gram matrix and whole call in thread CPU; exactness over 1,000 problems; savings; chatter; peers."""
    layout = compile_layout(VEHICLE.allocation_matrix, VEHICLE.thrust_lower_N, VEHICLE.thrust_upper_N)
    views = {name: InfluenceModel.of(VEHICLE, bench_region(), wake_model(name)) for name in ("paper", "jet")}
    effort, disturbance_first = (
        Weights(disturbance=1.0 / views["paper"].total_weight, effort=effort) for effort in (1e-3, 1e-6)
    )
    drawn = cases(PROBLEMS)
    problems = [(views["paper" if k % 4 < 2 else "jet"].gram(X_WB), wrench) for k, (X_WB, wrench) in enumerate(drawn)]
    exact = _against_grid(layout, problems, (effort, disturbance_first), options)
    poses = [X_WB for X_WB, _ in drawn[:8]]
    floor = InfluenceModel.of(
        VEHICLE, bench_region(), wake_model(WakeSettings(model="jet", floor=True), bench_target().bed_z_m)
    )
    gram_us = {
        name: float(np.median([timed_us(partial(view.gram, X_WB), 200)["median_us"] for X_WB in poses]))
        for name, view in views.items()
    }
    return (
        _speed(layout, problems[:40], effort)
        | {"gram_us": max(gram_us.values()), "gram_us_by_model": gram_us, "gram_points": len(bench_region().points_W_m)}
        | exact
        | _potential(layout, views["paper"], effort)
        | {
            "floor": _coupled(layout, [(floor.gram(X), w) for X, w in drawn[:60]], effort),
            "chatter": _chatter(layout, views, disturbance_first),
            "peers": _peers(layout, problems[:_PEERS], disturbance_first),
        }
    )


def _speed(layout: Layout, problems: list[Problem], weights: Weights) -> dict[str, float]:
    """The compiled search alone (wrench to thrusts), and the call from Python with all its checks."""
    packed, rest = weights.packed, np.zeros(len(layout.lower_N))
    fixed = (layout.lines, layout.lower_N, layout.upper_N, rest, packed, COUPLING_LIMIT)
    search, call, pinv = [], [], []
    for G, wrench in problems:
        search.append(timed_us(partial(split_allocation, G, layout.inverse, wrench, *fixed), 200)["median_us"])
        call.append(timed_us(partial(min_wash_allocation, layout, wrench, G, weights), 100)["median_us"])
        pinv.append(timed_us(partial(min_norm_allocation, layout, wrench), 100)["median_us"])
    return {
        "search_us": float(np.median(search)),
        "search_worst_case_us": float(np.max(search)),
        "call_us": float(np.median(call)),
        "pseudo_inverse_call_us": float(np.median(pinv)),
    }


@njit
def _line_grid(
    G: Array, start: Array, line: Array, low: float, high: float, count: int, previous: Array, weights: Array
) -> float:
    """Least cost of the thrusters of one line over `count` equal steps from low to high."""
    best = np.inf
    T = np.zeros(start.size)
    before = np.where(np.abs(line) > 1e-12, previous, 0.0)
    for step in range(count):
        t = low + (high - low) * step / (count - 1)
        for i in range(start.size):
            if abs(line[i]) > 1e-12:
                T[i] = start[i] + t * line[i]
        best = min(best, cost(G, T, before, weights))
    return best


@njit
def _square_grid(
    G: Array, start: Array, lines: Array, ends: Array, count: int, previous: Array, weights: Array
) -> float:
    """Least cost over count x count points, nothing assumed about G; `ends`, shape (2, 2), are each line's limits."""
    best = np.inf
    for a in range(count):
        for b in range(count):
            T = start + (ends[0, 0] + (ends[0, 1] - ends[0, 0]) * a / (count - 1)) * lines[0]
            T += (ends[1, 0] + (ends[1, 1] - ends[1, 0]) * b / (count - 1)) * lines[1]
            best = min(best, cost(G, T, previous, weights))
    return best


def _against_grid(
    layout: Layout, problems: list[Problem], kinds: tuple[Weights, Weights], options: BenchOptions
) -> dict[str, Any]:
    """Largest excess over the best of 1201 x 1201 points of the null space within limits, on every problem.

    Every other problem has hardly any weight on effort. With no Gram entry between the two lines the best
    of the square is the sum of the best of each line, the same minimum over the same 1.44 million points, which is
    checked on the first problems with the square itself.
    """
    rest = np.zeros(len(layout.lower_N))
    worst, error, gap, squares, split = -np.inf, 0.0, 0.0, 0.0, 0.0
    methods: dict[str, int] = {}
    for done, (G, wrench) in enumerate(problems):
        if done % 50 == 0:
            options.progress(done, len(problems), "grid")
        weights = kinds[done % 2]
        packed = weights.packed
        found = min_wash_allocation(layout, wrench, G, weights)
        value = cost(G, found.thrusts_N.copy(), rest, packed)
        start = layout.inverse @ wrench
        ends = np.array([box_range(start, line, layout.lower_N, layout.upper_N) for line in layout.lines])
        split = max(split, coupling(G, layout.lines))
        grid = sum(
            _line_grid(G, start, line, low, high, GRID, rest, packed)
            for line, (low, high) in zip(layout.lines, ends, strict=True)
        )
        worst = max(worst, value / grid - 1.0)
        error = max(error, float(np.linalg.norm(found.given_up_B) / np.linalg.norm(wrench)))
        gap = max(gap, found.gap)
        methods[found.method] = methods.get(found.method, 0) + 1
        if done < 5:
            square = _square_grid(G, start, layout.lines, ends, GRID, rest, packed)
            squares = max(squares, abs(square - grid) / square)
    return {
        "problems": len(problems),
        "worst_vs_grid_rel": worst,
        "grid_split_error_rel": squares,
        "coupling_max_rel": split,
        "wrench_error_rel": error,
        "gap_max": gap,
        "methods": methods,
    }


def _potential(layout: Layout, view: InfluenceModel, weights: Weights) -> dict[str, Any]:
    """D over D of the pseudo-inverse at equal wrench, by where the target is; problems where both are zero left out."""
    rng = np.random.default_rng(2)
    pure = Weights(disturbance=weights.disturbance, effort=1e-9)
    table: dict[str, Any] = {}
    ratios = []
    for name, below in CLASSES.items():
        rows: dict[str, list[float]] = {"weighted": [], "disturbance only": []}
        still = 0
        for _ in range(_POTENTIAL):
            azimuth, reach = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.45, 0.7)
            side = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            eye = bench_target().centre_W_m - reach * (np.cos(below) * side + np.sin(below) * np.array([0.0, 0.0, 1.0]))
            level = quat_from_matrix(look_at(eye, eye + side))
            G, wrench = view.gram(Pose(eye, level)), rng.normal(size=6) * [6.0, 6.0, 4.0, 0.3, 0.5, 0.5]
            before = float(min_norm_allocation(layout, wrench, G).disturbance or 0.0)
            if before <= 0.0:
                still += 1
                continue
            for row, chosen in zip(rows.values(), (weights, pure), strict=True):
                row.append(float(min_wash_allocation(layout, wrench, G, chosen).disturbance or 0.0) / before)
        ratios += rows["weighted"]
        table[name] = {what: _quartiles(row) for what, row in rows.items()} | {"n": len(row), "no_disturbance": still}
    return {"pinv_ratio_median": float(np.median(ratios)), "pinv_ratio": table}


def _quartiles(values: list[float]) -> list[float] | None:
    return [float(q) for q in np.percentile(values, [25, 50, 75])] if values else None


def _coupled(layout: Layout, problems: list[Problem], weights: Weights) -> dict[str, float]:
    """Branch and bound where wall jets along the floor couple horizontal and vertical thrusters."""
    spans, gaps = [], []
    for G, wrench in problems:
        spans.append(timed_us(partial(min_wash_allocation, layout, wrench, G, weights), 3)["median_us"])
        gaps.append(min_wash_allocation(layout, wrench, G, weights).gap)
    return {"call_us": float(np.median(spans)), "call_us_max": float(np.max(spans)), "gap_max": float(np.max(gaps))}


def _chatter(layout: Layout, views: dict[str, InfluenceModel], weights: Weights) -> dict[str, Any]:
    """Sign flips and jumps along 60 s of an orbit at 10 Hz with noisy wrenches, by weight of the proximal term."""
    dt, steps = 0.1, 600
    table: dict[str, Any] = {}
    for name, view in views.items():
        rng = np.random.default_rng(3)
        wrench = np.zeros(6)
        course = []
        for k in range(steps):
            angle = 2.0 * np.pi * k / steps
            eye = bench_target().centre_W_m + np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), -0.35])
            X_WB = Pose(eye, quat_from_matrix(look_at(eye, bench_target().centre_W_m)))
            # Correlated over half a second, as the wrenches of a tracker are; it sinks by 1 N.
            wrench = 0.8 * wrench + 0.6 * rng.normal(size=6) * [1.0, 1.0, 1.0, 0.05, 0.05, 0.08]
            course.append((view.gram(X_WB), wrench - np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])))
        ways: dict[str, Callable[[Array, Array, Array], Array]] = {
            "pseudo-inverse": lambda _G, w, _T: min_norm_allocation(layout, w).thrusts_N
        }
        for proximal in (0.0, 1e-4, 1e-3, 1e-2):
            chosen = Weights(disturbance=weights.disturbance, effort=weights.effort, previous=proximal)
            ways[f"w_previous {proximal:g}"] = partial(_step, layout, chosen)
        table[name] = {}
        for way, allocate in ways.items():
            thrusts, path, D = np.zeros(len(layout.lower_N)), [], []
            for G, w in course:
                thrusts = allocate(G, w, thrusts)
                path.append(thrusts)
                D.append(disturbance(G, thrusts))
            signs = np.sign(np.where(np.abs(path) < 1e-6, 0.0, path))
            flips = np.sum(signs[1:] * signs[:-1] < 0.0)
            jumps = np.abs(np.diff(path, axis=0)).max(axis=1)
            table[name][way] = {
                "sign_flips_per_s": float(flips / (steps * dt)),
                "jump_p95_N": float(np.percentile(jumps, 95)),
                "disturbance_mean": float(np.mean(D)),
            }
    return table


def _step(layout: Layout, weights: Weights, G: Array, wrench: Array, before: Array) -> Array:
    return min_wash_allocation(layout, wrench, G, weights, before).thrusts_N


def _peers(layout: Layout, problems: list[Problem], weights: Weights) -> dict[str, Any]:
    """SciPy's SLSQP from the pseudo-inverse, and a quadratic program in split thrusts without cross terms (DAQP)."""
    n = len(layout.lower_N)
    packed, rest = weights.packed, np.zeros(n)
    one = np.eye(n)
    H = np.ascontiguousarray(2.0 * weights.effort * np.block([[one, -one], [-one, one]]) + 1e-9 * np.eye(2 * n))
    rows = np.ascontiguousarray(np.hstack([layout.B, -layout.B]))
    sense = np.concatenate([np.zeros(2 * n), np.full(6, 5)]).astype(np.int32)

    def cost_of(T: Array, G: Array) -> float:
        return float(cost(G, T, rest, packed))

    def slsqp(G: Array, wrench: Array) -> Array:
        start = min_norm_allocation(layout, wrench).thrusts_N
        bounds = list(zip(layout.lower_N, layout.upper_N, strict=True))
        held = LinearConstraint(layout.B, layout.B @ start, layout.B @ start)
        found = minimize(cost_of, start, args=(G,), method="SLSQP", bounds=bounds, constraints=[held])
        return found.x if found.success else start

    def split(G: Array, wrench: Array) -> Array:
        most = np.concatenate([layout.upper_N, -layout.lower_N, wrench])
        least = np.concatenate([np.zeros(2 * n), wrench])
        x, _, _, _ = daqp.solve(H, weights.disturbance * np.diag(G).copy(), rows, most, least, sense)
        return np.asarray(x[:n] - x[n:])

    values = [cost(G, min_wash_allocation(layout, w, G, weights).thrusts_N.copy(), rest, packed) for G, w in problems]
    table: dict[str, Any] = {}
    for name, peer in {"slsqp": slsqp, "l1_qp": split}.items():
        spans, excess = [], []
        for (G, wrench), ours in zip(problems, values, strict=True):
            began = time.thread_time_ns()
            theirs = peer(G, wrench)
            spans.append((time.thread_time_ns() - began) / 1e3)
            excess.append(cost(G, theirs, rest, packed) / ours - 1.0)
        table[name] = {
            "call_us": float(np.median(spans)),
            "excess_mean": float(np.mean(excess)),
            "excess_max": float(np.max(excess)),
        }
    return table
