"""From flights to the operator's table: deviation, D, the target's water, and what it costs, by world and w_track.

Everything is over pairs of one seed and pilot, ours and direct; logarithms and intervals as in the gentle bench.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise_paper.operator_study.flight import DEVIATIONS, FIGURES
from wakewise_paper.wash_reduction.figures import LEAST_M_S, SPEED, Row, log_reduction_pct, means, pairs_of, ratio
from wakewise_paper.wash_reduction.summary_table import TROUBLE_M_S

LEAST_D = 0.25e-6
"""D below counts as this in logarithms, (m/s)^2: the square of the least speed that counts."""
DEVIATION, D = "velocity_deviation_pct", "disturbance"
TOLD = tuple(key for key in FIGURES if key not in (*DEVIATIONS, D, "cpu_s"))
COSTS = (
    ("energy_kJ", "energy_ratio"),
    ("position_rmse_mm", "position_ratio"),
    ("velocity_error_rms_mm_s", "velocity_error_ratio"),
    ("silt_lifted_g", "silt_lifted_ratio"),
    ("ray_optical_depth", "silt_rays_ratio"),
    ("sway_rms_mm", "sway_ratio"),
    ("sway_wash_mm", "sway_wash_ratio"),
)
"""Sums of ours over sums of direct's, gains and losses alike."""

Known = tuple[str, str, int]
"""World, pilot and seed of a flight."""
Flights = Mapping[Known, Row]


def table(
    ours: Flights, direct: Flights, trims: Mapping[Known, str], lost: frozenset[Known] = frozenset()
) -> dict[str, Any]:
    """Figures of some flights of a method against direct allocation in the same waters.

    Parameters
    ----------
    ours, direct : mapping
    trims : mapping
        Stratum of each flight.
    lost : frozenset
        Flights of ours that failed.
    """
    paired = {key: direct[key] for key in ours if key in direct}
    answer: dict[str, Any] = {"flights": len(ours), "failed": len(lost)}
    own = means(ours.values(), (*DEVIATIONS, *TOLD))
    own.pop("flights")
    answer[DEVIATION] = own[DEVIATION]
    answer["velocity_deviation_interval_pct"] = own[f"{DEVIATION}_interval"]
    answer["velocity_deviation_worst_pct"] = _most(ours, DEVIATION)
    answer["velocity_deviation_over_15_flights"] = sum(
        float(row.get(DEVIATION) or 0.0) >= 15.0 for row in ours.values()
    )
    answer["velocity_deviation_floor_pct"] = means(paired.values(), (DEVIATION,))[DEVIATION]
    for key in DEVIATIONS[1:]:
        answer[key] = own[key]
    answer |= _less("disturbance_reduction", _d_pairs(paired, ours, trims), len(lost & set(direct)))
    trouble = {key: row for key, row in direct.items() if float(row.get(SPEED) or 0.0) > TROUBLE_M_S}
    answer["trouble_flights"] = sum(key in ours or key in lost for key in trouble)
    answer |= _less("target_speed_reduction", pairs_of(trouble, ours, SPEED, trims), len(lost & set(trouble)))
    everywhere = _less("target_speed_reduction_all", pairs_of(direct, ours, SPEED, trims), len(lost & set(direct)))
    answer |= everywhere
    answer["direct_target_speed_mean_m_s"] = means(paired.values(), (SPEED,))[SPEED]
    for key in TOLD:
        answer[key] = own[key]
    for figure, name in COSTS:
        answer[name], answer[f"{name}_interval"] = ratio(pairs_of(direct, ours, figure, trims))
    answer["why"] = _why(answer)
    return answer


def sliced(flights: Flights, *, world: str | None = None, pilot: str | None = None) -> dict[Known, Row]:
    """Those of a world and a pilot; of all where it is None."""
    return {
        key: row
        for key, row in flights.items()
        if (world is None or key[0] == world) and (pilot is None or key[1] == pilot)
    }


def _less(name: str, pairs: list[Any], lost: int) -> dict[str, Any]:
    value, interval, worst = log_reduction_pct(pairs, lost)
    return {f"{name}_pct": value, f"{name}_interval_pct": interval, f"{name}_worst_pct": worst}


def _d_pairs(direct: Flights, ours: Flights, trims: Mapping[Known, str]) -> list[Any]:
    """Pairs of D in units in which its least value is that of the speeds."""
    unit = LEAST_D / LEAST_M_S
    return [(theirs / unit, own / unit, where) for theirs, own, where in pairs_of(direct, ours, D, trims)]


def _most(rows: Flights, key: str) -> float | None:
    known = [float(value) for row in rows.values() if (value := row.get(key)) is not None and np.isfinite(value)]
    return max(known) if known else None


def _why(answer: Mapping[str, Any]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    reasons: dict[str, str] = {}
    for key, value in answer.items():
        if value is not None:
            continue
        if "interval" in key:
            reasons[key] = "one flight or none"
        elif key.startswith("target_speed_reduction") and not answer["trouble_flights"] and "_all" not in key:
            reasons[key] = "direct leaves 10 mm/s or less in all of these flights"
        elif key.startswith("sway"):
            reasons[key] = "the target is rigid, or no photograph was taken"
        else:
            reasons[key] = "no flight gave it, or nothing of it with direct allocation"
    return reasons
