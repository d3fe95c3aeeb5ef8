"""`wakewise link sensors`: live values of the sensors of a companion computer."""

from __future__ import annotations

import math
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import format_value, print_json
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise_ardusub.sensors.sensor_polling import PolledSensor


def sensors(
    depth: Annotated[Path | None, typer.Option(metavar="BUS", help="I2C bus of an MS5837, /dev/i2c-1.")] = None,
    depth_model: Annotated[str, typer.Option(help="30BA (Bar30) or 02BA (Bar02).")] = "30BA",
    imu: Annotated[
        Path | None, typer.Option(metavar="PORT", help="Serial port of a WitMotion JY901, /dev/ttyUSB0.")
    ] = None,
    baud: Annotated[int, typer.Option(help="Of the inertial unit.")] = 9600,
    imu_axes: Annotated[
        str, typer.Option(help="Where the unit's x, y and z point: forward, back, right, left, down, up.")
    ] = "right,forward,up",
    poses: Annotated[
        str | None, typer.Option(metavar="PORT", help="UDP port, or ADDRESS:PORT, to which lines with poses come.")
    ] = None,
    forward: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Hand poses on as MAVLink's VISION_POSITION_ESTIMATE, over UDP."),
    ] = None,
    system: Annotated[
        int, typer.Option(help="Id of the vehicle of which --forward sends poses (SYSID_THISMAV).", min=1, max=255)
    ] = 1,
    density: Annotated[float, typer.Option(help="Of the water, kg/m3: 1000 fresh, 1025 salt.")] = 1000.0,
    zero: Annotated[
        bool, typer.Option("--zero", help="The vehicle is at the surface now: take its pressure for depth 0.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(help="End after so long; else on Ctrl-C.", min=0.1)] = None,
    json: Json = False,
) -> None:
    """Show what depth sensor, inertial unit and senders of poses say, live: values, rates, and what goes wrong.

    A pose is a line of JSON, {"t": s, "p": [north, east, down], "q": [w, x, y, z]}, or of the same numbers separated by
    commas (docs/sensors.md). With --json the figures at the end are printed; give --seconds.
    """
    from wakewise.core.errors import InputError
    from wakewise_ardusub.sensors import PoseForwarder
    from wakewise_ardusub.sensors.sensor_polling import watch

    if json and seconds is None:
        raise InputError("--json: prints the figures at the end; give --seconds")
    told: list[dict[str, Any]] = []
    with ExitStack() as stack:
        if forward is not None and poses is None:
            raise InputError("--forward: goes with --poses")
        forwarder = None if forward is None else stack.enter_context(closing(PoseForwarder(forward, system)))
        sources = _sources(stack, depth, depth_model, imu, baud, imu_axes, poses, density, zero)
        try:
            for told in watch(sources, math.inf if seconds is None else seconds, every_s=1.0, passed=forwarder):
                if not json:
                    for line in told:
                        typer.echo(_line(line))
        except KeyboardInterrupt:
            pass
    passed = None if forwarder is None else {"to": forward, "sent": forwarder.sent, "not_sent": forwarder.lost}
    if json:
        print_json({"sensors": told, "forwarded": passed})
    elif passed is not None:
        typer.echo(f"handed on  {passed['sent']} poses to {forward}, {passed['not_sent']} could not be")


def _sources(
    stack: ExitStack,
    depth: Path | None,
    depth_model: str,
    imu: Path | None,
    baud: int,
    imu_axes: str,
    poses: str | None,
    density: float,
    zero: bool,
) -> list[PolledSensor]:
    from wakewise.core.errors import InputError
    from wakewise_ardusub.sensors import DepthSensor, I2CBus, InertialUnit, LinePoses, SerialPort, UdpSocket, mounting
    from wakewise_ardusub.sensors.sensor_polling import DepthSource, InertialSource, PoseSource

    sources: list[PolledSensor] = []
    if zero and depth is None:
        raise InputError("--zero: goes with --depth")
    if depth is not None:
        bus = stack.enter_context(closing(I2CBus(depth)))
        sensor = DepthSensor(bus, depth_model, density=density)
        if zero:
            typer.echo(f"surface pressure {sensor.zero() / 100.0:.1f} mbar", err=True)
        sources.append(DepthSource(sensor, str(depth)))
    if imu is not None:
        unit = InertialUnit(mounting([axis.strip() for axis in imu_axes.split(",")]))
        sources.append(InertialSource(unit, stack.enter_context(closing(SerialPort(imu, baud))), str(imu)))
    if poses is not None:
        port = stack.enter_context(UdpSocket(poses))
        typer.echo(f"poses are listened for on UDP port {port.port}", err=True)
        sources.append(PoseSource(LinePoses(), port, poses))
    if not sources:
        raise InputError("link sensors: none named; give --depth, --imu or --poses")
    return sources


def _line(told: dict[str, Any]) -> str:
    """A source in one line."""
    values = ", ".join(f"{name} {_value(value)}" for name, value in told["last"].items()) or "nothing yet"
    amiss = f"; {told['bad']} bad" + (f" ({told['complaint']})" if told["complaint"] else "") if told["bad"] else ""
    return f"{told['sensor']:<6} {told['rate_hz']:6.1f} Hz  {values}{amiss}"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(f"{x:.3f}" for x in value)
    return f"{value:.3f}" if isinstance(value, float) else format_value(value)
