"""What `wakewise link transect` and `wakewise link orbit` share: options, and the loop from consent to the hold."""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import end_status_line, format_value, print_json, status_line

if TYPE_CHECKING:
    from wakewise_ardusub.link.transports import MavlinkCodec
    from wakewise_ardusub.survey.survey_plan import MakeLines, SurveyPace
    from wakewise_ardusub.survey.transect_session import TransectSession

DEFAULT_CONNECTION, DEFAULT_VEHICLE = "udpin:127.0.0.1:14560", "bluerov2-heavy"
LOOP_S, LINE_S, LINE_PIPED_S, ENDS_S = 0.02, 0.2, 5.0, 3.0

Connection = Annotated[
    str,
    typer.Option(
        metavar="PLACE",
        help="Where the vehicle's MAVLink is: udpin:HOST:PORT waits for its router, udpout:HOST:PORT speaks first.",
    ),
]
Speed = Annotated[float, typer.Option(metavar="M/S", help="0.05 to 0.30.")]
Every = Annotated[float, typer.Option(metavar="M", help="Metres between two photographs; 0: none.")]
Camera = Annotated[
    str, typer.Option(help="mavlink (MAV_CMD_IMAGE_START_CAPTURE) or digicam (MAV_CMD_DO_DIGICAM_CONTROL).")
]
Current = Annotated[
    str,
    typer.Option(metavar="M/S,DEG", help="Speed and direction that the water goes to; felt (from holding the place)."),
]
RangeDelay = Annotated[
    float, typer.Option(metavar="S", help="Delay of the rangefinder: about 0.3 of a DVL A50, 0.8 of a Ping.")
]
Gap = Annotated[
    float, typer.Option(metavar="S", help="Longest drop-out of the rangefinder flown through at a held depth.")
]
Fence = Annotated[float, typer.Option(metavar="M", help="Farthest from the start that a line or an orbit may reach.")]
VehicleName = Annotated[str, typer.Option(help="Library name or vehicle YAML file; its drag gives the current.")]
System = Annotated[int, typer.Option(min=1, max=255, help="The vehicle's MAVLink system id.")]
Consent = Annotated[
    bool,
    typer.Option("--consent", help="Begin as soon as all is well: giving it is the consent, as Enter otherwise is."),
]
Wait = Annotated[float, typer.Option(metavar="S", min=1.0, help="How long to wait until all is well.")]
Out = Annotated[Path | None, typer.Option(help="A new folder for journal and figures; runs/NAME-TIME if not given.")]


@dataclass(frozen=True, kw_only=True)
class SurveyCommand:
    """Options that every survey command has; `name` is that of its folder."""

    name: str
    connection: str
    every: float
    camera: str
    current: str
    range_delay: float
    gap: float
    fence: float
    vehicle: str
    system: int
    consent: bool
    wait: float
    out: Path | None
    json: bool
    allocate: bool = False


