"""Wash against energy: our method at several power limits beside every rival, over whole scans.

Written down before the flights:

- Seeds 1301 to 1308, flown for nothing else; whole paths of the quick preset; no models.
- `dp` is what all are held against, seed by seed: ratios of geometric means of wash and energy.
- The knee is the limit farthest from the straight line between the ends of the front, in logarithms of both (V. Satopaa
  et al. 2011, doi 10.1109/ICDCSW.2011.20, without smoothing). The default should be the knee in most places.
- At equal energy: the front, interpolated in logarithms at the energy of a rival within its range, is to leave no more.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import LEAST_M_S, Interval, geometric_ratio, pairs_of
from wakewise.experiments.campaigns.study import Key, Row, flight_trial, run_study, selected, store_folder
from wakewise.experiments.trials.timing import BenchOptions

FIRST_SEED, MOST_SEEDS = 1301, 8
PLACES: dict[str, dict[str, Any]] = {
    "payload": {"world": "payload"},
    "close": {"world": "close"},
    "sheltered": {"world": "sheltered"},
    "payload/bluerov2-heavy": {"world": "payload", "vehicle": "bluerov2-heavy"},
}
"""Where scans are flown: fields of a scenario by name."""
LIMITS: dict[str, dict[str, Any]] = {
    "wake-aware/excess-0": {"control.allocation.power_excess": 0.0},
    "wake-aware/excess-0.5": {"control.allocation.power_excess": 0.5},
    "wake-aware": {},
    "wake-aware/excess-2": {"control.allocation.power_excess": 2.0},
    "wake-aware/no-limit": {"control.allocation.power_limit": False},
}
"""The front: fields of our method by name, in the order of the power that they allow."""
RIVALS = ("no-forward-jets", "weighted-pseudo-inverse", "allocation-only")
BASE = "dp"
METHODS = (BASE, *RIVALS, *LIMITS)
SOURCES = ("wakewise_paper:wash_reduction/energy_front.py",)


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wanted and not known yet, and gather the fronts.

    Raises
    ------
    InputError
        If a place or method is not known.
    """
    began = time.monotonic()
    places = selected("--worlds", options.worlds, tuple(PLACES))
    methods = selected("--methods", options.methods, METHODS)
    if BASE not in methods:
        raise InputError(f"--methods: needs {BASE}, which the others are held against")
    if options.seeds > MOST_SEEDS:
        raise InputError(f"--seeds {options.seeds}: the front has {MOST_SEEDS} seeds, {FIRST_SEED} and on")
    trials = {
        (place, method, seed): flight(place, method, seed)
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds)
        for place in places
        for method in methods
    }
    made = run_study("front", trials, options.store or store_folder("front"), options)
    return {
        "places": {place: front_of(place, methods, made.rows) for place in places},
        **made.counts,
        "wall_s": time.monotonic() - began,
    }


def flight(place: str, method: str, seed: int) -> PlannedTrial:
    """The whole path of a quick scan."""
    fields = {"method": method.partition("/")[0], **PLACES[place], **LIMITS.get(method, {}), "seed": seed}
    return flight_trial(str(fields["world"]), method, seed, fields, sources=SOURCES, variation=f"front/{place}")


def front_of(place: str, methods: Sequence[str], rows: Mapping[Key, Row]) -> dict[str, Any]:
    """Ratios of a place by method, its knee, and our front against each rival at the rival's energy."""
    own = {method: {key[2]: row for key, row in rows.items() if key[:2] == (place, method)} for method in methods}
    found = {method: ratios(own[method], own.get(BASE, {})) for method in methods}
    points = {name: found[name] for name in LIMITS if name in found and found[name]["wash"] is not None}
    against = {}
    for rival in (rival for rival in RIVALS if rival in found and found[rival]["wash"] is not None):
        wash = interpolated(list(points.values()), found[rival]["energy"])
        against[rival] = None if wash is None else wash / found[rival]["wash"]
    return {"methods": found, "knee": knee(points), "wash_ratio_at_equal_energy": against}


def ratios(ours: Mapping[int, Row], theirs: Mapping[int, Row]) -> dict[str, Any]:
    """Wash and energy over those of the base, geometric means over seeds, with intervals; None without pairs."""
    told: dict[str, Any] = {}
    for name, figure in (("wash", "target_speed_mean_m_s"), ("energy", "energy_kJ")):
        told[name], told[f"{name}_interval"], told[f"{name}_pairs"] = paired_ratio(ours, theirs, figure)
    return told


def paired_ratio(
    ours: Mapping[int, Row], theirs: Mapping[int, Row], figure: str
) -> tuple[float | None, Interval | None, int]:
    """Ratio of the geometric means of a figure over pairs of one seed, its interval, and the number of pairs.

    Speeds below `LEAST_M_S` count as that; None without pairs.
    """
    least = LEAST_M_S if figure.endswith("m_s") else 1e-9
    pairs = [(max(mine, least), max(other, least)) for other, mine, _ in pairs_of(theirs, ours, figure, {})]
    if not pairs:
        return None, None, 0
    return *geometric_ratio([m for m, _ in pairs], [o for _, o in pairs]), len(pairs)


def knee(points: Mapping[str, Mapping[str, Any]]) -> str | None:
    """The limit farthest below the line between the ends of the front; None of fewer than three."""
    if len(points) < 3:
        return None
    xy = np.log([[point["energy"], point["wash"]] for point in points.values()])
    along = xy[-1] - xy[0]
    below = along[1] * (xy[:, 0] - xy[0, 0]) - along[0] * (xy[:, 1] - xy[0, 1])
    return list(points)[int(np.argmax(below))]


def interpolated(points: Sequence[Mapping[str, Any]], energy: float) -> float | None:
    """Wash of a front at an energy, linear in logarithms; None outside its range."""
    ordered = sorted((point["energy"], point["wash"]) for point in points)
    x = np.array([e for e, _ in ordered])
    if not len(x) or not x[0] <= energy <= x[-1]:
        return None
    return float(np.exp(np.interp(np.log(energy), np.log(x), np.log([w for _, w in ordered]))))
