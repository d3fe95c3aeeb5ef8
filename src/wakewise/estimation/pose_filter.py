"""Where the vehicle is and how it moves, from camera poses, a gyro and a depth sensor.

A Kalman filter in its steady state: the gains are constants, found once from the assumed noise by the discrete Riccati
equation (B. D. O. Anderson and J. B. Moore, Optimal Filtering, 1979, chapter 4), so a step costs microseconds.

- Each axis of the world has position, velocity and an unmodelled acceleration (a random walk: trim, current, drag that
  the model has not got). Between poses they are moved by the vehicle's equations under the commanded thrusts.
- Attitude follows the gyro, less its bias, and is drawn to the poses: a complementary correction.
- A measurement is compared with where the vehicle was when it was taken, by velocity and acceleration over its age.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from wakewise.arrays import Array, freeze
from wakewise.estimation.kernels import body_twist, predict, take_depth, take_pose
from wakewise.estimation.settings import FilterSettings
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Measurement
from wakewise.vehicles import Vehicle, acceleration, compile_body


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterState:
    """Mean of the filter.

    `mean`, shape (19,), as laid out in `kernels`; `thrusts_N`, shape (n,), what the thrusters are believed to give
    now, behind their commands. `time_s` counts from the start, on the clock of the measurements.
    """

    time_s: float
    mean: Array
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, mean=(19,), thrusts_N=(None,))

    @property
    def unmodelled_W_m_s2(self) -> Array:
        """Steady acceleration that the model does not explain, shape (3,), in the world."""
        return self.mean[6:9]

    @property
    def gyro_bias_rad_s(self) -> Array:
        """Estimated bias of the gyro, shape (3,)."""
        return self.mean[16:19]


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterGains:
    """Steady-state gains; `move` and `depth`, shape (3,), `turn`, shape (2,), as `kernels.take_pose` wants them."""

    move: Array
    depth: Array
    turn: Array
    gyro: float
    rate_without_gyro: float

    def __post_init__(self) -> None:
        freeze(self, move=(3,), depth=(3,), turn=(2,))


def steady_gain(F: Array, Q: Array, H: Array, R: float) -> tuple[Array, Array]:
    """Steady-state Kalman gain, shape (n,), and covariance before the update, shape (n, n), of one scalar measurement.

    F (n, n) advances the state, Q (n, n) is the process noise of that step, H (n,) the measured row, R its variance.
    """
    P = np.asarray(solve_discrete_are(F.T, H[:, None], Q, np.array([[R]])))
    return P @ H / (H @ P @ H + R), P


def filter_gains(settings: FilterSettings) -> FilterGains:
    """Gains that the assumed noise leads to."""
    dt = 1.0 / settings.pose_rate_hz
    modelled = settings.motion_model == "vehicle"
    white = settings.acceleration_noise_m_s2 if modelled else settings.manoeuvre_noise_m_s2
    walk = settings.disturbance_walk_m_s2
    F = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    Q = white**2 * np.array([[dt**3 / 3, dt**2 / 2, 0.0], [dt**2 / 2, dt, 0.0], [0.0, 0.0, 0.0]])
    Q += walk**2 * np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    if modelled:
        move, P = steady_gain(F, Q, np.array([1.0, 0.0, 0.0]), settings.position_std_m**2)
    else:
        # Without a model there is no steady error of one: position and velocity only.
        short, P2 = steady_gain(F[:2, :2], Q[:2, :2], np.array([1.0, 0.0]), settings.position_std_m**2)
        move, P = np.append(short, 0.0), np.zeros((3, 3))
        P[:2, :2] = P2
    # Attitude error and gyro bias: d(theta)/dt = gyro - bias. A gyro sample's noise held for one sample is white noise.
    angle = settings.gyro_std_rad_s**2 / settings.gyro_rate_hz
    bias = settings.gyro_bias_walk_rad_s2**2
    turn, _ = steady_gain(
        np.array([[1.0, -dt], [0.0, 1.0]]),
        np.array([[angle * dt + bias * dt**3 / 3, -bias * dt**2 / 2], [-bias * dt**2 / 2, bias * dt]]),
        np.array([1.0, 0.0]),
        settings.attitude_std_rad**2,
    )
    turning = settings.turning_noise_rad_s2**2
    gyro, _ = steady_gain(
        np.eye(1), np.array([[turning / settings.gyro_rate_hz]]), np.ones(1), settings.gyro_std_rad_s**2
    )
    alone, _ = steady_gain(
        F[:2, :2],
        turning * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]),
        np.array([1.0, 0.0]),
        settings.attitude_std_rad**2,
    )
    return FilterGains(
        move=move,
        depth=P[:, 0] / (P[0, 0] + settings.depth_std_m**2),
        turn=turn,
        gyro=float(gyro[0]),
        rate_without_gyro=float(alone[1]),
    )


class PoseFilter:
    """Steady-state pose filter on a nominal vehicle; implements `wakewise.interfaces.Estimator`.

    Its clock starts at `start_s` with `init` and must be that of the measurements' time stamps. While poses are
    missing the estimate runs on by the model and the gyro, held in depth by the pressure sensor.
    """

    def __init__(self, vehicle: Vehicle, settings: FilterSettings | None = None, start_s: float = 0.0) -> None:
        self.settings = settings or FilterSettings()
        self.gains = filter_gains(self.settings)
        self._start_s = start_s
        self._body = compile_body(vehicle)
        self._B = vehicle.allocation_matrix
        self._lag_s = np.maximum(vehicle.time_constants_s, 1e-9)
        self._modelled = self.settings.motion_model == "vehicle"

    def init(self, start: BodyState) -> FilterState:
        """State at the start, from a first guess; thrusters still, no bias."""
        mean = np.zeros(19)
        mean[:3] = start.X_WB.p_m
        mean[3:6] = start.X_WB.R @ start.nu_B[:3]
        mean[9:13] = start.X_WB.q
        mean[13:16] = start.nu_B[3:]
        return FilterState(time_s=self._start_s, mean=mean, thrusts_N=np.zeros(self._B.shape[1]))

    def step(
        self, state: FilterState, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[FilterState, BodyState]:
        """Advance by `dt_s` under the commanded thrusts, shape (n,), take in what was measured, and say where we are.

        Measurements that are not finite, or older than the settings allow, are left out; one from the future counts
        as new.
        """
        mean = state.mean.copy()
        now_s = state.time_s + dt_s
        commands = np.where(np.isfinite(thrusts_N), thrusts_N, 0.0)
        kept = np.exp(-dt_s / self._lag_s)
        thrusts = commands + kept * (state.thrusts_N - commands)
        twist_rate = np.zeros(6)
        if self._modelled:
            # Mean thrust over the step, exact for the first-order lag.
            push = commands + (state.thrusts_N - commands) * (self._lag_s / dt_s) * (1.0 - kept)
            twist_rate = acceleration(self._body, mean[9:13], body_twist(mean), self._B @ push, _STILL)
        usable = [m for m in measurements if now_s - m.time_s <= self.settings.oldest_s]
        rates = [m.omega_B_rad_s for m in usable if m.omega_B_rad_s is not None and np.isfinite(m.omega_B_rad_s).all()]
        gyro = np.sum(rates, axis=0) / len(rates) if rates else np.zeros(3)
        a_W = predict(mean, twist_rate, dt_s, gyro, bool(rates), self.gains.gyro)
        rate_gain = 0.0 if rates else self.gains.rate_without_gyro
        for measured in usable:
            age_s = max(now_s - measured.time_s, 0.0)
            if measured.X_WB is not None and np.isfinite(measured.X_WB.p_m.sum() + measured.X_WB.q.sum()):
                take_pose(
                    mean, measured.X_WB.p_m, measured.X_WB.q, age_s, self.gains.move, self.gains.turn, rate_gain, a_W
                )
            if measured.depth_m is not None and np.isfinite(measured.depth_m):
                take_depth(mean, float(measured.depth_m), age_s, self.gains.depth, a_W)
        estimate = BodyState(X_WB=Pose(mean[:3], mean[9:13]), nu_B=body_twist(mean))
        return FilterState(time_s=now_s, mean=mean, thrusts_N=thrusts), estimate


_STILL = np.zeros(3)
_STILL.setflags(write=False)
