"""From a box-fresh autopilot to thrusts in the water, with the stand-in autopilot at the other end of the wire."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from wakewise.core.errors import EnvironmentFailure
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.checks import check, verdict
from wakewise_ardusub.link.connection import receive_kind, send_command
from wakewise_ardusub.link.motor_interface import motor_output
from wakewise_ardusub.link.parameters import read_all_parameters, read_parameters, set_parameter
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.link.upload import start_script, upload_script
from wakewise_ardusub.link.vehicle_survey import survey
from wakewise_ardusub.physics.physics import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics

HEAVY = load_vehicle("bluerov2-heavy")
DIRECTIONS = (1, -1, -1, 1, 1, -1, 1, -1)


class Wire:
    """A `Talk` whose other end is the stand-in; its time goes on while something is waited for."""

    system = 1

    def __init__(self, **values: float) -> None:
        turned = {f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(DIRECTIONS, 1)}
        parameters = {**own_parameters(), "SCR_ENABLE": 0.0, **turned, **values}
        self.autopilot = SimulatedAutopilot(parameters, loop_hz=100.0)
        self.behind = InProcessPhysics(body=FreeWater(HEAVY), table=PulseTable.of(HEAVY, parameters))
        self.piloted, self._loops = True, 0
        self._waiting: deque[Any] = deque()
        self._parsers = ardupilotmega.MAVLink(None)
        self._voices: dict[tuple[int, int], Any] = {}

    def say(self, who: tuple[int, int], name: str, /, **fields: Any) -> None:
        voice = self._voices.setdefault(who, ardupilotmega.MAVLink(None, srcSystem=who[0], srcComponent=who[1]))
        data = bytes(getattr(voice, f"{name}_encode")(**fields).pack(voice))
        voice.seq = (voice.seq + 1) % 256
        self.autopilot.hear(data, str(who))
        if who != (1, 191):
            self._waiting.extend(self._parsers.parse_buffer(data) or [])

    def send(self, name: str, **fields: Any) -> None:
        self.say((1, 191), name, **fields)

    def loop(self) -> None:
        self._loops += 1
        if self.piloted and self._loops % 10 == 0:
            self.pilot()
        motion = self.behind.exchange(self.autopilot.pulses_us, 100)
        assert motion is not None
        self.autopilot.step(motion)
        for packet in self.autopilot.take_out():
            self._waiting.extend(self._parsers.parse_buffer(packet) or [])

    def receive_any(self, timeout_s: float) -> Any:
        for _ in range(max(round(100 * timeout_s), 1)):
            if self._waiting:
                return self._waiting.popleft()
            self.loop()
        return self._waiting.popleft() if self._waiting else None

    def hear(self, kinds: Collection[str], timeout_s: float) -> Any:
        return receive_kind(self, kinds, timeout_s)

    def pilot(self) -> None:
        """The ground station's heartbeat and sticks let go."""
        self.say((255, 190), "heartbeat", type=6, autopilot=8, base_mode=0, custom_mode=0, system_status=4)
        x, y, z, r = protocol.STICKS_MIDDLE
        self.say((255, 190), "manual_control", target=1, x=x, y=y, z=z, r=r, buttons=0)


def _installed() -> Wire:
    wire = Wire()
    upload_script(wire, script_text().encode("utf-8"))
    start_script(wire)
    return wire


def test_a_fresh_autopilot_is_no_go_until_the_script_is_on_it() -> None:
    """What the check asks for, done one by one with the package's own means, makes it go."""
    wire = Wire()
    before = {row.what for row in check(survey(wire, HEAVY, seconds=0.3)) if row.verdict == "no-go"}
    assert before == {"SCR_ENABLE", "script"}
    upload_script(wire, script_text().encode("utf-8"))
    start_script(wire)
    facts = survey(wire, HEAVY, seconds=0.3)
    assert [row.what for row in check(facts) if row.verdict != "go"] == ["motors seen"]
    assert verdict(check(facts)) == "unseen"
    assert verdict(check(facts), motors_seen=False) == "go"
    assert facts.parameters[protocol.ENABLE_PARAMETER] == 0.0


def test_thrusts_that_are_desired_arrive_in_the_water() -> None:
    """The output for the autopilot's own parameters, the message, the script and the table give the thrusts back."""
    wire = _installed()
    output = motor_output(HEAVY, read_parameters(wire))
    desired = np.array([9.0, -6.0, 4.0, -3.0, 12.0, -9.0, 2.5, 0.0])
    send_command(wire, 400, 1.0)
    set_parameter(wire, protocol.ENABLE_PARAMETER, 1.0)
    for i in range(10):
        wire.send(
            "set_actuator_control_target",
            time_usec=1_000_000 + 50_000 * i,
            group_mlx=protocol.THRUST_GROUP,
            target_system=1,
            target_component=1,
            controls=list(output.controls(desired)),
        )
        for _ in range(5):
            wire.loop()
    assert wire.autopilot.armed
    assert wire.autopilot.overridden
    assert wire.autopilot.pulses_us[:8] == tuple(output.pulses_us(desired))
    assert output.delivered_N(np.array(wire.autopilot.pulses_us[:8], dtype=float)) == pytest.approx(desired, abs=0.12)
    silent = 0
    while wire.autopilot.overridden:
        wire.loop()
        silent += 1
        assert silent <= 100 * protocol.NEUTRAL_WITHIN_S
    wire.loop()
    assert set(wire.autopilot.pulses_us[:8]) == {1500}


def test_all_parameters_come_and_an_armed_autopilot_is_not_rebooted() -> None:
    """The whole list is what the autopilot holds; a reboot in the water is refused here, before it is asked for."""
    wire = _installed()
    held = {name: wire.autopilot.parameters.get(name) for name in wire.autopilot.parameters}
    assert read_all_parameters(wire) == held
    wire.loop()
    send_command(wire, 400, 1.0)
    for _ in range(120):
        wire.loop()
    assert wire.autopilot.armed
    wire._waiting.clear()
    with pytest.raises(EnvironmentFailure, match="armed or not heard"):
        start_script(wire)
    assert wire.autopilot.armed
