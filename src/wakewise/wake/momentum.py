"""The law that a free jet obeys: the momentum flux through any plane across it is the thrust that made it.

Whatever a fit scores, measured speeds and thrusts must keep to it. A thrust in kilograms-force for newtons, or speeds
in feet a second, are off by a factor of four and more, and no residual shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.wake.calibration import calibrated_values
from wakewise.wake.fit_parameters import family
from wakewise.wake.jets import AxialJet
from wakewise.wake.samples import JetSamples

LIKELY = (0.5, 1.3)
"""Momentum flux over thrust that a jet of water may have: swirl, walls and the near field take from it, little adds."""
POSSIBLE = (0.25, 3.0)
"""Outside of this no jet lies: every confusion of units does."""
_RADII = 4000
_REACH = 6.0


@dataclass(frozen=True, kw_only=True)
class MomentumLaw:
    """Momentum flux over thrust: `measured`, of a Gaussian jet through all points, and `fitted`, of the fitted model.

    Both are medians over the planes in which points lie, from `nearest_m` to `farthest_m`. `measured` is None where no
    point lies off the axis, so that the flux cannot be told.
    """

    measured: float | None
    fitted: float
    nearest_m: float
    farthest_m: float

    @property
    def words(self) -> str:
        """For people."""
        where = f"{self.nearest_m:.2g} to {self.farthest_m:.2g} m from the disk"
        points = "not told by points on the axis" if self.measured is None else f"{self.measured:.2f} by the points"
        marked = f"; units? a jet in water has {LIKELY[0]:g} to {LIKELY[1]:g}"
        doubt = any(not is_likely(value) for value in (self.measured, self.fitted) if value is not None)
        return f"{points}, {self.fitted:.2f} by the model, {where}; the law says 1{marked if doubt else ''}"


def is_likely(ratio: float) -> bool:
    """Whether a momentum flux over thrust is one of a jet in water."""
    return LIKELY[0] <= ratio <= LIKELY[1]


def flux_over_thrust(jet: AxialJet, along_m: Array, area_m2: float) -> Array:
    """Momentum flux through planes across a free jet over its thrust, in fresh water.

    Parameters
    ----------
    jet : AxialJet
    along_m : ndarray, shape (n,)
        Distances of the planes from the disk, more than 0.
    area_m2 : float
        Of the disk.

    Returns
    -------
    ndarray, shape (n,)
    """
    edge = _REACH * (along_m[:, None] + np.sqrt(area_m2))
    # Finer near the axis, where the speed is.
    r = edge * np.linspace(0.0, 1.0, _RADII) ** 2
    speed = jet.speed(along_m[:, None], r, 1.0, area_m2)
    return np.asarray(2.0 * np.pi * FRESH_WATER_KG_M3 * np.trapezoid(speed**2 * r, r, axis=1))


def momentum_law(samples: JetSamples, model: AxialJet) -> MomentumLaw:
    """Momentum flux over thrust of measured speeds and of the model that was fitted to them.

    Raises
    ------
    InputError
        If that of the speeds lies where no jet's does: their unit or the thrusts' is another.
    """
    planes = np.quantile(samples.x_m, np.linspace(0.05, 0.95, 19))
    area = samples.disk_area_m2
    gaussian = family("jet-fitted")
    values, held = calibrated_values(gaussian, samples)
    told = not any(p.shapes == "angle" and p.name in held for p in gaussian.parameters)
    measured = float(np.median(flux_over_thrust(gaussian.model(values), planes, area))) if told else None
    if measured is not None and not POSSIBLE[0] <= measured <= POSSIBLE[1]:
        raise InputError(
            f"{samples.title}: units? the points' momentum flux in water is {measured:.2g} times the thrust, a jet has "
            f"{LIKELY[0]:g} to {LIKELY[1]:g}; thrusts must be in N (1 kgf is 9.81 N) of one thruster, speeds in m/s, "
            "radii from the axis in m"
        )
    return MomentumLaw(
        measured=measured,
        fitted=float(np.median(flux_over_thrust(model, planes, area))),
        nearest_m=float(planes[0]),
        farthest_m=float(planes[-1]),
    )
