"""Current from station keeping: a vehicle at rest over ground pushes as hard as the water drags.

With the vehicle's horizontal drag D_l u + D_q |u| u per axis (Fossen) the force of the thrusters gives the velocity u
through the water, and the current is its opposite, turned into W. Roll and pitch are taken for small.
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles import Vehicle

FASTEST_M_S = 1.5
"""A current that comes out faster than this is unknown: the vehicle was not at rest, or is another one."""


def current_of_hold(vehicle: Vehicle, thrusts_N: Array, heading_rad: float) -> Array | None:
    """The current, shape (2,), north and east, m/s, from mean thrusts, shape (n,), at rest; None where unknown."""
    force = (vehicle.allocation_matrix @ thrusts_N)[:2]
    water = vehicle.hydrodynamics
    through = np.zeros(2)
    for axis in range(2):
        linear, quadratic = float(water.linear_damping[axis, axis]), float(water.quadratic_damping[axis, axis])
        size = abs(float(force[axis]))
        if quadratic > 0.0:
            speed = (-linear + math.sqrt(linear**2 + 4.0 * quadratic * size)) / (2.0 * quadratic)
        elif linear > 0.0:
            speed = size / linear
        else:
            return None
        through[axis] = math.copysign(speed, force[axis])
    if not np.isfinite(through).all() or math.hypot(*through) > FASTEST_M_S:
        return None
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return -np.array([c * through[0] - s * through[1], s * through[0] + c * through[1]])
