"""Gyro, pressure sensor and camera-based pose of the simulated vehicle: rates, noise, bias and latency."""

from __future__ import annotations

import heapq

import numpy as np

from wakewise.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.interfaces import BodyState, Measurement
from wakewise.tank.settings import TankSettings

_TICK_TOLERANCE_S = 1e-9  # a sample due at the end of a step belongs to that step


class Sensors:
    """Samples the true state and hands each sample over once its latency has passed.

    Each sensor draws from its own child of `rng`, so that changing one leaves the others' noise alone. A measurement
    carries the instant at which it was *taken*; those handed over together are sorted by it, but a late pose may be
    older than what was handed over before.
    """

    def __init__(self, settings: TankSettings, rng: np.random.Generator) -> None:
        self._settings = settings
        self._pose_rng, self._gyro_rng, self._depth_rng = rng.spawn(3)
        self._gyro_bias_B = self._gyro_rng.normal(0.0, settings.gyro_bias_rad_s, 3)
        self._taken = [0, 0, 0]
        self._under_way: list[tuple[float, int, Measurement]] = []
        self._count = 0

    @property
    def rates_hz(self) -> tuple[float, float, float]:
        """Of pose, gyro and depth."""
        s = self._settings
        return (s.pose_rate_hz, s.gyro_rate_hz, s.depth_rate_hz)

    def next_due_s(self) -> float:
        """When the next sample is to be taken; the first ones one period after the start."""
        return min((n + 1) / rate for n, rate in zip(self._taken, self.rates_hz, strict=True))

    def sample(self, time_s: float, state: BodyState) -> None:
        """Take the samples that are due at `time_s`, where the vehicle is in the true `state`."""
        s = self._settings
        for kind, rate_hz in enumerate(self.rates_hz):
            if (self._taken[kind] + 1) / rate_hz > time_s + _TICK_TOLERANCE_S:
                continue
            self._taken[kind] += 1
            if kind == 0:
                turn = quat_from_rotvec(self._pose_rng.normal(0.0, s.pose_noise_rad, 3))
                shift = self._pose_rng.normal(0.0, s.pose_noise_m, 3)
                seen = Pose(state.X_WB.p_m + shift, quat_multiply(state.X_WB.q, turn))
                self._send(time_s + s.pose_latency_s, Measurement(time_s=time_s, X_WB=seen))
            elif kind == 1:
                noise = self._gyro_rng.normal(0.0, s.gyro_noise_rad_s, 3)
                omega = state.nu_B[3:] + self._gyro_bias_B + noise
                self._send(time_s, Measurement(time_s=time_s, omega_B_rad_s=omega))
            else:
                depth = float(state.X_WB.p_m[2] + self._depth_rng.normal(0.0, s.depth_noise_m))
                self._send(time_s, Measurement(time_s=time_s, depth_m=depth))

    def collect(self, time_s: float) -> tuple[Measurement, ...]:
        """What has arrived by `time_s` and was not collected before, oldest sample first."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= time_s + _TICK_TOLERANCE_S:
            arrived.append(heapq.heappop(self._under_way))
        return tuple(m for _, _, m in sorted(arrived, key=lambda item: (item[2].time_s, item[1])))

    def _send(self, arrival_s: float, measurement: Measurement) -> None:
        heapq.heappush(self._under_way, (arrival_s, self._count, measurement))
        self._count += 1
