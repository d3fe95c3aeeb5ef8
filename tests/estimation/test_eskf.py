"""The filter alone: what it makes of sensors that are noisy, late, silent or broken, and how well it knows itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from wakewise.core.geometry import (
    Pose,
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)
from wakewise.core.interfaces import BodyState, Measurement
from wakewise.estimation import ErrorStateFilter
from wakewise.estimation.eskf_kernels import residual_wrench
from wakewise.estimation.settings import FilterSettings, Priors
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body, load_vehicle, step_rk4
from wakewise.simulation.tank.sensors import FORCE_WALK_M_S2, GYRO_WALK_RAD_S, GaussMarkovProcess
from wakewise.simulation.tank.settings import MismatchSettings, SensorSettings

VEHICLE = load_vehicle("paper")
STEADY = Priors(pose_slow_std_m=0.0, pose_slow_std_rad=0.0, tracking_slow_std_m=0.0, depth_bias_std_m=0.0)
"""What is to be assumed of sensors none of whose errors last."""
BODY = compile_body(VEHICLE)
DT = 0.02


def record(
    *,
    seconds,
    latency_s=0.03,
    offset_m=0.0,
    gyro_bias=0.0,
    noise=1.0,
    silent=(np.inf, np.inf),
    priors=None,
    seed=0,
    load_W_N=None,
    outlier_every=0,
    slow_m=0.0,
    slow_rad=0.0,
    depth_bias_m=0.0,
    settings=None,
):
    """Fly the nominal vehicle on thrusts that wander, filter its sensors; returns errors, NEES of the pose and state.

    Errors per step: position, velocity, attitude, rate (each three). `load_W_N(t)` pulls at the vehicle unknown to
    the filter; every n-th pose is half a metre off where `outlier_every` says so. `slow_m` and `slow_rad` are spreads
    of errors of poses that last half a minute; unless `priors` say otherwise the filter knows of none.
    """
    rng = np.random.default_rng(seed)
    shift, turn = (
        GaussMarkovProcess(spread, 30.0, r) for spread, r in zip((slow_m, slow_rad), rng.spawn(2), strict=True)
    )
    filter_ = ErrorStateFilter(VEHICLE, settings, priors=priors or STEADY)
    p, q, nu = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0, 0, 0]), np.zeros(6)
    start = p + offset_m * np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0)
    state = filter_.init(BodyState(X_WB=Pose(start, q)))
    thrusts, command, queue, errors, nees, pose_due, poses = np.zeros(8), np.zeros(8), [], [], [], 1.0 / 62.0, 0
    for k in range(round(seconds / DT)):
        if k % 25 == 0:
            command = rng.normal(size=8) * 0.2
        now, v_before = (k + 1) * DT, matrix_from_quat(q) @ nu[:3]
        for sub in range(4):
            thrusts = thruster_lag(thrusts, command, VEHICLE.time_constants_s, DT / 4)
            wrench = VEHICLE.allocation_matrix @ thrusts
            if load_W_N is not None:
                wrench[:3] += matrix_from_quat(q).T @ load_W_N(k * DT)
            p, q, nu = step_rk4(BODY, p, q, nu, wrench, np.zeros(3), DT / 4)
            t = k * DT + (sub + 1) * DT / 4
            if t >= pose_due - 1e-9:
                pose_due, poses = pose_due + 1.0 / 62.0, poses + 1
                turned = quat_multiply(q, quat_from_rotvec(noise * 0.0035 * rng.normal(size=3) + turn.at(t)))
                seen = p + noise * 0.002 * rng.normal(size=3) + shift.at(t)
                if outlier_every and poses % outlier_every == 0:
                    seen = seen + np.array([0.5, 0.0, 0.0])
                if not silent[0] <= t < silent[1]:
                    queue.append((t + latency_s, Measurement(time_s=t, X_WB=Pose(seen, turned))))
        arrived = tuple(m for due, m in queue if due <= now + 1e-9)
        queue = [(due, m) for due, m in queue if due > now + 1e-9]
        R = matrix_from_quat(q)
        gyro = nu[3:] + gyro_bias + noise * 0.002 * rng.normal(size=3)
        force = R.T @ ((R @ nu[:3] - v_before) / DT - [0.0, 0.0, 9.80665]) + noise * 0.05 * rng.normal(size=3)
        depth = float(p[2] + depth_bias_m + noise * 0.005 * rng.normal())
        arrived += (Measurement(time_s=now, omega_B_rad_s=gyro, force_B_m_s2=force, depth_m=depth),)
        state, estimate = filter_.step(state, DT, arrived, command)
        tilt = rotvec_from_quat(quat_multiply(quat_conjugate(estimate.X_WB.q), q))
        error = np.r_[p - estimate.X_WB.p_m, nu[:3] - estimate.nu_B[:3], tilt, nu[3:] - estimate.nu_B[3:]]
        errors.append(error)
        pose_error = np.r_[error[:3], tilt]
        nees.append(pose_error @ np.linalg.solve(estimate.covariance[:6, :6], pose_error))
    return np.array(errors), np.array(nees), state


def rms(errors):
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def test_noise_is_averaged_away():
    """Raw poses of 3.5 mm and 0.35 deg leave less than 1.5 mm, 0.1 deg, and velocity is known to millimetres."""
    errors, _, state = record(seconds=12.0)
    late = errors[250:]
    assert rms(late[:, :3]) < 0.0015
    assert rms(late[:, 3:6]) < 0.003
    assert rms(late[:, 6:9]) < np.radians(0.1)
    assert rms(late[:, 9:]) < 0.006
    assert state.rejected <= 2
    assert state.late == 0


@pytest.mark.slow
def test_the_filter_knows_how_wrong_it_is():
    """Told the sensors' own noise, its mean NEES over independent flights is within the 95 % bounds of chi-square.

    Told what a user would state, which is rounded up, it claims less than it knows, and no more.
    """
    own = FilterSettings(
        position_std_m=0.002,
        attitude_std_rad=0.0035,
        gyro_std_rad_s=0.002,
        accelerometer_std_m_s2=0.05,
        depth_std_m=0.005,
    )
    at, stated = (
        np.array([record(seconds=6.0, seed=seed, settings=s)[1][[200, 299]] for seed in range(12)])
        for s in (own, FilterSettings())
    )
    low, high = chi2.ppf([0.025, 0.975], 6 * at.size) / at.size
    assert low < at.mean() < high
    assert 0.3 * at.mean() < stated.mean() < at.mean()


def test_exact_sensors_and_model_leave_next_to_no_error():
    """Without noise what is left is far below the noise that the filter assumes."""
    errors, _, _ = record(seconds=6.0, noise=0.0)
    assert rms(errors[100:, :3]) < 3e-4
    assert rms(errors[100:, 6:9]) < 5e-4


def test_a_start_five_centimetres_off_is_forgotten():
    """Within a second the first guess does not matter any more."""
    errors, _, _ = record(seconds=3.0, offset_m=0.05)
    assert np.linalg.norm(errors[0, :3]) > 0.02
    assert rms(errors[50:, :3]) < 0.003


def test_a_gyro_bias_is_found():
    """0.01 rad/s of bias, three times what is expected, ends up in the bias and not in attitude or rate."""
    errors, _, state = record(seconds=15.0, gyro_bias=0.01)
    np.testing.assert_allclose(state.gyro_bias_rad_s, 0.01, atol=0.0015)
    assert rms(errors[-250:, 6:9]) < np.radians(0.1)
    assert rms(errors[-250:, 9:]) < 0.006


def test_ten_seconds_without_poses_are_bridged_and_owned_up_to():
    """From 5 to 15 s no pose arrives: the estimate stays within three of its own sigmas, and then returns."""
    errors, nees, state = record(seconds=17.0, silent=(5.0, 15.0))
    assert np.linalg.norm(errors[250:750, :3], axis=1).max() < 0.25
    assert nees[745] < chi2.ppf(0.999, 6)
    assert rms(errors[800:, :3]) < 0.003
    assert state.position_std_m < 0.003


def test_uncertainty_grows_while_poses_are_missing():
    """After five seconds without a pose the filter claims ten times the error that it has with poses."""
    _, _, with_poses = record(seconds=5.0)
    _, _, without = record(seconds=10.0, silent=(5.0, 20.0))
    assert without.position_std_m > 10.0 * with_poses.position_std_m


def test_latency_is_taken_back():
    """Poses 90 ms old, three times the usual, are late for the default wait and harmless for a longer one."""
    fresh, _, _ = record(seconds=8.0, latency_s=0.0)
    waited, _, state = record(seconds=8.0, latency_s=0.09, priors=replace(STEADY, settle_s=0.095))
    _, _, hurried = record(seconds=2.0, latency_s=0.09)
    assert state.late == 0
    assert hurried.late > 80
    assert rms(waited[200:, :3]) < 2.0 * rms(fresh[200:, :3])


def test_wrong_poses_are_left_out():
    """Every tenth pose half a metre off changes next to nothing, and each is counted."""
    errors, _, state = record(seconds=8.0, outlier_every=10)
    assert rms(errors[200:, :3]) < 0.002
    assert 45 <= state.rejected <= 55


def test_a_sudden_load_is_noticed_and_found():
    """3 N from nowhere at 4 s: a few centimetres for a moment, then a load estimate of 3 N, and calm again."""

    def pull(t):
        return np.array([3.0, 0.0, 0.0]) if t >= 4.0 else np.zeros(3)

    errors, _, state = record(seconds=12.0, load_W_N=pull)
    assert np.linalg.norm(errors[200:, :3], axis=1).max() < 0.06
    assert rms(errors[400:, :3]) < 0.003
    load_B = residual_wrench(
        BODY.packed, np.array(VEHICLE.allocation_matrix), state.mean, state.thrusts_N, state.rest_q
    )
    np.testing.assert_allclose(matrix_from_quat(state.mean[3:7]) @ load_B[:3], [3.0, 0.0, 0.0], atol=0.35)


def test_waves_are_followed():
    """A load that swings by 1 N at 0.3 Hz, far beyond the assumed noise, costs millimetres and no rejected poses."""
    errors, _, state = record(seconds=12.0, load_W_N=lambda t: np.array([np.sin(0.6 * np.pi * t), 0.0, 0.0]))
    assert rms(errors[200:, :3]) < 0.004
    assert state.rejected < 20


def test_what_is_broken_or_too_old_is_left_out():
    """NaN in gyro, depth, force or thrusts, and a pose from long ago, change nothing: same estimate as silence."""
    filter_ = ErrorStateFilter(VEHICLE)
    start = filter_.init(BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.0]))))
    lost, nothing = np.full(3, np.nan), float("nan")
    old = Measurement(time_s=-5.0, X_WB=Pose(np.array([9.0, 9.0, 9.0])))
    nonsense = Measurement(time_s=0.02, omega_B_rad_s=lost, force_B_m_s2=lost, p_WB_m=lost, depth_m=nothing)
    first, silent = filter_.step(start, DT, (), np.zeros(8))
    second, noisy = filter_.step(start, DT, (old, nonsense), np.full(8, np.nan))
    np.testing.assert_array_equal(silent.X_WB.p_m, noisy.X_WB.p_m)
    np.testing.assert_array_equal(first.mean, second.mean)
    assert second.late == 1
    assert np.isfinite(second.mean).all()


def test_order_of_arrival_does_not_matter():
    """The same measurements handed over early or late, within the wait, leave the same settled state."""
    filter_ = ErrorStateFilter(VEHICLE)
    rng = np.random.default_rng(3)
    samples = [
        Measurement(time_s=0.02 * (k + 1), X_WB=Pose(0.002 * rng.normal(size=3)), depth_m=float(0.005 * rng.normal()))
        for k in range(20)
    ]
    settled = []
    for lag in (0, 1):
        state = filter_.init(BodyState(X_WB=Pose(np.zeros(3))))
        for k in range(30):
            batch = tuple(samples[k - lag : k - lag + 1]) if k >= lag else ()
            state, _ = filter_.step(state, DT, batch, np.full(8, 0.1))
        settled.append(state)
    np.testing.assert_allclose(settled[0].mean, settled[1].mean, atol=1e-12)
    assert settled[0].accepted == settled[1].accepted == 40


@pytest.mark.parametrize(("ratio", "least", "most"), [(0.5, 1.0, 3.2), (1.0, 4.0, 8.0), (2.0, 12.0, 40.0)])
def test_the_claim_follows_the_assumed_slow_error(ratio, least, most):
    """Poses off by half, once and twice what is assumed: NEES of 6 components near 1.5, 6 and 24, white noise aside.

    Told of no slow error, the filter claims to be hundreds of times surer than it is.
    """
    slow = {"slow_m": ratio * 0.004, "slow_rad": ratio * 0.0026}
    found = [record(seconds=3.0, seed=seed, priors=Priors(), **slow)[1][-1] for seed in range(12)]
    assert least < np.mean(found) < most
    if ratio == 1.0:
        blind = [record(seconds=3.0, seed=seed, **slow)[1][-1] for seed in range(3)]
        assert np.mean(blind) > 20.0 * np.mean(found)


def test_a_depth_that_is_off_for_good_does_not_drag_the_place_along():
    """3 cm of bias: with it as a state the height stays within 5 mm, without it is pulled off by more."""
    within, _, state = record(seconds=6.0, priors=Priors(), depth_bias_m=0.03)
    dragged, _, _ = record(seconds=6.0, depth_bias_m=0.03)
    assert np.abs(within[200:, 2]).max() < 0.005 < np.abs(dragged[200:, 2]).max()
    assert state.mean[-1] == pytest.approx(0.03, abs=0.005)


def test_the_filters_figures_are_not_the_tanks():
    """None of the spreads that the filter assumes of sensors and vehicle is the one that the tank draws with."""
    filter_, priors, tank, apart = FilterSettings(), Priors(), SensorSettings(), MismatchSettings()
    pairs = [
        (filter_.position_std_m, tank.pose_noise_m),
        (filter_.attitude_std_rad, tank.pose_noise_rad),
        (filter_.tracking_std_m, tank.tracking_noise_m),
        (filter_.gyro_std_rad_s, tank.gyro_noise_rad_s),
        (filter_.accelerometer_std_m_s2, tank.accelerometer_noise_m_s2),
        (filter_.depth_std_m, tank.depth_noise_m),
        (priors.gyro_bias_std_rad_s, tank.gyro_bias_rad_s),
        (priors.accelerometer_bias_std_m_s2, tank.accelerometer_bias_m_s2),
        (priors.depth_bias_std_m, tank.depth_bias_m),
        (priors.gain_std, 0.01 * apart.thrust_pct / np.sqrt(3.0)),
        (priors.drag_std, 0.01 * apart.damping_pct / np.sqrt(3.0)),
        (priors.gyro_bias_walk_rad_s2, GYRO_WALK_RAD_S),
        (priors.accelerometer_bias_walk_m_s3, FORCE_WALK_M_S2),
    ]
    for assumed, drawn in pairs:
        assert abs(np.log(assumed / drawn)) > 0.1, (assumed, drawn)
