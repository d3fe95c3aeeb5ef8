"""Error-state extended Kalman filter (ESKF): pose, twist, load and current from camera, tracking, inertial unit, depth.

After J. Sola, Quaternion kinematics for the error-state Kalman filter, arXiv:1711.02508, section 5, with the attitude
error in the body. The mean is predicted by the vehicle's equations of motion under the commanded thrusts, the
covariance by the Jacobian of the same step.

*States.* Pose, twist, thruster gains, drag, inertia, current, unmodelled force and moment at rest (trim, tether, the
current's drag), inertial biases, and slow errors of the sensors whose standard deviation is set: camera (calibration,
refraction), tracking, depth zero. Gains, drag and current are not observable in hover; their covariance stays.

*Late measurements* are processed in the order of their time stamps. The stored state is `settle_s` behind the present;
each step predicts a copy of it to now. Measurements later than `settle_s` are left out and counted.

*Adaptive process noise.* The running mean of the normalised innovations of poses scales the process noise (after R. K.
Mehra, Approaches to adaptive filtering, IEEE Trans. Autom. Control 17 (1972) 693, doi 10.1109/TAC.1972.1100100): it
grows after a sudden load and shrinks back to the settings.

*Gates.* Measurements with a Mahalanobis distance beyond the chi-squared quantile of `gate` are rejected and counted.
After `gate_patience` rejected poses in a row the initial covariance is added.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Measurement
from wakewise.estimation.corrections import NOTHING, correct_by_force, correct_by_pose, correct_by_sum
from wakewise.estimation.current_from_drag import current_if_known
from wakewise.estimation.eskf_kernels import CURRENT, FORCE, GYRO, TICK_S, TURNING, advance, residual_wrench
from wakewise.estimation.settings import FilterSettings, Priors
from wakewise.robot.vehicles import Vehicle, compile_body, with_each_drag


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterState:
    """State of the filter.

    `mean`, shape (E + 1,), and `covariance`, shape (E, E), as laid out in `eskf_kernels`, hold at `settled_s`; so do
    `thrusts_N`, shape (n,), what the thrusters are believed to give, behind their commands. `rest_q`, shape (4,), is
    the first attitude, at which the unmodelled load is given. `time_s` is now, on the clock of the
    measurements. `commands` (start time, thrusts) and `pending` measurements lie between the two times.
    """

    time_s: float
    settled_s: float
    mean: Array
    covariance: Array
    thrusts_N: Array
    rest_q: Array
    commands: tuple[tuple[float, Array], ...] = ()
    pending: tuple[Measurement, ...] = ()
    consecutive_rejected_poses: int = 0
    innovation_mean: Array = field(default_factory=lambda: np.zeros(6))
    noise_scale: float = 1.0
    accepted: int = 0
    rejected: int = 0
    late: int = 0

    def __post_init__(self) -> None:
        errors = len(self.mean) - 1
        freeze(
            self, mean=(errors + 1,), covariance=(errors, errors), thrusts_N=(None,), rest_q=(4,), innovation_mean=(6,)
        )

    @property
    def gyro_bias_rad_s(self) -> Array:
        """Estimated bias of the gyro, shape (3,)."""
        return self.mean[19:22]

    @property
    def position_std_m(self) -> float:
        """How far off the position may be, one sigma of its distance, at `settled_s`."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))


