"""Figures of the optimum (`energy_optimum.py`): flight by flight, and over those in which `dp` leaves too much wash."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.experiments.campaigns.statistics import LEAST_M_S
from wakewise.experiments.campaigns.study import Key, Row
from wakewise_paper.wash_reduction.energy_optimum import ENERGIES, choose_under_budget
from wakewise_paper.wash_reduction.headline import TROUBLE_M_S

NAMED = ("rule", "belief", "belief_any")
KINDS = ("bound", "attained")


def bound_figures(rows: Mapping[Key, Row]) -> dict[str, Any]:
    """Table of all flights, by name, and `trouble`, over those in which `dp` leaves more than 10 mm/s; None of none."""
    trouble = [row for row in rows.values() if (row["dp_m_s"] or 0.0) > TROUBLE_M_S]
    return {
        "flights": {f"{scenario} {seed}": reductions(row) for (scenario, _, seed), row in rows.items()},
        "trouble": over_flights(trouble) if trouble else None,
    }


def reductions(row: Row) -> dict[str, float | None]:
    """A flight's figures with speeds as `*_less_pct` than `dp` as it was flown, whose own stays in m/s.

    Speeds below `LEAST_M_S` count as it.
    """
    told: dict[str, float | None] = {}
    for key, value in row.items():
        if key.endswith("_m_s") and key != "dp_m_s":
            less = None if value is None else 100.0 * (1.0 - float(np.exp(_log(row, key))))
            told[key.removesuffix("_m_s") + "_less_pct"] = less
        else:
            told[key] = value
    return told


def over_flights(rows: list[Row]) -> dict[str, Any]:
    """Over flights: reductions by the mean of logarithms, energies by sums, as in the headline.

    `bound_1.3_less_pct` and the like hold each flight to the bound on energy; `bound_1.3_summed_less_pct` holds their
    sum to it, so that flights in which power buys much may have more. The rule, and what is believed, are beside them,
    each over the flights that have it, and the least thrusts without the noise of the wrench, `least_less_pct`.
    """
    told: dict[str, Any] = {"flights": len(rows)}
    told["least_less_pct"] = _less([_log(row, "least_m_s") for row in rows])
    for name in NAMED:
        own = [row for row in rows if row[f"{name}_m_s"] is not None]
        told[f"{name}_flights"] = len(own)
        told[f"{name}_less_pct"] = _less([_log(row, f"{name}_m_s") for row in own])
        told[f"{name}_energy"] = _ratio(own, [float(row[f"{name}_energy"] or 0.0) for row in own])
    for kind in KINDS:
        for name, most in ENERGIES.items():
            told[f"{kind}_{name}_less_pct"] = _less([_log(row, f"{kind}_{name}_m_s") for row in rows])
            told[f"{kind}_{name}_energy"] = _ratio(rows, [float(row[f"{kind}_{name}_energy"] or 0.0) for row in rows])
            told[f"{kind}_{name}_summed_less_pct"] = _summed(rows, kind, most)
    return told


def _summed(rows: list[Row], kind: str, most: float) -> float | None:
    """Reduction if the flights share a bound on their summed energy, each at one of its own or with the least."""
    powers = np.array([float(row["least_power_W"] or 0.0) for row in rows])
    logs = np.array([[_log(row, "least_m_s"), *(_log(row, f"{kind}_{name}_m_s") for name in ENERGIES)] for row in rows])
    energy = np.array([[1.0, *(float(row[f"{kind}_{name}_energy"] or 0.0) for name in ENERGIES)] for row in rows])
    picks = choose_under_budget(logs, energy * powers[:, None], most * float(powers.sum()))
    return _less([float(own[pick]) for own, pick in zip(logs, picks, strict=True)])


def _log(row: Row, key: str) -> float:
    """Logarithm of a speed over that of `dp` as flown."""
    return float(np.log(max(row[key] or 0.0, LEAST_M_S) / max(row["dp_m_s"] or 0.0, LEAST_M_S)))


def _less(logs: list[float]) -> float | None:
    return 100.0 * (1.0 - float(np.exp(np.mean(logs)))) if logs else None


def _ratio(rows: list[Row], energies: list[float]) -> float | None:
    """Energy of all flights over that of the least thrusts; flights of a scenario last about the same."""
    powers = np.array([float(row["least_power_W"] or 0.0) for row in rows])
    return float(powers @ np.array(energies) / powers.sum()) if rows else None
