"""A vehicle on loopback: what an autopilot would send, and what it is sent."""

from __future__ import annotations

import socket
from collections import Counter
from types import TracebackType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

import made_logs


def free_ends() -> str:
    """A connection to listen by at a port that the system gave."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return f"udpin:127.0.0.1:{free.getsockname()[1]}"


class Vehicle:
    """A UDP socket that speaks as system 1, component 1 to a port of this computer.

    It gives the same pulses for as long as it is asked to `say` them; parameters only when it is asked for them.
    """

    def __init__(self, port: int, system: int = 1) -> None:
        self.system, self._to = system, ("127.0.0.1", port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._mav = ardupilotmega.MAVLink(None, srcSystem=system, srcComponent=1)
        self._parser = ardupilotmega.MAVLink(None)
        self.heard: Counter[str] = Counter()
        self.senders: set[tuple[int, int]] = set()
        self.values: dict[str, float] = {}

    def __enter__(self) -> Vehicle:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, _: TracebackType | None) -> None:
        self._socket.close()

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def send(self, message: Any) -> None:
        self._socket.sendto(message.pack(self._mav), self._to)
        self._mav.seq = (self._mav.seq + 1) % 256

    def send_bytes(self, data: bytes) -> None:
        self._socket.sendto(data, self._to)

    def say(self, *pulses: int) -> None:
        """State and pulses, once."""
        mav = ardupilotmega
        self.send(mav.MAVLink_heartbeat_message(12, 3, 81 + 128, 19, 4, 3))
        volts = round(1e3 * made_logs.VOLTAGE_V)
        self.send(mav.MAVLink_sys_status_message(0, 0, 0, 0, volts, 0, -1, 0, 0, 0, 0, 0, 0))
        self.send(mav.MAVLink_attitude_message(0, 0.1, -0.1, 1.0, 0.0, 0.0, 0.0))
        self.send(mav.MAVLink_local_position_ned_message(0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
        self.send(mav.MAVLink_servo_output_raw_message(0, 0, *pulses, *[0] * (16 - len(pulses))))

    def listen(self) -> None:
        """Take in what came, and answer questions for parameters."""
        while True:
            try:
                data, self._to = self._socket.recvfrom(65535)
            except BlockingIOError:
                return
            for message in self._parser.parse_buffer(data) or []:
                self.heard[message.get_type()] += 1
                self.senders.add((message.get_srcSystem(), message.get_srcComponent()))
                if message.get_type() == "PARAM_REQUEST_READ":
                    self._answer(message.param_id)
                elif message.get_type() == "NAMED_VALUE_FLOAT":
                    self.values[message.name] = message.value

    def _answer(self, name: str) -> None:
        known = {f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(made_logs.DIRECTIONS, 1)}
        known |= {f"SERVO{i}_FUNCTION": 32.0 + i if i <= 8 else 0.0 for i in range(1, 17)}
        if name in known:
            self.send(ardupilotmega.MAVLink_param_value_message(name.encode(), known[name], 9, 100, 0))
