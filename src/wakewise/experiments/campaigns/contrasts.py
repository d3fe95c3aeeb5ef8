"""What of a campaign is compared with what: methods in each world, or whatever else its trials differ in."""

from __future__ import annotations

from typing import Any

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import FACTORS
from wakewise.experiments.campaigns.summary import ComparisonMetric, MethodSummary, Place, summarize
from wakewise.experiments.campaigns.table import Results, varying_factors

MEASURES = (
    ComparisonMetric("success", "% of models good", 100.0, False),
    ComparisonMetric("rmse_mm", "mm RMSE of the model", 1.0, True),
    ComparisonMetric("completeness_pct", "% of the surface", 1.0, False),
    ComparisonMetric("target_speed_mean_m_s", "mm/s of water at the target", 1e3, True),
    ComparisonMetric("exposure_speed_mean_m_s", "mm/s while the shutter is open", 1e3, True),
    ComparisonMetric("position_rmse_mm", "mm off the wished place", 1.0, True),
    ComparisonMetric("energy_kJ", "kJ of the thrusters", 1.0, True),
)
"""What a page judges by, as far as trials have it; the first of RMSE and the water's speed that is there leads."""
_LEADING = ("rmse_mm", "target_speed_mean_m_s")


def comparable(found: Results) -> tuple[str, ...]:
    """Factors of which trials have several, methods first; `method` alone where they differ in nothing but seeds."""
    return varying_factors(found.plan)


def paired_groups(found: Results, compare: str = "") -> list[Place]:
    """Trials that have ended, as `summarize` compares them: `method` is the compared factor, `world` what else differs.

    Raises
    ------
    InputError
        If `compare` is no factor of a campaign that can be compared.
    """
    compare = compare or comparable(found)[0]
    if compare not in FACTORS or compare == "seed":
        allowed = ", ".join(factor for factor in FACTORS if factor != "seed")
        raise InputError(f"--compare: '{compare}', allowed: {allowed}")
    apart = [factor for factor in comparable(found) if factor not in (compare, "target")]
    told: list[dict[str, Any]] = []
    for one in found.made:
        if one.state not in ("done", "failed"):
            continue
        factors = one.entry.factors
        world = ", ".join(str(factors.get(factor, "")) for factor in apart)
        if not world and compare != "world":
            world = str(factors.get("world", ""))
        told.append(
            {
                "world": world or "all",
                "method": str(factors.get(compare, "")),
                "target": "" if compare == "target" else str(factors.get("target", "")),
                "seed": int(factors.get("seed", 0)),
                "folder": f"trials/{one.entry.key}/work",
                "figures": dict(one.figures),
                "reason": one.reason,
            }
        )
    return list(told)


def measures(found: list[Place]) -> list[ComparisonMetric]:
    """Those that some trial has, the leading one first."""
    known = {key for place in found for key, value in place["figures"].items() if value is not None}
    there = [measure for measure in MEASURES if measure.figure in known]
    leading = next((figure for figure in _LEADING if figure in known), "")
    return sorted(there, key=lambda measure: measure.figure != leading)


def method_contrasts(found: list[Place]) -> list[tuple[ComparisonMetric, MethodSummary]]:
    """Each measure in each world, over the trials that all of the compared have ended."""
    worlds = dict.fromkeys(place["world"] for place in found)
    pairs = ((measure, summarize(measure, world, found)) for measure in measures(found) for world in worlds)
    return [(measure, one) for measure, one in pairs if one is not None]
