"""Shows what `wakewise bench gentle` found: the headline, a table for each scenario, the mechanisms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import typer

from wakewise.ui.cli.console import format_value, interval, print_table

_COLUMNS = (
    ("target_speed_mean_m_s", "mm/s", 1e3),
    ("target_speed_p95_m_s", "p95", 1e3),
    ("exposure_speed_mean_m_s", "exposing", 1e3),
    ("exceedance_1cm_s_pct", "%>1cm/s", 1.0),
    ("bed_shear_p95_Pa", "bed Pa", 1.0),
    ("ray_optical_depth", "rays/1000", 1e3),
    ("sway_rms_mm", "sway mm", 1.0),
    ("position_rmse_mm", "body mm", 1.0),
    ("camera_rmse_mm", "cam. mm", 1.0),
    ("energy_kJ", "kJ", 1.0),
    ("solve_ms_p99", "ms", 1.0),
)
"""What people are shown of each method; the rest is in the JSON."""

_BARS = (
    ("reduction_vs_dp_pct", "less wash than dp, %", ">= 80"),
    ("reduction_vs_mpc_pct", "less than mpc, %", ">= 80"),
    ("worst_world_pct", "less than dp in the worst scenario, %", ">= 50"),
    ("reduction_vs_no_forward_jets_pct", "less than the bow rule, %", ">= 20"),
    ("position_ok", "camera where dp has it", "yes"),
    ("energy_ratio", "energy over dp's", "<= 1.3"),
    ("silt_rays_reduction_pct", "less silt on the rays, %", ">= 60"),
    ("sway_reduction_pct", "less sway at the shutter, %", ">= 60"),
    ("wrong_current_keeps_pct", "kept with a wrong current, %", ">= 67"),
)
_CALM = (
    ("wash_ratio", "wash over dp's", "<= 1"),
    ("silt_ratio", "silt on the rays over dp's", "<= 1.05"),
    ("energy_ratio", "energy over dp's", "<= 1.05"),
)


def show_gentle(result: dict[str, Any]) -> None:
    """The headline first, then a table per scenario with a row per method, then mechanisms and the paper's world."""
    _show_headline(result["headline"])
    for name, scenario in result["scenarios"].items():
        seeds = max((row["flights"] for row in scenario["methods"].values()), default=0)
        rows = []
        for method, row in scenario["methods"].items():
            less = reduction(row.get("reduction_vs_dp_pct"), row.get("reduction_vs_dp_interval_pct"))
            rows.append((method, *scaled(row, _COLUMNS), less, reduction(row.get("worst_seed_vs_dp_pct"))))
        columns = ("method", *(title for _, title, _ in _COLUMNS), "less than dp", "worst")
        print_table("Tn", columns, rows, f"{name}: {scenario['title']}; {seeds} seeds")
    mechanisms = sorted(
        {mechanism for scenario in result["scenarios"].values() for mechanism in scenario["mechanisms"]}
    )
    if mechanisms:
        _show_mechanisms(result["scenarios"], mechanisms)
    if result["bound"]:
        _show_bound(result["bound"])
    for flow, figures in result["flows"].items():
        less = ", ".join(
            f"{reduction(*(figures[f'reduction_vs_{rival}_{what}pct'] for what in ('', 'interval_')))} than {rival}"
            for rival in ("dp", "mpc")
        )
        typer.echo(f"{flow} (circular: the planner's own model is the water): wake-aware moves less by {less}")
    known = result["flights"] - result["flown"] - result["failed"]
    typer.echo(f"{result['flown']} flights flown, {known} known, {result['failed']} failed")
    show_failures(result)


def show_failures(result: Mapping[str, Any]) -> None:
    """A line for each flight that failed."""
    for failure in result["failures"]:
        typer.echo(f"failed: {failure['flow']}, {failure['name']}, seed {failure['seed']}: {failure['reason']}")


def scaled(row: Mapping[str, Any], columns: Sequence[tuple[str, str, float]]) -> list[float | None]:
    """Values of a row in the units of the columns (key, title, factor)."""
    return [None if row[key] is None else scale * row[key] for key, _, scale in columns]


def _show_headline(headline: dict[str, Any]) -> None:
    """What was chosen beforehand, and its bars."""
    beside = headline["beside"]
    rows = []
    for part, bars in (("trouble", _BARS), ("calm", _CALM)):
        own = headline[part]
        for place, (key, words, bar) in enumerate(bars):
            ends = own.get(key.removesuffix("_pct") + ("_interval_pct" if key.endswith("_pct") else "_interval"))
            label = f"{part}, {own['flights']} flights" if place == 0 else ""
            others = [one[part].get(key) for one in beside.values()]
            rows.append((label, words, own.get(key), interval(*(ends or (None, None))), *others, bar))
    columns = ("", "figure", "wake-aware", "95 %", *beside, "bar")
    print_table("ttn", columns, rows, "headline: flights in which dp leaves more than 10 mm/s, less than 5")
    most = headline["everywhere"]
    for name, words in (("wash", "wash"), ("silt_rays", "silt on the rays"), ("sway", "sway")):
        if most[f"{name}_most_ratio"] is not None:
            typer.echo(
                f"worst anywhere: {words} {format_value(most[f'{name}_most_ratio'])} times dp's, "
                f"{most[f'{name}_most_where']}"
            )


def _show_mechanisms(scenarios: dict[str, Any], mechanisms: list[str]) -> None:
    """What each mechanism is worth, scenario by scenario: left out, alone."""
    rows = []
    for name, scenario in scenarios.items():
        cells = [scenario["mechanisms"].get(mechanism, {}) for mechanism in mechanisms]
        rows.append((name, *(f"{reduction(c.get('left_out_pct'))} / {reduction(c.get('alone_pct'))}" for c in cells)))
    print_table("tn", ("scenario", *mechanisms), rows, "mechanisms: slower by, all others on / alone")


def _show_bound(bound: dict[str, Any]) -> None:
    """The most that sharing thrusts out could gain: less wash than `dp` as flown, energy over the least thrusts'."""
    from wakewise_paper.wash_reduction.energy_optimum import ENERGIES

    cells = []
    rows = {**bound["flights"], **({} if bound["trouble"] is None else {"all in trouble": bound["trouble"]})}
    for flight, row in rows.items():
        speed = row.get("dp_m_s")
        most = [
            f"{reduction(row[f'attained_{name}_less_pct'])} to {reduction(row[f'bound_{name}_less_pct'])}"
            for name in ENERGIES
        ]
        named = [
            f"{reduction(row[f'{name}_less_pct'])}, {format_value(row[f'{name}_energy'])}"
            for name in ("rule", "belief", "belief_any")
        ]
        cells.append((flight, None if speed is None else 1e3 * speed, *most, *named))
    columns = ("flight", "dp mm/s", *(f"{name} x energy" for name in ENERGIES), "rule", "belief", "belief, any")
    print_table("Tn", columns, cells, "the most that sharing thrusts out could gain: less than dp as flown")


def reduction(value: float | None, interval: tuple[float, float] | None = None) -> str:
    """A share in percent, with its interval."""
    if value is None:
        return "—"
    return f"{value:.0f} %" if interval is None else f"{value:.0f} % ({interval[0]:.0f} to {interval[1]:.0f})"
