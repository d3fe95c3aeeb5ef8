"""Shows what `wakewise bench worlds` found: a table for each world."""

from __future__ import annotations

from typing import Any

import typer

from wakewise.ui.cli.console import format_value, print_table
from wakewise_paper.cli.bench_wash import reduction, scaled, show_failures

_COLUMNS = (
    ("target_speed_mean_m_s", "target mm/s", 1e3),
    ("exposure_speed_mean_m_s", "exposing mm/s", 1e3),
    ("bed_shear_p95_Pa", "bed Pa", 1.0),
    ("silt_suspended_max_g", "silt g", 1.0),
    ("ray_optical_depth", "ray depth", 1.0),
    ("sway_rms_mm", "sway mm", 1.0),
    ("sway_wash_mm", "by wash mm", 1.0),
    ("position_rmse_mm", "position mm", 1.0),
    ("energy_kJ", "energy kJ", 1.0),
    ("rmse_mm", "model mm", 1.0),
    ("completeness_pct", "complete %", 1.0),
    ("completeness_1mm_pct", "1 mm %", 1.0),
    ("success_pct", "success %", 1.0),
)


def show_worlds(result: dict[str, Any]) -> None:
    """One table per world, a row per method; last, how much less each moves the target's water than the first."""
    for name, world in result["worlds"].items():
        default = ", of the presets" if name == result["default_world"] else ""
        flights = max((row["flights"] for row in world["methods"].values()), default=0)
        first = next(iter(world["methods"]))
        rows = [
            (method, *scaled(row, _COLUMNS), _less(row["against"].get(first)))
            for method, row in world["methods"].items()
        ]
        columns = ("method", *(title for _, title, _ in _COLUMNS), f"less than {first}")
        print_table("tn", columns, rows, f"{name}{default}: {world['title']}; {flights} seeds")
    if result["judge"]:
        _show_judge(result["judge"])
    typer.echo(f"{result['flights']} flights, {result['models']} models, {result['failed']} failed")
    show_failures(result)
    typer.echo(f"emergent: {result['emergent']}\ntyped in: {result['typed_in']}")


def _show_judge(judge: dict[str, Any]) -> None:
    """The same flights in the tank and in the lattice."""
    rows = []
    for world, methods in judge.items():
        for method, row in methods.items():
            cells = []
            for place in ("tank_", "tank_clear_", "lattice_", "lattice_clear_"):
                speed, less = row[f"{place}m_s"], row[f"{place}less_pct"]
                part = "" if less is None or method == "dp" else f" ({less:.0f} %)"
                cells.append(format_value(None if speed is None else 1e3 * speed) + part)
            rows.append((world, method, *cells))
    columns = ("world", "method", "tank: on the target", "8 cm off", "lattice: on the target", "8 cm off")
    title = "the second judge: hovers in tank and lattice, target held still; mm/s, and less than dp"
    print_table("ttn", columns, rows, title)


def _less(ratios: dict[str, Any] | None) -> str:
    if ratios is None:
        return reduction(None)
    return reduction(ratios["target_speed_less_pct"], ratios["target_speed_less_interval_pct"])
