"""`wakewise link sitl` and `wakewise link sitl-autopilot`: physics behind ArduSub's firmware, and a simulated
autopilot.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import ProgressBars, format_value, print_json, status_line
from wakewise.ui.cli.options import Json, Preset, ScenarioFile, Sets, Vehicle, World, overrides, seed_option

if TYPE_CHECKING:
    from wakewise.core.arrays import Array
    from wakewise.robot.vehicles import Vehicle as AnyVehicle
    from wakewise_ardusub.physics import PhysicsFigures
    from wakewise_ardusub.sitl.sea_sensors import SeaSensors
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
    from wakewise_ardusub.sitl.udp_endpoints import PhysicsBackend
    from wakewise_ardusub.sitl_plant import DepthMonitor

DEFAULT_VEHICLE = "bluerov2-heavy"
_STATION, _COMPANION, _WATCH = "127.0.0.1:14550", "127.0.0.1:14560", "127.0.0.1:14570"

Seconds = Annotated[
    float | None, typer.Option("--seconds", min=0.1, help="End by itself after so long.", show_default=False)
]


def sitl(
    scenario: ScenarioFile = None,
    vehicle: Vehicle = None,
    world: World = None,
    preset: Preset = "quick",
    sets: Sets = None,
    port: Annotated[int, typer.Option(help="UDP port that physics listens on; 0 lets the system choose.")] = 9002,
    host: Annotated[str, typer.Option(help="Address it listens on; 0.0.0.0 lets other computers in.")] = "127.0.0.1",
    rate: Annotated[
        int | None, typer.Option(metavar="HZ", help="Steps a second; as the firmware asks if not given.")
    ] = None,
    params: Annotated[
        Path | None,
        typer.Option(
            help="The autopilot's .params: which output is which motor (SERVOn_FUNCTION), which turns the other way "
            "round (MOT_n_DIRECTION). Motors are on outputs 1, 2, ... if not given."
        ),
    ] = None,
    own_clock: Annotated[
        bool, typer.Option("--fast", help="Let the firmware run as fast as both can, not by the clock on the wall.")
    ] = False,
    held: Annotated[
        float,
        typer.Option(
            metavar="S",
            min=0.0,
            help="How long the vehicle is held at the surface, so that ArduSub calibrates its depth sensor there, "
            "before it is let down to its start; 0: it begins under water.",
        ),
    ] = 15.0,
    watch: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="Where a copy of the autopilot's MAVLink comes, whose depth is held against the truth; none: it is "
            "not.",
        ),
    ] = _WATCH,
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """Put a vehicle in its water behind ArduSub: ArduPilot's JSON physics link (`--model JSON`), until Ctrl-C.

    Start the firmware, or `wakewise link sitl-autopilot --physics 127.0.0.1:9002`, beside it. The vehicle starts anew
    when the firmware does: at the surface, and then let down to where the scenario starts it.
    """
    from wakewise.operation import load_scenario
    from wakewise_ardusub.physics import PhysicsServer, PulseTable
    from wakewise_ardusub.physics.physics import open_socket, serve
    from wakewise_ardusub.sitl.own_parameters import read_params
    from wakewise_ardusub.sitl_plant import SitlPlant

    if scenario is None and vehicle is None:
        vehicle = DEFAULT_VEHICLE
    chosen = overrides(sets, seed=None, vehicle=vehicle, target=None, target_size=None, world=world)
    flown = load_scenario(preset, scenario, chosen).parts()
    table = PulseTable.of(flown.vehicle, None if params is None else read_params(params))
    behind = SitlPlant(parts=flown, held_s=held)
    physics = PhysicsServer(behind.begin, table.thrusts, rate_hz=rate, own_clock=own_clock)
    with ExitStack() as stack:
        listening = stack.enter_context(open_socket(host, port))
        depths = _depth_watch(stack, watch)
        with ProgressBars().stage("water") as progress:
            warning = behind.ready(progress)
        if warning:
            typer.echo(warning, err=True)
        typer.echo(
            f"{flown.vehicle.name} in {flown.scenario.world} at UDP {host}:{listening.getsockname()[1]}; "
            "now start the firmware with --model JSON",
            err=True,
        )

        def said() -> None:
            figures = physics.figures()
            if depths is not None and not figures.stage:
                depths.look(figures.depth_m)
            status_line(_physics_line(figures, depths))

        with suppress(KeyboardInterrupt):
            serve(physics, listening, _until(seconds), said=said)
    figures = physics.figures()
    if json:
        seen = {} if depths is None else depths.facts()
        print_json({"vehicle": flown.vehicle.name, "world": flown.scenario.world, **asdict(figures), **seen})
    else:
        typer.echo(_physics_line(figures, depths))
        if figures.refused:
            typer.echo(f"last refused    {physics.why_refused}")


def sitl_autopilot(
    vehicle: Annotated[
        str, typer.Option(help="Library name or vehicle YAML file; 6 or 8 thrusters.")
    ] = DEFAULT_VEHICLE,
    physics: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Physics to fly in, such as `wakewise link sitl` at 127.0.0.1:9002; still water of its own if not "
            "given.",
        ),
    ] = None,
    out: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST:PORT",
            help=f"Where MAVLink goes; may be repeated. {_STATION} (ground station), {_COMPANION} (companion) and "
            f"{_WATCH} (`wakewise link sitl`, which compares depths) if not given.",
        ),
    ] = None,
    params: Annotated[Path | None, typer.Option(help="Parameters in place of its own, .params or .parm.")] = None,
    script: Annotated[Path | None, typer.Option(help="A Lua script in place of the one that is shipped.")] = None,
    no_script: Annotated[
        bool, typer.Option("--no-script", help="Without any script, as an autopilot is out of the box.")
    ] = False,
    pilot: Annotated[
        bool,
        typer.Option(
            "--pilot", help="With a pilot of its own, who arms, switches the script on and lets the sticks go."
        ),
    ] = False,
    relief: Annotated[
        str | None,
        typer.Option(
            metavar="SHAPE",
            help="A bed 5 m deep with a rangefinder above it, without --physics: flat, trapezoid or sawtooth.",
        ),
    ] = None,
    current: Annotated[
        float, typer.Option(metavar="M/S", min=0.0, max=0.5, help="Speed of a drawn current, with --relief.")
    ] = 0.0,
    seed: Annotated[
        int,
        typer.Option(callback=seed_option, help="Of relief, current and errors of sensors, with --relief."),
    ] = 0,
    loop: Annotated[float, typer.Option(metavar="HZ", help="Loops a second.")] = 100.0,
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """Simulate ArduSub in pure Python, until Ctrl-C: MAVLink, arming, modes, mixer, failsafes and the script.

    It is for trials and tests and no copy of the firmware: docs/sitl.md lists what it does and what it does not.
    """
    from wakewise.core.errors import InputError
    from wakewise_ardusub.optional_dependencies import need

    need("wakewise link sitl-autopilot", "links", only=("pymavlink", "lupa"))
    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.link.protocol import ALT_HOLD
    from wakewise_ardusub.sitl.inprocess_session import ScriptedGroundStation, route_messages
    from wakewise_ardusub.sitl.own_parameters import own_parameters, read_params
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
    from wakewise_ardusub.sitl.udp_endpoints import UdpEndpoint, UdpPhysics, run

    if script is not None and no_script:
        raise InputError("--script and --no-script: one or the other")
    if relief is None and current:
        raise InputError("--current: goes with --relief")
    if relief is not None and physics is not None:
        raise InputError("--relief, --physics: the bed is of the stand-in's own water, give one")
    sea = None if relief is None else _sea(relief, current, seed)
    chosen = any_vehicle(vehicle)
    values = own_parameters(len(chosen.thrusters)) | ({} if params is None else read_params(params))
    scripts = {} if no_script else _scripts(script)
    # Water of its own has no surface to start at: there it was carried down, switched on, to where it is.
    zero_m = 0.0 if physics is None else None
    made = SimulatedAutopilot(
        values | {"SCHED_LOOP_RATE": loop},
        loop_hz=loop,
        scripts=scripts,
        zero_depth_m=zero_m,
        sensors=None if sea is None else sea[0],
    )
    if sea is not None:
        made.set_mode(ALT_HOLD)  # in MANUAL the current would carry it away, and its weight down
    behind = _embedded(chosen, values, sea) if physics is None else UdpPhysics(*_address("--physics", physics))
    outs = out or [_STATION, _COMPANION, _WATCH]
    links = [UdpEndpoint(*_address("--out", each), out=True) for each in outs]
    typer.echo(f"simulated ArduSub, system {made.system}: MAVLink to {', '.join(outs)}", err=True)
    with ExitStack() as held:
        held.enter_context(suppress(KeyboardInterrupt))
        held.callback(behind.close)
        for link in links:
            held.callback(link.close)
        turn = ScriptedGroundStation(made, route_messages(made, links)).turn if pilot else None
        run(made, behind, links, _until(seconds), turn=turn, said=lambda: status_line(_autopilot_line(made)))
    if json:
        print_json(_autopilot_facts(made))
    else:
        typer.echo(_autopilot_line(made))


def _scripts(file: Path | None) -> dict[str, str]:
    """The script that is shipped, or another one."""
    from wakewise.core.errors import InputError
    from wakewise_ardusub.sitl.inprocess_session import shipped_script

    if file is None:
        return shipped_script()
    try:
        return {file.name: file.read_text("latin-1")}
    except OSError as fault:
        raise InputError(f"--script {file}: {fault.strerror}") from None


_Sea = tuple["SeaSensors", "Callable[[float], Array]"]


def _sea(name: str, speed_m_s: float, seed: int) -> _Sea:
    """Sensors above a drawn bed, and a drawn current."""
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise_ardusub.sitl.sea_sensors import SHAPES, Relief, SeaSensors, SensorErrors, drawn_current

    shape = next((known for known in SHAPES if known == name), None)
    if shape is None:
        raise InputError(f"--relief {name!r}: must be {', '.join(SHAPES)}")
    rng = np.random.default_rng(seed)
    return SeaSensors(Relief.drawn(shape, rng), SensorErrors(), rng), drawn_current(rng, speed_m_s)


def _embedded(vehicle: AnyVehicle, values: dict[str, float], sea: _Sea | None) -> PhysicsBackend:
    import numpy as np

    from wakewise.core.geometry import Pose
    from wakewise.core.interfaces import BodyState
    from wakewise_ardusub.physics import FreeWater, PulseTable
    from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics

    body = FreeWater(vehicle)
    if sea is not None:
        start = Pose(np.array([0.0, 0.0, 3.4]), np.array([1.0, 0.0, 0.0, 0.0]))
        body = FreeWater(vehicle, BodyState(X_WB=start), sea[1])
    return InProcessPhysics(body=body, table=PulseTable.of(vehicle, values))


def _address(option: str, text: str) -> tuple[str, int]:
    from wakewise.core.errors import InputError

    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or not 0 < int(port) <= 65535:
        raise InputError(f"{option} {text}: must be HOST:PORT, such as 127.0.0.1:14550")
    return host, int(port)


def _until(seconds: float | None) -> Callable[[], bool]:
    end_s = None if seconds is None else time.monotonic() + seconds
    return lambda: end_s is None or time.monotonic() < end_s


def _depth_watch(stack: ExitStack, where: str) -> DepthMonitor | None:
    """What holds the autopilot's depth against the truth; None, and a line, where nothing can be overheard."""
    from wakewise.core.errors import EnvironmentFailure
    from wakewise_ardusub.link.connection import parse_connection
    from wakewise_ardusub.optional_dependencies import ARDUSUB
    from wakewise_ardusub.sitl_plant import DepthMonitor

    if where == "none":
        return None
    _address("--watch", where)
    if not ARDUSUB.has("links"):
        typer.echo("the autopilot's depth is not compared: the extra `links` is not installed", err=True)
        return None
    from wakewise_ardusub.link.protocol import DEFAULT_SYSTEM
    from wakewise_ardusub.link.transports import MavlinkCodec, open_transport

    try:
        transport = open_transport(parse_connection(f"udpin:{where}", "--watch"))
    except EnvironmentFailure as fault:
        if where != _WATCH:
            raise
        typer.echo(f"the autopilot's depth is not compared: {fault} (--watch HOST:PORT takes another)", err=True)
        return None
    stack.callback(transport.close)
    return DepthMonitor(MavlinkCodec(transport, DEFAULT_SYSTEM))


