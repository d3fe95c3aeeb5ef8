"""`wakewise link`: real vehicles and what they recorded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import ProgressBars, format_value, print_json, write_page
from wakewise.ui.cli.options import Json
from wakewise_ardusub.cli import link_ardusub, link_install_script, link_orbit, link_route, link_sitl, link_transect
from wakewise_ardusub.cli.link_sensors import sensors
from wakewise_ardusub.cli.link_wash_meter import Ahead, Points, WakeModelName, region_ahead, region_words, wash_meter

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle
    from wakewise.scene.targets import Region
    from wakewise_ardusub.logs.channels import VehicleLog
    from wakewise_ardusub.logs.replay_allocation import ReplayedAllocation
    from wakewise_ardusub.logs.table import LogTable

app = typer.Typer(help="Real vehicles and what they recorded.")
app.command("wash-meter")(wash_meter)
app.command("sensors")(sensors)

app.command("ardusub")(link_ardusub.ardusub)
app.command("install-script")(link_install_script.install_script)
app.command("route")(link_route.route)
app.command("transect")(link_transect.transect)
app.command("orbit")(link_orbit.orbit)
app.command("sitl")(link_sitl.sitl)
app.command("sitl-autopilot")(link_sitl.sitl_autopilot)

DEFAULT_VEHICLE = "bluerov2-heavy"


@app.command("log")
def log(
    file: Annotated[
        Path, typer.Argument(help="A telemetry log (.tlog), the autopilot's own (.BIN) or BlueOS's recording (.mcap).")
    ],
    vehicle: Annotated[
        str | None,
        typer.Option(
            help="Library name or vehicle YAML file of the vehicle that was flown; bluerov2-heavy if not given."
        ),
    ] = None,
    ahead: Ahead = 0.4,
    points: Points = None,
    wake_model: WakeModelName = "jet",
    any_vehicle: Annotated[
        bool,
        typer.Option(
            "--any-vehicle",
            help="Read the log of another vehicle than an ArduSub, too: attitude, height, outputs and voltage, "
            "without thrusts, sticks and names of modes.",
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for table, figures and page; runs/log-NAME if not given.")
    ] = None,
    json: Json = False,
) -> None:
    """Read a vehicle's log, however damaged, and say what gentler thrusts would have spared at each instant.

    Leaves steps.parquet (sticks, servo outputs, depth, attitude, pose, thrusts, D on one clock), log.json,
    parameters.csv and report.html: a folder that `wakewise export` takes to rosbag2 and tum like a trial's. A bad
    record is a packet with a wrong checksum, or a stretch of bytes that is no record. What vehicle it is of is asked of
    its heartbeats or its firmware's name: another than an ArduSub is refused.
    """
    from wakewise.core.errors import InputError
    from wakewise.core.optional_dependencies import has
    from wakewise.robot.vehicles import load_vehicle
    from wakewise_ardusub.logs.read import read_log
    from wakewise_ardusub.logs.table import log_facts, tabulate, write_folder

    chosen = load_vehicle(vehicle or DEFAULT_VEHICLE)
    region = region_ahead(chosen, ahead, points)
    folder = out or Path("runs") / f"log-{file.stem}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: a file is there, a folder is needed")
    bars = ProgressBars()
    with bars.stage("reading"):
        found = read_log(file, any_vehicle=any_vehicle)
        table = tabulate(found)
    with bars.stage("hindsight"):
        looked, why_not = _hindsight(found, table, chosen, region, wake_model, named=vehicle is not None)
    facts = {
        "vehicle": found.identity.words if found.identity.is_other else chosen.name,
        "wake_model": wake_model,
        "points": region_words(ahead, points),
        **log_facts(found, table, looked, why_not),
    }
    write_folder(folder, found, table, looked, facts)
    facts["folder"] = str(folder)
    page = has("reports")
    if page:
        from wakewise_ardusub.reports.log import write_log_page

        write_page("page", lambda: write_log_page(folder, [thruster.name for thruster in chosen.thrusters]))
    if json:
        print_json(facts)
    else:
        _show(facts, folder, page)


def _hindsight(
    found: VehicleLog, table: LogTable, vehicle: Vehicle, region: Region, wake_model: str, *, named: bool
) -> tuple[ReplayedAllocation | None, str | None]:
    """Flown thrusts against others, or why there is none; a vehicle that was named must fit, the default may not."""
    from wakewise import wake
    from wakewise.core.errors import InputError
    from wakewise_ardusub.logs.replay_allocation import replay_log

    model = wake.wake_model(wake_model)
    if found.identity.is_other:
        why = f"are judged for an ArduSub only, this is {found.identity.words}"
        if named:
            raise InputError(f"--vehicle {vehicle.name}: thrusters {why}; leave the option out")
        return None, why
    if not found.identity.is_known and not named:
        return None, "are not judged: nothing in the log says what vehicle it is of, --vehicle NAME does"
    if "servo" not in found.series:
        return None, "the log holds no servo outputs"
    try:
        return replay_log(table.rows, found.parameters, vehicle, region, model), None
    except InputError as fault:
        if named:
            raise
        return None, str(fault)


def _show(facts: dict[str, Any], folder: Path, page: bool) -> None:
    from wakewise.core.optional_dependencies import how_to_install

    reasons = ", ".join(f"{count} {reason}" for reason, count in facts["bad_by_reason"].items())
    bad = f"{facts['bad_records']} bad" + (f" ({reasons}; {facts['bad_bytes']} bytes)" if reasons else "")
    cut = "; the file ends within a record" if facts["cut_short"] else ""
    typer.echo(f"{facts['file']}: {facts['format']}, {facts['records']} records, {bad}{cut}")
    for jump in facts["clock_jumps"][:5]:
        typer.echo(f"clock           jumped by {jump['step_s']:+.1f} s at {jump['time_s']:.1f} s; taken out")
    if len(facts["clock_jumps"]) > 5:
        typer.echo(f"                and {len(facts['clock_jumps']) - 5} more jumps")
    if facts["unread_records"]:
        unread = ", ".join(f"{count} {name}" for name, count in facts["unread_records"].items())
        typer.echo(f"not read        records of other fields than are known: {unread}")
    system = "" if facts["system"] is None else f", system {facts['system']}"
    others = f"; others left aside: {facts['other_systems']}" if facts["other_systems"] else ""
    typer.echo(f"vehicle         {facts['identity']}{system}{others}")
    modes = ", ".join(f"{mode} {seconds:.0f} s" for mode, seconds in facts["modes"].items())
    typer.echo(
        f"time            {facts['duration_s']:.0f} s, armed {facts['armed_s']:.0f} s; {modes or 'no mode said'}"
    )
    what = "height" if "height_max_m" in facts else "depth"
    typer.echo(f"{what:16}{format_value(facts[f'{what}_max_m'])} m at most, from {facts['depth_from'] or 'nothing'}")
    if "why_no_hindsight" in facts:
        typer.echo(f"thrusters       {facts['why_no_hindsight']}")
    elif not facts["running_s"]:
        typer.echo("thrusters       none ran, so there is nothing to spare")
    else:
        flown, least, gentle = (format_value(facts[f"disturbance_{k}"]) for k in ("flown", "least", "gentle"))
        typer.echo(f"thrusters       ran {facts['running_s']:.0f} s as {facts['vehicle']}'s")
        typer.echo(f"mean D          {flown} (m/s)^2 as flown, {least} with least thrusts, {gentle} with gentle ones")
        if facts["saved_pct"] is not None:
            typer.echo(f"saved           {facts['saved_pct']:.1f} % of D as flown, at points {facts['points']}")
        else:
            typer.echo(f"saved           nothing to: no jet moves the points by 0.1 mm/s ({facts['points']})")
    typer.echo(f"written to      {folder}" + ("" if page else f" (no page: {how_to_install('reports')})"))
