"""Snapshots of a flight for the pages, taken at each step in the thread of the flight without waiting.

The truth of the world is read in this thread only. All other values are computed from the snapshots in the server's.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid, TruthProvider
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle

WINDOW_S = 10.0
"""Window of deviation and savings."""
SAMPLED_S = 0.1
LOOKS_S = 2.0
"""Time for which the true water is measured after a request."""
TRUE_EVERY_S, SILT_EVERY_S = 0.5, 1.0
MEAN_OF = 10
"""Steps over which commanded thrusts are averaged for the readout: small ones are sent as pulses."""
_SOLVES = 3000
_LEAST_ASKED_M_S = 0.005


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightSnapshot:
    """One step of a flight as it is shown.

    `thrusts_N`, shape (n,), are the commanded ones in the mean of the last steps; `true_m_s`, shape (points,), the
    speed that the thrusters gave the water at the readout's points when it was last asked, None where nobody knows.
    """

    step: Step
    thrusts_N: Array
    asked_W_m_s: Array
    velocity_W_m_s: Array
    energy_J: float
    power_W: float
    true_m_s: Array | None
    X_WC: Pose
    silt: ScalarGrid | None


class SnapshotRecorder:
    """Called as `(step, truth_provider)` at each step; `now` is the newest snapshot, for any thread.

    `points_W_m`, shape (n, 3): where the true water is asked, if the truth provider knows. `given`: called when the
    step's thrusts are on their way. `asked`: velocity that is asked for in W, shape (3,).
    """

    def __init__(
        self,
        vehicle: Vehicle,
        points_W_m: Array,
        dt_s: float,
        given: Callable[[], None],
        asked: Callable[[], Array],
    ) -> None:
        self._vehicle, self._points_W_m, self._dt_s = vehicle, points_W_m, dt_s
        self._given, self._asked = given, asked
        self._thrusts: deque[Array] = deque(maxlen=MEAN_OF)
        self._solves_s = np.zeros(_SOLVES)
        self._steps = 0
        self._energy_J = 0.0
        self._true: Array | None = None
        self._silt: ScalarGrid | None = None
        self._true_s = self._silt_s = self._sampled_s = -np.inf
        self._followed: deque[tuple[Array, Array]] = deque(maxlen=round(WINDOW_S / SAMPLED_S))
        self.now: FlightSnapshot | None = None
        self._looked_s = -np.inf

    def look(self) -> None:
        """Measure the true water, too, for `LOOKS_S` from now on."""
        self._looked_s = time.monotonic()

    @property
    def looked_at(self) -> bool:
        """Whether `look` was called within `LOOKS_S`."""
        return time.monotonic() - self._looked_s < LOOKS_S

    def __call__(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Take a snapshot of a step."""
        self._given()
        now_s = step.time_s
        self._thrusts.append(step.command.thrusts_N)
        self._solves_s[self._steps % _SOLVES] = step.solve_s
        self._steps += 1
        state = step.truth.state if step.truth is not None else step.estimate
        power_W = step.truth.power_W if step.truth is not None else float("nan")
        self._energy_J += power_W * self._dt_s
        asked_W = self._asked()
        velocity_W = state.X_WB.R @ state.nu_B[:3]
        if now_s >= self._sampled_s + SAMPLED_S - 1e-9:
            self._sampled_s = now_s
            self._followed.append((asked_W, velocity_W))
        if truth_provider is not None and self.looked_at:
            self._ask(now_s, truth_provider)
        tilt_rad = step.truth.tilt_rad if step.truth is not None else step.tilt_rad
        self.now = FlightSnapshot(
            step=step,
            thrusts_N=np.mean(self._thrusts, axis=0),
            asked_W_m_s=asked_W,
            velocity_W_m_s=velocity_W,
            energy_J=self._energy_J,
            power_W=power_W,
            true_m_s=self._true,
            X_WC=state.X_WB @ self._vehicle.X_BC_at(tilt_rad),
            silt=self._silt,
        )

    def _ask(self, now_s: float, truth_provider: TruthProvider) -> None:
        """Measure silt and true water at their intervals."""
        if now_s >= self._silt_s + SILT_EVERY_S:
            self._silt_s, self._silt = now_s, truth_provider.silt()
        elif now_s >= self._true_s + TRUE_EVERY_S:
            self._true_s = now_s
            excess = getattr(truth_provider, "excess_velocity", None)
            if excess is not None:
                self._true = np.linalg.norm(excess(self._points_W_m), axis=1)

    @property
    def solve_ms_p99(self) -> float:
        """Control's thread CPU in a step, 99th percentile of the last minute."""
        known = self._solves_s[: min(self._steps, _SOLVES)]
        return 1e3 * float(np.percentile(known, 99)) if len(known) else 0.0

    @property
    def deviation_pct(self) -> float | None:
        """Rms of velocity less command, over the rms of the command; None while the command is zero."""
        followed = list(self._followed)
        if not followed:
            return None
        asked, had = (np.array(column) for column in zip(*followed, strict=True))
        desired = float(np.mean(np.sum(asked**2, axis=1)))
        if desired < _LEAST_ASKED_M_S**2:
            return None
        return 100.0 * float(np.sqrt(np.mean(np.sum((had - asked) ** 2, axis=1)) / desired))
