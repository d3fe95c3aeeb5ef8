"""A bed of relief under the simulated autopilot, and the sensors of a survey: rangefinder and Doppler log (DVL).

`Relief` is a bed that rises and falls along one direction: flat, trapezoids or sawteeth, begun at a drawn phase. The
two shapes are those on which ArduSub's SURFTRAK was tried (github.com/clydemcqueen/ardusub_surftrak); the numbers are
our own. `SeaSensors` gives DISTANCE_SENSOR with
delay, noise, outliers and drop-outs, and a position and velocity with a Doppler log's errors.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise_ardusub.physics.datagrams import PhysicsState

Shape = Literal["flat", "trapezoid", "sawtooth"]
SHAPES: tuple[Shape, ...] = ("flat", "trapezoid", "sawtooth")
_STEP_M, _HALVINGS = 0.05, 12
"""Steps in which a ray is followed to the bed, and how often the last one is halved: to 12 micrometres."""


@dataclass(frozen=True, kw_only=True)
class Relief:
    """A bed at `depth_m`, positive down, with shapes of `height_m` on it, and a period along `along_rad`; m.

    `slope` is that of a trapezoid's two faces and of a sawtooth's steep one; `phase` in [0, 1) shifts the pattern.
    Raises InputError if the faces do not fit into the period.
    """

    shape: Shape = "flat"
    depth_m: float = 5.0
    height_m: float = 0.5
    period_m: float = 8.0
    slope: float = 0.25
    along_rad: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.depth_m, self.height_m, self.period_m, self.slope, self.along_rad, self.phase)
        fits = self.slope > 0.0 and 2.0 * self.height_m / max(self.slope, 1e-9) < self.period_m
        if self.shape not in SHAPES or not all(map(math.isfinite, numbers)) or not fits:
            raise InputError(f"bed {self.shape}: faces of slope {self.slope:g} must fit into {self.period_m:g} m")

    @classmethod
    def drawn(cls, shape: Shape, rng: np.random.Generator, depth_m: float = 5.0) -> Relief:
        """One of a drawn height (0.3 to 0.6 m), slope (0.15 to 0.3) and phase, with a period of 8 m."""
        height_m, slope, phase = rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.3), rng.uniform()
        return cls(shape=shape, depth_m=depth_m, height_m=height_m, slope=slope, phase=phase)

    def bed_m(self, north_m: float, east_m: float) -> float:
        """Depth of the bed at a place, m."""
        if self.shape == "flat":
            return self.depth_m
        along = north_m * math.cos(self.along_rad) + east_m * math.sin(self.along_rad)
        x = (along / self.period_m + self.phase) % 1.0 * self.period_m
        face_m = self.height_m / self.slope
        if self.shape == "sawtooth":
            rest_m = self.period_m - face_m
            up = x / face_m if x < face_m else (self.period_m - x) / rest_m
        else:
            flat_m = 0.5 * self.period_m - face_m
            up = min(max((x - flat_m) / face_m, 0.0), 1.0, max((self.period_m - x) / face_m, 0.0))
        return self.depth_m - self.height_m * up

    def range_m(self, place_W_m: Array, way_W: Array) -> float:
        """Way from a place along a direction, shape (3,) each, to where it first meets the bed.

        Infinite where the direction is within 6 deg of level or points up.
        """
        if way_W[2] < 0.1:
            return math.inf

        def above_m(along_m: float) -> float:
            at = place_W_m + along_m * way_W
            return self.bed_m(float(at[0]), float(at[1])) - float(at[2])

        deepest, highest = self.depth_m, self.depth_m - self.height_m
        near = max((highest - float(place_W_m[2])) / float(way_W[2]), 0.0)
        last = (deepest - float(place_W_m[2])) / float(way_W[2])
        far = near
        while above_m(far) > 0.0 and far < last:
            near, far = far, far + _STEP_M
        for _ in range(_HALVINGS):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if above_m(middle) > 0.0 else (near, middle)
        return 0.5 * (near + far)


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """Errors of rangefinder and Doppler log.

    Delay (s), white noise (m), share of outliers, drop-outs a minute and their length (s); velocity error (m/s, first
    order with `velocity_tau_s`), acceleration error while the log is lost (m/s2).
    """

    delay_s: float = 0.3
    range_noise_m: float = 0.01
    outlier_share: float = 0.01
    gaps_per_min: float = 1.0
    gap_s: float = 0.5
    velocity_noise_m_s: float = 0.002
    velocity_tau_s: float = 0.5
    drift_m_s2: float = 0.004
    least_m: float = 0.3
    most_m: float = 20.0


class SeaSensors:
    """Rangefinder and Doppler log of one vehicle above a bed.

    Parameters
    ----------
    relief : Relief
    errors : SensorErrors
    rng : numpy Generator
    """

    def __init__(self, relief: Relief, errors: SensorErrors, rng: np.random.Generator) -> None:
        self.relief, self.errors, self._rng = relief, errors, rng
        self.range_lost = self.log_lost = False
        """Faults: no distance; no velocity from the Doppler log."""
        self._ranges: deque[tuple[float, float]] = deque(maxlen=512)
        self._last_s: float | None = None
        self._off_m, self._off_m_s = np.zeros(3), np.zeros(3)
        self._gap_until = {"range": -1.0, "log": -1.0}

    def estimate(self, motion: PhysicsState) -> PhysicsState:
        """What the autopilot's filter makes of a motion: position and velocity with the log's errors; takes a range."""
        dt_s = 0.0 if self._last_s is None else motion.time_s - self._last_s
        self._last_s = motion.time_s
        range_m = self.relief.range_m(motion.p_WB_m, matrix_from_quat(motion.q_WB)[:, 2])
        self._ranges.append((motion.time_s, range_m))
        draw, errors = self._rng, self.errors
        chance = errors.gaps_per_min / 60.0 * dt_s
        for name in self._gap_until:
            if draw.random() < chance:
                self._gap_until[name] = motion.time_s + errors.gap_s
        if self.lost(motion.time_s):
            self._off_m_s = self._off_m_s + errors.drift_m_s2 * dt_s * np.array([0.6, 0.8, 0.0])
        elif dt_s > 0.0:
            keep = math.exp(-dt_s / errors.velocity_tau_s)
            spread = errors.velocity_noise_m_s * math.sqrt(1.0 - keep * keep)
            self._off_m_s = keep * self._off_m_s + spread * draw.normal(size=3) * np.array([1.0, 1.0, 0.0])
        self._off_m = self._off_m + dt_s * self._off_m_s
        return replace(motion, p_WB_m=motion.p_WB_m + self._off_m, v_W_m_s=motion.v_W_m_s + self._off_m_s)

    def lost(self, now_s: float) -> bool:
        """Whether the Doppler log gives no velocity now."""
        return self.log_lost or now_s < self._gap_until["log"]

    def distance_cm(self, now_s: float) -> int | None:
        """The distance that DISTANCE_SENSOR tells now, in whole cm; None in a drop-out, and where it meets no bed."""
        if self.range_lost or now_s < self._gap_until["range"]:
            return None
        old = [distance for at_s, distance in self._ranges if at_s <= now_s - self.errors.delay_s]
        if not old or not math.isfinite(old[-1]):
            return None
        told = old[-1] + self.errors.range_noise_m * self._rng.normal()
        if self._rng.random() < self.errors.outlier_share:
            told = self._rng.uniform(self.errors.least_m, self.errors.most_m)
        return round(100.0 * told)


def drawn_current(rng: np.random.Generator, speed_m_s: float, gust_m_s: float = 0.01) -> Callable[[float], Array]:
    """A uniform current in W as a function of time (s): a drawn direction, and a slow drawn swell of its speed."""
    towards, period_s, phase = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(40.0, 90.0), rng.uniform(0.0, 2.0 * math.pi)
    way = np.array([math.cos(towards), math.sin(towards), 0.0])

    def current(time_s: float) -> Array:
        swell = min(gust_m_s, speed_m_s) * math.sin(2.0 * math.pi * time_s / period_s + phase)
        return (speed_m_s + swell) * way

    return current
