"""`wakewise link ardusub`: fly a real ArduSub vehicle beside its pilot."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import print_json, status_line
from wakewise.ui.cli.options import Json, Sets
from wakewise_ardusub.cli.link_ardusub_check import (
    DEFAULT_MOTOR_RESULTS,
    Check,
    Motors,
    MotorTest,
    Params,
    Results,
    Untested,
    check_vehicle,
    test_vehicle_motors,
)

if TYPE_CHECKING:
    from wakewise_ardusub.link.connection import Endpoint
    from wakewise_ardusub.link.transports import Transport
    from wakewise_ardusub.session.session import ProtectedRegion, VehicleSession

DEFAULT_VEHICLE = "bluerov2-heavy"
LINE_S = 0.2


def ardusub(
    connection: Annotated[
        str,
        typer.Option(
            metavar="PLACE",
            help="Where the vehicle's MAVLink is: udpin:HOST:PORT waits for its router, udpout:HOST:PORT speaks first.",
        ),
    ] = "udpin:127.0.0.1:14560",
    vehicle: Annotated[str, typer.Option(help="Library name or vehicle YAML file.")] = DEFAULT_VEHICLE,
    method: Annotated[
        str, typer.Option(help="How thrusts are chosen, such as wake-aware, allocation-only or dp.")
    ] = "wake-aware",
    system: Annotated[
        int, typer.Option(min=1, max=255, help="The vehicle's MAVLink system id, which its companion shares.")
    ] = 1,
    target: Annotated[
        str | None,
        typer.Option(
            metavar="N,E,D",
            help="Where the middle of the target is, in m from the autopilot's origin: north, east, down.",
        ),
    ] = None,
    ahead: Annotated[
        float,
        typer.Option(
            metavar="M",
            help="Without --target: from the bow, as the session begins, to the middle of a ball of 0.5 m across.",
        ),
    ] = 0.4,
    points: Annotated[
        Path | None,
        typer.Option(
            help="CSV with x_m, y_m, z_m from the middle of the vehicle as the session begins (forward, right, down) "
            "and weight: what to spare instead of a ball."
        ),
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(
            metavar="LEFT,TOP,RIGHT,BOTTOM",
            help="The target's box in the camera's picture as the session begins, in shares of its width and height. "
            "A ground station may send another (MAV_CMD_CAMERA_TRACK_RECTANGLE).",
        ),
    ] = None,
    distance: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            min=0.1,
            max=20.0,
            help="From the camera to a target in a box, where no rangefinder (DISTANCE_SENSOR) tells it.",
        ),
    ] = None,
    video: Annotated[
        str | None,
        typer.Option(
            metavar="STREAM",
            help="The camera's stream: an address (rtsp://...), an .sdp file, or a number for a camera at this "
            "computer. The target of a box is mapped and tracked in it.",
        ),
    ] = None,
    video_delay: Annotated[
        float,
        typer.Option(
            metavar="S", min=0.0, max=1.5, help="How old a picture of the stream is when it arrives, 0 to 1.5 s."
        ),
    ] = 0.2,
    tilt: Annotated[
        float,
        typer.Option(
            metavar="DEG",
            min=-90.0,
            max=90.0,
            help="How far the camera is tilted up, where the autopilot reports no camera mount.",
        ),
    ] = 0.0,
    relay: Annotated[
        str | None,
        typer.Option(
            metavar="PLACE",
            help="Stand between ground station and vehicle: where the ground station sends, such as "
            "udpin:0.0.0.0:14550. Sticks go on let go while the companion drives. Without it the companion only "
            "listens to a copy.",
        ),
    ] = None,
    listen_only: Annotated[
        bool, typer.Option("--listen-only", help="Never engage, whatever anybody asks for.")
    ] = False,
    buttons: Annotated[
        str,
        typer.Option(
            metavar="WHAT=N,...",
            help="Buttons of the pilot's sticks, by number from 0: engage (which also releases), capture, scan, hold, "
            "stop, operator, precise, gain_up, gain_down. Those at which the autopilot itself acts (BTNn_FUNCTION) are "
            "refused; on a fresh ArduSub 0 and 15 are free.",
        ),
    ] = "",
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="WAY",
            help="What takes the photographs: mavlink (MAV_CMD_IMAGE_START_CAPTURE), digicam "
            "(MAV_CMD_DO_DIGICAM_CONTROL), or run:PROGRAM, its {file} the photograph's path. Without it they are "
            "noted and not taken.",
        ),
    ] = None,
    depths: Annotated[str, typer.Option(metavar="LEAST,MOST", help="Depths within which it drives (m).")] = "0.2,50",
    fence: Annotated[
        float, typer.Option(metavar="M", min=0.1, max=1000.0, help="Farthest from the target that it drives.")
    ] = 5.0,
    battery: Annotated[
        float, typer.Option(metavar="V", min=0.0, max=100.0, help="Least voltage at which it drives; 0: any.")
    ] = 0.0,
    sets: Sets = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for journal and record; runs/sea-VEHICLE-TIME if not given.")
    ] = None,
    check: Check = False,
    params: Params = None,
    motor_test: MotorTest = False,
    motors: Motors = None,
    motor_results: Results = DEFAULT_MOTOR_RESULTS,
    untested: Untested = False,
    json: Json = False,
) -> None:
    """Fly a real ArduSub vehicle beside its pilot: sticks ask for motion, thrusts are chosen to spare the target.

    Needs the script on the autopilot (`wakewise link install-script`); --check says whether all is well before
    anything moves. Type Enter, or press the button given as `engage`, to consent once all is well, and again to take
    the sticks back; any loss gives them back by itself. Ctrl-C lets go of the vehicle and ends.
    """
    from wakewise.core.errors import InputError
    from wakewise.core.optional_dependencies import need as need_extra
    from wakewise_ardusub.optional_dependencies import need

    if sum((check or params is not None, motor_test)) > 1:
        raise InputError("--check, --motor-test: one after the other, give one")
    if motors is not None and not motor_test:
        raise InputError("--motors: goes with --motor-test")
    meant = _buttons(buttons)
    if params is not None:
        check_vehicle(connection, vehicle, system, params, motor_results, buttons=meant, untested=untested, json=json)
        return
    need("wakewise link ardusub", "links", only=("pymavlink",))
    if video is not None:
        need_extra("wakewise link ardusub --video", "photos", only=("cv2",))
    if check:
        check_vehicle(connection, vehicle, system, None, motor_results, buttons=meant, untested=untested, json=json)
        return
    if motor_test:
        test_vehicle_motors(connection, vehicle, system, motors, motor_results, json=json)
        return
    import math
    import secrets

    from wakewise.operation import load_scenario, parse_overrides
    from wakewise_ardusub.link.connection import parse_connection
    from wakewise_ardusub.link.engagement_fsm import EngagementLimits
    from wakewise_ardusub.link.tracking_commands import checked_box
    from wakewise_ardusub.link.transports import MavlinkCodec
    from wakewise_ardusub.session.cameras import parse_camera
    from wakewise_ardusub.session.session import VehicleSession
    from wakewise_ardusub.session.vehicle_flight import SEA
    from wakewise_ardusub.session.video_stream import VideoSource

    vehicle_at = parse_connection(connection)
    ground_at = None if relay is None else parse_connection(relay, "--relay")
    changes = {**SEA, **parse_overrides(sets or []), "vehicle": vehicle, "method": method, "name": "sea"}
    scenario = load_scenario(None, None, changes)
    low, high = _numbers(depths, "--depths", "LEAST,MOST", 2)
    limits = EngagementLimits(depth_m=(low, high), distance_m=fence, battery_V=battery)
    gate_options: dict[str, Any] = {
        "limits": limits,
        "buttons": meant,
        "listen_only": listen_only,
        "system": system,
    }
    stream = None if video is None else VideoSource(place=video, delay_s=video_delay)
    made_camera = None if camera is None else parse_camera(camera)
    spare = _spare(vehicle, target, ahead, points)
    boxed = None if box is None else checked_box(_numbers(box, "--box", "LEFT,TOP,RIGHT,BOTTOM", 4))
    stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime())
    folder = out or Path("runs") / f"sea-{Path(vehicle).stem}-{stamp}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: a file is there, a folder is needed")
    with ExitStack() as stack:
        transport, finish = _carried(stack, vehicle_at, ground_at)
        post = MavlinkCodec(transport, system)
        session = VehicleSession(
            scenario=scenario,
            receiving=post,
            send=post.send,
            folder=folder,
            spare=spare,
            session=secrets.randbelow(2**31) + 1,
            gate_options=gate_options,
            camera=made_camera,
            box=boxed,
            distance_m=math.nan if distance is None else distance,
            video=stream,
            tilt_rad=math.radians(tilt),
        )
        finish(session)
        why = "ended"
        try:
            session.start()
            _watch(session, vehicle_at.words)
        except KeyboardInterrupt:  # how a session ends: nothing of it could be gone on with
            why = "Ctrl-C"
        finally:
            with _uninterrupted():
                session.stop(why)
            if session.gate.known.messages or session.fault is not None:
                _say(f"let go of the vehicle ({why}); kept: {folder}")
            else:
                session.journal.discard()
                _say(f"ended ({why}); nothing was heard, so nothing is kept")
    if session.fault is not None:
        raise session.fault
    if json:
        kept = str(folder) if folder.is_dir() else None
        print_json({"folder": kept, "engagements": session.gate.engagement.entries, **session.figures()})


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let a second, impatient Ctrl-C not cut short what lets go of the vehicle and writes its folder."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _carried(
    stack: ExitStack, vehicle_at: Endpoint, ground_at: Endpoint | None
) -> tuple[Transport, Callable[[VehicleSession], None]]:
    """What carries the bytes, and what is to be done once the session is there."""
    from wakewise.core.errors import InputError
    from wakewise_ardusub.link.mavlink_relay import MavlinkRelay
    from wakewise_ardusub.link.transports import RelayTransport, open_transport, open_udp

    if ground_at is None:
        transport = open_transport(vehicle_at)
        stack.callback(transport.close)
        return transport, lambda _: None
    for option, end in (("--connection", vehicle_at), ("--relay", ground_at)):
        if end.way not in ("udpin", "udpout"):
            raise InputError(f"{option} {end.words}: the relay forwards udpin:HOST:PORT and udpout:HOST:PORT only")
    if vehicle_at == ground_at:
        raise InputError(f"--relay {ground_at.words}: is the place of --connection, two are needed")
    tap = RelayTransport()
    sockets = [stack.enter_context(open_udp(end)) for end in (vehicle_at, ground_at)]
    known = [None if end.way == "udpin" else (end.host, end.port) for end in (vehicle_at, ground_at)]

    def begin(session: VehicleSession) -> None:
        gate = session.gate
        relay = MavlinkRelay(
            *sockets,
            driving=lambda: gate.entry is not None,
            heard=tap.put,
            vehicle_at=known[0],
            ground_at=known[1],
        )
        tap.out = relay.send
        relay.start()
        stack.callback(relay.stop)

    return tap, begin


def _watch(session: VehicleSession, where: str) -> None:
    """Show how it stands and hand key presses over, until the session is over."""
    import select

    from wakewise.core.errors import InputError

    terminal, told, due_s = sys.stderr.isatty(), "", 0.0
    keys = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
    consent = "no terminal, so only --buttons engage=N consents" if keys is None else "Enter consents and takes back"
    _say(f"listening at {where}; {consent}, Ctrl-C ends")
    while session.running:
        if session.gate.button_fault:
            raise InputError(session.gate.button_fault)
        if keys is None:
            time.sleep(LINE_S)
        elif select.select([keys], [], [], LINE_S)[0] and keys.readline():
            said = session.gate.press()
            session.journal.write("key", said=said)
            _say(f"{chr(13) if terminal else ''}{said}")
        line = session.line()
        if terminal:
            status_line(line)
        elif line.split("  ")[0] != told or time.monotonic() >= due_s:
            told, due_s = line.split("  ")[0], time.monotonic() + 5.0
            _say(line)


_FARTHEST_M = 10_000.0


def _spare(vehicle: str, target: str | None, ahead: float, points: Path | None) -> ProtectedRegion:
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise.core.geometry import Pose
    from wakewise.robot.importers import any_vehicle
    from wakewise.scene.targets import Region
    from wakewise_ardusub.logs.replay_allocation import bow_points
    from wakewise_ardusub.session.session import ProtectedRegion

    if target is not None and points is not None:
        raise InputError("--target, --points: both say what to spare, give one")
    if target is not None:
        place = np.array(_numbers(target, "--target", "N,E,D", 3))
        if np.abs(place).max() > _FARTHEST_M:
            raise InputError(f"--target {target!r}: is farther than {_FARTHEST_M:g} m from the autopilot's origin")
        return ProtectedRegion(place_W_m=place)
    chosen = any_vehicle(vehicle)
    if points is None:
        bow_points(chosen, ahead)  # refuses what is too near or too far
        return ProtectedRegion(ahead_m=ahead)
    from wakewise.ui.cli.points import read_points

    places, weights = read_points(points, chosen, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    return ProtectedRegion(points=Region(points_W_m=places, weights=weights, distance_m=np.zeros(len(places))))


def _numbers(text: str, option: str, form: str, count: int) -> tuple[float, ...]:
    import math

    from wakewise.core.errors import InputError

    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count or not all(map(math.isfinite, found)):
        raise InputError(f"{option} {text!r}: must be {form}, {count} finite numbers separated by commas")
    if option == "--depths" and not found[0] < found[1]:
        raise InputError(f"{option} {text!r}: the least depth must be less than the most")
    return found


def _buttons(text: str) -> dict[str, int]:
    """What buttons mean, from WHAT=N pairs."""
    from wakewise.core.errors import InputError
    from wakewise.operation.teleop.input import ACTIONS

    allowed = ("engage", *ACTIONS)
    found: dict[str, int] = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        what, _, number = pair.partition("=")
        if what not in allowed or not number.isdigit() or int(number) > 15:
            raise InputError(f"--buttons {pair!r}: must be WHAT=N, WHAT of {', '.join(allowed)}, N from 0 to 15")
        if int(number) in found.values() or what in found:
            raise InputError(f"--buttons {text!r}: {pair} is given twice")
        found[what] = int(number)
    return found


def _say(line: str) -> None:
    typer.echo(line, err=True)
