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
        freeze(self, mean=(errors + 1,), covariance=(errors, errors), thrusts_N=(None,), rest_q=(4,), leaning=(6,))

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
        fresh = tuple(m for m in measurements if m.time_s > state.settled_s - TICK_S)
        waiting = tuple(sorted((*state.waiting, *fresh), key=lambda m: m.time_s))
        settled_s = max(now_s - self.priors.settle_s, state.settled_s)
        due = tuple(m for m in waiting if m.time_s <= settled_s + TICK_S)
        rest = waiting[len(due) :]
        walk = _Walk(state, commands)
        for measured in due:
            self._advance(walk, min(measured.time_s, settled_s))
            self._take(walk, measured)
        self._advance(walk, settled_s)
        begun = max((k for k, (since, _) in enumerate(commands) if since <= settled_s + TICK_S), default=0)
        settled = FilterState(
            time_s=now_s,
            settled_s=settled_s,
            mean=walk.mean,
            covariance=walk.P,
            thrusts_N=walk.thrusts_N,
            rest_q=state.rest_q,
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
        load_B = residual_wrench(self._packed, self._B, mean, walk.thrusts_N, walk.rest_q)
        force_W_N, around = mean[13:16], walk.P[FORCE : FORCE + 3, FORCE : FORCE + 3]
        water = current_if_known(self._drags, walk.rest_q, force_W_N, around, self.priors.drag_std)
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
        if until_s - walk.time_s > TICK_S:
            walk.time_s = advance(
                self._packed,
                self._B,
                self._lag_s,
                walk.mean,
                walk.P,
                walk.thrusts_N,
                walk.rest_q,
                walk.since_s,
                walk.commands_N,
                walk.time_s,
                until_s,
                self._noise,
                walk.noise_scale,
                self._lasting,
                self._lasts_s,
            )

    def _take(self, walk: _Walk, measured: Measurement) -> None:
        s, slow = self.settings, self._slow
        if measured.X_WB is not None:
            self._take_pose(walk, measured.X_WB)
        if measured.p_WB_m is not None:
            self._take_sum(walk, measured.p_WB_m, 0, slow["tracking"], s.tracking_std_m)
        if measured.depth_m is not None:
            self._take_sum(walk, (measured.depth_m,), 2, slow["depth"], s.depth_std_m)
        if measured.omega_B_rad_s is not None:
            self._take_sum(walk, measured.omega_B_rad_s, TURNING, GYRO, s.gyro_std_rad_s)
        if measured.force_B_m_s2 is not None:
            self._take_force(walk, measured.force_B_m_s2, measured.time_s)

    def _take_pose(self, walk: _Walk, seen: Pose) -> None:
        """Camera: where the vehicle is; what poses say together is heeded by the model's noise."""
        if walk.refused_in_a_row >= self.priors.gate_patience:
            walk.P += self._start_covariance
        distance, walk.noise_scale = correct_by_pose(
            walk.mean,
            walk.P,
            seen.p_m,
            seen.q,
            self._slow["camera"],
            self.settings.position_std_m,
            self.settings.attitude_std_rad,
            self._gate[6],
            walk.leaning,
            walk.noise_scale,
        )
        walk.refused_in_a_row = 0 if walk.count(distance, self._gate[6]) else walk.refused_in_a_row + 1

    def _take_sum(self, walk: _Walk, told: ArrayLike, first: int, second: int, std: float) -> None:
        """A sensor of the errors from `first` on, its own slow error from `second` on."""
        measured = _numbers(told)
        if measured is not None:
            gate = self._gate[len(measured)]
            walk.count(correct_by_sum(walk.mean, walk.P, measured, first, second, std, gate), gate)

    def _take_force(self, walk: _Walk, told: ArrayLike, time_s: float) -> None:
        """Accelerometer: the white error of the modelled acceleration, over one of its periods, counts as noise."""
        force_B_m_s2 = _numbers(told)
        if force_B_m_s2 is None:
            return
        period_s = max(time_s - walk.force_s, 1e-3) if walk.force_s is not None else 0.02
        walk.force_s = time_s
        std = math.hypot(
            self.settings.accelerometer_std_m_s2, self.priors.acceleration_noise_m_s2 / math.sqrt(period_s)
        )
        gate = self._gate[3]
        distance = correct_by_force(
            self._packed, self._B, walk.mean, walk.P, walk.thrusts_N, walk.rest_q, force_B_m_s2, std, gate
        )
        walk.count(distance, gate)


def _numbers(told: ArrayLike) -> Array | None:
    """What a sensor told, shape (m,), or None where that is no number."""
    measured = np.array(told, dtype=np.float64)
    return measured if math.isfinite(sum(measured.tolist())) else None


class _Walk:
    """The filter on its way from one settled instant to the next, and on to now; lives for one step."""

    def __init__(self, state: FilterState, commands: tuple[tuple[float, Array], ...]) -> None:
        self.time_s = state.settled_s
        self.mean, self.P = state.mean.copy(), state.covariance.copy()
        self.thrusts_N, self.rest_q = state.thrusts_N.copy(), state.rest_q
        self.refused_in_a_row = state.poses_refused_in_a_row
        self.leaning, self.noise_scale = state.leaning.copy(), state.noise_scale
        self.taken, self.refused = state.taken, state.refused
        self.force_s: float | None = None
        self.since_s = np.array([since for since, _ in commands])
        self.commands_N = np.array([thrusts for _, thrusts in commands])

    def count(self, distance: float, gate: float) -> bool:
        """Count a measurement as taken or refused; returns whether it was taken."""
        right = distance <= gate
        self.taken += right
        self.refused += not right
        return right
