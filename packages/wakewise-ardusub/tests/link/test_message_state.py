"""What is known after messages: of whom, what, and what not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega

from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage, stick_axes, tilt_of, update_link_state

STICKS = {"target": 1, "x": 0, "y": 0, "z": 500, "r": 0, "buttons": 0}


def after(*said: MavlinkMessage, known: LinkState | None = None) -> LinkState:
    """What is known after messages, a second apart."""
    known = known or LinkState(session=7)
    for k, one in enumerate(said):
        known = update_link_state(known, one, 100.0 + k)
    return known


def beat(system: int = 1, component: int = 1, **fields: int) -> MavlinkMessage:
    """A heartbeat, of an armed ArduSub in MANUAL unless told otherwise."""
    return MavlinkMessage(
        system, component, "HEARTBEAT", {"type": 12, "autopilot": 3, "base_mode": 129, "custom_mode": 19, **fields}
    )


def test_only_the_autopilots_heartbeat_is_the_vehicles_state():
    """A gimbal of this vehicle and another vehicle say nothing of whether this one is armed."""
    known = after(beat(base_mode=1), beat(component=154), beat(system=2))
    assert known.armed is False
    assert known.heartbeat_s == 100.0
    assert known.components == {154}


def test_the_mode_has_ardusubs_name():
    """19 is MANUAL, and one without a name keeps its number."""
    assert after(beat()).mode_name == "MANUAL"
    assert after(beat(custom_mode=77)).mode_name == "mode 77"
    assert LinkState().mode_name == ""


@pytest.mark.parametrize(
    ("fields", "axes"),
    [
        ({"x": 1000}, (1, 0, 0, 0, 0)),
        ({"y": -1000}, (0, -1, 0, 0, 0)),
        ({"z": 0}, (0, 0, 1, 0, 0)),
        ({"z": 1000}, (0, 0, -1, 0, 0)),
        ({"r": 1000}, (0, 0, 0, 1, 0)),
        ({"s": 1000, "enabled_extensions": 1}, (0, 0, 0, 0, 1)),
        ({"s": 1000, "enabled_extensions": 2}, (0, 0, 0, 0, 0)),
        ({"x": 32767, "z": 32767}, (0, 0, 0, 0, 0)),
        ({"x": 40}, (0, 0, 0, 0, 0)),
    ],
)
def test_sticks_as_ardusub_has_them(fields, axes):
    """Forward, right, down, turn, tilt; the throttle goes from 0 (down) by 500 to 1000 (up)."""
    assert stick_axes({**STICKS, **fields}) == pytest.approx(np.array(axes, dtype=float))


def test_sticks_beyond_full_are_nonsense():
    """A stick at 1500 of 1000 is counted and moves nothing."""
    known = after(MavlinkMessage(255, 190, "MANUAL_CONTROL", {**STICKS, "x": 1500}))
    assert known.sticks is None
    assert (known.garbage, known.odd) == (1, ("MANUAL_CONTROL",))


def test_sticks_for_another_vehicle_are_not_ours():
    """They count by their target, whoever moves them."""
    assert after(MavlinkMessage(255, 190, "MANUAL_CONTROL", {**STICKS, "target": 2})).sticks is None


def test_two_ground_stations_at_once_are_a_takeover():
    """Sticks of two systems within a second; a station that comes back after a while is none."""
    one, two = (MavlinkMessage(system, 190, "MANUAL_CONTROL", STICKS) for system in (255, 254))
    known = update_link_state(update_link_state(LinkState(), one, 0.0), two, 0.5)
    assert known.takeover == "sticks from two ground stations, 255 and 254"
    assert update_link_state(update_link_state(LinkState(), one, 0.0), two, 1.5).takeover == ""


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (MavlinkMessage(255, 190, "SET_MODE", {"target_system": 1, "custom_mode": 2}), "system 255 set the mode"),
        (
            MavlinkMessage(255, 190, "COMMAND_LONG", {"target_system": 1, "command": 400}),
            "system 255 armed or disarmed",
        ),
        (
            MavlinkMessage(255, 190, "COMMAND_LONG", {"target_system": 1, "command": 300}),
            "system 255 started a mission",
        ),
        (MavlinkMessage(255, 190, "COMMAND_LONG", {"target_system": 1, "command": 511}), ""),
        (MavlinkMessage(255, 190, "COMMAND_LONG", {"target_system": 2, "command": 400}), ""),
        (
            MavlinkMessage(
                255, 0, "RC_CHANNELS_OVERRIDE", {"target_system": 1, **{f"chan{i}_raw": 65535 for i in range(1, 9)}}
            ),
            "",
        ),
        (
            MavlinkMessage(
                255, 0, "RC_CHANNELS_OVERRIDE", {"target_system": 1, **{f"chan{i}_raw": 1600 for i in range(1, 9)}}
            ),
            "system 255 overrides the pilot's channels",
        ),
    ],
)
def test_what_counts_as_taking_over(said, words):
    """Orders to this vehicle by which somebody takes it into their own hands."""
    assert after(said).takeover == words


def test_a_rival_is_told_from_its_own_echo():
    """Thrusts of a time that was not sent, and a heartbeat with another session's number, are somebody else's."""
    thrusts = MavlinkMessage(1, 191, "SET_ACTUATOR_CONTROL_TARGET", {"time_usec": 5})
    assert after(thrusts).duplicate
    assert not after(thrusts, known=LinkState(session=7).sent(5)).duplicate
    assert after(beat(component=191, custom_mode=8)).duplicate
    assert not after(beat(component=191, custom_mode=7)).duplicate


def test_ground_stations_are_known_by_their_heartbeats():
    """One of type 6 is a ground station, whatever its id."""
    known = after(beat(system=240, component=190, type=6, autopilot=8))
    assert dict(known.ground) == {240: 100.0}


def test_a_sensors_own_pose_is_preferred():
    """While a camera's pose comes, the autopilot's estimate, which is made of it, does not stand for it."""
    level = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
    camera = MavlinkMessage(1, 197, "VISION_POSITION_ESTIMATE", {"x": 1.0, "y": 2.0, "z": 3.0, **level})
    own = MavlinkMessage(1, 1, "LOCAL_POSITION_NED", {"x": 9.0, "y": 9.0, "z": 9.0, "vx": 0.2, "vy": 0.0, "vz": 0.0})
    known = update_link_state(update_link_state(LinkState(), camera, 0.0), own, 0.5)
    assert known.place_W_m == pytest.approx([1.0, 2.0, 3.0])
    assert known.velocity_W_m_s == (0.2, 0.0, 0.0)  # which the sensor does not give
    assert update_link_state(known, own, 1.5).place_W_m == pytest.approx([9.0, 9.0, 9.0])


@pytest.mark.parametrize(("frame", "child", "place"), [(1, 12, (1, 2, 3)), (4, 13, (2, 1, -3)), (21, 13, (1, -2, -3))])
def test_a_place_is_in_ned_whatever_frame_odometry_has(frame, child, place):
    """East, north, up and forward, left, up become north, east, down: fence and start use the estimator's place."""
    fields = {"frame_id": frame, "child_frame_id": child, "x": 1.0, "y": 2.0, "z": 3.0, "q": [1.0, 0.0, 0.0, 0.0]}
    assert after(MavlinkMessage(1, 197, "ODOMETRY", fields)).place_W_m == pytest.approx(place)


