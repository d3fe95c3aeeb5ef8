"""A pilot ashore for whom nobody must be there: arms the stand-in, switches the script on and lets the sticks go.

Once it has seen both it leaves them as somebody else puts them, until the stand-in starts anew.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.robot.importers import any_vehicle
from wakewise_ardusub.link.protocol import ENABLE_PARAMETER, STICKS_MIDDLE
from wakewise_ardusub.physics.pulses import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.inprocess_session import STATION, STATION_COMPONENT, MavlinkSender, shipped_script
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint, run

STICKS_S, BEAT_S, ASKS_S = 0.05, 1.0, 2.0
FIRST_S = 0.4
"""When it is first asked to arm: after the script has switched itself off, which it does as it starts."""


class ScriptedGroundStation:
    """Heartbeats and sticks of a ground station; arms and switches on once after each start.

    Parameters
    ----------
    made : SimulatedAutopilot
    carry : callable
        Takes bytes and the name of a link: to the stand-in and to everybody else.
    """

    def __init__(self, made: SimulatedAutopilot, carry: Callable[[bytes, str], None]) -> None:
        self._made, self._pilot = made, MavlinkSender(carry, STATION, STATION_COMPONENT, "pilot ashore")
        self._begin()

    def _begin(self) -> None:
        self._due = {"sticks": 0.0, "beat": 0.0, "ask": FIRST_S}
        self._done, self._last_s = False, 0.0

    def turn(self) -> None:
        """Say what is due, by the stand-in's time."""
        made, pilot = self._made, self._pilot
        if made.now_s < self._last_s:
            self._begin()
        self._last_s = made.now_s
        if self._is_due("sticks", STICKS_S):
            pilot.send(mavlink.MAVLink_manual_control_message(made.system, *STICKS_MIDDLE, 0))
        if self._is_due("beat", BEAT_S):
            pilot.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        self._done |= made.armed and made.parameters.get(ENABLE_PARAMETER) == 1.0
        if not self._done and self._is_due("ask", ASKS_S):
            if not made.armed:
                arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
                pilot.send(mavlink.MAVLink_command_long_message(made.system, 1, arm, 0, 1.0, 0, 0, 0, 0, 0, 0))
            if made.parameters.get(ENABLE_PARAMETER) != 1.0:
                real = mavlink.MAV_PARAM_TYPE_REAL32
                pilot.send(mavlink.MAVLink_param_set_message(made.system, 1, ENABLE_PARAMETER.encode(), 1.0, real))

    def _is_due(self, what: str, every_s: float) -> bool:
        now_s = self._made.now_s
        if now_s < self._due[what]:
            return False
        self._due[what] = now_s + every_s
        return True


def route_messages(made: SimulatedAutopilot, links: list[UdpEndpoint]) -> Callable[[bytes, str], None]:
    """Carries bytes to the stand-in and out on its links, as its router does."""

    def carry(data: bytes, name: str) -> None:
        made.hear(data, name)
        for link in links:
            link.write(data)

    return carry


def fly_piloted(vehicle: str, port: int, seconds: float = 3600.0, loop_hz: float = 100.0) -> None:
    """Fly until the time is over, or the process is ended; a companion listens at the port of this computer."""
    chosen = any_vehicle(vehicle)
    values = own_parameters(len(chosen.thrusters))
    made = SimulatedAutopilot(values, loop_hz=loop_hz, scripts=shipped_script())
    link = UdpEndpoint("127.0.0.1", port, out=True)
    behind = InProcessPhysics(body=FreeWater(chosen), table=PulseTable.of(chosen, values))
    end_s = time.monotonic() + seconds
    ashore = ScriptedGroundStation(made, route_messages(made, [link]))
    run(made, behind, [link], lambda: time.monotonic() < end_s, turn=ashore.turn)
    link.close()
