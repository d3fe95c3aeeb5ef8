"""What each method does to the target's water, in the tank and in the paper's own world, and what each lever is worth.

Every method flies the same vehicle, the same unknown trim (drawn per seed, +-1 N), sensors, estimator and mission: a
hover on an orbit of 40 deg and an arc of one of 20 deg, both legs and the way between them in one figure, over a silty
bed in the default current. Seeds are pairs: seed k is the same draw for all methods. Intervals are 95 % of a bootstrap
over seeds. Flow `parcels` is the tank's own water; flow `paper` is circular (`paper_world`) and says so.

Levers are held against `wake-aware` without any, which is what they are added to. Ballast and standoff change vehicle
and mission for everybody; `ballast and standoff (dp)` says what they do without any planner.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.experiments.benches.gentle_trial import FIGURES, Trial, World, fly_trial
from wakewise.experiments.benches.timing import BenchOptions

METHODS = ("dp", "pseudo-inverse", "unaware", "smooth", "wake-aware")
SEEDS = {"paper": 10, "parcels": 10}
LEVER_SEEDS = {"paper": 3, "parcels": 4}
RESAMPLES = 2000

SPEED = "target_speed_mean_m_s"
BALLAST: dict[str, Any] = {"float_N": 1.2, "shift_mm": 6.0}
"""A float that outdoes the unknown trim of 1 N, and a centre of gravity that balances the vehicle at a pitch of
atan(6 / 10) = 31 deg, half way between the mission's orbits of 20 and 40 deg."""

CONE: dict[str, Any] = {"wake.model": "paper-calibrated", "wake.edge_width_deg": 3.0}
"""Belief in the paper's cone, much wider than a jet: it stands for where a jet's water may go later."""

LEVERS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "no planning (instant)": ("instant", {}, {}),
    "linear wake model": ("linear", {}, {}),
    "wide cone": ("wake-aware", CONE, {}),
    "halo": ("wake-aware", {"levers.halo": True}, {}),
    "wide cone and halo": ("wake-aware", CONE | {"levers.halo": True}, {}),
    "bed points and floor (instant)": ("instant", {"wake.floor": True, "levers.bed": True}, {}),
    "bed points and floor": ("wake-aware", {"wake.floor": True, "levers.bed": True}, {}),
    "incoherent sum": ("wake-aware", {"levers.incoherent": True}, {}),
    "quiet windows": ("wake-aware", CONE | {"levers.quiet": True}, {}),
    "attitude freedom": ("wake-aware", CONE | {"levers.tilt_deg": 3.0}, {}),
    "standoff 0.65 m": ("wake-aware", {}, {"standoff_m": 0.65}),
    "floats": ("wake-aware", {}, {"float_N": BALLAST["float_N"]}),
    "centre of gravity forward": ("wake-aware", {}, {"shift_mm": BALLAST["shift_mm"]}),
    "all": (
        "wake-aware",
        CONE | {"levers.halo": True, "levers.quiet": True},
        {"shift_mm": BALLAST["shift_mm"], "standoff_m": 0.65},
    ),
    "all, at the same standoff": (
        "wake-aware",
        CONE | {"levers.halo": True, "levers.quiet": True},
        {"shift_mm": BALLAST["shift_mm"]},
    ),
    "ballast and standoff (dp)": ("dp", {}, {"shift_mm": BALLAST["shift_mm"], "standoff_m": 0.65}),
}
"""Method, fields of its settings, and changes of vehicle or mission, by the lever's name. `all` leaves out what made
things worse with seeds 1 and 2, so those who want figures that it was not chosen by must fly other seeds."""
NOT_IN_PAPER = (
    "wide cone",
    "wide cone and halo",
    "bed points and floor",
    "bed points and floor (instant)",
)
"""Levers that the paper's world, which has no bed and is a wide cone, cannot reward or has already."""

