"""Sensors: rates, latency, noise of the stated size, one seed one record."""

import numpy as np
import pytest

from wakewise.geometry import Pose, quat_conjugate, quat_from_euler, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.interfaces import BodyState
from wakewise.tank import Sensors
from wakewise.tank.sensors import _turned, pose_loss
from wakewise.tank.settings import SensorSettings

STATE = BodyState(
    X_WB=Pose(np.array([0.1, -0.2, 0.8]), quat_from_euler(0.1, -0.2, 0.7)), nu_B=np.array([0, 0, 0, 0.1, 0.2, -0.3])
)

VECTOR = np.concatenate([STATE.X_WB.p_m, STATE.X_WB.q, STATE.nu_B])
FORCE = np.array([0.3, -0.1, -9.8])


def _record(seconds, seed=0, turbidity=0.0, **settings):
    sensors = Sensors(SensorSettings(**settings), np.random.default_rng(seed))
    out = []
    while sensors.next_due_s() <= seconds:
        time_s = sensors.next_due_s()
        sensors.sample(time_s, VECTOR, FORCE, turbidity)
        out += [(time_s, m) for m in sensors.collect(time_s)]
    return out


def test_each_sensor_keeps_its_rate():
    """Ten seconds hold 620 poses and 100 tracked places less those under way, 500 inertial and 200 depth samples."""
    record = [m for _, m in _record(10.0, pose_dropout=0.0)]
    assert sum(m.X_WB is not None for m in record) in (618, 619, 620)
    assert sum(m.p_WB_m is not None for m in record) in (99, 100)
    assert sum(m.omega_B_rad_s is not None and m.force_B_m_s2 is not None for m in record) == 500
    assert sum(m.depth_m is not None for m in record) == 200


def test_a_pose_arrives_late_with_the_time_it_was_taken():
    """Poses come no sooner than their latency after their stamp, tracking after its own; the rest at once."""
    for now, m in _record(2.0, pose_latency_s=0.1, tracking_latency_s=0.05):
        late = now - m.time_s
        least = 0.1 if m.X_WB is not None else 0.05 if m.p_WB_m is not None else 0.0
        assert late >= least - 1e-9
        assert least > 0.0 or late < 1e-9


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


def test_the_accelerometer_feels_the_specific_force():
    """Its mean is the true specific force within the bias, its scatter the stated noise."""
    force = np.array([m.force_B_m_s2 for _, m in _record(60.0) if m.force_B_m_s2 is not None]) - FORCE
    assert np.abs(force.mean(axis=0)).max() < 4 * 0.05
    assert force.std(axis=0) == pytest.approx(np.full(3, 0.05), rel=0.08)


def test_poses_fail_in_turbid_water_and_leave_the_noise_alone():
    """1 % fail in clear water, all where 5 % of the contrast is left; those that do not fail are the same poses."""
    clear = {m.time_s: m.X_WB.p_m for _, m in _record(20.0) if m.X_WB is not None}
    murky = {m.time_s: m.X_WB.p_m for _, m in _record(20.0, turbidity=3.8) if m.X_WB is not None}
    blind = [m for _, m in _record(20.0, turbidity=4.3) if m.X_WB is not None]
    assert 1220 <= len(clear) <= 1238
    assert 0 < len(murky) < 0.6 * len(clear)
    assert not blind
    assert all(np.array_equal(p, clear[t]) for t, p in murky.items() if t in clear)


def test_an_outage_is_an_outage():
    """Between the stated times there is no pose, before and after there are."""
    times = [m.time_s for _, m in _record(6.0, pose_outages_s=((2.0, 4.0),)) if m.X_WB is not None]
    assert not [t for t in times if 2.0 <= t < 4.0]
    assert min(times) < 2.0
    assert max(times) > 4.0


def test_contrast_decides_on_poses():
    """Loss rises from the plain dropout to certainty as exp(-c d) falls from the least contrast to half of it."""
    assert pose_loss(0.0, 0.7, 0.01) == pytest.approx(0.01)
    assert pose_loss(np.log(10.0) / 0.7, 0.7, 0.01) == pytest.approx(0.01)
    assert pose_loss(np.log(20.0) / 0.7, 0.7, 0.01) == pytest.approx(1.0)
    assert 0.1 < pose_loss(np.log(14.0) / 0.7, 0.7, 0.01) < 0.9


def test_a_turned_attitude_is_the_product_of_quaternions():
    """For large, small and no turns the compiled product is the geometry's."""
    for turn in ([0.3, -0.2, 1.1], [1e-9, 0.0, 2e-9], [0.0, 0.0, 0.0]):
        expected = quat_multiply(STATE.X_WB.q, quat_from_rotvec(turn))
        assert _turned(np.array(STATE.X_WB.q), np.array(turn)) == pytest.approx(expected, abs=1e-15)
