"""The headline: one table, chosen before anything was flown (docs/research-log/0033).

Flights are known by scenario and seed, over all scenarios and worlds together.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.experiments.campaigns.statistics import as_reduction, log_reduction_pct, pairs_of, ratio
from wakewise.experiments.campaigns.study import Row

SPEED = "target_speed_mean_m_s"
TROUBLE_M_S, CALM_M_S = 0.010, 0.005
"""Wash of `dp` where there is trouble, more than; and where there is none, less than."""
POSITION_SHARE, POSITION_MM = 1.05, 0.2
"""The camera may be off by so much of what `dp` leaves, and so much more."""
SILT, SWAY, PLACE, ENERGY = "ray_optical_depth", "sway_rms_mm", "camera_rmse_mm", "energy_kJ"
SWAY_WASH = "sway_wash_mm"
"""What the vehicle adds to the sway of the same water without it: all that a controller can take away (0038)."""
BODY = "position_rmse_mm"
RIVALS = ("dp", "mpc", "no-forward-jets", "no-forward-jets+trim", "weighted-pseudo-inverse")
BESIDE = (
    "allocation-only",
    "wake-aware+trim",
    "dp+trim",
    "no-forward-jets",
    "no-forward-jets+trim",
    "weighted-pseudo-inverse",
)
"""What the table is made for as well."""
WRONG = "wake-aware, wrong current"

Known = tuple[str, int]
"""Scenario and seed."""
Flights = Mapping[str, Mapping[Known, Row]]
"""Rows by method and by flight."""


def headline(flights: Flights, trims: Mapping[Known, str], failed: set[tuple[str, Known]]) -> dict[str, Any]:
    """The table for `wake-aware`, for other methods beside it, and for scenarios chosen whole."""
    speeds = {key: float(row[SPEED] or 0.0) for key, row in flights.get("dp", {}).items() if row.get(SPEED) is not None}
    groups: dict[str, list[float]] = {}
    for (scenario, _), value in speeds.items():
        groups.setdefault(scenario, []).append(value)
    whole = {key: float(np.mean(groups[key[0]])) for key in speeds}

    def table(method: str, by: Mapping[Known, float]) -> dict[str, Any]:
        return {
            "trouble": exposed_figures(method, {k for k in by if by[k] > TROUBLE_M_S}, flights, trims, failed),
            "calm": still_water_figures(method, {k for k in by if by[k] < CALM_M_S}, flights, trims),
        }

    beside = [name for name in BESIDE if flights.get(name)]
    return {
        "method": "wake-aware",
        **table("wake-aware", speeds),
        "by_scenario": table("wake-aware", whole),
        "everywhere": worst_harm(flights.get("dp", {}), flights.get("wake-aware", {})),
        "beside": {name: table(name, speeds) for name in beside},
    }


def tag_of(rival: str) -> str:
    """A method's name within the name of a figure."""
    return rival.replace("-", "_").replace("+", "_")


def exposed_figures(
    method: str, where: set[Known], flights: Flights, trims: Mapping[Known, str], failed: set[tuple[str, Known]]
) -> dict[str, Any]:
    """Figures over the flights in which `dp` leaves too much."""
    rows = {name: {k: v for k, v in own.items() if k in where} for name, own in flights.items()}
    ours, dp = rows.get(method, {}), rows.get("dp", {})
    lost = {k for name, k in failed if name == method and k in where}
    answer: dict[str, Any] = {"flights": len(where), "scenarios": sorted({k[0] for k in where})}
    for rival in RIVALS:
        tag, base = tag_of(rival), rows.get(rival, {})
        if rival == method:
            continue
        found = log_reduction_pct(pairs_of(base, ours, SPEED, trims), len(lost & set(base)))
        answer[f"reduction_vs_{tag}_pct"], answer[f"reduction_vs_{tag}_interval_pct"] = found[:2]
        answer[f"worst_flight_vs_{tag}_pct"] = found[2]
        answer[f"sums_reduction_vs_{tag}_pct"] = as_reduction(*ratio(pairs_of(base, ours, SPEED, trims)))[0]
    worst: dict[str, float] = {}
    for scenario in answer["scenarios"]:
        here = {k: v for k, v in dp.items() if k[0] == scenario}
        value = log_reduction_pct(pairs_of(here, ours, SPEED, trims), len(lost & set(here)))[0]
        if value is not None:
            worst[scenario] = value
    answer["worst_world"] = min(worst, key=lambda name: worst[name]) if worst else None
    answer["worst_world_pct"] = min(worst.values()) if worst else None
    answer["by_world_pct"] = worst
    answer |= place(dp, ours, len(lost))
    answer["energy_ratio"], answer["energy_ratio_interval"] = ratio(pairs_of(dp, ours, ENERGY, trims))
    for name, figure in (("silt_rays", SILT), ("sway", SWAY), ("sway_wash", SWAY_WASH)):
        less = as_reduction(*ratio(pairs_of(dp, ours, figure, trims)))
        answer[f"{name}_reduction_pct"], answer[f"{name}_reduction_interval_pct"] = less
        answer[f"{name}_worst_world_pct"] = _worst_ratio(dp, ours, figure, answer["scenarios"])
    if method == "wake-aware":
        answer |= acceptance_checks(dp, ours, rows.get(WRONG, {}), trims)
    answer["why"] = _why(answer, len(where))
    return answer