def _physics_line(figures: PhysicsFigures, depths: DepthMonitor | None) -> str:
    if not figures.frames:
        return f"no firmware yet; {figures.refused} datagrams refused"
    pulses = " ".join(str(pulse) for pulse in figures.pulses_us[:8])
    where = figures.stage or ("" if depths is None else depths.words)
    return (
        f"{format_value(figures.rate_hz)} Hz, {figures.lost} lost, {figures.repeats} repeated, "
        f"{figures.refused} refused; t {figures.time_s:.1f} s, "
        f"depth {figures.depth_m or 0.0:.2f} m{', ' if where else ''}{where}; pulses {pulses}"
    )


def _autopilot_line(made: SimulatedAutopilot) -> str:
    from wakewise_ardusub.sitl.modes import MODES

    pulses = " ".join(str(pulse) for pulse in made.pulses_us[:8])
    state = f"{'armed' if made.armed else 'disarmed'}, {MODES.get(made.mode, made.mode)}"
    depth_m = float(made.motion.p_WB_m[2])
    said = f"; {made.texts[-1]}" if made.texts else ""
    return f"t {made.now_s:.1f} s, {state}, depth {depth_m:.2f} m; pulses {pulses}{said}"


def _autopilot_facts(made: SimulatedAutopilot) -> dict[str, Any]:
    return {
        "time_s": made.now_s,
        "armed": made.armed,
        "mode": made.mode,
        "depth_m": float(made.motion.p_WB_m[2]),
        "pulses_us": list(made.pulses_us),
        "bad_data": made.bad_data,
        "script_faults": made.script_faults,
        "texts": list(made.texts)[-10:],
    }
