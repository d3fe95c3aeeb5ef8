"""Figures for ground stations: disturbance D, what the thrusts save against the least ones, and coverage."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control import vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TruthProvider
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.scene.missions import Coverage, patches_of
from wakewise.wake import InfluenceModel
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import COVERAGE_NAME, DISTURBANCE_NAME, SAVED_NAME
from wakewise_ardusub.session.engagement import FlightOwnership

FIGURES_S = 0.5
STILL_M_S = 1e-4
"""Root mean square speed at the points below which there is nothing to save."""


@dataclass(kw_only=True, eq=False)
class WashFigures:
    """D of the thrusts that act and what they save against the least ones, for ground stations; twice a second.

    `speeds_m_s` is the root mean square speed at the target's points of both, for people; None before any.
    """

    parts: Parts
    gate: OutputGate
    turn: FlightOwnership
    flown_N: Callable[[], Array]
    speeds_m_s: tuple[float, float] | None = None
    _due_s: float = -math.inf
    _covered_pct: float | None = None
    _coverage: Coverage | None = None

    def __call__(self, step: Step, _truth_provider: TruthProvider | None = None) -> None:
        """Compute them anew, if it is time."""
        if step.time_s < self._due_s:
            return
        self._due_s = step.time_s + FIGURES_S
        engaged = self.turn.entry is not None
        thrusts = step.command.thrusts_N if engaged else self.flown_N()
        view = self._view
        gram = view.gram(step.estimate.X_WB)
        if not np.isfinite(gram).all():
            return
        found = {DISTURBANCE_NAME: disturbance_of(gram, thrusts)}
        least = min_norm_allocation(self._layout, self._layout.B @ thrusts, gram).disturbance or 0.0
        weight = view.total_weight
        self.speeds_m_s = (math.sqrt(found[DISTURBANCE_NAME] / weight), math.sqrt(max(least, 0.0) / weight))
        if engaged and least > weight * STILL_M_S**2:
            found[SAVED_NAME] = 100.0 * (1.0 - found[DISTURBANCE_NAME] / least)
        if self._covered_pct is not None:
            found[COVERAGE_NAME] = self._covered_pct
        self.gate.figures = found

    def photographed(self, X_WC: Pose) -> None:
        """A photograph was taken from here; what it has seen is computed in a thread of its own."""
        self._beside.submit(self._do, self._see, X_WC)

    def retarget(self, parts: Parts) -> None:
        """Compute them for another target from now on; nothing of it was photographed."""
        self._beside.submit(self._do, self._retarget, parts)

    def protect(self, parts: Parts) -> None:
        """Compute them for another region of the same target from now on."""
        self._beside.submit(self._do, self._protect, parts)

    def close(self) -> None:
        """Finish what is being computed, and drop what waits."""
        self._beside.shutdown(cancel_futures=True)

    def _do(self, work: Callable[[Any], None], about: Pose | Parts) -> None:
        """Compute in the thread; the flight goes on with the last figures if that fails."""
        try:
            work(about)
        except Exception as fault:  # a fault of a figure must neither end the flight nor vanish
            if self.gate.journal is not None:
                self.gate.journal.write("figures", amiss=f"{type(fault).__name__}: {fault}")

    def _protect(self, parts: Parts) -> None:
        self._view = InfluenceModel.of(parts.vehicle, parts.region, parts.wake)

    def _retarget(self, parts: Parts) -> None:
        self.parts, self._coverage, self._covered_pct = parts, None, None
        self._view = InfluenceModel.of(parts.vehicle, parts.region, parts.wake)

    def _see(self, X_WC: Pose) -> None:
        target, before = self.parts.target, self._coverage
        if before is None:
            before = Coverage.begin(patches_of(target.mesh, target.bed_z_m))
        self._coverage = after = before.seen(X_WC, self.parts.camera)
        self._covered_pct = 100.0 * after.share

    def begin(self) -> None:
        """Compute afresh at the next step."""
        self._due_s = -math.inf
        self.gate.figures = {}

    def __post_init__(self) -> None:
        self._view = InfluenceModel.of(self.parts.vehicle, self.parts.region, self.parts.wake)
        self._layout = vehicle_layout(self.parts.vehicle)
        self._beside = ThreadPoolExecutor(1, thread_name_prefix="coverage")
