"""What each of the paper's tables is judged by, and how many of its figures are met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from wakewise.experiments.campaigns.summary import ComparisonMetric, MethodSummary, Place, summarize

JUDGED = {
    "dynamic": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "success": ComparisonMetric("success", "% of models", 100.0, False),
    "station": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "ablation": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "sediment": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "flow": ComparisonMetric("piv_speed_m_s", "mm/s by PIV", 1e3, True),
    "field": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "operator": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "comparison": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
}
"""By table what it is judged by."""


def glances(table: str, places: Sequence[Place]) -> list[MethodSummary]:
    """One for each world of a table, over the trials that all of its methods have; none of tables without methods."""
    if table not in JUDGED:
        return []
    found = (summarize(JUDGED[table], world, places) for world in dict.fromkeys(place["world"] for place in places))
    return [one for one in found if one is not None]


CIRCULAR = ("paper",)
"""Worlds whose water is the planner's own model: what is met there alone is told apart."""
SETUP = "pump-tank"
"""The world that is the paper's own set-up: its tank, with the water that pumps move."""


def count_met(tables: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, int]:
    """How many of the figures that the paper quotes are met, each counted once, however many worlds or flows it has.

    `quoted`: figures with a value of the paper and one of ours; `met`: in some world that is not circular; `surely`:
    there with the whole interval on that side; `circular`: in a circular world alone; `own`, `own_judged`: in the
    paper's own set-up, and those that have a value there; `worlds`: those that are judged in a world at all.
    """
    found: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for name, rows in tables.items():
        for row in rows:
            if row["paper"] is not None and row["met"] is not None:
                found.setdefault((name, row["method"], row["figure"]), []).append(row)
    fair = {key: [row for row in rows if row["met"] and row["world"] not in CIRCULAR] for key, rows in found.items()}
    return {
        "quoted": len(found),
        "met": sum(bool(rows) for rows in fair.values()),
        "surely": sum(any(row["sure"] for row in rows) for rows in fair.values()),
        "own": sum(any(row["met"] and row["world"] == SETUP for row in rows) for rows in found.values()),
        "own_judged": sum(any(row["world"] == SETUP for row in rows) for rows in found.values()),
        "worlds": sum(any(row["world"] != "-" for row in rows) for rows in found.values()),
        "circular": sum(not fair[key] and any(row["met"] for row in rows) for key, rows in found.items()),
    }
