"""`wakewise link transect`: a slow survey on stock ArduSub by GUIDED targets."""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import format_value, print_json, status_line
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise_ardusub.link.transports import MavlinkCodec
    from wakewise_ardusub.survey.transect_session import MakeLines, TransectSession

DEFAULT_VEHICLE = "bluerov2-heavy"
LOOP_S, LINE_S, LINE_PIPED_S, ENDS_S = 0.02, 0.2, 5.0, 3.0


def transect(
    connection: Annotated[
        str,
        typer.Option(
            metavar="PLACE",
            help="Where the vehicle's MAVLink is: udpin:HOST:PORT waits for its router, udpout:HOST:PORT speaks first.",
        ),
    ] = "udpin:127.0.0.1:14560",
    length: Annotated[
        float | None,
        typer.Option(metavar="M", help="One line of this length from here; 20 if neither --area nor --map is given."),
    ] = None,
    area: Annotated[
        str | None, typer.Option(metavar="WIDTHxLENGTH", help="A lawnmower from here, m: lines of LENGTH side by side.")
    ] = None,
    spacing: Annotated[float, typer.Option(metavar="M", help="Between two lines of --area.")] = 0.5,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", help="GeoJSON or KML file with one LineString in WGS 84 (longitude, latitude)."),
    ] = None,
    heading: Annotated[
        str,
        typer.Option(
            metavar="DEG", help="Of the line or of --area: degrees from north; here (as it is) or current (against it)."
        ),
    ] = "here",
    speed: Annotated[float, typer.Option(metavar="M/S", help="0.05 to 0.30.")] = 0.1,
    altitude: Annotated[float, typer.Option(metavar="M", help="Of the rangefinder above the bed.")] = 0.8,
    every: Annotated[float, typer.Option(metavar="M", help="Metres between two photographs; 0: none.")] = 0.0,
    camera: Annotated[
        str, typer.Option(help="mavlink (MAV_CMD_IMAGE_START_CAPTURE) or digicam (MAV_CMD_DO_DIGICAM_CONTROL).")
    ] = "mavlink",
    current: Annotated[
        str,
        typer.Option(
            metavar="M/S,DEG", help="Speed and direction that the water goes to; felt (from holding the place)."
        ),
    ] = "felt",
    range_delay: Annotated[
        float, typer.Option(metavar="S", help="Delay of the rangefinder: about 0.3 of a DVL A50, 0.8 of a Ping.")
    ] = 0.3,
    gap: Annotated[
        float, typer.Option(metavar="S", help="Longest drop-out of the rangefinder flown through at a held depth.")
    ] = 0.8,
    fence: Annotated[float, typer.Option(metavar="M", help="Farthest from the start that a line may reach.")] = 200.0,
    vehicle: Annotated[
        str, typer.Option(help="Library name or vehicle YAML file; its drag gives the current.")
    ] = DEFAULT_VEHICLE,
    system: Annotated[int, typer.Option(min=1, max=255, help="The vehicle's MAVLink system id.")] = 1,
    consent: Annotated[
        bool,
        typer.Option(
            "--consent", help="Begin as soon as all is well: giving it is the consent, as Enter otherwise is."
        ),
    ] = False,
    wait: Annotated[float, typer.Option(metavar="S", min=1.0, help="How long to wait until all is well.")] = 120.0,
    out: Annotated[Path | None, typer.Option(help="Folder for the journal; runs/transect-TIME if not given.")] = None,
    json: Json = False,
) -> None:
    """Fly slow lines at an altitude above the bed on stock ArduSub: GUIDED targets, no motor override, no script.

    The pilot arms and keeps the sticks. Enter (or setting GUIDED) consents; Enter pauses and goes on, q and Enter or
    Ctrl-C ends. Any stick, mode change or loss ends it in POSHOLD; if this program dies, ArduSub stops after 3 s.
    """
    from wakewise.core.errors import EnvironmentFailure, InputError
    from wakewise_ardusub.optional_dependencies import need

    need("wakewise link transect", "links", only=("pymavlink",))
    import secrets

    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.link.connection import parse_connection
    from wakewise_ardusub.link.session_log import JOURNAL_FILE, SessionLog
    from wakewise_ardusub.link.transports import MavlinkCodec, open_transport
    from wakewise_ardusub.survey.survey_plan import SurveyPace
    from wakewise_ardusub.survey.survey_safety import SurveyLimits
    from wakewise_ardusub.survey.transect_session import TransectOptions, TransectSession

    pace = SurveyPace(speed_m_s=speed, altitude_m=altitude)
    lines = _lines(length, area, spacing, map_file, heading)
    for option, value, least, most in (
        ("--every", every, 0.0, 1000.0), ("--range-delay", range_delay, 0.0, 2.0), ("--gap", gap, 0.3, 5.0),
        ("--fence", fence, 1.0, 5000.0),
    ):  # fmt: skip
        if not least <= value <= most:
            raise InputError(f"{option} {value:g}: must be from {least:g} to {most:g}")
    if camera not in ("mavlink", "digicam"):
        raise InputError(f"--camera {camera!r}: must be mavlink or digicam")
    chosen = any_vehicle(vehicle)
    if altitude < 0.5 * chosen.size_m[2] + 0.2:
        raise InputError(f"--altitude {altitude:g}: the hull is {chosen.size_m[2]:.2f} m high, it would touch the bed")
    options = TransectOptions(
        pace=pace,
        limits=SurveyLimits(range_s=gap, fence_m=fence),
        delay_s=range_delay,
        current_W_m_s=None if current == "felt" else _current(current),
        camera=camera,
        every_m=every,
    )
    vehicle_at = parse_connection(connection)
    folder = out or Path("runs") / f"transect-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: a file is there, a folder is needed")
    with ExitStack() as stack:
        transport = open_transport(vehicle_at)
        stack.callback(transport.close)
        codec = MavlinkCodec(transport, system)
        journal = SessionLog(folder / JOURNAL_FILE)
        stack.callback(journal.close)
        session = TransectSession(
            send=codec.send,
            lines=lines,
            vehicle=chosen,
            options=options,
            clock=time.monotonic,
            journal=journal,
            system=system,
            session=secrets.randbelow(2**31) + 1,
        )
        typer.echo(f"listening at {vehicle_at.words}; journal: {folder / JOURNAL_FILE}", err=True)
        _fly(session, codec, consent=consent, wait_s=wait)
    figures = {"folder": str(folder), **session.figures()}
    if json:
        print_json(figures)
    else:
        for name, value in figures.items():
            typer.echo(f"{name:24}{format_value(value)}")
    if session.refused:
        raise InputError(session.refused)
    if not session.finished:
        raise EnvironmentFailure(f"survey ended after {figures['flown_m']:.1f} m: {session.ended_by or session.why}")


