"""Where the vehicle is, how it moves and how sure that is, from camera poses, tracking, an inertial unit and depth.

An error-state Kalman filter (J. Sola, Quaternion kinematics for the error-state Kalman filter, arXiv:1711.02508,
section 5, for the error of attitude in the body): the mean moves by the vehicle's own equations under the commanded
thrusts; the covariance moves by the Jacobian of the very same step.

**What is not known** stays so for longer than a sample, so it is no white noise: the gains of the thrusters, drag,
inertia and the current are states with a stated spread, next to a force and a moment that nothing explains (trim,
tether, the current at rest, see `resting`) and the inertial unit's biases. While a vehicle hovers these cannot be told
apart and need not be; when the camera is lost and the vehicle sets off, they carry it away from its estimate, and the
covariance knows it.

**Slow errors of the sensors** (a camera's calibration, map and refraction, the tracking's own, the pressure sensor's
zero), if their spread is stated, are states, too: they do not average out, and the covariance then says so.

**Late measurements** are taken in the order in which they were made. The filter lives `settle_s` behind the present,
where nothing is missing any more; for the answer of each step a copy of it runs on to now with what has arrived so
far, mostly the inertial unit. A measurement later than `settle_s` is left out and counted.

**Sudden loads**: the model's errors are small as long as nothing pulls at the vehicle, and a filter that says so is
surprised by a wave, a tether or a thruster that fails: its innovations then lean to one side for a while. Their running
mean, in units of what chance allows, is the surprise (after R. K. Mehra, Approaches to adaptive filtering, IEEE Trans.
Autom. Control 17 (1972) 693, doi 10.1109/TAC.1972.1100100): above 1 the model's noise grows, below it shrinks back to
the settings.

**The current** is told from the level part of the load at rest (`current`), once that is known.

**Wrong measurements** (chance below `gate` by the filter's own covariance) are left out and counted; after
`gate_patience` poses in a row the filter gives in: it takes itself to know as little as at the start.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from wakewise.arrays import Array, freeze
from wakewise.estimation.current import told_current
from wakewise.estimation.kernels import (
    CURRENT,
    FORCE,
    GYRO,
    correct,
    felt,
    predict,
    turn_between,
    turned_by,
    unexplained,
)
from wakewise.estimation.settings import FilterSettings, Priors
from wakewise.geometry import Pose, matrix_from_quat
from wakewise.interfaces import BodyState, Measurement
from wakewise.physics import GRAVITY_M_S2
from wakewise.vehicles import Vehicle, compile_body, with_each_drag

_TICK_S = 1e-9
_MEMORY = 15  # poses that the mean of innovations goes back, a quarter of a second at 62 Hz
_CHANCE = 9.0 / (2 * _MEMORY - 1)  # square of three sigmas of that mean for a filter whose noise is right
_CLIP = 3.0  # one wrong pose counts for no more sigmas than this
_LARGEST_SURPRISE = 10.0
_HASTE = 0.1  # growth of the noise per pose and unit of surprise: at most tenfold in 3 poses, back by half in 7
_NOISIEST = 300.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FilterState:
    """Everything that the filter remembers.

    `mean`, shape (E + 1,), and `covariance`, shape (E, E), as laid out in `kernels`, hold at `settled_s`; so do
    `thrusts_N`, shape (n,), what the thrusters are believed to give, behind their commands. `rest_q`, shape (4,), is
    the attitude that the unmodelled load is told for, the first one. `time_s` is now, on the clock of the measurements.
    `commands` (from when, thrusts) and `waiting` measurements are what lies between.
    """

    time_s: float
    settled_s: float
    mean: Array
    covariance: Array
    thrusts_N: Array
    rest_q: Array
    commands: tuple[tuple[float, Array], ...] = ()
    waiting: tuple[Measurement, ...] = ()
    poses_refused_in_a_row: int = 0
    leaning: Array = field(default_factory=lambda: np.zeros(6))
    noise_scale: float = 1.0
    taken: int = 0
    refused: int = 0
    late: int = 0

    def __post_init__(self) -> None:
        errors = len(self.mean) - 1
        freeze(self, mean=(None,), covariance=(errors, errors), thrusts_N=(None,), rest_q=(4,), leaning=(6,))

    @property
    def unmodelled_force_W_N(self) -> Array:
        """Force at rest that the model does not explain, the current's drag in it, shape (3,), in the world."""
        return self.mean[13:16]

    @property
    def gyro_bias_rad_s(self) -> Array:
        """Estimated bias of the gyro, shape (3,)."""
        return self.mean[19:22]

    @property
    def position_std_m(self) -> float:
        """How far off the position may be, one sigma of its distance, at `settled_s`."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))


class ErrorStateFilter:
    """Error-state Kalman filter on a nominal vehicle; implements `wakewise.interfaces.Estimator`.

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
        self._drags = tuple(compile_body(other).packed for other in with_each_drag(vehicle))
        self._B = vehicle.allocation_matrix
        self._lag_s = np.maximum(vehicle.time_constants_s, 1e-9)
        self._noise = np.array(
            [
                s.acceleration_noise_m_s2,
                s.turning_noise_rad_s2,
                s.force_walk_N,
                s.moment_walk_N_m,
                s.gyro_bias_walk_rad_s2,
                s.accelerometer_bias_walk_m_s3,
            ]
        )
        # chdtri is the inverse of chi-squared's upper tail.
        self._gate = {
            n: float(chdtri(n, self.settings.gate)) if self.settings.gate > 0.0 else np.inf for n in (1, 3, 6)
        }
        spread = (
            s.start_std_m,
            s.start_std_rad,
            s.start_std_m_s,
            s.start_std_rad_s,
            s.force_std_N,
            s.moment_std_N_m,
            s.gyro_bias_std_rad_s,
            s.accelerometer_bias_std_m_s2,
        )
        n = self._B.shape[1]
        lasting = np.repeat([s.current_std_m_s, s.drag_std, s.inertia_std, s.gain_std], [3, 6, 6, n])
        lasts_s = np.full(len(lasting), s.lasting_s)
        self._slow: dict[str, int] = {}
        """Where the slow errors of the sensors that have one begin among the errors."""
        for sensor, spreads, time_s in (
            ("camera", np.repeat([s.pose_slow_std_m, s.pose_slow_std_rad], 3), s.slow_s),
            ("tracking", np.full(3, s.tracking_slow_std_m), s.slow_s),
            ("depth", np.array([s.depth_bias_std_m]), s.lasting_s),
        ):
            if spreads.any():
                self._slow[sensor] = CURRENT + len(lasting)
                lasting = np.concatenate([lasting, spreads])
                lasts_s = np.concatenate([lasts_s, np.full(len(spreads), time_s)])
        self._lasting, self._lasts_s = lasting, lasts_s
        self._start_covariance = np.diag(np.square(np.concatenate([np.repeat(spread, 3), lasting])))
        self._errors = len(self._start_covariance)

    def init(self, start: BodyState) -> FilterState:
        """State at the start, from a first guess; thrusters still, no bias, nothing unmodelled."""
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
        """Advance by `dt_s` under the commanded thrusts, shape (n,), take in what was measured, say where we are."""
        now_s = state.time_s + dt_s
        commands = (*state.commands, (state.time_s, np.where(np.isfinite(thrusts_N), thrusts_N, 0.0)))
        fresh = tuple(m for m in measurements if m.time_s > state.settled_s - _TICK_S)
        waiting = tuple(sorted((*state.waiting, *fresh), key=lambda m: m.time_s))
        settled_s = max(now_s - self.priors.settle_s, state.settled_s)
        due = tuple(m for m in waiting if m.time_s <= settled_s + _TICK_S)
        rest = waiting[len(due) :]
        walk = _Walk(state, commands)
        for measured in due:
            self._advance(walk, min(measured.time_s, settled_s))
            self._take(walk, measured)
        self._advance(walk, settled_s)
        begun = max((k for k, (since, _) in enumerate(commands) if since <= settled_s + _TICK_S), default=0)
        settled = replace(
            state,
            time_s=now_s,
            settled_s=settled_s,
            mean=walk.mean.copy(),
            covariance=walk.P.copy(),
            thrusts_N=walk.thrusts_N,
            commands=commands[begun:],
            waiting=rest,
            poses_refused_in_a_row=walk.refused_in_a_row,
            leaning=walk.leaning,
            noise_scale=walk.noise_scale,
            taken=walk.taken,
            refused=walk.refused,
            late=state.late + len(measurements) - len(fresh),
        )
        return settled, self._present(walk, rest, now_s)

    def _present(self, walk: _Walk, rest: tuple[Measurement, ...], now_s: float) -> BodyState:
        """Carry the settled state on to now with what has arrived meanwhile; kept for this answer only."""
        for measured in rest:
            self._advance(walk, min(measured.time_s, now_s))
            self._take(walk, measured)
        self._advance(walk, now_s)
        mean = walk.mean
        load_B = unexplained(self._packed, self._B, mean, walk.thrusts_N, walk.rest_q)
        force_W_N, around = mean[13:16], walk.P[FORCE : FORCE + 3, FORCE : FORCE + 3]
        water = told_current(self._drags, walk.rest_q, force_W_N, around, self.priors.drag_std)
        current, spread = (None, None) if water is None else water
        return BodyState(
            X_WB=Pose(mean[:3], mean[3:7]),
            nu_B=mean[7:13],
            load_B=load_B,
            covariance=walk.P[:12, :12],
            current_W_m_s=current,
            current_covariance=spread,
        )

    def _advance(self, walk: _Walk, until_s: float) -> None:
        """Move on to a time, command by command."""
        while until_s - walk.time_s > _TICK_S:
            command, changes_s = walk.command_at(walk.time_s)
            end_s = min(until_s, changes_s)
            dt_s = end_s - walk.time_s
            kept = np.exp(-dt_s / self._lag_s)
            # Mean thrust over the step, exact for the first-order lag.
            push = command + (walk.thrusts_N - command) * (self._lag_s / dt_s) * (1.0 - kept)
            noise = self._noise.copy()
            noise[:4] *= walk.noise_scale
            predict(
                self._packed, self._B, walk.mean, walk.P, push, walk.rest_q, dt_s, noise, self._lasting, self._lasts_s
            )
            walk.thrusts_N = command + kept * (walk.thrusts_N - command)
            walk.time_s = end_s

    def _take(self, walk: _Walk, measured: Measurement) -> None:
        s = self.settings
        if measured.X_WB is not None and np.isfinite(measured.X_WB.p_m.sum() + measured.X_WB.q.sum()):
            if walk.refused_in_a_row >= self.priors.gate_patience:
                walk.P[np.diag_indices(self._errors)] += np.diag(self._start_covariance)
            H, residual, std = self._pose_rows(walk, measured.X_WB)
            self._heed(walk, residual / np.sqrt(np.einsum("ij,jk,ik->i", H, walk.P, H) + std**2))
            distance = self._correct(walk, H, residual, std)
            walk.refused_in_a_row = 0 if distance <= self._gate[6] else walk.refused_in_a_row + 1
        if measured.p_WB_m is not None and np.isfinite(measured.p_WB_m).all():
            H = np.zeros((3, self._errors))
            H[:, :3] = np.eye(3)
            residual = measured.p_WB_m - walk.mean[:3] - self._slow_part(walk, "tracking", H, 3)
            self._correct(walk, H, residual, np.full(3, s.tracking_std_m))
        if measured.depth_m is not None and np.isfinite(measured.depth_m):
            H = np.zeros((1, self._errors))
            H[0, 2] = 1.0
            residual = measured.depth_m - walk.mean[2:3] - self._slow_part(walk, "depth", H, 1)
            self._correct(walk, H, residual, np.array([s.depth_std_m]))
        if measured.omega_B_rad_s is not None and np.isfinite(measured.omega_B_rad_s).all():
            H = np.zeros((3, self._errors))
            H[:, 9:12] = H[:, GYRO : GYRO + 3] = np.eye(3)
            expected = walk.mean[10:13] + walk.mean[19:22]
            self._correct(walk, H, measured.omega_B_rad_s - expected, np.full(3, s.gyro_std_rad_s))
        if measured.force_B_m_s2 is not None and np.isfinite(measured.force_B_m_s2).all():
            self._take_force(walk, measured.force_B_m_s2, measured.time_s)

    def _pose_rows(self, walk: _Walk, seen: Pose) -> tuple[Array, Array, Array]:
        """Jacobian (6, E), residual (6,) and noise (6,) of a camera pose, its slow error included."""
        H, residual, q = np.zeros((6, self._errors)), np.empty(6), walk.mean[3:7]
        H[:, :6] = np.eye(6)
        slow = self._slow_part(walk, "camera", H, 6)
        residual[:3] = seen.p_m - walk.mean[:3] - slow[:3]
        if slow.any():
            q = turned_by(q, slow[3:])
        residual[3:] = turn_between(q, seen.q)
        return H, residual, np.repeat([self.settings.position_std_m, self.settings.attitude_std_rad], 3)

    def _slow_part(self, walk: _Walk, sensor: str, H: Array, size: int) -> Array:
        """A sensor's slow error as believed, shape (size,), and its columns in H."""
        k = self._slow.get(sensor)
        if k is None:
            return np.zeros(size)
        H[:, k : k + size] = np.eye(size)
        return walk.mean[k + 1 : k + 1 + size]

    @staticmethod
    def _heed(walk: _Walk, innovation: Array) -> None:
        """Let the model's noise follow what the normalised innovations of poses, shape (6,), say about it."""
        walk.leaning = walk.leaning + (np.clip(innovation, -_CLIP, _CLIP) - walk.leaning) / _MEMORY
        surprise = min(float(np.max(walk.leaning**2)) / _CHANCE, _LARGEST_SURPRISE)
        walk.noise_scale = float(np.clip(walk.noise_scale * np.exp(_HASTE * (surprise - 1.0)), 1.0, _NOISIEST))

    def _take_force(self, walk: _Walk, force_B_m_s2: Array, time_s: float) -> None:
        """Accelerometer: dv/dt + omega x v - R' g, seen through tilt, the unmodelled force and the bias.

        The white error of the modelled acceleration,
        over one period of the sensor, counts as noise.
        """
        mean = walk.mean
        R_WB = matrix_from_quat(mean[3:7])
        down_B = R_WB.T @ np.array([0.0, 0.0, GRAVITY_M_S2])
        H = np.empty((3, self._errors))
        expected = felt(self._packed, self._B, mean, walk.thrusts_N, walk.rest_q, down_B, H)
        period_s = max(time_s - walk.force_s, 1e-3) if walk.force_s is not None else 0.02
        walk.force_s = time_s
        s = self.settings
        std = np.hypot(s.accelerometer_std_m_s2, self.priors.acceleration_noise_m_s2 / np.sqrt(period_s))
        self._correct(walk, H, force_B_m_s2 - expected, np.full(3, std))

    def _correct(self, walk: _Walk, H: Array, residual: Array, std: Array) -> float:
        gate = self._gate[len(residual)]
        distance = float(correct(walk.mean, walk.P, H, residual, np.diag(std**2), gate))
        walk.taken += distance <= gate
        walk.refused += distance > gate
        return distance


class _Walk:
    """The filter on its way from one settled instant to the next, and on to now; lives for one step."""

    def __init__(self, state: FilterState, commands: tuple[tuple[float, Array], ...]) -> None:
        self.time_s = state.settled_s
        self.mean, self.P = state.mean.copy(), state.covariance.copy()
        self.thrusts_N, self.rest_q = state.thrusts_N, state.rest_q
        self.refused_in_a_row = state.poses_refused_in_a_row
        self.leaning, self.noise_scale = state.leaning, state.noise_scale
        self.taken, self.refused = state.taken, state.refused
        self.force_s: float | None = None
        self._commands = commands

    def command_at(self, time_s: float) -> tuple[Array, float]:
        """Thrusts commanded at a time, and until when."""
        for k in range(len(self._commands) - 1, -1, -1):
            if self._commands[k][0] <= time_s + _TICK_S:
                after_s = self._commands[k + 1][0] if k + 1 < len(self._commands) else np.inf
                return self._commands[k][1], after_s
        return self._commands[0][1], self._commands[1][0] if len(self._commands) > 1 else np.inf
