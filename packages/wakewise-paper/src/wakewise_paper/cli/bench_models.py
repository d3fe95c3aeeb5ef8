"""Shows what `wakewise bench models` and `wakewise bench front` found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

from wakewise.ui.cli.console import format_value, interval, print_table
from wakewise_paper.cli.bench_wash import scaled, show_failures

_COLUMNS = (
    ("rmse_mm", "RMSE mm", 1.0),
    ("completeness_pct", "complete %", 1.0),
    ("completeness_1mm_pct", "1 mm %", 1.0),
    ("success_pct", "success %", 1.0),
    ("sway_about_mean_mm", "sway mm", 1.0),
    ("target_drag_peak_N", "drag N", 1.0),
    ("bed_over_threshold_s", "grains s", 1.0),
    ("target_speed_mean_m_s", "wash mm/s", 1e3),
    ("position_rmse_mm", "place mm", 1.0),
    ("energy_kJ", "kJ", 1.0),
)
_SILT_COLUMNS = (
    ("ray_optical_depth", "rays", 1.0),
    ("turbidity_mean_per_m", "round the target 1/m", 1.0),
    ("silt_lifted_g", "lifted g", 1.0),
    ("bed_over_threshold_s", "grains s", 1.0),
    ("target_speed_mean_m_s", "wash mm/s", 1e3),
    ("energy_kJ", "kJ", 1.0),
)


def show_models(result: Mapping[str, Any]) -> None:
    """A table per part, a row per case and method; last, RMSE beside the base's with its interval.

    Of flights without models silt is told, and last the attenuation along the rays over the base's.
    """
    for part in result["parts"].values():
        if not part["models"]:
            _show_silt(part)
            continue
        rows = []
        for row in part["rows"]:
            more = row.get("rmse_mm_more")
            low, high = row.get("rmse_mm_more_interval") or (None, None)
            ends = interval(low, high, "no interval")
            told = "" if more is None else f"{more:+.2f} ({ends}; {row['rmse_mm_more_pairs']})"
            rows.append((row["title"], row["method"], row["scans"], *scaled(row, _COLUMNS), told))
        columns = ("case", "method", "scans", *(title for _, title, _ in _COLUMNS), "RMSE more than the base")
        print_table("ttn", columns, rows, part["title"])
    typer.echo(f"{result['flights']} scans, {result['failed']} failed")
    show_failures(result)


def _show_silt(part: Mapping[str, Any]) -> None:
    rows = [
        (row["title"], row["method"], row["flights"], *scaled(row, _SILT_COLUMNS), _over_base(row))
        for row in part["rows"]
    ]
    columns = ("case", "method", "flights", *(title for _, title, _ in _SILT_COLUMNS), "rays over the base's")
    print_table("ttn", columns, rows, part["title"])


def _over_base(row: Mapping[str, Any]) -> str:
    if row.get("ray_optical_depth_ratio") is None:
        return ""
    return f"{row['ray_optical_depth_ratio']:.2f} ({_ends(row, 'ray_optical_depth_ratio')})"


def show_front(result: Mapping[str, Any]) -> None:
    """A table per place: wash and energy over those of `dp`; the knee; our front at each rival's energy."""
    for name, place in result["places"].items():
        rows = [
            (method, row["wash_pairs"], *(cell for key in ("wash", "energy") for cell in (row[key], _ends(row, key))))
            for method, row in place["methods"].items()
        ]
        print_table("tn", ("method", "pairs", "wash", "95 %", "energy", "95 %"), rows, f"{name}: over dp's")
        typer.echo(f"knee of the front: {place['knee'] or 'unknown'}")
        for rival, ratio in place["wash_ratio_at_equal_energy"].items():
            said = "outside the front" if ratio is None else f"{format_value(ratio)} of its wash"
            typer.echo(f"at the energy of {rival}: {said}")
    typer.echo(f"{result['flights']} flights, {result['failed']} failed")
    show_failures(result)


def _ends(row: Mapping[str, Any], key: str) -> str:
    return interval(*(row.get(f"{key}_interval") or (None, None)))
