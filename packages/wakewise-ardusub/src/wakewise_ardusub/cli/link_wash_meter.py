"""`wakewise link wash-meter`: live wash of a vehicle's thrusters on its target, flown and with gentler allocations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import print_json
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle as AnyVehicle
    from wakewise.scene.targets import Region
    from wakewise_ardusub.vehicle_summary import VehicleSummary
    from wakewise_ardusub.wash_meter.run import MeterLoop

Ahead = Annotated[
    float,
    typer.Option(
        "--ahead",
        metavar="M",
        help="From the bow to the middle of a ball of 0.5 m across, which stands for the target.",
    ),
]
Points = Annotated[
    Path | None,
    typer.Option(
        "--points",
        help="CSV with x_m, y_m, z_m from the middle of the vehicle (forward, right, down) and weight: what to spare "
        "instead.",
        show_default=False,
    ),
]
WakeModelName = Annotated[
    str, typer.Option("--wake-model", help="paper, paper-calibrated, fitted, linear, jet or jet-fitted.")
]
Vehicle = Annotated[
    str,
    typer.Option("--vehicle", help="Library name or vehicle YAML file."),
]


def wash_meter(
    connection: Annotated[
        str | None,
        typer.Option(
            metavar="ENDS",
            help="udpin:HOST:PORT, where the vehicle's router sends to; or udpout:HOST:PORT of a server that answers.",
        ),
    ] = None,
    vehicle: Vehicle = "bluerov2-heavy",
    ahead: Ahead = 0.4,
    points: Points = None,
    wake_model: WakeModelName = "jet",
    params: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The autopilot's parameters, as QGroundControl or `link log` writes them: channels and "
            "MOT_n_DIRECTION.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0 takes any that is free.", min=0, max=65535)] = 8766,
    host: Annotated[
        str,
        typer.Option(
            help="Address of the page. Any but this computer's own asks others for the token that is printed."
        ),
    ] = "127.0.0.1",
    no_token: Annotated[
        bool, typer.Option("--no-token", help="Let everybody look who reaches the page, as on a vehicle's own network.")
    ] = False,
    system: Annotated[
        int | None,
        typer.Option(
            min=1, max=255, help="MAVLink system id of the vehicle; the first with servo outputs if not given."
        ),
    ] = None,
    publish: Annotated[
        bool,
        typer.Option(
            "--publish", help="Send WW_D and WW_SAVED as NAMED_VALUE_FLOAT, so that ground stations show them."
        ),
    ] = False,
    ask: Annotated[
        bool,
        typer.Option("--ask", help="Ask the autopilot for SERVOn_FUNCTION and MOT_n_DIRECTION: it is read, not set."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for meter.csv and meter.json of the dive; none if not given.")
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the vehicle as a craft file for the meter on a small computer, and end."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Show in a page, live, the wash of a vehicle's thrusters on its target, and what gentler thrusts would save.

    It listens and never commands the vehicle; without --publish and --ask it sends nothing at all (with udpout: a
    heartbeat). Ctrl-C ends it.
    """
    from wakewise import wake
    from wakewise.core.errors import InputError
    from wakewise.robot.vehicles import load_vehicle
    from wakewise_ardusub.link.parameters import read_parameter_file
    from wakewise_ardusub.optional_dependencies import need
    from wakewise_ardusub.vehicle_summary import VehicleSummary
    from wakewise_ardusub.wash_meter.run import MeterSettings

    chosen = load_vehicle(vehicle)
    craft = VehicleSummary.of(chosen, wake.wake_model(wake_model))
    if write is not None:
        _write(write, craft)
        return
    need("wakewise link wash-meter", "links", only=("pymavlink",))
    if connection is None:
        raise InputError("--connection: missing, udpin:HOST:PORT or udpout:HOST:PORT is needed")
    settings = MeterSettings(
        connection=connection,
        host=host,
        port=port,
        token=not no_token,
        system=system,
        publish=publish,
        ask=ask,
        out=out,
    )
    from wakewise.core.jit.precompile import is_warm
    from wakewise_ardusub.wash_meter.run import MeterLoop

    region = region_ahead(chosen, ahead, points)
    known = {} if params is None else read_parameter_file(params)
    if not is_warm(("fly",)):
        _say("kernels are compiled first, this time only: some seconds")
    work = MeterLoop(settings, craft, region.points_W_m, region.weights, region_words(ahead, points), known, _say)
    state = _run(work)
    if json:
        print_json(state)


def region_ahead(vehicle: AnyVehicle, ahead: float, points: Path | None) -> Region:
    """Protected region in the vehicle's frame: a ball ahead of the bow, or the points of a file.

    Raises
    ------
    InputError
        If the ball is out of range, or the file holds no points outside the vehicle.
    """
    import numpy as np

    from wakewise.core.geometry import Pose
    from wakewise.scene.targets import Region
    from wakewise.ui.cli.points import read_points
    from wakewise_ardusub.logs.replay_allocation import bow_points

    if points is None:
        return bow_points(vehicle, ahead)
    places, weights = read_points(points, vehicle, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    return Region(points_W_m=places, weights=weights, distance_m=np.zeros(len(places)))


def region_words(ahead: float, points: Path | None) -> str:
    """The protected region in words."""
    return f"of {points}" if points is not None else f"of a ball {ahead:g} m ahead of the bow"


def _run(work: MeterLoop) -> dict[str, Any]:
    """Work until Ctrl-C, which ends it as it should end."""
    import signal

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: work.over.set())
    try:
        return work.run()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _write(path: Path, craft: VehicleSummary) -> None:
    from wakewise.core.errors import InputError
    from wakewise.core.files import write_text
    from wakewise_ardusub.vehicle_summary import vehicle_summary_json
    from wakewise_ardusub.wash_savings import WashSavingsCalculator

    text = vehicle_summary_json(craft)
    if not WashSavingsCalculator.is_small(craft):
        raise InputError(
            f"--write {path}: vehicle {craft.name} has spare thrusters that cannot be looked at one by one; its meter "
            "needs a 64-bit computer, which reads the vehicle file itself"
        )
    write_text(path, text)
    _say(f"written to    {path}")


def _say(line: str) -> None:
    typer.echo(line, err=True)
