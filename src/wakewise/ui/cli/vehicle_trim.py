"""`wakewise vehicle trim`: what ballast keeps the target's water stillest over a mission, or what a flight asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wakewise.ui.cli.console import answer, print_json, print_table
from wakewise.ui.cli.options import Force, Json, check_file

if TYPE_CHECKING:
    from wakewise.control.ballast_advice import TrimAdvice, TrimRow

KNOWN_TO_N = 0.5
"""A net weight that was measured or weighed is known to that."""


def trim(
    vehicle: Annotated[str | None, typer.Argument(help="Library name or vehicle file; paper if not given.")] = None,
    scenario: Annotated[Path | None, typer.Option(help="Scenario file with mission, target and tank.")] = None,
    net_weight: Annotated[
        float | None, typer.Option(metavar="N", help="Known net weight; negative if it floats.")
    ] = None,
    known_to: Annotated[
        float | None, typer.Option(metavar="N", help="How well: the trim lies within this, more or less.")
    ] = None,
    flight: Annotated[Path | None, typer.Option(help="Folder of a trial: trim from its hover.")] = None,
    write: Annotated[
        Path | None, typer.Option(help="With --flight: its scenario with the new ballast, as a file.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Advise on ballast: for a mission beforehand, or from the hover of a flight.

    For a mission: D and thrust of holding its poses by net buoyancy and centre of gravity. Advised is the least effort
    that is not worse by D, light by as much as the trim is unknown, since a heavy vehicle blows down; the least D by
    the wake model, bed points and wall jets included, is told beside it.

    From a flight: how heavy the vehicle was, where that sits, and which block takes it away. `wakewise scan FILE` flies
    with what --write left.
    """
    from wakewise.core.errors import InputError

    if flight is not None:
        others = {"VEHICLE": vehicle, "--scenario": scenario, "--net-weight": net_weight, "--known-to": known_to}
        given = [name for name, value in others.items() if value is not None]
        if given:
            raise InputError(f"--flight: says what was flown and how heavy it was, {given[0]} does not go with it")
        check_file(write, "--write", force)
        _from_flight(flight, write, json)
        return
    if write is not None:
        raise InputError("--write: writes what a flight asks for, give its folder with --flight")
    _for_mission(vehicle or "paper", scenario, net_weight, known_to, json)


def _from_flight(folder: Path, write: Path | None, json: bool) -> None:
    """Trim of a flight, and the scenario file that flies with it."""
    import shlex

    from wakewise.core.files import write_text
    from wakewise.operation.flight_trim import folder_trim
    from wakewise.operation.scenario import dump_scenario
    from wakewise.operation.trial_folder import BY_HAND

    parts, found = folder_trim(folder)
    trimmed = parts.scenario.model_copy(update={"ballast": (*parts.scenario.ballast, *found.blocks)})
    if write is not None:
        write_text(write, f"# {found.words}\n{dump_scenario(trimmed)}")
    figures = {
        "vehicle": parts.vehicle.name,
        "net_weight_N": found.heavy_N,
        "net_weight_std_N": found.weight_std_N,
        "moment_forward_Nm": float(found.moment_Nm[0]),
        "moment_starboard_Nm": float(found.moment_Nm[1]),
        "moment_std_Nm": [float(value) for value in found.moment_std_Nm],
        "blocks": [block.model_dump(mode="json") for block in found.blocks],
        "ballast": [block.model_dump(mode="json") for block in trimmed.ballast],
        "advice": found.advice,
    }
    command = "cockpit" if trimmed.pilot == BY_HAND and trimmed.control_log is None else "scan"
    # A folder of its own: that of the flight holds another trial.
    fly = shlex.join(["wakewise", command, str(write), "--out", f"runs/{folder.resolve().name}-trimmed"])
    written = None if write is None else f"written: {write}; fly with it: {fly}"
    answer(json, figures, f"{parts.vehicle.title}: {found.words}", written)


def _for_mission(
    vehicle: str, scenario: Path | None, net_weight: float | None, known_to: float | None, json: bool
) -> None:
    """Trim by the wake model over a mission's poses."""
    from wakewise.control import AllocationSettings
    from wakewise.control.ballast_advice import trim_advice
    from wakewise.operation import load_scenario
    from wakewise.robot.vehicles.ballast import net_buoyancy_N
    from wakewise.wake import wake_model

    chosen = load_scenario(None, scenario, {"vehicle": vehicle})
    parts = chosen.parts()
    _ = parts.preflight
    route, body = parts.route, parts.vehicle
    times = route.exposures_s[:: max(1, len(route.exposures_s) // 24)]
    poses = tuple(route.body(float(t), parts.aim).X_WB for t in times)
    wake = wake_model(chosen.control.wake.model_copy(update={"floor": True}), chosen.tank.size_m[2])
    settings = chosen.control.model_copy(update={"allocation": AllocationSettings(include_bed=True)})
    unknown_N = known_to
    if unknown_N is None:
        apart = chosen.tank.mismatch
        unasked_N = apart.trim_range_N if apart.trim_N is None else abs(apart.trim_N)
        unknown_N = unasked_N if net_weight is None else KNOWN_TO_N
    advice = trim_advice(body, poses, parts.region, wake, settings, net_weight_N=net_weight or 0.0, unknown_N=unknown_N)
    if json:
        print_json(
            {
                "vehicle": body.name,
                "poses": len(poses),
                "net_buoyancy_N": net_buoyancy_N(body) - (net_weight or 0.0),
                "unknown_trim_N": unknown_N,
                "rows": [asdict(row) for row in advice.rows],
                "now": asdict(advice.now),
                "best": asdict(advice.best),
                "gentlest": asdict(advice.gentlest),
                "advice": advice.words,
            }
        )
        return
    where = f"{len(poses)} poses, trim known to {unknown_N:g} N"
    speeds = f"{body.title}: water speed at the target in mm/s (by the wake model), {where}"
    _print_ballasts(speeds, advice, lambda row: 1e3 * row.speed_m_s)
    _print_ballasts(f"thrust to hold its poses in N, {where}", advice, lambda row: row.thrust_N)
    _print_ballasts("of it down in N", advice, lambda row: row.down_N)
    typer.echo(f"advice: {advice.words}")
    typer.echo(advice.wake_words)


def _print_ballasts(title: str, advice: TrimAdvice, value: Callable[[TrimRow], float]) -> None:
    """A figure of each ballast, by net buoyancy and centre of gravity; what is now and what is advised are marked."""
    shifts = sorted({row.shift_mm for row in advice.rows})
    rows = []
    for float_N in sorted({row.float_N for row in advice.rows}):
        found = {row.shift_mm: row for row in advice.rows if row.float_N == float_N}
        cells = (f"{_mark(advice, found[shift])}{value(found[shift]):z.2f}" for shift in shifts)
        rows.append((f"{float_N:+z.2f}", *cells))
    print_table("n", ("floats with N", *(f"CG {shift:+z.0f} mm" for shift in shifts)), rows, title)


def _mark(advice: TrimAdvice, row: TrimRow) -> str:
    marks = [word for word, one in (("now", advice.now), ("advised", advice.best)) if row == one]
    return f"{', '.join(marks)}: " if marks else ""
