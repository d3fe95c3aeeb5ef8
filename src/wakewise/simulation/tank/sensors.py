"""Sensors of the simulated vehicle: camera pose, optical tracking, inertial unit, pressure, on one clock.

Each has a rate, noise, latency, slow errors, and for poses outliers and failures in turbid water.

Slow errors are stationary first-order Gauss-Markov processes per axis (P. S. Maybeck, Stochastic Models, Estimation,
and Control 1, Academic Press 1979, section 4.11). Inertial biases walk as those of two sport cameras and a stereo rig
under water: 1e-4 and 1.7e-5 rad/s, 6 to 9e-4 and 3e-4 m/s2 per root second (calibration files of SVIn2, S. Rahman, A.
Quattrini Li, I. Rekleitis, arXiv:1810.03200). Outliers of poses are confused markers or flat markers seen face on,
which have two poses (G. Schweighofer, A. Pinz, IEEE TPAMI 28 (2006) 2024, doi 10.1109/TPAMI.2006.252); their sizes are
estimates.

Contrast of markers falls as exp(-c d) over a path d in water of beam attenuation c (S. Q. Duntley, Light in the sea, J.
Opt. Soc. Am. 53 (1963) 214, doi 10.1364/JOSA.53.000214). Poses begin to fail below `LEAST_CONTRAST` and all fail at
half of it.
"""

from __future__ import annotations

import heapq
import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Measurement
from wakewise.core.jit.njit import njit
from wakewise.robot.vehicles.vehicle import TiltJoint
from wakewise.simulation.tank.settings import SensorSettings, Span


class GaussMarkovProcess:
    """Three independent processes of standard deviation `sigma` with correlation time `lasts_s`.

    Exact between any two times: x(t + dt) = a x(t) + sigma sqrt(1 - a^2) n with a = exp(-dt / lasts_s), so that the
    spread is `sigma` from the first value on, however often it is asked for.
    """

    def __init__(self, sigma: float, lasts_s: float, rng: np.random.Generator) -> None:
        self._sigma, self._lasts_s, self._rng = sigma, lasts_s, rng
        self._time_s = 0.0
        self._value = rng.normal(0.0, sigma, 3)

    def at(self, time_s: float) -> Array:
        """The error at a time, not before the last one asked for, shape (3,)."""
        kept = math.exp((self._time_s - time_s) / self._lasts_s)
        spread = self._sigma * math.sqrt(max(1.0 - kept * kept, 0.0))
        self._value = kept * self._value + spread * self._rng.standard_normal(3)
        self._time_s = time_s
        return self._value


OUTLIER_M, OUTLIER_RAD = 0.1, 0.2
"""How far off a pose is that is far off, one sigma per axis."""
GYRO_WALK_RAD_S, FORCE_WALK_M_S2 = 5e-5, 5e-4
"""Random walk of the inertial unit's biases in a second, one sigma per axis."""
LEAST_CONTRAST = 0.1  # an assumption: detectors of printed marks work down to a contrast of some percent to a fifth
_TICK_TOLERANCE_S = 1e-9  # a sample due at the end of a step belongs to that step