class ErrorStateFilter:
    """Error-state Kalman filter on a nominal vehicle; implements `wakewise.core.interfaces.Estimator`.

    Its clock starts at `start_s` with `init` and must be that of the measurements' time stamps. While poses are
    missing the estimate runs on by the model and the inertial unit, held in depth by the pressure sensor, and its
    covariance grows; all of it is in `BodyState.covariance` of what `step` returns.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        settings: FilterSettings | None = None,
        start_s: float = 0.0,
        priors: Priors | None = None,
    ) -> None:
        self.settings = settings or FilterSettings()
        s = self.priors = priors or Priors()
        self._start_s = start_s
        self._body = compile_body(vehicle)
        self._packed = self._body.packed
        self._drags = np.stack([compile_body(other).packed for other in with_each_drag(vehicle)])
        self._B = vehicle.allocation_matrix
        self._lag_s = np.maximum(vehicle.time_constants_s, 1e-9)
        self._noise = np.array([
            s.acceleration_noise_m_s2, s.turning_noise_rad_s2, s.force_walk_N, s.moment_walk_N_m,
            s.gyro_bias_walk_rad_s2, s.accelerometer_bias_walk_m_s3,
        ])  # fmt: skip
        # chdtri is the inverse of chi-squared's upper tail.
        self._gate = {
            n: float(chdtri(n, self.settings.gate)) if self.settings.gate > 0.0 else np.inf for n in (1, 3, 6)
        }
        spread = (
            s.start_std_m, s.start_std_rad, s.start_std_m_s, s.start_std_rad_s, s.force_std_N, s.moment_std_N_m,
            s.gyro_bias_std_rad_s, s.accelerometer_bias_std_m_s2,
        )  # fmt: skip
        n = self._B.shape[1]
        lasting = np.repeat([s.current_std_m_s, s.drag_std, s.inertia_std, s.gain_std], [3, 6, 6, n])
        time_constants_s = np.full(len(lasting), s.lasting_s)
        self._slow = {"camera": NOTHING, "tracking": NOTHING, "depth": NOTHING}
        """Where the slow errors of the sensors begin among the errors."""
        for sensor, spreads, time_s in (
            ("camera", np.repeat([s.pose_slow_std_m, s.pose_slow_std_rad], 3), s.slow_s),
            ("tracking", np.full(3, s.tracking_slow_std_m), s.slow_s),
            ("depth", np.array([s.depth_bias_std_m]), s.lasting_s),
        ):
            if spreads.any():
                self._slow[sensor] = CURRENT + len(lasting)
                lasting = np.concatenate([lasting, spreads])
                time_constants_s = np.concatenate([time_constants_s, np.full(len(spreads), time_s)])
        self._lasting, self._time_constants_s = lasting, time_constants_s
        self._start_covariance = np.diag(np.square(np.concatenate([np.repeat(spread, 3), lasting])))
        self._errors = len(self._start_covariance)

    def init(self, start: BodyState) -> FilterState:
        """State at the start; zero thrust, bias and unmodelled load."""
        mean = np.zeros(self._errors + 1)
        mean[:3], mean[3:7], mean[7:13] = start.X_WB.p_m, start.X_WB.q, start.nu_B
        return FilterState(
            time_s=self._start_s,
            settled_s=self._start_s,
            mean=mean,
            covariance=self._start_covariance,
            thrusts_N=np.zeros(self._B.shape[1]),
            rest_q=start.X_WB.q,
        )

    def step(
        self, state: FilterState, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[FilterState, BodyState]:
        """Predict by `dt_s` under the commanded thrusts, shape (n,), correct by the measurements, return the
        estimate.
        """
        now_s = state.time_s + dt_s
        commands = (*state.commands, (state.time_s, np.where(np.isfinite(thrusts_N), thrusts_N, 0.0)))
        fresh = tuple(m for m in measurements if m.time_s > state.settled_s - TICK_S)
        pending = tuple(sorted((*state.pending, *fresh), key=lambda m: m.time_s))
        settled_s = max(now_s - self.priors.settle_s, state.settled_s)
        due = tuple(m for m in pending if m.time_s <= settled_s + TICK_S)
        rest = pending[len(due) :]
        work = _WorkingState(state, commands)
        for measured in due:
            self._advance(work, min(measured.time_s, settled_s))
            self._correct(work, measured)
        self._advance(work, settled_s)
        begun = max((k for k, (since, _) in enumerate(commands) if since <= settled_s + TICK_S), default=0)
        settled = FilterState(
            time_s=now_s,
            settled_s=settled_s,
            mean=work.mean,
            covariance=work.P,
            thrusts_N=work.thrusts_N,
            rest_q=state.rest_q,
            commands=commands[begun:],
            pending=rest,
            consecutive_rejected_poses=work.rejected_in_a_row,
            innovation_mean=work.innovation_mean,
            noise_scale=work.noise_scale,
            accepted=work.accepted,
            rejected=work.rejected,
            late=state.late + len(measurements) - len(fresh),
        )
        return settled, self._present(work, rest, now_s)

    def _present(self, work: _WorkingState, rest: tuple[Measurement, ...], now_s: float) -> BodyState:
        """Predict from `settled_s` to now with the pending measurements; the result is not stored."""
        for measured in rest:
            self._advance(work, min(measured.time_s, now_s))
            self._correct(work, measured)
        self._advance(work, now_s)
        mean = work.mean
        load_B = residual_wrench(self._packed, self._B, mean, work.thrusts_N, work.rest_q)
        force_W_N, around = mean[13:16], work.P[FORCE : FORCE + 3, FORCE : FORCE + 3]
        water = current_if_known(self._drags, work.rest_q, force_W_N, around, self.priors.drag_std)
        current, spread = (None, None) if water is None else water
        return BodyState(
            X_WB=Pose(mean[:3], mean[3:7]),
            nu_B=mean[7:13],
            load_B=load_B,
            covariance=work.P[:12, :12],
            current_W_m_s=current,
            current_covariance=spread,
        )

    def _advance(self, work: _WorkingState, until_s: float) -> None:
        """Predict to a time, command by command."""
        if until_s - work.time_s > TICK_S:
            work.time_s = advance(
                self._packed, self._B, self._lag_s, work.mean, work.P, work.thrusts_N, work.rest_q, work.since_s,
                work.commands_N, work.time_s, until_s, self._noise_in_current(work.mean), work.noise_scale,
                self._lasting, self._time_constants_s,
            )  # fmt: skip

    def _noise_in_current(self, mean: Array) -> Array:
        """Process noise, shape (6,), with the walk of the load that a turbulent current makes."""
        noise = self._noise.copy()
        walk_N = self.priors.turbulence_rate * math.hypot(mean[13], mean[14])
        noise[2] += walk_N
        noise[3] += self.priors.turbulence_arm_m * walk_N
        return noise

    def _correct(self, work: _WorkingState, measured: Measurement) -> None:
        s, slow = self.settings, self._slow
        if measured.X_WB is not None:
            self._correct_pose(work, measured.X_WB, measured.pose_std)
        if measured.p_WB_m is not None:
            self._correct_sum(work, measured.p_WB_m, 0, slow["tracking"], s.tracking_std_m)
        if measured.depth_m is not None:
            self._correct_sum(work, (measured.depth_m,), 2, slow["depth"], s.depth_std_m)
        if measured.omega_B_rad_s is not None:
            self._correct_sum(work, measured.omega_B_rad_s, TURNING, GYRO, s.gyro_std_rad_s)
        if measured.force_B_m_s2 is not None:
            self._correct_force(work, measured.force_B_m_s2, measured.time_s)

    def _correct_pose(self, work: _WorkingState, seen: Pose, std: tuple[float, float] | None) -> None:
        """Correct by a camera pose and adapt the process noise.

        `std`, m and rad, is its noise where it states one: then it has no slow error, since it defines the frame.
        """
        if work.rejected_in_a_row >= self.priors.gate_patience:
            work.P += self._start_covariance
        distance, work.noise_scale = correct_by_pose(
            work.mean,
            work.P,
            seen.p_m,
            seen.q,
            self._slow["camera"] if std is None else NOTHING,
            *(std or (self.settings.position_std_m, self.settings.attitude_std_rad)),
            self._gate[6],
            work.innovation_mean,
            work.noise_scale,
        )
        work.rejected_in_a_row = 0 if work.count(distance, self._gate[6]) else work.rejected_in_a_row + 1

    def _correct_sum(self, work: _WorkingState, values: ArrayLike, first: int, second: int, std: float) -> None:
        """Correct by a sensor of the errors from `first` on, with its slow error from `second` on."""
        measured = _numbers(values)
        if measured is not None:
            gate = self._gate[len(measured)]
            work.count(correct_by_sum(work.mean, work.P, measured, first, second, std, gate), gate)

    def _correct_force(self, work: _WorkingState, values: ArrayLike, time_s: float) -> None:
        """Correct by the accelerometer; noise includes the modelled acceleration's white error over one period."""
        force_B_m_s2 = _numbers(values)
        if force_B_m_s2 is None:
            return
        period_s = max(time_s - work.force_s, 1e-3) if work.force_s is not None else 0.02
        work.force_s = time_s
        std = math.hypot(
            self.settings.accelerometer_std_m_s2, self.priors.acceleration_noise_m_s2 / math.sqrt(period_s)
        )
        gate = self._gate[3]
        distance = correct_by_force(
            self._packed, self._B, work.mean, work.P, work.thrusts_N, work.rest_q, force_B_m_s2, std, gate
        )
        work.count(distance, gate)


def _numbers(values: ArrayLike) -> Array | None:
    """Values of a sensor, shape (m,), or None if one is not finite."""
    measured = np.array(values, dtype=np.float64)
    return measured if math.isfinite(sum(measured.tolist())) else None


class _WorkingState:
    """Working copy of the state during one step."""

    def __init__(self, state: FilterState, commands: tuple[tuple[float, Array], ...]) -> None:
        self.time_s = state.settled_s
        self.mean, self.P = state.mean.copy(), state.covariance.copy()
        self.thrusts_N, self.rest_q = state.thrusts_N.copy(), state.rest_q
        self.rejected_in_a_row = state.consecutive_rejected_poses
        self.innovation_mean, self.noise_scale = state.innovation_mean.copy(), state.noise_scale
        self.accepted, self.rejected = state.accepted, state.rejected
        self.force_s: float | None = None
        self.since_s = np.array([since for since, _ in commands])
        self.commands_N = np.array([thrusts for _, thrusts in commands])

    def count(self, distance: float, gate: float) -> bool:
        """Count a measurement as accepted or rejected; returns whether it was accepted."""
        right = distance <= gate
        self.accepted += right
        self.rejected += not right
        return right
