"""A commanded velocity that never runs into anything: it falls so that the hull can stop in front of it.

Towards each plane and sphere of the surroundings the velocity of approach is at most that from which the way left, less
the clearance, suffices to stop: v = sqrt(2 a (h - h0)). Along it the hull slides; away from it all is allowed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose
from wakewise.planning import Surroundings
from wakewise.planning.barrier import plane_gap, sphere_gap
from wakewise.planning.problem import CLEARANCE_M

FELT_M_S = 0.02
"""Loss of speed from which it is worth saying what is in the way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CollisionLimiter:
    """What is solid, half the hull's size, shape (3,), and how hard the hull can brake."""

    around: Surroundings
    half_m: Array
    braking_m_s2: float

    def __post_init__(self) -> None:
        freeze(self, half_m=(3,))

    def allowed(self, X_WB: Pose, velocity_W_m_s: Array, omega_B_rad_s: Array) -> tuple[Array, str | None]:
        """The velocity nearly as wished, shape (3,), and what is in its way, None if nothing.

        A hull that turns, `omega_B_rad_s` of shape (3,), makes way for its corners.
        """
        velocity, R, slope, blocks = np.array(velocity_W_m_s), X_WB.R, np.empty(6), None
        planes, spheres = self.around.planes, self.around.spheres
        for k in range(len(planes) + len(spheres)):
            if k < len(planes):
                gap = plane_gap(X_WB.p_m, R, self.half_m, planes[k], slope)
            else:
                gap = sphere_gap(X_WB.p_m, R, self.half_m, spheres[k - len(planes)], slope)
            closing = -float(slope[:3] @ velocity + slope[3:] @ omega_B_rad_s)
            most = math.sqrt(2.0 * self.braking_m_s2 * max(gap - CLEARANCE_M, 0.0))
            if closing > most:
                velocity += (closing - most) * slope[:3]
                blocks = self.around.name(k) if closing - most > FELT_M_S else blocks
        return velocity, blocks
