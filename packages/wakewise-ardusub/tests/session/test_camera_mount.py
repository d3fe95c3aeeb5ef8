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
from wakewise_ardusub.session.camera_mount import ASKS_S, MountControl

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
    assert (mount.reported, mount.angle_rad) == (False, 0.3)
    gate.hear(name, **fields)
    assert mount.reported
    assert mount.angle_rad == pytest.approx(math.radians(-20.0))
    assert math.asin(mount.X_BC().R[2, 2]) == pytest.approx(math.radians(20.0))
    assert mount.words == "camera -20 deg"
    assert mount.flown(VEHICLE) is VEHICLE


@pytest.mark.parametrize(
    ("name", "fields"),
    [("MOUNT_STATUS", {}), ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"q": [math.nan] * 4})],
)
def test_nonsense_is_no_angle(name: str, fields: dict[str, object]) -> None:
    """It is counted, and the camera stays where it was stated to be."""
    gate = Gate()
    gate.hear(name, **fields)
    assert gate.known.garbage == 1
    assert not mount_of(gate).reported


def test_it_is_steered_while_engaged_and_given_back_once() -> None:
    """An angle is sent when it differs, at most five times a second; nothing is sent by a session that only listens."""
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
    mount.ask(0.3, engaged=False)
    mount.give_back()
    assert gate.sent[2:] == [(0.0, by_pilot)]


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
