"""Where wash ruins a model: whole scans by mechanism, dose, advice and method, each with its model.

Seeds are the same for all methods and cases of a part, so that scans are compared in pairs. Intervals are 95 % by
Student's t over pairs; shares have exact ones. A scan without a model is no success; it has no part in means of RMSE
and completeness, and counts as 20 mm and 0 % in their differences. A campaign keeps the trials: a run that was stopped
goes on.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import WORST, mean_figures, mean_interval, pairs_of, share_interval
from wakewise.experiments.campaigns.study import Row, StudyResult, run_study, selected, store_folder
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_paper.model_failure.cases import Case, cases_of, load_parts
from wakewise_paper.wash_reduction.energy_front import paired_ratio

FIGURES = (
    "rmse_mm",
    "rmse_mean_shape_mm",
    "completeness_pct",
    "completeness_1mm_pct",
    "registered_images",
    "target_speed_mean_m_s",
    "sway_wash_mm",
    "sway_about_mean_mm",
    "sway_peak_mm",
    "target_stress_peak_Pa",
    "target_drag_peak_N",
    "shifted_mm",
    "bed_over_threshold_s",
    "exposure_optical_depth",
    "ray_optical_depth",
    "turbidity_mean_per_m",
    "silt_lifted_g",
    "position_rmse_mm",
    "roll_pitch_rms_deg",
    "energy_kJ",
)
"""Means over seeds that are told of each case and method."""
DIFFERENCES = ("rmse_mm", "completeness_pct", "completeness_1mm_pct", "sway_about_mean_mm")
"""Of these the difference to the base is told, seed by seed."""
RATIOS = ("target_speed_mean_m_s", "energy_kJ", "sway_wash_mm")
"""Of these the ratio to the base is told, seed by seed."""
SILT_RATIOS = ("ray_optical_depth", "turbidity_mean_per_m", "silt_lifted_g", "bed_over_threshold_s")
"""Of these, too, where a part has flights without models."""

ModelKey = tuple[str, str, str, int]
"""Part, case, method and seed."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Make the scans that are wanted and not known yet, and gather the tables.

    `options.scenarios` names parts, `options.methods` methods; `options.seeds` is the most seeds of a part.

    Raises
    ------
    InputError
        If a part or method is not known.
    """
    began = time.monotonic()
    parts = selected("--scenarios", options.scenarios, tuple(load_parts()))
    cases = {part: cases_of(part) for part in parts}
    known = tuple(dict.fromkeys(method for own in cases.values() for case in own for method in case.methods))
    methods = selected("--methods", options.methods, known)
    missing = [part for part, own in cases.items() if not any(base_of(own, case)[1] in methods for case in own)]
    if missing:
        base = base_of(cases[missing[0]], cases[missing[0]][0])[1]
        raise InputError(f"--methods: needs {base}, which the others of part {missing[0]} are held against")
    trials = planned(cases, methods, options.seeds)
    made = run_study("models", trials, options.store or store_folder("models"), options)
    return {
        "parts": {part: part_figures(part, cases[part], methods, made) for part in parts},
        **made.counts,
        "wall_s": time.monotonic() - began,
    }


def planned(
    cases: Mapping[str, Sequence[Case]], methods: Sequence[str], most_seeds: int
) -> dict[ModelKey, PlannedTrial]:
    """Trials by key, seed by seed, so that a run that is stopped has whole seeds."""
    found: dict[ModelKey, PlannedTrial] = {}
    for part, own in cases.items():
        file = load_parts()[part]
        for seed in range(file.first_seed, file.first_seed + min(file.seeds, most_seeds)):
            for case in own:
                for method in (method for method in case.methods if method in methods):
                    found[part, case.name, method, seed] = case.trial(method, seed)
    return found


def part_figures(
    part: str, cases: Sequence[Case], methods: Sequence[str], made: StudyResult[ModelKey]
) -> dict[str, Any]:
    """Table of a part: a row for each case and method, held against `base_of` it."""
    file = load_parts()[part]
    rows: list[dict[str, Any]] = []
    for case in cases:
        for method in (method for method in case.methods if method in methods):
            base = base_of(cases, case)
            own, others = (_of(made, part, *which) for which in ((case.name, method), base))
            row = {"case": case.name, "title": case.title, "method": method, "doses": case.doses}
            row |= model_figures(own) if file.models else mean_figures(filter(None, own.values()), FIGURES)
            rows.append(row | ({} if base == (case.name, method) else against(own, others, models=file.models)))
    axes = {name: {"title": axis.title, "unit": axis.unit} for name, axis in file.axes.items()}
    return {"title": file.title, "models": file.models, "rows": rows, "axes": axes}


def base_of(cases: Sequence[Case], case: Case) -> tuple[str, str]:
    """Case and method that a case is held against: its first method; in a part with one method, the first case."""
    across = len(load_parts()[case.part].methods) == 1
    return (cases[0].name, cases[0].methods[0]) if across else (case.name, case.methods[0])


def model_figures(rows: Mapping[int, Row | None]) -> dict[str, Any]:
    """Means with intervals, and the share of scans that succeeded; a trial that failed is no success."""
    told = mean_figures((row for row in rows.values() if row is not None), FIGURES)
    told["scans"] = len(rows)
    succeeded = sum(bool(row and row.get("success")) for row in rows.values())
    told["success_pct"] = 100.0 * succeeded / len(rows) if rows else None
    told["success_interval_pct"] = [100.0 * end for end in share_interval(succeeded, len(rows))] if rows else None
    return told


def against(ours: Mapping[int, Row | None], theirs: Mapping[int, Row | None], *, models: bool = True) -> dict[str, Any]:
    """Differences and ratios of pairs of one seed, each with its interval and the number of pairs.

    Without models there are ratios only, and those of silt beside them.
    """
    told: dict[str, Any] = {}
    mine, others = _judged(ours), _judged(theirs)
    for figure in DIFFERENCES if models else ():
        more = [own - other for other, own, _ in pairs_of(others, mine, figure, {})]
        name = f"{figure}_more"
        told[name], told[f"{name}_interval"] = mean_interval(more) if more else (None, None)
        told[f"{name}_pairs"] = len(more)
    for figure in RATIOS if models else (*RATIOS, *SILT_RATIOS):
        name = f"{figure}_ratio"
        told[name], told[f"{name}_interval"], told[f"{name}_pairs"] = paired_ratio(mine, others, figure)
    return told


def _judged(rows: Mapping[int, Row | None]) -> dict[int, Row]:
    """Figures in which a model that was not made is the worst."""
    return {
        seed: dict(row or {}) | {key: WORST[key] for key in WORST if (row or {}).get(key) is None}
        for seed, row in rows.items()
    }


def _of(made: StudyResult[ModelKey], part: str, case: str, method: str) -> dict[int, Row | None]:
    """Figures of a case and method by seed; None of a scan that failed."""
    found: dict[int, Row | None] = {key[3]: row for key, row in made.rows.items() if key[:3] == (part, case, method)}
    return found | {key[3]: None for key in made.failures if key[:3] == (part, case, method)}
