"""Loop of the wash meter: connection, meter, page and record, ten readings per second; its settings."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.ui.web.origin_check import is_loopback
from wakewise_ardusub.link.connection import Endpoint, parse_connection
from wakewise_ardusub.link.protocol import DISTURBANCE_NAME, SAVED_NAME
from wakewise_ardusub.logs.channels import SERVOS
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_meter.meter import (
    DiveRecord,
    MeterReading,
    WashHistory,
    WashMeter,
    WashTotals,
    reading_as_json,
)
from wakewise_ardusub.wash_meter.server import MeterServer
from wakewise_ardusub.wash_meter.vehicle_listener import MavlinkSocket, VehicleListener

TICK_S = 0.1
PORT = 8766


@dataclass(frozen=True, kw_only=True)
class MeterSettings:
    """What one meter does.

    Parameters
    ----------
    connection : str
        `udpin:HOST:PORT` where the vehicle's router sends to, or `udpout:HOST:PORT` of its server.
    host, port : str, int
        Where the page is served; port 0 takes any.
    token : bool
        Whether callers from other computers must show the token.
    system : int or None
        The vehicle's MAVLink system id; the first with servo outputs if None.
    publish : bool
        Send D and saved per cent as NAMED_VALUE_FLOAT.
    ask : bool
        Ask the autopilot for its motors' channels and directions.
    out : Path or None
        Folder for the dive's record.
    """

    connection: str
    host: str = "127.0.0.1"
    port: int = PORT
    token: bool = True
    system: int | None = None
    publish: bool = False
    ask: bool = False
    out: Path | None = None

    def __post_init__(self) -> None:
        _ = self.ends
        if self.system is not None and not 1 <= self.system <= 255:
            raise InputError(f"--system {self.system}: 1 to 255 are allowed")
        if not 0 <= self.port <= 65535:
            raise InputError(f"--port {self.port}: 0 to 65535 are allowed")
        if self.out is not None and self.out.exists() and not self.out.is_dir():
            raise InputError(f"--out {self.out}: a file is there, a folder is needed")

    @property
    def ends(self) -> Endpoint:
        """The connection taken apart.

        Raises
        ------
        InputError
            If it is none of UDP: a server for one client, such as BlueOS' TCP one, is not for somebody who only looks.
        """
        ends = parse_connection(self.connection)
        if ends.way not in ("udpin", "udpout"):
            raise InputError(
                f"--connection {self.connection}: a meter listens by UDP, udpin:HOST:PORT or udpout:HOST:PORT; a file "
                "is for `wakewise link log`"
            )
        return ends


BEAT_S, PUBLISH_S, ASK_S = 1.0, 0.5, 0.5
_MOST_ROUNDS, _AT_ONCE = 5, 6
"""How often a parameter that does not come is asked for."""

Say = Callable[[str], None]


class MeterLoop:
    """One meter at work; `run` until `over` is set.

    Parameters
    ----------
    settings : MeterSettings
    craft : VehicleSummary
    points_B_m, weights : ndarray, shape (n, 3) and (n,)
        What is to be spared, in the vehicle's frame.
    points : str
        The same in words, such as "of a ball 0.4 m ahead of the bow".
    parameters : mapping
        The autopilot's, as known beforehand.
    say : callable
        Takes lines for the person at the terminal.

    Raises
    ------
    InputError
        If a port is taken, or parameters and craft do not fit.
    """

    def __init__(
        self,
        settings: MeterSettings,
        craft: VehicleSummary,
        points_B_m: Array,
        weights: Array,
        points: str,
        parameters: Mapping[str, float],
        say: Say,
    ) -> None:
        self.settings, self.points, self.say = settings, points, say
        self.over = threading.Event()
        self.listener = VehicleListener(settings.system, parameters)
        self.meter = WashMeter(craft, self.listener, points_B_m, weights)
        self.history = WashHistory(weight=float(np.sum(weights)))
        self._lock = threading.Lock()
        self._began_s = time.monotonic()
        self._reading = MeterReading(time_s=self._began_s, why_not="nothing is heard yet")
        self._asked = 0
        self._due_s = {"beat": 0.0, "publish": 0.0, "ask": 0.0}
        with ExitStack() as stack:
            self.wire = MavlinkSocket(settings.ends)
            stack.callback(self.wire.close)
            where = (settings.host, settings.port)
            self.server = MeterServer(self.state, self._past, self._command, *where, token=settings.token)
            stack.pop_all()

    def run(self) -> dict[str, Any]:
        """Work until told to stop; how it stood at the end."""
        with ExitStack() as stack:
            stack.callback(self.wire.close)
            self.server.start()
            stack.callback(self.server.stop)
            record = None
            if self.settings.out is not None:
                record = kept = DiveRecord(self.settings.out, self.meter.craft)
                stack.callback(lambda: kept.close(self.state()))
            self._introduce()
            due_s = time.monotonic()
            while not self.over.is_set():
                self._listen(due_s)
                now_s = time.monotonic()
                with self._lock:
                    self._reading = self.meter.read(now_s)
                    self.history.add(self._reading)
                    reading = self._reading
                self._speak(now_s)
                if record is not None:
                    record.add(time.time(), reading)
                due_s = max(due_s + TICK_S, now_s)
        return self.state()

    def state(self) -> dict[str, Any]:
        """How it stands, as JSON has it."""
        with self._lock:
            state = reading_as_json(self.meter, self._reading, self.history, self.points)
        return state | {
            "up_s": state["time_s"] - self._began_s,
            "messages": self.listener.messages,
            "bad_messages": self.wire.bad,
            "publishes": self.settings.publish,
        }

    def _past(self) -> dict[str, Any]:
        with self._lock:
            return self.history.told()

    def _command(self, what: str) -> str | None:
        with self._lock:
            if what == "mark":
                return self.meter.mark(self._reading.time_s)
            if what == "unmark":
                self.meter.unmark()
            else:
                self.meter.dive = WashTotals()
            return None

    def _listen(self, until_s: float) -> None:
        """Take in what comes until the next reading is due."""
        while True:
            for heard in self.wire.heard():
                with self._lock:
                    self.listener.hear(heard.time_s, heard.system, heard.component, heard.name, heard.fields)
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 or self.over.is_set():
                return
            self.wire.wait(left_s)

    def _speak(self, now_s: float) -> None:
        """Say what was allowed: heartbeat, values, and questions that are still open."""
        settings, system = self.settings, self.listener.system or self.settings.system or 1
        if (settings.publish or settings.ends.way != "udpin") and self._is_due("beat", now_s, BEAT_S):
            self.wire.beat(system)
        if settings.publish and self._is_due("publish", now_s, PUBLISH_S) and self._reading.savings is not None:
            boot_ms = round(1e3 * (now_s - self._began_s))
            self.wire.publish(system, boot_ms, DISTURBANCE_NAME, self._reading.savings.disturbance["flown"])
            saved = self.meter.saved_pct()
            if saved is not None:
                self.wire.publish(system, boot_ms, SAVED_NAME, saved)
        if settings.ask and self.listener.system is not None and self._is_due("ask", now_s, ASK_S):
            self._ask(system)

    def _ask(self, system: int) -> None:
        """A few questions; one that is not answered comes again, not for ever."""
        unknown = self._unknown()
        for _ in range(min(_AT_ONCE, len(unknown))):
            if self._asked < _MOST_ROUNDS * (SERVOS + self.meter.craft.count):
                self.wire.ask(system, unknown[self._asked % len(unknown)])
                self._asked += 1

    def _unknown(self) -> list[str]:
        """Parameters that matter and are not known."""
        wanted = [f"MOT_{i + 1}_DIRECTION" for i in range(self.meter.craft.count)]
        wanted += [f"SERVO{i + 1}_FUNCTION" for i in range(SERVOS)]
        return [name for name in wanted if name not in self.listener.parameters]

    def _is_due(self, what: str, now_s: float, every_s: float) -> bool:
        if now_s < self._due_s[what]:
            return False
        self._due_s[what] = now_s + every_s
        return True

    def _introduce(self) -> None:
        settings = self.settings
        ends = settings.ends
        self.say(f"wash meter: {' or '.join(self.server.addresses)} (Ctrl-C ends it)")
        heard = f"listens at {ends.host}:{ends.port}" if ends.way == "udpin" else f"asks {ends.host}:{ends.port}"
        says = [
            *(["a heartbeat"] if settings.publish or ends.way != "udpin" else []),
            *(["named values"] if settings.publish else []),
            *(["questions for parameters"] if settings.ask else []),
        ]
        self.say(f"vehicle      {heard}; sends {', '.join(says) or 'nothing'}; never a command")
        if not is_loopback(settings.host):
            who = "who shows the token" if settings.token else "everybody on this network"
            self.say(f"page         open at {settings.host} to {who}: to look, and to mark a target; nothing more")
