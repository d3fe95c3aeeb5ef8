"""Measurements out of messages: when they were made, and in which frames."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.geometry import (
    Pose,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_matrix,
    quat_multiply,
)
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.pose_messages import odometry_pose
from wakewise_ardusub.link.telemetry_adapter import (
    SETTLED,
    SenderClock,
    TelemetryAdapter,
    to_measurements,
)

STILL = {"rollspeed": 0.0, "pitchspeed": 0.0, "yawspeed": 0.0}
UNIT = st.tuples(*(st.floats(-1.0, 1.0) for _ in range(4))).filter(lambda q: np.linalg.norm(q) > 0.1)
PLACE = st.tuples(*(st.floats(-50.0, 50.0) for _ in range(3)))


def attitude(boot_s: float, yaw: float = 0.0, **rates: float) -> MavlinkMessage:
    """ATTITUDE at a time since boot."""
    fields = {"time_boot_ms": round(1e3 * boot_s), "roll": 0.0, "pitch": 0.0, "yaw": yaw, **STILL, **rates}
    return MavlinkMessage(1, 1, "ATTITUDE", fields)


def place(boot_s: float) -> MavlinkMessage:
    """LOCAL_POSITION_NED at a time since boot."""
    fields = {"time_boot_ms": round(1e3 * boot_s), "x": 1.0, "y": 2.0, "z": 3.0, "vx": 0.0, "vy": 0.0, "vz": 0.0}
    return MavlinkMessage(1, 1, "LOCAL_POSITION_NED", fields)


@given(lags=st.lists(st.floats(0.0, 0.2), min_size=1, max_size=60))
@settings(max_examples=100, deadline=None)
def test_times_are_right_but_for_the_quickest_way(lags):
    """Messages that took up to 0.2 s: each is dated when it was made, plus at most what the quickest so far took."""
    clock, quickest = SenderClock(), math.inf
    for k, lag_s in enumerate(lags):
        made_s = 5.0 + 0.1 * k
        quickest = min(quickest, lag_s)
        clock, time_s, jump_s = clock.at(made_s, 1000.0 + made_s + lag_s)
        assert jump_s == 0.0
        assert time_s == pytest.approx(1000.0 + made_s + quickest, abs=1e-9)


@pytest.mark.parametrize("by_s", [-3600.0, -2.0, 2.0, 86400.0])
def test_a_clock_that_jumps_is_told_and_refused_for_a_while(by_s):
    """By how much it jumped is said once; then nothing is measured until it has gone on evenly."""
    telemetry, found = TelemetryAdapter(), ()
    for k in range(20):
        telemetry, found = to_measurements(telemetry, attitude(5000.0 + 0.02 * k), 1000.0 + 0.02 * k, 1)
    assert len(found) == 1
    answers = []
    for k in range(20, 40):
        telemetry, found = to_measurements(telemetry, attitude(5000.0 + by_s + 0.02 * k), 1000.0 + 0.02 * k, 1)
        answers.append(len(found))
    assert telemetry.jump == f"the clock of component 1 of system 1 jumped by {by_s:+.2f} s"
    assert answers == [0] * (SETTLED + 1) + [1] * (19 - SETTLED)


def test_a_position_gets_the_attitude_of_its_own_instant():
    """The attitude of 40 ms before, carried on by the rates that it came with."""
    telemetry, gyro = to_measurements(TelemetryAdapter(), attitude(10.0, yaw=0.5, yawspeed=1.0), 100.0, 1)
    assert gyro[0].omega_B_rad_s == pytest.approx([0.0, 0.0, 1.0])
    telemetry, found = to_measurements(telemetry, place(10.04), 100.04, 1)
    X_WB = found[0].X_WB
    assert X_WB.p_m == pytest.approx([1.0, 2.0, 3.0])
    assert pytest.approx(matrix_from_quat(quat_from_euler(0.0, 0.0, 0.54)), abs=1e-6) == X_WB.R


def test_a_position_without_a_fresh_attitude_is_no_pose():
    """None was heard, or the last is too old to be carried on."""
    assert to_measurements(TelemetryAdapter(), place(10.0), 100.0, 1)[1] == ()
    telemetry, _ = to_measurements(TelemetryAdapter(), attitude(10.0), 100.0, 1)
    assert to_measurements(telemetry, place(10.5), 100.5, 1)[1] == ()


def test_other_vehicles_measure_nothing():
    """Attitude of system 2, or of another component of ours, and system 2's odometry are not this vehicle's."""
    message = attitude(10.0)
    for system, component in ((2, 1), (1, 154)):
        said = MavlinkMessage(system, component, message.name, message.fields)
        assert to_measurements(TelemetryAdapter(), said, 100.0, 1)[1] == ()
    for system, measured in ((1, 1), (2, 0)):
        said = MavlinkMessage(system, 197, "ODOMETRY", odometry())
        assert len(to_measurements(TelemetryAdapter(), said, 100.0, 1)[1]) == measured


def test_specific_force_at_rest_points_up():
    """RAW_IMU says -1000 mG along z at rest."""
    said = MavlinkMessage(1, 1, "RAW_IMU", {"time_usec": 10_000_000, "xacc": 0, "yacc": 0, "zacc": -1000})
    found = to_measurements(TelemetryAdapter(), said, 100.0, 1)[1]
    assert found[0].force_B_m_s2 == pytest.approx([0.0, 0.0, -9.81], abs=0.01)


def test_a_cameras_pose_puts_the_autopilots_estimate_aside():
    """VISION_POSITION_ESTIMATE is a pose; while it comes LOCAL_POSITION_NED is none."""
    telemetry, _ = to_measurements(TelemetryAdapter(), attitude(10.0), 100.0, 1)
    seen = {"usec": 7_000_000, "x": 1.0, "y": 2.0, "z": 3.0, "roll": 0.1, "pitch": 0.2, "yaw": 0.3}
    telemetry, found = to_measurements(telemetry, MavlinkMessage(1, 197, "VISION_POSITION_ESTIMATE", seen), 100.0, 1)
    assert found[0].X_WB.q == pytest.approx(quat_from_euler(0.1, 0.2, 0.3))
    assert to_measurements(telemetry, place(10.02), 100.02, 1)[1] == ()


@given(p=PLACE, q=UNIT)
@settings(max_examples=100, deadline=None)
def test_odometry_is_the_same_pose_in_every_frame(p, q):
    """Written in NED and FRD, in ENU and FLU, and in local FLU: one pose to 1e-9."""
    wanted = Pose(np.array(p), np.array(q) / np.linalg.norm(q))
    enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    flu = np.diag([1.0, -1.0, -1.0])
    for world, body, frame, child in ((np.eye(3), np.eye(3), 1, 12), (enu, flu, 4, 13), (flu, flu, 21, 13)):
        R = world.T @ wanted.R @ body
        x, y, z = world.T @ wanted.p_m
        fields = {"frame_id": frame, "child_frame_id": child, "x": x, "y": y, "z": z, "q": list(quat_from_matrix(R))}
        found = odometry_pose(fields)
        assert found.p_m == pytest.approx(wanted.p_m, abs=1e-9)
        turned = quat_multiply(quat_conjugate(wanted.q), found.q)
        assert abs(turned[0]) == pytest.approx(1.0, abs=1e-9)


def odometry() -> dict[str, object]:
    """Fields of an ODOMETRY at the origin."""
    return {"time_usec": 1, "frame_id": 1, "child_frame_id": 12, "x": 0.0, "y": 0.0, "z": 0.0, "q": [1.0, 0, 0, 0]}


@pytest.mark.parametrize("fields", [{"frame_id": 0}, {"child_frame_id": 99}, {"q": [0.0] * 4}, {"x": math.nan}])
def test_odometry_that_is_none_measures_nothing(fields):
    """A global frame, an unknown one, no quaternion, no number: nothing is measured and nothing raised."""
    said = MavlinkMessage(1, 197, "ODOMETRY", {**odometry(), **fields})
    assert to_measurements(TelemetryAdapter(), said, 100.0, 1)[1] == ()
