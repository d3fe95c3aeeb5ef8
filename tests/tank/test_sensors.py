"""Sensors: rates, latency, noise of the stated size, one seed one record."""

import numpy as np
import pytest

from wakewise.geometry import Pose, quat_conjugate, quat_from_euler, quat_multiply, rotvec_from_quat
from wakewise.interfaces import BodyState
from wakewise.tank import Sensors, TankSettings

STATE = BodyState(
    X_WB=Pose(np.array([0.1, -0.2, 0.8]), quat_from_euler(0.1, -0.2, 0.7)), nu_B=np.array([0, 0, 0, 0.1, 0.2, -0.3])
)


def _record(seconds, seed=0, **settings):
    sensors = Sensors(TankSettings(**settings), np.random.default_rng(seed))
    out = []
    while sensors.next_due_s() <= seconds:
        time_s = sensors.next_due_s()
        sensors.sample(time_s, STATE)
        out += [(time_s, m) for m in sensors.collect(time_s)]
    return out


def test_each_sensor_keeps_its_rate():
    """Ten seconds hold 620 poses less those under way, 500 gyro and 200 depth samples."""
    record = [m for _, m in _record(10.0)]
    assert sum(m.X_WB is not None for m in record) in (618, 619, 620)
    assert sum(m.omega_B_rad_s is not None for m in record) == 500
    assert sum(m.depth_m is not None for m in record) == 200


def test_a_pose_arrives_late_with_the_time_it_was_taken():
    """Poses come no sooner than their latency after their stamp; gyro and depth at once."""
    for now, m in _record(2.0, pose_latency_s=0.1):
        late = now - m.time_s
        assert late >= 0.1 - 1e-9 if m.X_WB is not None else late == pytest.approx(0.0, abs=1e-9)


def test_noise_has_the_stated_size():
    """Scatter of pose, gyro and depth is what the settings say, within 8 %; the gyro has a constant bias."""
    record = [m for _, m in _record(60.0)]
    poses = [m.X_WB for m in record if m.X_WB is not None]
    position = np.array([X.p_m - STATE.X_WB.p_m for X in poses])
    turn = np.array([rotvec_from_quat(quat_multiply(quat_conjugate(STATE.X_WB.q), X.q)) for X in poses])
    gyro = np.array([m.omega_B_rad_s for m in record if m.omega_B_rad_s is not None]) - STATE.nu_B[3:]
    depth = np.array([m.depth_m for m in record if m.depth_m is not None]) - 0.8
    assert position.std() == pytest.approx(0.002, rel=0.08)
    assert turn.std() == pytest.approx(0.0035, rel=0.08)
    assert gyro.std(axis=0) == pytest.approx(np.full(3, 0.002), rel=0.08)
    assert np.abs(gyro.mean(axis=0)).max() > 1e-4
    assert depth.std() == pytest.approx(0.005, rel=0.08)


def test_changing_one_sensor_leaves_the_others_alone():
    """A faster pose does not change the gyro's noise."""
    one, two = ([m.omega_B_rad_s for _, m in _record(2.0, pose_rate_hz=r)] for r in (62.0, 100.0))
    assert np.array_equal(np.array([w for w in one if w is not None]), np.array([w for w in two if w is not None]))
