"""One thruster: where it sits, which way it pushes, how hard and how fast."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError

REACH_M = 10.0
"""Furthest a thruster may sit from the body origin; beyond it a file most likely holds millimetres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Thruster:
    """Mounting and limits of one thruster T on body B.

    A thrust T > 0 pushes the vehicle along `axis_B` and sends the jet along `-axis_B`; T < 0 does the opposite.

    Parameters
    ----------
    name : str
    p_BT_m : ndarray, shape (3,)
        Centre of the disk from the origin of B, expressed in B.
    axis_B : ndarray, shape (3,)
        Direction of the force for positive thrust, normalised here.
    max_forward_N, max_reverse_N : float
        Largest thrust along `axis_B` and against it, both as magnitudes.
    disk_area_m2 : float
        Area that the propeller sweeps.
    time_constant_s : float
        First-order lag from commanded to delivered thrust; 0 means at once.
    gain : float
        Newton delivered per newton commanded. 1 unless the parameters are a plant's (see `perturbed`).

    Raises
    ------
    InputError
        If the axis has no length, a number is not finite or out of range, or the thruster is more than 10 m away.
    """

    name: str
    p_BT_m: Array
    axis_B: Array
    max_forward_N: float
    max_reverse_N: float
    disk_area_m2: float
    time_constant_s: float
    gain: float = 1.0

    def __post_init__(self) -> None:
        freeze(self, p_BT_m=(3,), axis_B=(3,))
        where = f"thruster {self.name}"
        length = float(np.linalg.norm(self.axis_B))
        if length < 1e-6:
            raise InputError(f"{where}: axis {self.axis_B.tolist()} has length {length:g}, it must not be zero")
        # A unit axis is kept to the last bit, so that a copy of a thruster is the same thruster.
        if abs(length - 1.0) > 1e-14:
            axis = self.axis_B / length
            axis.setflags(write=False)
            object.__setattr__(self, "axis_B", axis)
        distance = float(np.linalg.norm(self.p_BT_m))
        if distance > REACH_M:
            raise InputError(f"{where}: {distance:g} m from the body origin, at most {REACH_M:g} m (are these metres?)")
        for field, low_allowed in (
            ("max_forward_N", True),
            ("max_reverse_N", True),
            ("disk_area_m2", False),
            ("time_constant_s", True),
            ("gain", False),
        ):
            value = float(getattr(self, field))
            if not math.isfinite(value) or value < 0.0 or (value == 0.0 and not low_allowed):
                allowed = "at least 0" if low_allowed else "more than 0"
                raise InputError(f"{where}: {field} = {value:g}, must be finite and {allowed}")

    @property
    def wrench_per_newton_B(self) -> Array:
        """Force and moment about the body origin that one newton of thrust makes, shape (6,)."""
        return np.concatenate([self.axis_B, np.cross(self.p_BT_m, self.axis_B)])
