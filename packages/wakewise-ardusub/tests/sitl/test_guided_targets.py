"""GUIDED and POSHOLD of the stand-in, its bed and its survey sensors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, POSHOLD
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.modes import GUIDED
from wakewise_ardusub.sitl.sea_sensors import Relief, SeaSensors, SensorErrors, drawn_current

HEAVY = load_vehicle("bluerov2-heavy")
POSVEL, POSVELACC, VEL, POS = 0x800 | 0x1C0, 0x800, 0xDC7, 0xDF8


def guided(firmware: tuple[int, int, int] = (4, 5, 3), **more: Any) -> InProcessSession:
    """Armed and in GUIDED, in a current of 0.1 m/s to the east."""
    body = FreeWater(HEAVY, current=lambda _: np.array([0.0, 0.1, 0.0]))
    flight = InProcessSession(HEAVY, loop_hz=50.0, scripts={}, body=body, firmware=firmware, **more).run(0.2)
    flight.arm(True)
    flight.set_mode(GUIDED)
    return flight.run(8.0)


def send(flight: InProcessSession, mask: int, numbers: tuple[float, ...], yaw: float = 0.0, frame: int = 1) -> None:
    """One target: x, y, z, vx, vy, vz, ax, ay, az."""
    message = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *numbers, yaw, 0.0)
    flight.companion.send(message)


@pytest.mark.slow
@pytest.mark.parametrize("firmware", [(4, 5, 3), (4, 8, 0)])
def test_a_moving_target_is_followed_across_a_current_and_lapses_after_three_seconds(firmware: Any) -> None:
    """Within 2 mm/s and 2 cm; 3 s after the last message the vehicle stops, and holds where it is."""
    flight = guided(firmware)
    mask = POSVELACC if firmware >= (4, 8, 0) else POSVEL
    speeds, off = [], []
    for k in range(450):
        send(flight, mask, (0.01 * k, 0.0, 2.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0), yaw=0.5)
        flight.run(0.1)
        if k > 300:
            speeds.append(flight.autopilot.motion.v_W_m_s[0] - 0.1)
            off.append(flight.autopilot.motion.p_WB_m[1])
    assert np.sqrt(np.mean(np.square(speeds))) < 0.002
    assert np.abs(off).max() < 0.02
    assert euler_from_quat(flight.autopilot.motion.q_WB)[2] == pytest.approx(0.5, abs=0.02)
    assert flight.run(2.7).autopilot.motion.v_W_m_s[0] > 0.08
    assert abs(flight.run(6.0).autopilot.motion.v_W_m_s[0]) < 0.02
    place = flight.run(20.0).autopilot.motion.p_WB_m.copy()
    assert np.abs(flight.run(10.0).autopilot.motion.p_WB_m - place).max() < 0.02
    assert flight.autopilot.mode == GUIDED


@pytest.mark.parametrize(("rate", "turns_to"), [(0.2, 1.0), (-0.2, None), (0.0, 1.0)])
def test_a_turn_rate_beside_a_heading_is_the_rate_of_the_turn_and_a_negative_one_turns_away(
    rate: float, turns_to: float | None
) -> None:
    """As ArduSub: to 1 rad at 11 deg/s (whole degrees) or, for 0, at 60 deg/s; with -0.2 rad/s away from it."""
    flight = guided()
    place = flight.autopilot.motion.p_WB_m.copy()
    for _ in range(30):
        numbers = (*place, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        flight.companion.send(
            mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x1C0, *numbers, 1.0, rate)
        )
        flight.run(0.1)
    heading = euler_from_quat(flight.autopilot.motion.q_WB)[2]
    if turns_to is None:
        assert heading < -0.2
    elif rate:
        assert heading == pytest.approx(3.0 * math.radians(11.0), abs=0.1)
    else:
        assert heading == pytest.approx(turns_to, abs=0.05)


def test_targets_that_ardusub_does_not_take_change_nothing() -> None:
    """An acceleration before 4.8, an acceleration alone, another frame, no number, another mode."""
    flight = guided()
    before = flight.autopilot.target
    numbers = (5.0, 0.0, 2.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    send(flight, POSVELACC, numbers)
    send(flight, 0xC3F, numbers)
    send(flight, POSVEL, numbers, frame=mavlink.MAV_FRAME_GLOBAL)
    send(flight, POSVEL, (math.nan, *numbers[1:]))
    flight.run(0.1)
    assert flight.autopilot.target is before
    flight.set_mode(ALT_HOLD)
    send(flight, POSVEL, numbers)
    assert flight.run(0.1).autopilot.target is None


def test_offsets_in_the_body_frame_are_turned_by_the_heading() -> None:
    """A velocity ahead of a vehicle that heads east goes east; a position alone stays valid."""
    flight = guided()
    place = flight.autopilot.motion.p_WB_m.copy()
    send(flight, POS, (*place, 0, 0, 0, 0, 0, 0), yaw=0.0)
    assert flight.run(5.0).autopilot.target.velocity_W_m_s.tolist() == [0.0, 0.0, 0.0]
    send(flight, 0x9F8, (*place, 0, 0, 0, 0, 0, 0), yaw=math.pi / 2)
    flight.run(6.0)
    send(flight, VEL, (0, 0, 0, 0.2, 0, 0, 0, 0, 0), frame=mavlink.MAV_FRAME_BODY_NED)
    flight.run(2.0)
    assert flight.autopilot.target.velocity_W_m_s == pytest.approx([0.0, 0.2, 0.0], abs=0.02)


def test_poshold_holds_the_place_until_a_stick_moves_and_the_new_one_after_it() -> None:
    """Against the current within 3 cm; half a stick moves the vehicle by more than 0.3 m, where it then stays."""
    flight = guided()
    flight.set_mode(POSHOLD)
    place = flight.run(20.0).autopilot.motion.p_WB_m.copy()
    assert np.abs(flight.run(10.0).autopilot.motion.p_WB_m - place).max() < 0.03
    flight.sticks = (500, 0, 500, 0)
    flight.run(4.0)
    flight.sticks = (0, 0, 500, 0)
    moved = flight.run(20.0).autopilot.motion.p_WB_m.copy()
    assert moved[0] - place[0] > 0.3
    assert np.abs(flight.run(5.0).autopilot.motion.p_WB_m - moved).max() < 0.03


@pytest.mark.parametrize("shape", ["trapezoid", "sawtooth"])
def test_relief_is_within_its_height_and_no_steeper_than_its_slope(shape: Any) -> None:
    """Over four periods, from the bed's depth to that less the height; steps of 1 mm are no steeper than stated."""
    relief = Relief.drawn(shape, np.random.default_rng(3))
    depth = np.array([relief.bed_m(x, 0.3) for x in np.arange(0.0, 32.0, 0.001)])
    assert depth.max() == pytest.approx(relief.depth_m, abs=1e-3)
    assert depth.min() == pytest.approx(relief.depth_m - relief.height_m, abs=1e-3)
    assert np.abs(np.diff(depth)).max() <= 0.001 * relief.slope + 1e-9
    with pytest.raises(InputError, match="faces of slope"):
        Relief(shape=shape, height_m=2.0, slope=0.1)


