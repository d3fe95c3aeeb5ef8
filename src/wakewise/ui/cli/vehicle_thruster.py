"""`wakewise vehicle thruster` and `wakewise vehicle lag`: what a thruster makes of a pulse, and how fast it follows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.ui.cli.console import format_value, print_json, print_table
from wakewise.ui.cli.options import Json


def thruster(
    table: Annotated[
        str,
        typer.Argument(
            help="Thrust curve of the library (t200) or path of a CSV with columns supply_V, pwm_us, thrust_N or "
            "force_kgf, and if known rpm, power_W, current_A, voltage_V."
        ),
    ] = "t200",
    supply_V: Annotated[
        float | None,
        typer.Option("--supply-V", help="Supply voltage, within the table; 16, or the nearest there is, if not given."),
    ] = None,
    thrust: Annotated[
        list[float] | None, typer.Option(metavar="N", help="Desired thrust to look up; may be repeated.")
    ] = None,
    pwm: Annotated[list[float] | None, typer.Option(metavar="US", help="Pulse to look up; may be repeated.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Also write an SVG drawing to this file.")] = None,
    json: Json = False,
) -> None:
    """Show a thrust curve: limits, deadband, and pulses, thrusts, speed and power both ways."""
    from wakewise.core.files import write_text
    from wakewise.robot.thrusters.thrust_table import load_curve
    from wakewise.robot.thrusters.thruster_facts import curve_facts, usual_voltage
    from wakewise.ui.reports.vehicle.thrust_drawing import curve_svg

    curve = load_curve(table)
    facts = curve_facts(curve, usual_voltage(curve) if supply_V is None else supply_V, thrust or (), pwm or ())
    if plot is not None:
        write_text(plot, curve_svg(curve, facts["supply_V"]))
    if json:
        print_json(facts)
        return
    voltages = ", ".join(f"{value:g}" for value in facts["voltages_V"])
    typer.echo(f"{facts['name']} at {facts['supply_V']:g} V (table: {voltages} V)")
    typer.echo(f"limits {facts['limits_N'][0]:z.2f} to {facts['limits_N'][1]:+z.2f} N")
    typer.echo(f"no thrust from {facts['deadband_us'][0]:g} to {facts['deadband_us'][1]:g} us, both included")
    low, high = facts["first_step_N"]
    typer.echo(f"smallest thrusts held {low:z.2f} and {high:+z.2f} N; a smaller demand becomes that or none, by half")
    _print_rows("curve", facts["table"])
    if facts["thrusts"]:
        _print_rows("for desired thrusts", facts["thrusts"], desired=True)
    if facts["pulses"]:
        _print_rows("for pulses", facts["pulses"])
    for note in (*facts["notes"], *facts["why"].values()):
        typer.echo(f"note: {note}")
    typer.echo(f"source: {facts['source']}")
    if plot is not None:
        typer.echo(f"drawing: {plot}")


def lag(
    data: Annotated[
        Path,
        typer.Argument(
            help="CSV of a measured step with columns time_s, command and thrust_N. The command is a commanded "
            "thrust, or the square of a commanded speed or voltage."
        ),
    ],
    average_s: Annotated[
        float | None,
        typer.Option(
            help="Compare averages over this time; 0 for raw samples, one period of the propeller's ripple if not "
            "given."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Identify a thruster's lag and dead time from a measured step."""
    from wakewise.robot.thrusters.lag_fit import identify_lag, read_step
    from wakewise.robot.thrusters.thruster_facts import lag_facts

    facts = lag_facts(identify_lag(*read_step(data), average_s=average_s))
    if json:
        print_json(facts)
        return
    typer.echo(f"{facts['model']}, after dead time\n")
    for name, estimate in facts["estimates"].items():
        error = estimate["standard_error"]
        spread = "not bounded by the data" if error is None else f"standard error {format_value(error)}"
        unit = "" if estimate["unit"] == "1" else estimate["unit"]
        typer.echo(f"  {name:<18}{estimate['value']:>10.4g}  {unit:<22}{spread}")
    typer.echo(f"\nmean delay {facts['mean_delay_s']:.4g} s by the fit", nl=False)
    measured = facts["measured_delay_s"]
    if measured is None:
        typer.echo(f"; by area none: {facts['why']['measured_delay_s']}")
    else:
        typer.echo(f", {measured:.4g} s by area (standard error {facts['measured_delay_error_s']:.2g} s)")
    start, end = facts["window_s"]
    typer.echo(f"R2 {facts['r2_raw']:.4f} against raw samples, from {start:g} to {end:g} s")
    if facts["average_s"] > 0.0:
        typer.echo(
            f"R2 {facts['r2']:.4f} against averages over {facts['average_s']:.3g} s, which themselves reach "
            f"{facts['r2_ceiling']:.4f} against the raw samples"
        )
    for model in facts["models"]:
        typer.echo(f"  {model['name']:<34}averaged R2 {model['r2']:.4f}   BIC {model['bic']:.1f}")


def _print_rows(title: str, rows: list[dict[str, Any]], *, desired: bool = False) -> None:
    columns = {"desired N": ("desired_N", 2)} if desired else {}
    columns |= {"pulse us": ("pwm_us", 0), "thrust N": ("thrust_N", 2), "rpm": ("rpm", 0), "power W": ("power_W", 1)}
    cells = [
        [None if row[key] is None else f"{row[key]:z.{digits}f}" for key, digits in columns.values()] for row in rows
    ]
    print_table("n", list(columns), cells, title)
