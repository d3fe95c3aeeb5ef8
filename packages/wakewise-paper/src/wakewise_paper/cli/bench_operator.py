"""Shows what `wakewise bench operator` found: the claim against its bars, then a table of worlds and w_tracks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

from wakewise.ui.cli.console import format_value, interval, print_table
from wakewise_paper.cli.bench_wash import reduction, scaled, show_failures

_BARS = (
    ("velocity_deviation_pct", "velocity_deviation_interval_pct", "velocity deviation, %", "< 15"),
    ("target_speed_reduction_pct", "target_speed_reduction_interval_pct", "less wash in trouble, %", "> 60"),
    ("disturbance_reduction_pct", "disturbance_reduction_interval_pct", "less D, %", "> 60"),
    ("energy_ratio", "energy_ratio_interval", "energy over direct's", ""),
    ("position_ratio", "position_ratio_interval", "place error over direct's", ""),
    ("silt_lifted_ratio", "silt_lifted_ratio_interval", "silt lifted over direct's", ""),
    ("sway_wash_ratio", "sway_wash_ratio_interval", "the wash's sway over direct's", ""),
)
_COLUMNS = ("flights", "deviation", "floor", "planned %", "mm/s", "direct", "less wash", "trouble", "less D", "energy")


def show_operator(result: Mapping[str, Any]) -> None:
    """The claim first, with pilots, courses and rivals beside it; then each world by w_track; then the paper's."""
    claim = result["claim"]
    beside: dict[str, Mapping[str, Any]] = {**claim["pilots"], **claim["courses"], **claim["rivals"]}
    title = f"claim: w_track 5, {claim['flights']} flights, of {claim['trouble_flights']} direct leaves over 10 mm/s"
    rows: list[tuple[Any, ...]] = [
        (name, claim[key], interval(*(claim[ends] or (None, None))), *(one[key] for one in beside.values()), bar)
        for key, ends, name, bar in _BARS
    ]
    print_table("tn", ("", "wake-aware", "95 %", *beside, "bar"), rows, title)
    rows = []
    for name, world in result["worlds"].items():
        rows += [(name, w_track, *_cells(row)) for w_track, row in world["w_track"].items()]
        rows.append((name, "no-forward-jets", *_cells(world["no-forward-jets"])))
    title = "worlds; less wash and D than direct allocation on the same seeds"
    print_table("ttn", ("world", "w_track", *_COLUMNS), rows, title)
    for key, where in (("w_track", "in front"), ("w_track_over", "above")):
        for w_track, row in result["paper"][key].items():
            typer.echo(
                f"paper (circular), {where}, w_track {w_track}: "
                f"deviation {format_value(row['velocity_deviation_pct'])} %, "
                f"D less by {reduction(row['disturbance_reduction_pct'])}, "
                f"wash by {reduction(row['target_speed_reduction_pct'])}"
            )
    _show_cockpit(result)
    known = result["flights"] - result["flown"] - result["failed"]
    typer.echo(f"{result['flown']} flights flown, {known} known, {result['failed']} failed")
    show_failures(result)


def _show_cockpit(result: Mapping[str, Any]) -> None:
    for name, one in (result.get("cockpit") or {}).items():
        typer.echo(
            f"cockpit, cores {name}: stick to thrust {one['latency_ms_p50']:.0f} ms, p99 {one['latency_ms_p99']:.0f} "
            f"(< 120); {one['pictures_per_s']:.1f} pictures a second; first light {one['first_light_s']:.1f} s"
        )
    for name, one in (result.get("coverage") or {}).items():
        typer.echo(
            f"coverage, {name.replace('_', ' ')}, {one['photos']} photographs: right of "
            f"{one['coverage_agreement_pct']:.1f} % of the target (a trivial guess {one['coverage_trivial_pct']:.1f}), "
            f"{one['coverage_ms_per_photo']:.1f} ms each"
        )
    for key in ("latency_ms_p99", "coverage_agreement_pct"):
        if key in result["why"]:
            typer.echo(f"{key}: not measured: {result['why'][key]}")


def _cells(row: Mapping[str, Any]) -> list[Any]:
    return [
        row["flights"],
        row["velocity_deviation_pct"],
        row["velocity_deviation_floor_pct"],
        row["velocity_deviation_planned_pct"],
        *scaled(row, [(key, "", 1e3) for key in ("target_speed_mean_m_s", "direct_target_speed_mean_m_s")]),
        reduction(row["target_speed_reduction_all_pct"], row["target_speed_reduction_all_interval_pct"]),
        reduction(row["target_speed_reduction_pct"]),
        reduction(row["disturbance_reduction_pct"]),
        row["energy_ratio"],
    ]
