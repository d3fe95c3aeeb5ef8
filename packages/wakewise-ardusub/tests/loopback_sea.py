"""A session beside the stand-in autopilot, over real bytes on ports of this computer."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.operation.scenario import Scenario
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.connection import parse_connection
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.transports import MavlinkCodec, open_transport
from wakewise_ardusub.physics.physics import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.session.session import ProtectedRegion, VehicleSession
from wakewise_ardusub.session.vehicle_flight import SEA
from wakewise_ardusub.sitl.inprocess_session import (
    MavlinkSender,
    ScriptedGroundStation,
    route_messages,
    shipped_script,
)
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint, run

VEHICLE = load_vehicle("bluerov2-heavy")
PATIENT = EngagementLimits(pose_s=5.0, telemetry_s=5.0, operator_s=5.0, thrusts_s=5.0, standstill_s=5.0)
"""For a computer that has other work."""


class Sea:
    """The stand-in autopilot in a thread of its own, on a UDP port of this computer, with a pilot ashore."""

    def __init__(self, port: int, body: FreeWater | None = None, **others: float) -> None:
        values = own_parameters(len(VEHICLE.thrusters)) | others
        self.autopilot = SimulatedAutopilot(values, loop_hz=50.0, scripts=shipped_script())
        self._link = UdpEndpoint("127.0.0.1", port, out=True)
        behind = InProcessPhysics(
            body=FreeWater(VEHICLE) if body is None else body, table=PulseTable.of(VEHICLE, values)
        )
        carry = route_messages(self.autopilot, [self._link])
        self._pilot = ScriptedGroundStation(self.autopilot, carry)
        self._station = MavlinkSender(carry, 255, 190, "station")
        self._sonar = MavlinkSender(carry, 1, 194, "sonar")
        self._parser, self.heard = mavlink.MAVLink(None), list[object]()
        self._parser.robust_parsing = True
        self._orders: list[Callable[[], None]] = []
        self.altitude_m = math.nan
        hear = self.autopilot.hear

        def overhear(data: bytes, name: str) -> None:
            if name not in ("station", "sonar", "pilot ashore"):
                self.heard += self._parser.parse_buffer(data) or []
            hear(data, name)

        self.autopilot.hear = overhear
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=run,
            args=(self.autopilot, behind, [self._link], lambda: not self._ended.is_set()),
            kwargs={"turn": self._turn},
        )
        self._thread.start()

    def _turn(self) -> None:
        self._pilot.turn()
        while self._orders:
            self._orders.pop(0)()
        if math.isfinite(self.altitude_m):
            said = mavlink.MAVLink_distance_sensor_message(0, 20, 3000, round(100 * self.altitude_m), 4, 0, 25, 0)
            self._sonar.send(said)

    def order(self, command: int, *numbers: float) -> int:
        """Send a command to the companion; the result of its answer."""
        before = len(self.acks(command))
        padded = [*numbers, *[0.0] * (7 - len(numbers))]
        self._orders.append(
            lambda: self._station.send(mavlink.MAVLink_command_long_message(1, 191, command, 0, *padded))
        )
        until(lambda: len(self.acks(command)) > before, "an answer", 10.0)
        return self.acks(command)[-1].result

    def of(self, name: str) -> list:
        """Messages of the companion."""
        return [one for one in list(self.heard) if one.get_type() == name and one.get_srcComponent() == 191]

    def acks(self, command: int) -> list:
        return [one for one in self.of("COMMAND_ACK") if one.command == command]

    def close(self) -> None:
        self._ended.set()
        self._thread.join(10.0)
        self._link.close()


def until(true: Callable[[], object], what: str, patience_s: float = 90.0) -> None:
    end_s = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end_s, f"waited {patience_s:g} s for {what}"
        time.sleep(0.02)


def session_at(port: int, folder: Path, **more) -> tuple[VehicleSession, Callable[[], None]]:
    """A session that listens at a port of this computer, and what closes it."""
    transport = open_transport(parse_connection(f"udpin:127.0.0.1:{port}"))
    codec = MavlinkCodec(transport, 1)
    fields = SEA | more.pop("fields", {})
    scenario = Scenario(vehicle="bluerov2-heavy", method="allocation-only").replace(**fields)
    session = VehicleSession(
        scenario=scenario,
        receiving=codec,
        send=codec.send,
        folder=folder,
        spare=ProtectedRegion(ahead_m=1.0),
        session=1,
        gate_options={"limits": PATIENT},
        **more,
    )
    session.start()

    def close() -> None:
        session.stop("over")
        transport.close()

    return session, close