def still_water_figures(method: str, where: set[Known], flights: Flights, trims: Mapping[Known, str]) -> dict[str, Any]:
    """Figures over the flights in which there is nothing to gain: do no harm."""
    ours, dp = ({k: v for k, v in flights.get(name, {}).items() if k in where} for name in (method, "dp"))
    answer: dict[str, Any] = {"flights": len(where)}
    for name, figure in (("wash", SPEED), ("silt", SILT), ("energy", ENERGY)):
        answer[f"{name}_ratio"], answer[f"{name}_ratio_interval"] = ratio(pairs_of(dp, ours, figure, trims))
    answer["why"] = _why(answer, len(where))
    return answer


def worst_harm(dp: Mapping[Known, Row], ours: Mapping[Known, Row]) -> dict[str, Any]:
    """Where ours does most harm, over all scenarios, in trouble or not: silt on the rays and sway over `dp`'s."""
    answer: dict[str, Any] = {}
    for name, figure in (("wash", SPEED), ("silt_rays", SILT), ("sway", SWAY)):
        by = {
            scenario: value
            for scenario in sorted({key[0] for key in dp})
            if (value := ratio(pairs_of({k: v for k, v in dp.items() if k[0] == scenario}, ours, figure, {}))[0])
        }
        worst = max(by, key=lambda scenario: by[scenario]) if by else None
        answer[f"{name}_most_ratio"], answer[f"{name}_most_where"] = (by[worst] if worst else None), worst
    answer["why"] = _why(answer, len(dp))
    return answer


def place(dp: Mapping[Known, Row], ours: Mapping[Known, Row], lost: int) -> dict[str, Any]:
    """Errors of the camera's place, root mean square over flights, and whether ours is no worse than it may be.

    The body's are told beside them.
    """
    answer: dict[str, Any] = {"position_ok": None}
    for name, figure in (("camera", PLACE), ("position", BODY)):
        pairs = pairs_of(dp, ours, figure, {})
        errors_mm = np.array([(base, own) for base, own, _ in pairs]).reshape(-1, 2)
        theirs, own = (float(v) for v in np.sqrt(np.mean(errors_mm**2, axis=0))) if pairs else (None, None)
        answer[f"{name}_rmse_mm"], answer[f"dp_{name}_rmse_mm"] = own, theirs
        if figure == PLACE and theirs is not None and own is not None:
            answer["position_ok"] = lost == 0 and own <= POSITION_SHARE * theirs + POSITION_MM
    return answer


def acceptance_checks(
    dp: Mapping[Known, Row], ours: Mapping[Known, Row], wrong: Mapping[Known, Row], trims: Mapping[Known, str]
) -> dict[str, Any]:
    """How much of the reduction stays with a wrong current, over the flights that were flown with both."""
    both = {k: v for k, v in dp.items() if k in wrong and k in ours}
    right = log_reduction_pct(pairs_of(both, ours, SPEED, trims))[0]
    left = log_reduction_pct(pairs_of(both, wrong, SPEED, trims))
    share = None if right is None or left[0] is None or not right > 0.0 else 100.0 * left[0] / right
    ends = left[1]
    return {
        "wrong_current_keeps_pct": share,
        "wrong_current_keeps_interval_pct": None
        if share is None or ends is None or right is None
        else (100.0 * ends[0] / right, 100.0 * ends[1] / right),
        "wrong_current_flights": len(both),
    }


def _worst_ratio(dp: Mapping[Known, Row], ours: Mapping[Known, Row], figure: str, scenarios: list[str]) -> float | None:
    """The least reduction of a figure over scenarios, in percent."""
    found = [
        ratio(pairs_of({k: v for k, v in dp.items() if k[0] == scenario}, ours, figure, {}))[0]
        for scenario in scenarios
    ]
    known = [value for value in found if value is not None]
    return 100.0 * (1.0 - max(known)) if known else None


def _why(answer: dict[str, Any], flights: int) -> dict[str, str]:
    """Reasons of what could not be computed."""
    missing = [key for key, value in answer.items() if value is None and not key.endswith(("interval", "interval_pct"))]
    reason = "no such flight was flown" if not flights else "not flown by both, or nothing of it to reduce"
    reasons = dict.fromkeys(missing, reason)
    if any(value is None and key.endswith(("interval", "interval_pct")) for key, value in answer.items()):
        reasons["intervals"] = "one flight or none"
    return reasons