def fly_survey(
    given: SurveyCommand, pace: SurveyPace, lines: MakeLines, *, layers_m: tuple[float, ...] = (), off_m: float = 0.6
) -> None:
    """Check, connect, fly until it is over, and print the figures; `off_m` off the target place ends it."""
    from wakewise.core.errors import EnvironmentFailure, InputError
    from wakewise.core.files import write_json
    from wakewise_ardusub.optional_dependencies import need

    need(f"wakewise link {given.name}", "links", only=("pymavlink",))
    import secrets

    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.link.connection import parse_connection
    from wakewise_ardusub.link.session_log import JOURNAL_FILE, SessionLog
    from wakewise_ardusub.link.transports import MavlinkCodec, open_transport
    from wakewise_ardusub.survey.allocated_session import AllocatedTransectSession
    from wakewise_ardusub.survey.survey_control import SurveyController
    from wakewise_ardusub.survey.survey_safety import SurveyLimits
    from wakewise_ardusub.survey.transect_session import TransectOptions, TransectSession

    for option, value, least, most in (
        ("--every", given.every, 0.0, 1000.0), ("--range-delay", given.range_delay, 0.0, 2.0),
        ("--gap", given.gap, 0.3, 5.0), ("--fence", given.fence, 1.0, 5000.0),
    ):  # fmt: skip
        if not least <= value <= most:
            raise InputError(f"{option} {value:g}: must be from {least:g} to {most:g}")
    if given.camera not in ("mavlink", "digicam"):
        raise InputError(f"--camera {given.camera!r}: must be mavlink or digicam")
    chosen = any_vehicle(given.vehicle)
    for altitude in (pace.altitude_m, *layers_m):
        if altitude < 0.5 * chosen.size_m[2] + 0.2:
            hull = f"the hull is {chosen.size_m[2]:.2f} m high"
            raise InputError(f"--altitude {altitude:g}: {hull}, it would touch the bed")
    options = TransectOptions(
        pace=pace,
        limits=SurveyLimits(range_s=given.gap, fence_m=given.fence, off_m=off_m),
        delay_s=given.range_delay,
        current_W_m_s=None if given.current == "felt" else _current(given.current),
        camera=given.camera,
        every_m=given.every,
        layers_m=layers_m,
    )
    vehicle_at = parse_connection(given.connection)
    folder = given.out or Path("runs") / f"{given.name}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: a file is there, a folder is needed")
    if (folder / JOURNAL_FILE).exists():
        raise InputError(f"--out {folder}: holds the journal of another survey, choose a new folder")
    if given.allocate:  # before the first message is queued, or its age would be taken for the autopilot's clock
        typer.echo("prepares the controller; the first time it compiles for a minute", err=True)
        SurveyController(chosen).warm_up()
    with ExitStack() as stack:
        transport = open_transport(vehicle_at)
        stack.callback(transport.close)
        codec = MavlinkCodec(transport, given.system)
        journal = SessionLog(folder / JOURNAL_FILE)
        stack.callback(journal.close)
        make = AllocatedTransectSession if given.allocate else TransectSession
        session = make(
            send=codec.send,
            lines=lines,
            vehicle=chosen,
            options=options,
            clock=time.monotonic,
            journal=journal,
            system=given.system,
            session=secrets.randbelow(2**31) + 1,
        )
        if isinstance(session, AllocatedTransectSession):
            stack.callback(session.gate.end, "the program ends")
        if len(layers_m) > 1:  # a comma may have been meant as a decimal point
            told = ", ".join(f"{layer:g} m" for layer in layers_m)
            typer.echo(f"{len(layers_m)} layers, above the bed: {told}", err=True)
        typer.echo(f"listening at {vehicle_at.words}; journal: {folder / JOURNAL_FILE}", err=True)
        try:
            _fly(session, codec, consent=given.consent, wait_s=given.wait)
        finally:
            end_status_line()
            if not session.known.messages:
                journal.discard()
    figures = session.figures()
    if session.known.messages:
        figures = {"folder": str(folder), **figures}
        write_json(folder / "figures.json", figures)
    if given.json:
        print_json(figures)
    else:
        _print(figures)
    if session.refused:
        raise InputError(session.refused)
    if not session.finished:
        planned_m = figures["planned_m"]
        way = f"{figures['flown_m']:.2f} m" + ("" if planned_m is None else f" of {planned_m:.2f} m")
        before = session.ended_by if session.ended_by and session.ended_by != session.why else ""
        last = session.why or session.ended_by
        raise EnvironmentFailure(f"survey ended after {way}: {last}" + (f" (before that: {before})" if before else ""))


def _print(figures: dict[str, Any]) -> None:
    """A line for each figure that there is: name, value, what it is."""
    from wakewise_ardusub.survey.survey_figures import FIGURE_MEANINGS

    for name, value in figures.items():
        if value is not None:
            shown = [round(part, 3) for part in value] if isinstance(value, list) else value
            typer.echo(f"{name:24}{format_value(shown)!s:24}  {FIGURE_MEANINGS[name]}".rstrip())


def _fly(session: TransectSession, codec: MavlinkCodec, *, consent: bool, wait_s: float) -> None:
    """Receive, judge and send until it is over; Ctrl-C ends it in the firmware's hold."""
    from wakewise.core.errors import InputError
    from wakewise_ardusub.link.protocol import GUIDED

    keys = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
    if keys is None and not consent and session.options.limits.mode != GUIDED:
        raise InputError("--allocate: there is no terminal, so Enter is not heard; give --consent beforehand")
    if keys is None and not consent:
        typer.echo("no terminal: Enter is not heard; the pilot's GUIDED begins, or --consent beforehand", err=True)
    began_s = told_s = time.monotonic()
    told, asked, warned, ends_s = "", False, "", math.inf
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
            if session.warning != warned:
                warned = session.warning
                typer.echo(f"\r{warned}", err=True)
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
        session.abort("q")
    elif word:
        said = session.pause() if session.state == "flying" else session.consent()
        typer.echo(f"\r{said}", err=True)


def _current(text: str) -> tuple[float, float]:
    from wakewise.core.errors import InputError

    try:
        speed, towards = (float(part) for part in text.split(","))
    except ValueError:
        speed = towards = math.nan
    if not (0.0 <= speed <= 1.0 and -360.0 <= towards <= 360.0):
        raise InputError(
            f"--current {text!r}: must be M/S,DEG such as 0.1,90 (0.1 m/s to the east), or felt, which measures it"
        )
    return speed * math.cos(math.radians(towards)), speed * math.sin(math.radians(towards))