def test_the_rangefinder_is_late_and_silent_in_a_drop_out() -> None:
    """It tells the distance of 0.3 s ago; without the Doppler log position modes are refused after 7 s."""
    quiet = SensorErrors(range_noise_m=0.0, outlier_share=0.0, gaps_per_min=0.0)
    sensors = SeaSensors(Relief(depth_m=4.0), quiet, np.random.default_rng(0))
    flight = guided(sensors=sensors)
    said = [m for m in flight.said if m.get_type() == "DISTANCE_SENSOR"]
    assert (said[-1].current_distance, said[-1].orientation) == (pytest.approx(200, abs=5), 25)
    sensors.range_lost = sensors.log_lost = True
    flight.said.clear()
    flight.run(8.0)
    assert not [m for m in flight.said if m.get_type() == "DISTANCE_SENSOR"]
    assert [m for m in flight.said if m.get_type() == "EKF_STATUS_REPORT"][-1].flags & mavlink.EKF_CONST_POS_MODE
    flight.set_mode(POSHOLD)
    assert flight.run(0.1).autopilot.mode == GUIDED
    assert flight.texts()[-1] == "Mode change failed: POSHOLD requires position"


@pytest.mark.parametrize("pitch_deg", [-10.0, 0.0, 10.0])
def test_a_tilted_rangefinder_sees_the_bed_along_its_own_axis(pitch_deg: float) -> None:
    """On a face of slope 0.25, 0.9 m below, the law of sines gives the range; it is not the depth over the cosine."""
    relief = Relief(shape="trapezoid", depth_m=5.0, height_m=0.6, slope=0.25, phase=0.3)
    sensors = SeaSensors(relief, SensorErrors(range_noise_m=0.0, outlier_share=0.0), np.random.default_rng(0))
    place = np.array([0.5, 0.0, relief.bed_m(0.5, 0.0) - 0.9])
    rises = (relief.bed_m(0.5, 0.0) - relief.bed_m(0.6, 0.0)) / 0.1
    assert abs(rises) == pytest.approx(0.25)
    tilt, face = np.radians(pitch_deg), np.arctan(rises)
    # pitched up, the body's z axis points ahead: towards a face that rises ahead
    expected = 0.9 * np.cos(face) / np.cos(tilt - face)
    motion = PhysicsState(
        time_s=0.0,
        p_WB_m=place,
        q_WB=quat_from_euler(0.0, tilt, 0.0),
        v_W_m_s=np.zeros(3),
        omega_B_rad_s=np.zeros(3),
        force_B_m_s2=np.zeros(3),
    )
    sensors.estimate(motion)
    assert sensors.distance_cm(0.3) == pytest.approx(100.0 * expected, abs=0.51)
    sensors.estimate(replace(motion, time_s=1.0, q_WB=quat_from_euler(0.0, np.radians(95.0), 0.0)))
    assert sensors.distance_cm(1.4) is None


def test_a_current_carries_a_vehicle_that_does_nothing() -> None:
    """After a minute without thrust it drifts as fast as the water, in the water's direction."""
    current = drawn_current(np.random.default_rng(2), 0.12, 0.0)
    body = FreeWater(HEAVY, current=current)
    for _ in range(3000):
        motion = body.step(np.zeros(8), 0.02)
    assert motion.v_W_m_s[:2] == pytest.approx(current(60.0)[:2], abs=0.01)