@pytest.mark.parametrize(
    ("system", "fields"),
    [(1, {"child_frame_id": 99}), (1, {"q": [0.0] * 4}), (1, {"x": math.nan}), (2, {})],
    ids=["frame", "quaternion", "number", "vehicle"],
)
def test_a_pose_that_the_estimator_refuses_is_not_a_fresh_one(system, fields):
    """Nor is one of another vehicle: the loss of the position must be noticed."""
    whole = {"frame_id": 1, "child_frame_id": 12, "x": 1.0, "y": 2.0, "z": 3.0, "q": [1.0, 0.0, 0.0, 0.0]}
    assert math.isinf(after(MavlinkMessage(system, 197, "ODOMETRY", {**whole, **fields})).pose_s)


def test_depth_is_positive_down():
    """VFR_HUD says an altitude."""
    assert after(MavlinkMessage(1, 1, "VFR_HUD", {"alt": -3.5})).depth_m == 3.5


def test_tilt_is_the_angle_of_the_body_from_upright():
    """By roll and pitch together; of an attitude that nobody said it is not a number."""
    said = MavlinkMessage(
        1, 1, "ATTITUDE", {"roll": 0.3, "pitch": 0.4, "yaw": 1.0, "rollspeed": 0, "pitchspeed": 0, "yawspeed": 0}
    )
    assert tilt_of(after(said)) == pytest.approx(math.acos(math.cos(0.3) * math.cos(0.4)))
    assert math.isnan(tilt_of(LinkState()))


def test_fields_of_a_real_message():
    """A message that pymavlink packed and read gives what was put in; fields of unwanted ones are not looked at."""
    mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    reader = ardupilotmega.MAVLink(None)
    packed = mav.param_value_encode(b"MOT_1_DIRECTION", -1.0, 9, 900, 3).pack(mav)
    packed += mav.named_value_float_encode(1, b"WKW_ENG", 1.0).pack(mav) + mav.system_time_encode(1, 1).pack(mav)
    known, unwanted = LinkState(), None
    for message in reader.parse_buffer(packed):
        unwanted = MavlinkMessage.of(message)
        known = update_link_state(known, unwanted, 3.0)
    assert dict(known.parameters) == {"MOT_1_DIRECTION": -1.0}
    assert known.named_value("WKW_ENG", 3.5) == (1.0, 0.5)
    assert unwanted is not None
    assert unwanted.fields == {}


@given(data=st.binary(max_size=400))
@settings(max_examples=200, deadline=None)
def test_any_bytes_leave_what_is_known_sound(data):
    """Whatever pymavlink makes of noise, nothing is raised and numbers that are kept are numbers."""
    reader = ardupilotmega.MAVLink(None)
    reader.robust_parsing = True
    known = LinkState()
    for message in reader.parse_buffer(data) or []:
        if message.get_type() != "BAD_DATA":
            known = update_link_state(known, MavlinkMessage.of(message), 1.0)
    assert known.place_W_m is None or np.isfinite(known.place_W_m).all()