Row = dict[str, float | None]


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly all trials on two processes and gather figures, reductions and levers of both flows."""
    seeds = _wished_seeds()
    trials: dict[tuple[str, str, int], Trial] = {}
    worlds: tuple[World, ...] = ("paper", "parcels")
    for world in worlds:
        for seed in range(1, (seeds or SEEDS[world]) + 1):
            for method in METHODS:
                trials[world, method, seed] = Trial(world=world, method=method, seed=seed)
        for name in levers_of(world):
            for seed in range(1, min(seeds or SEEDS[world], LEVER_SEEDS[world]) + 1):
                trials[world, name, seed] = lever_trial(world, name, seed)
    keys = list(trials)
    rows: dict[tuple[str, str, int], Row] = {}
    with ProcessPoolExecutor(max_workers=2, mp_context=get_context("spawn")) as pool:
        for key, row in zip(keys, pool.map(fly_trial, (trials[key] for key in keys)), strict=True):
            rows[key] = row
            options.progress(len(rows), len(keys), f"{key[0]}: {key[1]}, seed {key[2]}")
    return {"flows": {world: flow_figures(world, rows) for world in ("parcels", "paper")}, "why": why(rows)}


def levers_of(world: World) -> tuple[str, ...]:
    """Names of the levers that are tried in a world."""
    return tuple(name for name in LEVERS if world == "parcels" or name not in NOT_IN_PAPER)


def lever_trial(world: World, name: str, seed: int) -> Trial:
    """Trial of a lever."""
    method, control, changes = LEVERS[name]
    if world == "paper":
        control = {key: value for key, value in control.items() if not key.startswith("wake.")}
    return Trial(world=world, method=method, seed=seed, control=tuple(control.items()), **changes)


def flow_figures(world: str, rows: dict[tuple[str, str, int], Row]) -> dict[str, Any]:
    """Figures of one flow: means with intervals by method, reductions, levers."""
    by_name: dict[str, dict[int, Row]] = {}
    for (where, name, seed), row in rows.items():
        if where == world:
            by_name.setdefault(name, {})[seed] = row
    methods = {name: _means(by_name[name].values()) for name in METHODS}
    gentle = by_name["wake-aware"]
    answer: dict[str, Any] = {"circular": world == "paper", "seeds": len(gentle), "methods": methods}
    for base in ("dp", "unaware", "pseudo-inverse", "smooth"):
        for figure, short in ((SPEED, ""), ("exposure_speed_mean_m_s", "_exposure"), ("disturbance", "_disturbance")):
            value, interval = reduction_pct(by_name[base], gentle, figure)
            tag = base.replace("-", "_")
            answer[f"reduction_vs_{tag}{short}_pct"] = value
            answer[f"reduction_vs_{tag}{short}_interval_pct"] = interval
    answer["levers"], answer["lever_details"] = {}, {}
    for name in (n for n in by_name if n in LEVERS):
        value, interval = reduction_pct(gentle, by_name[name], SPEED)
        shot, shot_interval = reduction_pct(gentle, by_name[name], "exposure_speed_mean_m_s")
        dp, _ = reduction_pct(by_name["dp"], by_name[name], SPEED)
        answer["levers"][name] = value
        answer["lever_details"][name] = {
            "seeds": len(by_name[name]),
            "interval_pct": interval,
            "exposure_reduction_pct": shot,
            "exposure_interval_pct": shot_interval,
            "reduction_vs_dp_pct": dp,
            **_means(by_name[name].values()),
        }
    return answer


def reduction_pct(
    base: dict[int, Row], other: dict[int, Row], figure: str
) -> tuple[float | None, tuple[float, float] | None]:
    """How much smaller the mean of a figure is, in percent of the base's, over the seeds that both flew; 95 %."""
    seeds = sorted(set(base) & set(other))
    pairs = [(base[s][figure], other[s][figure]) for s in seeds]
    values = np.array([pair for pair in pairs if None not in pair], dtype=np.float64)
    if len(values) == 0 or not values[:, 0].mean() > 0.0:
        return None, None
    draws = values[np.random.default_rng(0).integers(0, len(values), (RESAMPLES, len(values)))].mean(axis=1)
    spread = 100.0 * (1.0 - draws[:, 1] / draws[:, 0])
    low, high = np.percentile(spread, [2.5, 97.5])
    return 100.0 * (1.0 - float(values[:, 1].mean() / values[:, 0].mean())), (float(low), float(high))


def why(rows: dict[tuple[str, str, int], Row]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    missing = {
        key: "no flight gave this figure" for row in rows.values() for key, value in row.items() if value is None
    }
    if "bed_speed_p95_m_s" in missing:
        missing["bed_speed_p95_m_s"] = "flow paper has no bed"
    return missing


def _means(rows: Iterable[Row]) -> dict[str, Any]:
    """Mean of each figure over seeds, its interval, and how many seeds."""
    listed = list(rows)
    answer: dict[str, Any] = {}
    for key in listed[0] if listed else FIGURES:
        values = [row[key] for row in listed]
        known = np.array([v for v in values if v is not None and np.isfinite(v)], dtype=np.float64)
        answer[key] = float(known.mean()) if len(known) else None
        if key in (SPEED, "exposure_speed_mean_m_s") and len(known) > 1:
            answer[f"{key}_interval"] = _interval(known)
    return answer


def _interval(values: Array) -> tuple[float, float]:
    draws = np.random.default_rng(0).choice(values, (RESAMPLES, len(values))).mean(axis=1)
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(low), float(high)


def _wished_seeds() -> int | None:
    """Seeds per method from the environment, for a quick look (WAKEWISE_SEEDS)."""
    text = os.environ.get("WAKEWISE_SEEDS", "")
    if not text:
        return None
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise InputError(f"WAKEWISE_SEEDS: '{text}', allowed 1 to 1000")
    return int(text)
