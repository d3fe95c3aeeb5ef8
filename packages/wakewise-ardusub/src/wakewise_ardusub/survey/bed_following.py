"""Bed following: a depth target that keeps an altitude above a bed, from a late and noisy downward rangefinder.

`BedTrack` holds the bed's depth at the times of its measurement (vehicle's depth then, plus distance) over a window. It
fits a line by least squares with Huber weights (Huber 1964, doi 10.1214/aoms/1177703732) and extrapolates it to the
present: so the delay costs nothing on a constant slope. A value far from that line is refused unless several in
a row agree with each other, as at a step. `DepthShaper` turns the desired depth into one that moves with bounded speed
and acceleration, critically damped, with the bed's own slope fed forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

WINDOW_S = 1.2
LONGEST_S = 5.0
"""How far, at most, the line is carried on beyond its last value; its slope fades with `FADE_S`."""
FADE_S = 1.0
GATE_M = 0.25
AGREE_M, AGREE = 0.15, 4
_HUBER_M = 0.02
_ROUNDS = 3
SLOWEST_RAD_S, FASTEST_RAD_S = 1.0, 2.5
LAG_M = 0.1
"""Way over the bed in one time constant of the depth target."""
_BRAKES = 0.8
"""Share of the largest acceleration that a way is planned to end with."""


@dataclass(frozen=True, kw_only=True)
class BedTrack:
    """Times (s) and depths (m) of the bed that were taken, newest last, and those refused since the last one taken."""

    taken: tuple[tuple[float, float], ...] = ()
    refused: tuple[float, ...] = ()
    outliers: int = 0

    def take(self, at_s: float, bed_m: float) -> BedTrack:
        """The track after a value; one that is no number, or not newer than the last, changes nothing."""
        if not math.isfinite(bed_m) or not math.isfinite(at_s) or (self.taken and at_s <= self.taken[-1][0]):
            return self
        expected = self.bed(at_s)
        if expected is not None and abs(bed_m - expected[0]) > GATE_M:
            refused = (*self.refused[-AGREE + 1 :], bed_m)
            if len(refused) < AGREE or max(refused) - min(refused) > AGREE_M:
                return replace(self, refused=refused, outliers=self.outliers + 1)
            return BedTrack(taken=((at_s, bed_m),), outliers=self.outliers)
        kept = tuple(one for one in self.taken if at_s - one[0] <= WINDOW_S)
        return BedTrack(taken=(*kept, (at_s, bed_m)), outliers=self.outliers)

    def bed(self, now_s: float) -> tuple[float, float] | None:
        """Depth of the bed (m) and its rate (m/s) now; None before the first value and `LONGEST_S` after the last."""
        if not self.taken or now_s - self.taken[-1][0] > LONGEST_S:
            return None
        times, depths = np.array(self.taken).T
        last = float(times[-1])
        if len(times) < AGREE:
            return float(np.median(depths)), 0.0
        t = times - last
        weights = np.ones(len(t))
        level = slope = 0.0
        for _ in range(_ROUNDS):
            mean_t, mean_d = np.average(t, weights=weights), np.average(depths, weights=weights)
            spread = float(weights @ (t - mean_t) ** 2)
            slope = float(weights @ ((t - mean_t) * (depths - mean_d))) / max(spread, 1e-9)
            level = float(mean_d - slope * mean_t)
            off = np.abs(depths - level - slope * t)
            weights = np.minimum(1.0, _HUBER_M / np.maximum(off, 1e-9))
        ahead_s = max(now_s - last, 0.0)
        fades = max(ahead_s - FADE_S, 0.0)
        carried = min(ahead_s, FADE_S) + FADE_S * (1.0 - math.exp(-fades / FADE_S))
        return level + slope * carried, slope * math.exp(-fades / FADE_S)


@dataclass(frozen=True, kw_only=True)
class DepthShaper:
    """Depth target, m, and its speed and acceleration; bounds in m/s and m/s2, bandwidth in rad/s."""

    depth_m: float
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    fastest_m_s: float = 0.25
    most_m_s2: float = 0.15
    bandwidth_rad_s: float = SLOWEST_RAD_S

    @classmethod
    def at(cls, depth_m: float, pace_m_s: float) -> DepthShaper:
        """At rest at a depth. The bandwidth grows with the vehicle's speed, which meets a face of the bed sooner.

        At 0.1 m/s and below it is 1 rad/s: a faster target follows the rangefinder's noise, and the thrusters blow at
        the bed.
        """
        return cls(depth_m=depth_m, bandwidth_rad_s=min(max(pace_m_s / LAG_M, SLOWEST_RAD_S), FASTEST_RAD_S))

    def towards(self, depth_m: float, speed_m_s: float, dt_s: float) -> DepthShaper:
        """The target one step later, on its way to a depth that moves with a speed."""
        w, most = self.bandwidth_rad_s, self.fastest_m_s
        ahead = min(max(speed_m_s, -most), most)
        gap_m = depth_m - self.depth_m
        stops = math.sqrt(2.0 * _BRAKES * self.most_m_s2 * abs(gap_m))  # else a long way ends beyond its target
        nearing = min(max(0.5 * w * gap_m, -stops), stops)
        asked = 2.0 * w * (ahead + nearing - self.speed_m_s)
        speed = self.speed_m_s + dt_s * min(max(asked, -self.most_m_s2), self.most_m_s2)
        speed = min(max(speed, -most), most)
        return replace(
            self,
            depth_m=self.depth_m + 0.5 * dt_s * (self.speed_m_s + speed),
            speed_m_s=speed,
            acceleration_m_s2=(speed - self.speed_m_s) / dt_s,
        )

    def resting(self, dt_s: float) -> DepthShaper:
        """The target one step later, braking to rest at the depth that it reaches."""
        return self.towards(self.depth_m, 0.0, dt_s)