class Sensors:
    """Samples the true state and hands each sample over once its latency has passed.

    Each sensor draws from its own child of `rng`, so that changing one leaves the others' noise alone. A measurement
    carries the instant at which it was *taken*; those handed over together are sorted by it, but a late pose may be
    older than what was handed over before.
    """

    def __init__(self, settings: SensorSettings, rng: np.random.Generator) -> None:
        self._settings = settings
        # The stream of a new sensor comes last: each of these stays what it is, that of the camera's joint too.
        self._pose_rng, imu_rng, self._depth_rng, self._tracking_rng, lasting_rng, self.joint_rng = rng.spawn(6)
        self._gyro_rng, self._force_rng = imu_rng.spawn(2)
        self._draw_lasting(settings, lasting_rng)
        self._gyro_bias_B = self._gyro_rng.normal(0.0, settings.gyro_bias_rad_s, 3)
        self._force_bias_B = self._force_rng.normal(0.0, settings.accelerometer_bias_m_s2, 3)
        self._samplers = (self._pose, self._imu, self._depth, self._tracking)
        self._rates_hz = settings.pose_rate_hz, settings.imu_rate_hz, settings.depth_rate_hz, settings.tracking_rate_hz
        self._taken = [0] * len(self._samplers)
        self._due_s = [1 / rate if rate > 0.0 else math.inf for rate in self._rates_hz]
        self._next_s = min(self._due_s)
        self._under_way: list[tuple[float, int, Measurement]] = []
        self._count = 0

    def _draw_lasting(self, s: SensorSettings, rng: np.random.Generator) -> None:
        """Draw what stays for the flight; every error has a stream of its own."""
        place, turn, track, when, far, walk, depth = rng.spawn(7)

        def drawn(span: Span, stream: np.random.Generator) -> float:
            return float(stream.uniform(*span))

        self._place_off = GaussMarkovProcess(drawn(s.pose_drift_m, place), drawn(s.pose_drift_time_s, place), place)
        self._turn_off = GaussMarkovProcess(drawn(s.pose_drift_rad, turn), drawn(s.pose_drift_time_s, turn), turn)
        self._track_off = GaussMarkovProcess(drawn(s.tracking_drift_m, track), drawn(s.pose_drift_time_s, track), track)
        self._stamp_late_s = drawn(s.pose_timestamp_delay_s, when)
        self._far_rng, self._walk_rng = far, walk
        self._depth_bias_m = float(depth.normal(0.0, s.depth_bias_m))

    def next_due_s(self) -> float:
        """When the next sample is to be taken; the first ones one period after the start."""
        return self._next_s

    def sample(self, time_s: float, state: Array, force_B_m_s2: Array, turbidity_per_m: float = 0.0) -> None:
        """Take the samples that are due at `time_s`.

        - `state`, shape (13,): true position, quaternion (w, x, y, z) and twist.
        - `force_B_m_s2`, shape (3,): true specific force at the body origin.
        - `turbidity_per_m`: beam attenuation between camera and target.
        """
        for kind, due_s in enumerate(self._due_s):
            if due_s <= time_s + _TICK_TOLERANCE_S:
                self._taken[kind] += 1
                self._due_s[kind] = (self._taken[kind] + 1) / self._rates_hz[kind]
                self._samplers[kind](time_s, state, force_B_m_s2, turbidity_per_m)
        self._next_s = min(self._due_s)

    def _pose(self, time_s: float, state: Array, _force: Array, turbidity_per_m: float) -> None:
        s = self._settings
        # Drawn whether or not it is lost, so that a lost pose leaves the noise of the next ones alone.
        turn = s.pose_noise_rad * self._pose_rng.standard_normal(3)
        shift = s.pose_noise_m * self._pose_rng.standard_normal(3)
        if self._pose_rng.uniform() < pose_loss(turbidity_per_m, s.pose_range_m, s.pose_dropout):
            return
        if s.pose_outages_s and any(begin <= time_s < end for begin, end in s.pose_outages_s):
            return
        shift, turn = shift + self._place_off.at(time_s), turn + self._turn_off.at(time_s)
        if self._far_rng.uniform() < s.pose_outliers:
            shift = shift + self._far_rng.normal(0.0, OUTLIER_M, 3)
            turn = turn + self._far_rng.normal(0.0, OUTLIER_RAD, 3)
        seen, arrives_s = Pose(state[:3] + shift, _turned(state[3:7], turn)), time_s + s.pose_latency_s
        # Nothing is stamped later than it arrives.
        self._send(arrives_s, Measurement(time_s=min(time_s + self._stamp_late_s, arrives_s), X_WB=seen))

    def _imu(self, time_s: float, state: Array, force_B_m_s2: Array, _turbidity: float) -> None:
        s = self._settings
        step = math.sqrt(1.0 / s.imu_rate_hz)
        self._gyro_bias_B = self._gyro_bias_B + GYRO_WALK_RAD_S * step * self._walk_rng.standard_normal(3)
        self._force_bias_B = self._force_bias_B + FORCE_WALK_M_S2 * step * self._walk_rng.standard_normal(3)
        omega = state[10:] + self._gyro_bias_B + s.gyro_noise_rad_s * self._gyro_rng.standard_normal(3)
        force = force_B_m_s2 + self._force_bias_B + s.accelerometer_noise_m_s2 * self._force_rng.standard_normal(3)
        self._send(time_s, Measurement(time_s=time_s, omega_B_rad_s=omega, force_B_m_s2=force))

    def _depth(self, time_s: float, state: Array, _force: Array, _turbidity: float) -> None:
        noise_m = self._depth_rng.normal(0.0, self._settings.depth_noise_m)
        depth = float(state[2] + self._depth_bias_m + noise_m)
        self._send(time_s, Measurement(time_s=time_s, depth_m=depth))

    def _tracking(self, time_s: float, state: Array, _force: Array, _turbidity: float) -> None:
        noise = self._tracking_rng.normal(0.0, self._settings.tracking_noise_m, 3)
        place = state[:3] + self._track_off.at(time_s) + noise
        self._send(time_s + self._settings.tracking_latency_s, Measurement(time_s=time_s, p_WB_m=place))

    def collect(self, time_s: float) -> tuple[Measurement, ...]:
        """What has arrived by `time_s` and was not collected before, oldest sample first."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= time_s + _TICK_TOLERANCE_S:
            arrived.append(heapq.heappop(self._under_way))
        return tuple(m for _, _, m in sorted(arrived, key=lambda item: (item[2].time_s, item[1])))

    def _send(self, arrival_s: float, measurement: Measurement) -> None:
        heapq.heappush(self._under_way, (arrival_s, self._count, measurement))
        self._count += 1


def pose_loss(turbidity_per_m: float, range_m: float, dropout: float) -> float:
    """Chance that a camera pose fails: `dropout` in clear water, rising to 1 as contrast falls below the least."""
    contrast = math.exp(-turbidity_per_m * range_m)
    seen = min(max(2.0 * contrast / LEAST_CONTRAST - 1.0, 0.0), 1.0)
    return 1.0 - (1.0 - dropout) * seen


@njit
def _turned(q: Array, turn_rad: Array) -> Array:
    """Quaternion (w, x, y, z), shape (4,), turned further by a rotation vector, shape (3,), of its own frame."""
    angle = math.sqrt(turn_rad[0] ** 2 + turn_rad[1] ** 2 + turn_rad[2] ** 2)
    share = math.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    w, x, y, z = math.cos(0.5 * angle), share * turn_rad[0], share * turn_rad[1], share * turn_rad[2]
    out = np.empty(4)
    out[0] = q[0] * w - q[1] * x - q[2] * y - q[3] * z
    out[1] = q[0] * x + q[1] * w + q[2] * z - q[3] * y
    out[2] = q[0] * y - q[1] * z + q[2] * w + q[3] * x
    out[3] = q[0] * z + q[1] * y - q[2] * x + q[3] * w
    return out


class CameraJoint:
    """A tilt joint with its encoder; a camera without a joint stays at zero and measures nothing.

    - `tilt_rad`: where it stands at the start; its stops hold it.
    - `settings`: bias and noise of what it measures.
    - `rng`: draws both.
    """

    def __init__(
        self, joint: TiltJoint | None, tilt_rad: float, settings: SensorSettings, rng: np.random.Generator
    ) -> None:
        self._joint, self._rng, self._noise_rad = joint, rng, settings.tilt_noise_rad
        self._bias_rad = float(rng.normal(0.0, settings.tilt_bias_rad))
        self.tilt_rad = 0.0 if joint is None else joint.within(tilt_rad)
        """Where it truly stands."""
        self._desired_rad = self.tilt_rad

    def aim(self, tilt_rad: float) -> None:
        """Set the reference angle; one that is not finite is ignored."""
        if np.isfinite(tilt_rad):
            self._desired_rad = tilt_rad

    def turn(self, time_s: float, dt_s: float) -> tuple[Measurement, ...]:
        """Turn for `dt_s` until `time_s`; what the encoder then says, nothing where there is no joint."""
        if self._joint is None:
            return ()
        self.tilt_rad = self._joint.towards(self.tilt_rad, self._desired_rad, dt_s)
        read = self.tilt_rad + self._bias_rad + float(self._rng.normal(0.0, self._noise_rad))
        return (Measurement(time_s=time_s, tilt_rad=read),)
