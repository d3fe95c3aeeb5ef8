"""The joint that tilts the camera: what the autopilot reports of it, and what is asked of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from wakewise.core.geometry import quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage, update_link_state
from wakewise_ardusub.link.protocol import MOUNT_BY_MAVLINK, MOUNT_BY_STICKS
from wakewise_ardusub.session.camera_mount import ASKS_S, GIVES, MountControl

VEHICLE = load_vehicle("bluerov2-heavy")


@dataclass
class Gate:
    """An output gate that keeps what it was given."""

    known: LinkState = field(default_factory=LinkState)
    now_s: float = 10.0
    sent: list[tuple[float, float]] = field(default_factory=list)

    def clock(self) -> float:
        return self.now_s

    def send(self, name: str, fields: dict[str, Any]) -> None:
        assert (name, fields["command"], fields["target_system"]) == ("command_long", 205, 1)
        self.sent.append((round(fields["param1"], 6), fields["param7"]))

    def hear(self, name: str, **fields: object) -> None:
        self.known = update_link_state(self.known, MavlinkMessage(1, 1, name, fields), self.now_s)


def mount_of(gate: Gate, **how: object) -> MountControl:
    return MountControl(gate=gate, vehicle=VEHICLE, **how)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("MOUNT_STATUS", {"pointing_a": -2000}),
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [float(part) for part in quat_from_euler(0.0, math.radians(-20), 0)]}),
    ],
)
def test_the_angle_is_the_autopilots(name: str, fields: dict[str, object]) -> None:
    """Up is positive, as of the vehicle's own joint: looking down lowers the camera's axis."""
    gate = Gate()
    mount = mount_of(gate, stated_rad=0.3)
    assert (mount.reported, mount.current_angle_rad()) == (False, 0.3)
    gate.hear(name, **fields)
    assert mount.reported
    assert mount.current_angle_rad() == pytest.approx(math.radians(-20.0))
    assert math.asin(mount.X_BC().R[2, 2]) == pytest.approx(math.radians(20.0))
    assert mount.words == "camera -20 deg"
    assert mount.flown(VEHICLE) is VEHICLE


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("MOUNT_STATUS", {}),
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [math.nan] * 4}),
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [0.0] * 4}),
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [2.0, 0.0, 0.0, 0.0]}),
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [1.0, 0.0, 0.0]}),
    ],
)
def test_nonsense_is_no_angle(name: str, fields: dict[str, object]) -> None:
    """It is counted, and the camera stays where it was stated to be."""
    gate = Gate()
    gate.hear(name, **fields)
    assert gate.known.garbage == 1
    assert not mount_of(gate).reported


def test_it_is_steered_while_engaged_and_given_back() -> None:
    """An angle is sent when it differs, at most five times a second; nothing is sent by a session that only listens.

    It is given back three times: a message may be lost.
    """
    gate = Gate()
    gate.hear("MOUNT_STATUS", pointing_a=0)
    mount = mount_of(gate)
    mount.ask(0.2, engaged=False)
    assert gate.sent == []
    mount.ask(0.2, engaged=True)
    mount.ask(0.3, engaged=True)
    gate.now_s += 1.1 * ASKS_S
    mount.ask(0.2, engaged=True)
    mount.ask(0.3, engaged=True)
    by_us, by_pilot = float(MOUNT_BY_MAVLINK), float(MOUNT_BY_STICKS)
    assert gate.sent == [(round(math.degrees(0.2), 6), by_us), (round(math.degrees(0.3), 6), by_us)]
    for _ in range(2):
        mount.ask(0.3, engaged=False)
    for _ in range(2):
        mount.give_back()
    assert gate.sent[2:] == [(0.0, by_pilot)] * GIVES


def test_an_angle_that_does_not_come_is_asked_for_again() -> None:
    """Each second, until the report is near it; nothing more is asked of a mount that fell silent."""
    gate = Gate()
    gate.hear("MOUNT_STATUS", pointing_a=0)
    mount = mount_of(gate)
    mount.flown(VEHICLE)
    for _ in range(25):
        gate.hear("MOUNT_STATUS", pointing_a=0)
        mount.ask(0.3, engaged=True)
        gate.now_s += 0.125
    assert len(gate.sent) == 4
    gate.hear("MOUNT_STATUS", pointing_a=round(100 * math.degrees(0.3)))
    before = len(gate.sent)
    for _ in range(21):
        gate.now_s += 0.1
        mount.ask(0.3 if not mount.silent else -0.3, engaged=True)
    assert len(gate.sent) == before
    assert mount.silent
    assert mount.words.endswith(", mount not heard")


def test_a_stabilized_mount_is_asked_for_its_angle_to_the_horizon() -> None:
    """ArduSub takes the hull's pitch off what is asked of servos; another kind is asked for the joint's angle."""
    for kind, pitch_rad in ((1.0, 0.2), (7.0, 0.0)):
        gate = Gate()
        gate.hear("MOUNT_STATUS", pointing_a=0)
        gate.hear("PARAM_VALUE", param_id="MNT1_TYPE", param_value=kind)
        gate.hear("ATTITUDE", roll=0.0, pitch=0.2, yaw=0.0, rollspeed=0.0, pitchspeed=0.0, yawspeed=0.0)
        mount_of(gate).ask(0.1, engaged=True)
        assert gate.sent[0][0] == pytest.approx(math.degrees(0.1 + pitch_rad), abs=1e-5)


def test_the_camera_comes_to_a_reported_angle_at_the_joints_rate() -> None:
    """What is reported is what the servo is asked for."""
    gate = Gate()
    gate.hear("MOUNT_STATUS", pointing_a=0)
    mount = mount_of(gate)
    assert mount.current_angle_rad() == 0.0
    gate.hear("MOUNT_STATUS", pointing_a=4000)
    gate.now_s += 0.1
    assert mount.current_angle_rad() == pytest.approx(0.1 * VEHICLE.tilt.rate_rad_s)
    gate.now_s += 10.0
    assert mount.current_angle_rad() == pytest.approx(math.radians(40.0))


def test_what_is_flown_is_decided_once() -> None:
    """A mount that is heard only after the controller was made is not steered, and its angle stays as stated."""
    gate = Gate()
    mount = mount_of(gate, stated_rad=-0.5)
    assert mount.flown(VEHICLE).tilt is None
    gate.hear("MOUNT_STATUS", pointing_a=0)
    mount.ask(0.0, engaged=True)
    assert gate.sent == []
    assert mount.current_angle_rad() == -0.5


def test_a_mount_that_is_not_reported_is_not_steered() -> None:
    """The controller's vehicle has a fixed camera at the stated angle; so has one without a joint."""
    for vehicle in (VEHICLE, replace(VEHICLE, tilt=None)):
        gate = Gate()
        mount = MountControl(gate=gate, vehicle=vehicle, stated_rad=math.radians(-90.0))
        mount.ask(0.2, engaged=True)
        assert gate.sent == []
        fixed = mount.flown(vehicle)
        assert fixed.tilt is None
        assert fixed.X_BC.R[:, 2] == pytest.approx(np.array([0.0, 0.0, 1.0]), abs=1e-9)
        assert pytest.approx(fixed.X_BC.R) == mount.X_BC().R
