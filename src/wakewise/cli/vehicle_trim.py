"""`wakewise vehicle trim`: what ballast keeps the target's water stillest over a mission."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from wakewise.cli.console import print_json, print_table
from wakewise.cli.options import Json

Vehicle = Annotated[str, typer.Argument(help="Library name or vehicle file.")]
ScenarioFile = Annotated[
    Path | None, typer.Option("--scenario", help="Scenario file with mission, target and tank.", show_default=False)
]


def trim(vehicle: Vehicle = "paper", scenario: ScenarioFile = None, json: Json = False) -> None:
    """Advise on ballast: D and thrust of holding a mission's poses by net buoyancy and centre of gravity.

    Advised is the least effort that is not worse by D, which is what the simulated tank bears out; the least D by the
    wake model, bed points and wall jets included, is told beside it.
    """
    import numpy as np

    from wakewise.control import LeverSettings
    from wakewise.control.trim import net_buoyancy_N, trim_advice
    from wakewise.operation import load_scenario
    from wakewise.wake import wake_model

    chosen = load_scenario(None, scenario, {"vehicle": vehicle})
    parts = chosen.parts()
    _ = parts.preflight
    route, body = parts.route, parts.vehicle
    times = route.exposures_s[:: max(1, len(route.exposures_s) // 24)]
    poses = tuple(route.body(float(t), parts.aim).X_WB for t in times)
    wake = wake_model(chosen.control.wake.model_copy(update={"floor": True}), chosen.tank.size_m[2])
    settings = chosen.control.model_copy(update={"levers": LeverSettings(bed=True)})
    apart = chosen.tank.mismatch
    unknown_N = apart.trim_range_N if apart.trim_N is None else abs(apart.trim_N)
    advice = trim_advice(body, poses, parts.region, wake, settings, unknown_N=unknown_N)
    if json:
        print_json(
            {
                "vehicle": body.name,
                "poses": len(poses),
                "net_buoyancy_N": net_buoyancy_N(body),
                "unknown_trim_N": unknown_N,
                "rows": [asdict(row) for row in advice.rows],
                "now": asdict(advice.now),
                "best": asdict(advice.best),
                "gentlest": asdict(advice.gentlest),
                "advice": advice.words,
            }
        )
        return
    from rich.table import Table

    shifts = sorted({row.shift_mm for row in advice.rows})
    table = Table(
        title=f"{body.title}: water speed at the target in mm/s (by the wake model), {len(poses)} poses, "
        f"trim known to {unknown_N:g} N",
        title_justify="left",
    )
    table.add_column("floats with N", justify="right")
    for shift in shifts:
        table.add_column(f"CG {shift:+.0f} mm", justify="right")
    table.add_column("thrust down N", justify="right")
    for float_N in sorted({row.float_N for row in advice.rows}):
        rows = [row for row in advice.rows if row.float_N == float_N]
        cells = [f"{1e3 * row.speed_m_s:.2f}" for row in sorted(rows, key=lambda row: row.shift_mm)]
        table.add_row(f"{float_N:+.1f}", *cells, f"{np.mean([row.down_N for row in rows]):.2f}")
    print_table(table)
    typer.echo(f"advice: {advice.words}")
    typer.echo(advice.wake_words)
