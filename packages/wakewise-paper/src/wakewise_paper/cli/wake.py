"""`wakewise wake validate|learn|calibrate-flight`: wake models against flows, a learned model, a jet from a hover."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.ui.cli.console import ProgressBars, answer, format_value, print_json, print_table, write_page
from wakewise.ui.cli.options import Json, seed_option

Seed = Annotated[int, typer.Option("--seed", callback=seed_option, help="Seed of the split and of the resamples.")]


def validate(
    out: Annotated[Path | None, typer.Option(help="Folder for wake.html and wake.json.")] = None,
    data: Annotated[
        Path, typer.Option(help="Folder of reference data (the real jets).", envvar="WAKEWISE_DATA")
    ] = Path("../shared/data"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser samples, no PIV.")] = False,
    through_piv: Annotated[
        bool,
        typer.Option("--through-piv", help="Also see the lattice's swirling jet and the parcels through virtual PIV."),
    ] = False,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Hold every wake model against every flow, on held-out thrusts, beside the paper's 0.99 and 0.82."""
    from wakewise.core.optional_dependencies import need
    from wakewise_paper.wake_validation import ValidationOptions, figures
    from wakewise_paper.wake_validation import validate as run

    if out is not None:
        need("--out", "reports")
    with ProgressBars().stage("validate") as progress:
        result = run(
            ValidationOptions(
                quick=quick,
                data=data if data.is_dir() else None,
                through_piv=through_piv,
                seed=seed,
                progress=progress,
            )
        )
    values = figures(result)
    if out is not None:
        from wakewise.core.files import write_json
        from wakewise_paper.reports.wake import write_wake_report

        write_json(out / "wake.json", values)
        write_page("report", lambda: write_wake_report(result, values, out))
    answer(json, values, partial(_show_validation, values), None if out is None else f"report: {out / 'wake.html'}")


def _show_validation(values: dict[str, Any]) -> None:
    for key, words in values["definitions"].items():
        flows = list(next(iter(values["models"].values())))
        rows = [(model, *(by_flow[flow][key] for flow in flows)) for model, by_flow in values["models"].items()]
        print_table("tn", ("model", *flows), rows, f"{key}: {words}")
    paper = values["paper"]
    typer.echo(f"the paper claims {paper['r2_core']} and {paper['r2_wake']} for its proxy")
    convergence = values["grid_convergence_pct"]
    typer.echo(f"lattice, two grids, centreline speed at 0.3 m: {format_value(convergence)} % apart")
    for key, reason in values["why"].items():
        typer.echo(f"not computed: {key}: {reason}")


def learn(
    draws: Annotated[int, typer.Option(min=1, max=1000, help="Waters of the tank to train on, each drawn.")] = 60,
    steps: Annotated[int, typer.Option(min=100, max=1_000_000, help="Steps of the training.")] = 8000,
    out: Annotated[Path | None, typer.Option(help="Write the network here; else it is judged and thrown away.")] = None,
    shipped: Annotated[
        bool, typer.Option("--shipped", help="Judge the network that ships instead of training one.")
    ] = False,
    held_out: Annotated[int, typer.Option(min=1, max=100, help="Waters of the tank to judge on.")] = 8,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Train the learned rival on tank and lattice; hold every model against water that none was fitted to."""
    from wakewise.wake.learned import load_network
    from wakewise_paper.learned_wake import evaluation
    from wakewise_paper.learned_wake.training import TrainingRecipe, make

    with ProgressBars().stage("learn") as progress:
        if shipped:
            network = load_network()
        else:
            network, _ = make(TrainingRecipe(draws=draws, steps=steps, seed=seed), out, progress)
        result = evaluation.judge(network, evaluation.held_out(held_out, progress=progress))
    written = None if out is None else f"written: {out}"
    answer(json, result | {"out": out and str(out)}, partial(_show_rivals, result), written)


def _show_rivals(result: dict[str, Any]) -> None:
    for key, words in (
        ("error_share", "root mean square error of the velocity over that of the velocity itself"),
        ("factor_of_2_pct", "share of the points with more than 1 cm/s (at 1 N) right within a factor of two, %"),
    ):
        scores = result["scores"].values()
        rows = [(model, *(by_model[model][key] for by_model in scores)) for model in next(iter(scores))]
        print_table("tn", ("model", *result["scores"]), rows, f"{key}: {words}")
    typer.echo(f"learned: {result['weights']} weights, {result['circular']}")


def calibrate_flight(
    world: Annotated[str, typer.Option(help="World of the library to fly in.")] = "payload",
    method: Annotated[str, typer.Option(help="Who holds the hover.")] = "dp",
    minutes: Annotated[float, typer.Option(min=0.5, max=30.0, help="How long the hover is.")] = 5.0,
    seed: Annotated[
        int, typer.Option(callback=seed_option, help="Seed of the world, which draws the jets' width.")
    ] = 1,
    held: Annotated[
        bool, typer.Option("--held", help="Hold the vehicle and let its bow thrusters push in turn.")
    ] = False,
    json: Json = False,
) -> None:
    """Calibrate the jet from a hover, by flakes that the camera sees drift; its error against minutes."""
    from wakewise_paper.flight_fit.curve import CalibrationFlight, curve, held_curve

    if held:
        result = held_curve(world, seed, minutes)
    else:
        with ProgressBars().stage("fly") as progress:
            result = curve(CalibrationFlight(world=world, method=method, seed=seed, minutes=minutes), progress)
    if json:
        print_json(result)
        return
    believed = result["believed"]
    rows = [(0, 0, believed["slope"], None, 1.0, None, "", believed["error_share"])]
    keys = ("minutes", "flakes", "half_width_slope", "slope_standard_error", "gain", "gain_standard_error")
    rows += [tuple(row[key] for key in (*keys, "slope_error_pct", "error_share")) for row in result["curve"]]
    columns = ("minutes", "flakes", "slope", "+-", "strength", "+-", "off by, %", "error of the water, share")
    print_table("n", columns, rows, f"half width slope, drawn {result['true_half_width_growth']:.3f}")
    if result["curve"]:
        law = format_value(result["curve"][-1]["gain"] ** 2)
        typer.echo(f"momentum flux over thrust: {law} at the end, strength squared; the law says 1")
