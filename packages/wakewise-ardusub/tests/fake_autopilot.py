"""An autopilot's side of conversations, in the same process and with no clock: parameters, versions, commands.

It loses messages where a test asks for that. What it answers goes through real MAVLink 2 bytes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

from wakewise_ardusub.link.connection import receive_kind


@dataclass
class FakeAutopilot:
    """A `Talk` whose other end is an autopilot."""

    parameters: dict[str, float] = field(default_factory=dict)
    version: tuple[int, int, int] = (4, 5, 3)
    armed: bool = False
    lose: Callable[[str, int], bool] = lambda kind, count: False
    """Whether the nth message of a kind, "in" to the autopilot or "out" of it, is lost."""
    deaf_to: frozenset[str] = frozenset()
    """Parameters that it does not take."""
    on: dict[str, Callable[[Any], None]] = field(default_factory=dict)
    """What else happens at a message, by its type."""
    sent: list[Any] = field(default_factory=list)
    system: int = 1
    waiting: deque[Any] = field(default_factory=deque)
    counts: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._companion = ardupilotmega.MAVLink(None, srcSystem=self.system, srcComponent=191)
        self._autopilot = ardupilotmega.MAVLink(None, srcSystem=self.system, srcComponent=1)
        self._parser = ardupilotmega.MAVLink(None)

    def say(self, name: str, /, *, system: int | None = None, component: int = 1, **fields: Any) -> None:
        """Put a message on the wire to the companion, of the autopilot or of somebody else."""
        voice = self._autopilot
        if system is not None or component != 1:
            voice = ardupilotmega.MAVLink(None, srcSystem=system or self.system, srcComponent=component)
        data = getattr(voice, f"{name}_encode")(**fields).pack(voice)
        if not self._lost("out"):
            self.waiting.extend(self._parser.parse_buffer(data) or [])

    def _lost(self, kind: str) -> bool:
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return self.lose(kind, self.counts[kind])

    def receive_any(self, timeout_s: float) -> Any:
        return self.waiting.popleft() if self.waiting else None

    def hear(self, kinds: Collection[str], timeout_s: float) -> Any:
        return receive_kind(self, kinds, timeout_s)

    def send(self, name: str, **fields: Any) -> None:
        message = getattr(self._companion, f"{name}_encode")(**fields)
        (heard,) = self._parser.parse_buffer(message.pack(self._companion))
        self.sent.append(heard)
        if self._lost("in"):
            return
        kind = heard.get_type()
        if kind in self.on:
            self.on[kind](heard)
        elif kind == "PARAM_REQUEST_READ":
            self._say_parameter(heard)
        elif kind == "PARAM_REQUEST_LIST":
            for index in range(len(self.parameters)):
                self._say_value(index)
        elif kind == "PARAM_SET":
            if heard.param_id in self.parameters and heard.param_id not in self.deaf_to:
                self.parameters[heard.param_id] = float(heard.param_value)
        elif kind == "COMMAND_LONG":
            self._command(heard)

    def _say_parameter(self, heard: Any) -> None:
        names = list(self.parameters)
        if heard.param_index >= 0:
            self._say_value(heard.param_index)
        elif heard.param_id in self.parameters:
            self._say_value(names.index(heard.param_id), index=65535)

    def _say_value(self, at: int, index: int | None = None) -> None:
        name = list(self.parameters)[at]
        self.say(
            "param_value",
            param_id=name.encode("ascii"),
            param_value=self.parameters[name],
            param_type=9,
            param_count=len(self.parameters),
            param_index=at if index is None else index,
        )

    def _command(self, heard: Any) -> None:
        asked_version = heard.command == 512 and heard.param1 == 148
        self.say("command_ack", command=heard.command, result=0 if asked_version else 3)
        if asked_version:
            major, minor, patch = self.version
            self.say(
                "autopilot_version",
                capabilities=0,
                flight_sw_version=major << 24 | minor << 16 | patch << 8 | 255,
                middleware_sw_version=0,
                os_sw_version=0,
                board_version=0,
                flight_custom_version=bytes(8),
                middleware_custom_version=bytes(8),
                os_custom_version=bytes(8),
                vendor_id=0,
                product_id=0,
                uid=0,
            )

    def heartbeat(self, mode: int = 19) -> None:
        """Say that it is there: a submarine of ArduPilot."""
        self.say(
            "heartbeat",
            type=12,
            autopilot=3,
            base_mode=1 | (128 if self.armed else 0),
            custom_mode=mode,
            system_status=4,
            mavlink_version=3,
        )
