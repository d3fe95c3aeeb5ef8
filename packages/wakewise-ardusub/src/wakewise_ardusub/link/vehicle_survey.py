"""Collects the facts for `checks.py` over a connection: autopilot, firmware, messages received and parameters."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from wakewise.core.errors import EnvironmentFailure
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.checks import CheckInputs, MotorResults, ReceivedTelemetry
from wakewise_ardusub.link.connection import MavlinkSession, send_command
from wakewise_ardusub.link.parameters import read_parameters
from wakewise_ardusub.link.protocol import (
    AUTOPILOT_COMPONENT,
    AUTOPILOT_VERSION,
    HEARTBEAT_PERIOD_S,
    REQUEST_MESSAGE,
    VERSION_NAME,
    heartbeat,
    interval_requests,
)

LISTEN_S = 3.0
"""Long enough for the script, which speaks twice a second, and for sticks and poses."""
PATIENCE_S = 5.0
SETTLE_S = 1.0
"""How long an autopilot may take to speak at the rates that were asked for."""
_ARDUPILOT, _SUBMARINE = 3, 12
_POSES = frozenset(
    {"LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "VISION_POSITION_ESTIMATE", "ODOMETRY", "VISION_POSITION_DELTA"}
)
_TAKEN = frozenset({"LOCAL_POSITION_NED", "VISION_POSITION_ESTIMATE", "ODOMETRY"})
"""Those of them that a session takes for a pose."""
Progress = Callable[[float, float], None]


def survey(
    link: MavlinkSession,
    vehicle: Vehicle,
    *,
    results: MotorResults | None = None,
    buttons: Mapping[str, int] | None = None,
    seconds: float = LISTEN_S,
    progress: Progress | None = None,
) -> CheckInputs:
    """All facts about the vehicle at the other end of a connection.

    Raises
    ------
    EnvironmentFailure
        If no autopilot of the connection's system id is heard, or it says no parameter.
    """
    beat = await_autopilot(link)
    kind = "ArduSub" if (beat.autopilot, beat.type) == (_ARDUPILOT, _SUBMARINE) else _kind(beat)
    heard = _listened(link, seconds, kind, mavlink_2=bytes(beat.get_msgbuf()[:1]) == b"\xfd")
    parameters = read_parameters(link, progress=progress)
    return CheckInputs(
        vehicle=vehicle,
        parameters=parameters,
        system=link.system,
        heard=heard,
        results=results,
        buttons=buttons or {},
    )


def await_autopilot(link: MavlinkSession, patience_s: float | None = None) -> Any:
    """A heartbeat of the vehicle's autopilot; our own goes out meanwhile, since routers send to those they know.

    Raises
    ------
    EnvironmentFailure
        If there is none; names the systems that were heard instead.
    """
    others: set[int] = set()
    patience_s = PATIENCE_S if patience_s is None else patience_s
    until = time.monotonic() + patience_s
    while True:
        send_heartbeat(link)
        next_s = time.monotonic() + HEARTBEAT_PERIOD_S
        while (message := link.receive_any(max(min(next_s, until) - time.monotonic(), 0.0))) is not None:
            if message.get_type() != "HEARTBEAT":
                continue
            if (message.get_srcSystem(), message.get_srcComponent()) == (link.system, AUTOPILOT_COMPONENT):
                return message
            if message.get_srcComponent() == AUTOPILOT_COMPONENT:
                others.add(message.get_srcSystem())
        if time.monotonic() >= until:
            break
    instead = f"; heard were systems {', '.join(map(str, sorted(others)))}" if others else "; nobody was heard"
    raise EnvironmentFailure(f"no heartbeat of system {link.system} in {patience_s:g} s{instead}")


def send_heartbeat(link: MavlinkSession) -> None:
    """The companion's heartbeat: an onboard controller, never a ground station."""
    link.send("heartbeat", **heartbeat())


def _listened(link: MavlinkSession, seconds: float, kind: str, *, mavlink_2: bool) -> ReceivedTelemetry:
    """Everything that is said for a while, at the rates that a session asks for; the version is asked for until it is.

    Pauses count from the second message of a kind after `SETTLE_S`.
    """
    for request, fields in interval_requests(link.system):
        link.send(request, **fields)
    last_s: dict[str, float] = {}
    gaps_s: dict[str, float] = {}

    def came(what: str) -> None:
        now_s = time.monotonic()
        if now_s < settled_s:
            return
        if what in last_s:
            gaps_s[what] = max(gaps_s.get(what, 0.0), now_s - last_s[what])
        last_s[what] = now_s

    sticks: Counter[int] = Counter()
    poses: Counter[str] = Counter()
    firmware: tuple[int, int, int] | None = None
    script: float | None = None
    until, hello_s = time.monotonic() + seconds, 0.0
    settled_s = time.monotonic() + min(SETTLE_S, 0.5 * seconds)
    while (left_s := until - time.monotonic()) > 0.0:
        if time.monotonic() >= hello_s:
            send_heartbeat(link)
            if firmware is None:
                send_command(link, REQUEST_MESSAGE, AUTOPILOT_VERSION)
            hello_s = time.monotonic() + HEARTBEAT_PERIOD_S
        message = link.receive_any(min(left_s, HEARTBEAT_PERIOD_S))
        if message is None:
            continue
        name = message.get_type()
        if name == "MANUAL_CONTROL" and message.target == link.system:
            sticks[message.get_srcSystem()] += 1
            came("sticks")
        elif message.get_srcSystem() != link.system:
            continue
        elif name == "AUTOPILOT_VERSION" and message.get_srcComponent() == AUTOPILOT_COMPONENT:
            firmware = _version(message)
        elif name == "NAMED_VALUE_FLOAT" and message.name.partition("\0")[0] == VERSION_NAME:
            script = float(message.value)
        elif name in _POSES and not (name == "GLOBAL_POSITION_INT" and message.lat == message.lon == 0):
            poses[name] += 1
            if name in _TAKEN:
                came("pose")
        elif name == "ATTITUDE":
            came("attitude")
    return ReceivedTelemetry(
        seconds=seconds,
        kind=kind,
        firmware=firmware,
        script=script,
        sticks=dict(sticks),
        poses=dict(poses),
        mavlink_2=mavlink_2,
        gaps_s=gaps_s,
    )


def _version(said: Any) -> tuple[int, int, int]:
    packed = int(said.flight_sw_version)
    return packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255


def _kind(beat: Any) -> str:
    maker = "ArduPilot" if beat.autopilot == _ARDUPILOT else f"autopilot {beat.autopilot}"
    return f"{maker}, vehicle type {beat.type}"
