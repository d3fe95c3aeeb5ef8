"""`wakewise wake`: calibrate a wake model to data."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.ui.cli.console import answer, interval, print_table
from wakewise.ui.cli.options import Json, seed_option

app = typer.Typer(help="What a jet does to the water: calibrate a model, see how good each is.")


@app.command("fit")
def fit(
    data: Annotated[
        Path,
        typer.Argument(
            help="CSV file with columns x_m, r_m (or y_m, z_m), thrust_N, u_m_s, optionally v_m_s, w_m_s, "
            "disk_diameter_m, in the jet's frame (x along the jet from the disk's middle); a text file of PIVlab, "
            "DaVis or Tecplot with units in its names (x [mm], u [m/s]), of a plane through the jet's axis; or a "
            "folder of image pairs *A, *B with a piv.yaml."
        ),
    ],
    model: Annotated[str, typer.Option(help="fitted, jet, jet-fitted or paper-calibrated.")] = "fitted",
    disk_diameter_m: Annotated[
        float | None, typer.Option(help="Diameter of the disk, if the CSV has no such column.")
    ] = None,
    thrust: Annotated[
        float | None, typer.Option(metavar="N", help="Thrust of all points in newtons, if no column says it.")
    ] = None,
    test_thrust: Annotated[
        list[float] | None,
        typer.Option(metavar="N", help="Hold this thrust out for the test; may be repeated. Else drawn."),
    ] = None,
    seed: Annotated[int, typer.Option(callback=seed_option, help="Seed of the split and of the resamples.")] = 0,
    bootstrap: Annotated[int, typer.Option(min=0, max=10000, help="Resamples for the 95 % intervals.")] = 200,
    out: Annotated[Path | None, typer.Option(help="Write the model here, for a scenario to take.")] = None,
    json: Json = False,
) -> None:
    """Calibrate a wake model: parameters with uncertainty, fitted on some thrusts and positions, tested on others.

    The momentum flux of a jet is its thrust, which is printed as a share: 0.5 to 1.3 in water. What lies far outside is
    refused, since a unit is another than the column's name says.
    """
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise.wake.calibration import calibrate, family, fit_figures, momentum_law, split_samples, write_fit
    from wakewise.wake.samples import read_samples

    chosen = family(model)
    if data.is_dir():
        from wakewise.vision.piv import samples_of_folder

        if thrust is not None:
            raise InputError(f"--thrust {thrust:g}: not with a folder of image pairs, whose piv.yaml says the thrust")
        samples = samples_of_folder(data)
    else:
        samples = read_samples(data, disk_diameter_m, thrust)
    rng = np.random.default_rng(seed)
    split = split_samples(samples, rng, test_thrusts_N=tuple(test_thrust or ()))
    found = calibrate(chosen, samples, rng, split=split, bootstrap=bootstrap)
    law = momentum_law(samples, chosen.model(found.values))
    if out is not None:
        write_fit(out, found, data.name, samples.disk_diameter_m, law)
    result = fit_figures(found) | {
        "points": len(samples),
        "disk_diameter_m": samples.disk_diameter_m,
        "momentum_flux_over_thrust": asdict(law),
    }
    written = None if out is None else f"written: {out}"
    answer(json, result | {"out": out and str(out)}, partial(_show_fit, result, law.words), written)


def _show_fit(result: dict[str, Any], law: str) -> None:
    rows = []
    for name, figure in result["parameters"].items():
        error = "held" if figure["held"] else figure["standard_error"]
        rows.append((name, figure["value"], error, interval(figure["low"], figure["high"], "—")))
    columns = ("parameter", "value", "standard error", "95 % of resamples")
    print_table("tn", columns, rows, f"{result['model']}, {result['points']} points")
    keys = ("r2_core", "r2_wake", "bias_far_pct", "points")
    scores = [(part, *(result[part][key] for key in keys)) for part in ("train", "test")]
    print_table("tn", ("", "R2 in A (core)", "R2 in B (wake)", "bias beyond 0.4 m, %", "points"), scores)
    typer.echo(f"momentum flux over thrust: {law}")
    typer.echo(f"split: {result['split']}")
    for warning in result["warnings"]:
        typer.echo(f"warning: {warning}")
