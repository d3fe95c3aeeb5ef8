"""Sensors: rates, latency, noise of the stated size, one seed one record."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.core.geometry import (
    Pose,
    quat_conjugate,
    quat_from_euler,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)
from wakewise.core.interfaces import BodyState
from wakewise.simulation.tank import Sensors
from wakewise.simulation.tank.sensors import _turned, pose_loss
from wakewise.simulation.tank.settings import SensorSettings

STATE = BodyState(
    X_WB=Pose(np.array([0.1, -0.2, 0.8]), quat_from_euler(0.1, -0.2, 0.7)), nu_B=np.array([0, 0, 0, 0.1, 0.2, -0.3])
)

VECTOR = np.concatenate([STATE.X_WB.p_m, STATE.X_WB.q, STATE.nu_B])
FORCE = np.array([0.3, -0.1, -9.8])


NOTHING_LASTS = {
    "pose_drift_m": (0.0, 0.0),
    "pose_drift_rad": (0.0, 0.0),
    "pose_timestamp_delay_s": (0.0, 0.0),
    "pose_outliers": 0.0,
    "tracking_drift_m": (0.0, 0.0),
    "depth_bias_m": 0.0,
}
"""Sensors whose errors are all gone at the next sample, but for the inertial unit's bias."""


def _record(seconds, seed=0, turbidity=0.0, **settings):
    sensors = Sensors(SensorSettings(**(NOTHING_LASTS | settings)), np.random.default_rng(seed))
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
    """Scatter of pose, gyro and depth is what the settings say, within 8 %; the gyro has a bias."""
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


def _place_errors(record):
    return np.array([m.X_WB.p_m - STATE.X_WB.p_m for m in record if m.X_WB is not None])


def test_a_poses_lasting_error_does_not_average_out():
    """The mean over two seconds is off by millimetres, each flight by its own; over 60 flights by the stated spread."""
    flights = [[m for _, m in _record(2.0, seed=k, pose_drift_m=(0.004, 0.004))] for k in range(60)]
    means = np.array([_place_errors(record).mean(axis=0) for record in flights])
    assert means.std() == pytest.approx(0.004, rel=0.2)
    exact = np.array([_place_errors([m for _, m in _record(2.0, seed=k)]).mean(axis=0) for k in range(5)])
    assert np.abs(exact).max() < 1e-3


def test_each_lasting_error_is_its_own_sensors():
    """Attitude, tracking and depth are off for good where they are told to be; the other sensors say what they said."""
    before = [m for _, m in _record(5.0)]
    for settings, of in (
        ({"pose_drift_rad": (0.003, 0.003)}, lambda m: m.X_WB is not None and m.X_WB.q),
        ({"tracking_drift_m": (0.004, 0.004)}, lambda m: m.p_WB_m),
        ({"depth_bias_m": 0.02}, lambda m: m.depth_m),
    ):
        after = [m for _, m in _record(5.0, **settings)]
        assert len(after) == len(before)
        changed = [
            not np.array_equal(of(a), of(b))
            for a, b in zip(before, after, strict=True)
            if of(a) is not None and of(a) is not False
        ]
        assert all(changed)
        for other in (lambda m: m.omega_B_rad_s, lambda m: m.X_WB and m.X_WB.p_m):
            assert all(np.array_equal(other(a), other(b)) for a, b in zip(before, after, strict=True))
    bias = np.array([m.depth_m for _, m in _record(5.0, depth_bias_m=0.02) if m.depth_m is not None]) - 0.8
    assert abs(bias.mean()) > 5.0 * bias.std() / np.sqrt(len(bias))


def test_a_pose_is_stamped_late_by_the_flights_own_delay():
    """Its stamp runs behind the picture by one value of the span, the same all flight; never behind its arrival."""
    exact = [m.time_s for _, m in _record(3.0) if m.X_WB is not None]
    late = [m.time_s for _, m in _record(3.0, pose_timestamp_delay_s=(0.005, 0.02)) if m.X_WB is not None]
    by = np.array(late) - np.array(exact)
    assert 0.005 <= by[0] <= 0.02 and by == pytest.approx(np.full(len(by), by[0]))
    hurried = [
        (now, m.time_s) for now, m in _record(1.0, pose_timestamp_delay_s=(0.02, 0.02), pose_latency_s=0.0) if m.X_WB
    ]
    assert hurried and all(stamp <= now + 1e-9 for now, stamp in hurried)


def test_one_pose_in_a_hundred_is_far_off():
    """0.6 to 1.6 % of 3,700 poses are off by centimetres, the others not at all."""
    plain = _place_errors([m for _, m in _record(60.0)])
    some = _place_errors([m for _, m in _record(60.0, pose_outliers=0.01)])
    moved = np.linalg.norm(some - plain, axis=1)
    assert 0.006 < np.mean(moved > 0.0) < 0.016
    assert np.median(moved[moved > 0.0]) > 0.05


def test_the_inertial_bias_walks():
    """Over 200 flights of 20 s the gyro's bias has gone 5e-5 sqrt(20) rad/s from where it was, within 15 %."""
    gone = []
    for k in range(200):
        settings = {
            "imu_rate_hz": 1.0,
            "gyro_noise_rad_s": 0.0,
            "gyro_bias_rad_s": 0.0,
            "pose_rate_hz": 0.1,
            "depth_rate_hz": 0.1,
        }
        rates = [
            m.omega_B_rad_s
            for _, m in _record(20.0, seed=k, tracking_rate_hz=0.0, **settings)
            if m.omega_B_rad_s is not None
        ]
        gone.append(rates[-1] - STATE.nu_B[3:])
    assert np.std(gone) == pytest.approx(5e-5 * np.sqrt(20.0), rel=0.15)


def test_errors_that_last_are_on_by_default():
    """A default sensor has each of them."""
    s = SensorSettings()
    assert min(s.pose_drift_m[0], s.pose_drift_rad[0], s.pose_timestamp_delay_s[0], s.tracking_drift_m[0]) > 0.0
    assert s.pose_outliers > 0.0 and s.depth_bias_m > 0.0


@pytest.mark.parametrize(
    "bad",
    [
        {"pose_drift_m": (0.005, 0.003)},
        {"pose_drift_time_s": (0.0, 10.0)},
        {"pose_drift_rad": (-0.1, 0.1)},
        {"pose_outliers": 1.5},
    ],
)
def test_spans_that_make_no_sense_are_refused(bad):
    """The first above the second, a memory of nothing, a negative spread, a chance above one."""
    with pytest.raises(ValidationError):
        SensorSettings(**bad)