def _fly(session: TransectSession, codec: MavlinkCodec, *, consent: bool, wait_s: float) -> None:
    """Receive, judge and send until it is over; Ctrl-C ends it in the firmware's hold."""
    from wakewise.core.errors import InputError

    keys = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
    began_s = told_s = time.monotonic()
    told, asked, ends_s = "", False, math.inf
    while session.state != "ended" and time.monotonic() < ends_s:
        try:
            said, _ = codec.receive(LOOP_S)
            for message in said:
                session.take(message)
            session.tick()
            now_s = time.monotonic()
            if keys is not None:
                _key(session, keys)
            if session.state == "ready" and consent and not asked:
                asked = True
                session.consent()
            begun = asked or session.plan is not None
            if not begun and session.state == "waiting" and now_s - began_s > wait_s:
                raise InputError(f"survey not begun within {wait_s:g} s: {session.why}")
            if session.ended_by and session.state in ("waiting", "ready") and keys is None:
                return  # nobody is there to go on
            line = session.line()
            if sys.stderr.isatty() and now_s - told_s >= LINE_S:
                told_s = now_s
                status_line(line)
            elif not sys.stderr.isatty() and (line.split("  ")[0] != told or now_s - told_s >= LINE_PIPED_S):
                told, told_s = line.split("  ")[0], now_s
                typer.echo(line, err=True)
        except KeyboardInterrupt:
            session.abort("Ctrl-C")
            ends_s = min(ends_s, time.monotonic() + ENDS_S)


