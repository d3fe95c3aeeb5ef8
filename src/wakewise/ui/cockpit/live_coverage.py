"""The coverage guide of a live flight: coverage by its photographs, and the next view, as sent to pages."""

from __future__ import annotations

import threading
from typing import Any

from wakewise.core.geometry import Pose
from wakewise.operation import Parts
from wakewise.operation.guide import begin_coverage
from wakewise.scene.missions import Coverage
from wakewise.ui.cockpit.state import number, rounded


class LiveCoverage:
    """Coverage by the photographs of one flight at their estimated poses.

    One thread adds photographs, another reads the coverage; the constructor takes about a second.
    """

    def __init__(self, parts: Parts) -> None:
        self._camera = parts.camera
        self._lock = threading.Lock()
        self._coverage: Coverage = begin_coverage(parts)
        # Kernels are read now, so that the first photograph costs no more than the others.
        self._coverage.seen(parts.start.X_WB @ parts.vehicle.X_BC, self._camera).words(parts.start.X_WB)

    def saw(self, X_WC: Pose) -> str:
        """Add a photograph; the coverage now, in words."""
        coverage = self._coverage.seen(X_WC, self._camera)
        with self._lock:
            self._coverage = coverage
        return f"{100.0 * coverage.share:.0f} % of the target is seen well"

    def told(self, X_WC: Pose) -> dict[str, Any]:
        """Share, scores of patches, and the next view for a camera that is at X_WC."""
        with self._lock:
            coverage = self._coverage
        view = coverage.next_view(X_WC)
        place = None if view is None else rounded(view.p_m, 3)
        return {
            "share": number(coverage.share, 4),
            "patches": rounded(coverage.score, 2),
            "next": {"position_W_m": place, "words": coverage.words(X_WC)},
        }
