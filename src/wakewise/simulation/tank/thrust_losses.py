"""What takes thrust from a thruster: a failure, or water that already runs through its disk."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.simulation.tank.settings import ThrusterFailure

KT_STILL = 0.32
"""Thrust coefficient T / (rho n^2 D^4) in still water of a Wageningen B3-50 screw with pitch 0.8 D."""

ADVANCE_OF_NO_THRUST = 0.88
"""Advance ratio V / (n D) at which the same screw gives no thrust.

Both from the series' polynomial (M. W. C. Oosterveld and P. van Oossanen 1975, Int. Shipbuild. Prog. 22, 251). Small
ducted thrusters publish bollard thrust only; this screw stands for them.
"""

_MOST_GAIN = 1.2  # water that runs against the jet raises thrust; the line holds no farther than J = -0.2


class FailingThrusters:
    """Turns wanted thrusts into what failing thrusters are still driven to; the motors' lag comes after.

    Parameters
    ----------
    failures : tuple of ThrusterFailure
    count : int
        Thrusters of the vehicle.

    Raises
    ------
    InputError
        If a failure names a thruster that the vehicle has not.
    """

    def __init__(self, failures: tuple[ThrusterFailure, ...], count: int) -> None:
        for failure in failures:
            if failure.thruster > count:
                raise InputError(f"tank.failures: thruster {failure.thruster}, the vehicle has {count}")
        self._failures = failures
        self._stuck_N: dict[int, float] = {}

    def wanted(self, time_s: float, wanted_N: Array, motors_N: Array) -> Array:
        """Thrusts, shape (n,), that motors now at `motors_N` turn towards when `wanted_N` is commanded."""
        if not self._failures:
            return wanted_N
        result = wanted_N.copy()
        for k, failure in enumerate(self._failures):
            i = failure.thruster - 1
            if time_s < failure.at_s - 1e-9:
                continue
            if failure.kind == "dead":
                result[i] = 0.0
            elif failure.kind == "half":
                result[i] *= 0.5 if failure.value is None else failure.value
            else:
                now = float(motors_N[i]) if failure.value is None else failure.value
                result[i] = self._stuck_N.setdefault(k, now)
        return result


def inflow_factors(thrusts_N: Array, inflow_m_s: Array, areas_m2: Array, density_kg_m3: float) -> Array:
    """Share of its still-water thrust that each thruster gives at the same revolutions, shape (n,).

    T(V) = T(0) (1 - V / V0), the linear law of thrust against advance (e.g. M. Blanke, K.-P. Lindegaard and
    T. I. Fossen 2000, Dynamic model for thrust generation of marine propellers, IFAC MCMC): V0 = J0 n D with
    n = sqrt(T(0) / (rho D^4 K_T)). Kept between 0 and 1.2.

    Parameters
    ----------
    thrusts_N : ndarray, shape (n,)
        In still water; only the size counts.
    inflow_m_s : ndarray, shape (n,)
        Speed of the water relative to the disk, along the jet that the thruster sends; its own suction left out.
    areas_m2 : ndarray, shape (n,)
    density_kg_m3 : float
    """
    diameters = np.sqrt(4 * areas_m2 / math.pi)
    no_thrust = ADVANCE_OF_NO_THRUST / math.sqrt(KT_STILL) * np.sqrt(np.abs(thrusts_N) / density_kg_m3) / diameters
    factor = 1.0 - np.divide(inflow_m_s, no_thrust, out=np.zeros_like(no_thrust), where=no_thrust > 1e-6)
    return np.clip(factor, 0.0, _MOST_GAIN)