def _key(session: TransectSession, keys: Any) -> None:
    import select

    if not select.select([keys], [], [], 0.0)[0]:
        return
    word = keys.readline()
    if word.strip().lower() == "q":
        session.abort("Ctrl-C: q")
    elif word:
        said = session.pause() if session.state == "flying" else session.consent()
        typer.echo(f"\r{said}", err=True)


def _lines(length: float | None, area: str | None, spacing: float, map_file: Path | None, heading: str) -> MakeLines:
    """What makes the lines once the vehicle's place, heading and the current are known."""
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise_ardusub.survey.survey_plan import SHORTEST_M, WEAK_M_S, ordered, parallel_lines, upstream_side

    if sum((length is not None, area is not None, map_file is not None)) > 1:
        raise InputError("--length, --area, --map: give one of them")
    if map_file is not None:
        if heading != "here":
            raise InputError("--heading: the map has it")
        return _map_lines(map_file)
    width_m, length_m = (SHORTEST_M, 20.0 if length is None else length) if area is None else _area(area)
    apart_m = spacing if area is not None else 2.0 * SHORTEST_M
    given = None if heading in ("here", "current") else _degrees(heading)
    parallel_lines(np.zeros(2), 0.0, width_m, length_m, apart_m, 1)  # refuses sizes before anything is connected

    def make(place: Any, here_rad: float, current: Any, _anchor: Any) -> list[Any]:
        along = here_rad if given is None else given
        if heading == "current" and math.hypot(*current) >= WEAK_M_S:
            along = math.atan2(-current[1], -current[0])
        side = upstream_side(along, current)
        lines = parallel_lines(place, along, width_m, length_m, apart_m, side)
        return lines if area is None else ordered(lines, current) if heading == "here" else lines

    return make


def _map_lines(path: Path) -> MakeLines:
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise_ardusub.survey.map_files import local_m, read_map
    from wakewise_ardusub.survey.survey_plan import ordered

    corners = read_map(path)
    local_m(corners, *corners[0])  # refuses what is too far apart before anything is connected

    def make(_place: Any, _heading: float, current: Any, anchor: Any) -> list[Any]:
        if anchor is None:
            raise InputError(f"{path}: the autopilot does not tell where it is on the globe (GLOBAL_POSITION_INT)")
        places = np.array([anchor.north_m, anchor.east_m]) + local_m(corners, anchor.latitude_deg, anchor.longitude_deg)
        return ordered([places[k : k + 2] for k in range(len(places) - 1)], current)

    return make


def _area(text: str) -> tuple[float, float]:
    from wakewise.core.errors import InputError

    try:
        width, length = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--area {text!r}: must be WIDTHxLENGTH in m, such as 4x20") from None
    return width, length


def _degrees(text: str) -> float:
    from wakewise.core.errors import InputError

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not -360.0 <= value <= 360.0:
        raise InputError(f"--heading {text!r}: must be degrees from north, here or current")
    return math.radians(value)


def _current(text: str) -> tuple[float, float]:
    from wakewise.core.errors import InputError

    try:
        speed, towards = (float(part) for part in text.split(","))
    except ValueError:
        speed = towards = math.nan
    if not (0.0 <= speed <= 1.0 and -360.0 <= towards <= 360.0):
        raise InputError(f"--current {text!r}: must be M/S,DEG, a speed up to 1 and where the water goes to, or felt")
    return speed * math.cos(math.radians(towards)), speed * math.sin(math.radians(towards))
