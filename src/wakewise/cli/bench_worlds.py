"""Shows what `wakewise bench worlds` found: a table for each world."""

from __future__ import annotations

from typing import Any

import typer

from wakewise.cli.console import print_table, shown

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
    ("success_pct", "success %", 1.0),
)


def show_worlds(result: dict[str, Any]) -> None:
    """One table per world, a row per method; last, how much less each moves the target's water than the first."""
    from rich.table import Table

    for name, world in result["worlds"].items():
        default = ", of the presets" if name == result["default_world"] else ""
        flights = max((row["flights"] for row in world["methods"].values()), default=0)
        table = Table(title=f"{name}{default}: {world['title']}; {flights} seeds", title_justify="left")
        table.add_column("method")
        for _, title, _ in _COLUMNS:
            table.add_column(title, justify="right")
        first = next(iter(world["methods"]))
        table.add_column(f"less than {first}", justify="right")
        for method, row in world["methods"].items():
            cells = [shown(None if row[key] is None else scale * row[key]) for key, _, scale in _COLUMNS]
            table.add_row(method, *cells, _less(row["against"].get(first)))
        print_table(table)
    if result["judge"]:
        _show_judge(result["judge"])
    typer.echo(f"{result['flights']} flights, {result['models']} models, {result['failed']} failed")
    for failure in result["failures"]:
        typer.echo(f"failed: {failure['flow']}, {failure['name']}, seed {failure['seed']}: {failure['reason']}")
    typer.echo(f"emergent: {result['emergent']}\ntyped in: {result['typed_in']}")


def _show_judge(judge: dict[str, Any]) -> None:
    """The same flights in the tank and in the lattice."""
    from rich.table import Table

    table = Table(title="the second judge: hovers in tank and lattice, target held still", title_justify="left")
    for title in ("world", "method", "tank mm/s", "lattice mm/s", "tank: less than dp", "lattice: less than dp"):
        table.add_column(title, justify="left" if title in ("world", "method") else "right")
    for world, methods in judge.items():
        for method, row in methods.items():
            speeds = [shown(None if row[flow] is None else 1e3 * row[flow]) for flow in ("tank_m_s", "lattice_m_s")]
            less = ["—" if row[key] is None else f"{row[key]:.0f} %" for key in ("tank_less_pct", "lattice_less_pct")]
            table.add_row(world, method, *speeds, *less)
    print_table(table)


def _less(ratios: dict[str, Any] | None) -> str:
    if ratios is None or ratios["target_speed_less_pct"] is None:
        return "—"
    interval = ratios["target_speed_less_interval_pct"]
    ends = "" if interval is None else f" ({interval[0]:.0f} to {interval[1]:.0f})"
    return f"{ratios['target_speed_less_pct']:.0f} %{ends}"
