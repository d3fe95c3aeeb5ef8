"""Which numbers of which wake model can be fitted: where a search starts, what is allowed, what each number shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.wake.jets import AxialJet
from wakewise.wake.models import ModelName, WakeSettings, wake_model


@dataclass(frozen=True)
class FitParameter:
    """One number of a model, named as in `WakeSettings`. `shapes` is what it tells of: "level", "reach" or "angle"."""

    name: str
    start: float
    low: float
    high: float
    shapes: str


@dataclass(frozen=True)
class WakeFamily:
    """A wake model with its free parameters; none for a model that is never fitted."""

    name: ModelName
    parameters: tuple[FitParameter, ...] = ()

    @property
    def start(self) -> Array:
        """Where the search starts, shape (p,)."""
        return np.array([parameter.start for parameter in self.parameters])

    def settings(self, values: Array) -> WakeSettings:
        """Settings of the model with parameter values, shape (p,)."""
        numbers = {p.name: float(v) for p, v in zip(self.parameters, values, strict=True)}
        return WakeSettings.model_validate({"model": self.name, **numbers})

    def model(self, values: Array) -> AxialJet:
        """The free jet with parameter values, shape (p,)."""
        jet = wake_model(self.settings(values).model_copy(update={"floor": False}))
        if not isinstance(jet, AxialJet):
            raise InputError(f"wake model '{self.name}': has a floor term, only the free jet can be fitted")
        return jet


FAMILIES: dict[str, WakeFamily] = {
    family.name: family
    for family in (
        WakeFamily("paper"),
        WakeFamily("paper-calibrated", (FitParameter("gain", 0.036, 1e-4, 50.0, "level"),)),
        WakeFamily(
            "fitted",
            (
                FitParameter("gain", 0.6, 1e-4, 50.0, "level"),
                FitParameter("decay_power", 0.85, 0.0, 6.0, "reach"),
                FitParameter("cosine_power", 47.0, 0.0, 600.0, "angle"),
                # At most the core of a 60 mm disk's jet, 6.2 diameters; beyond, it only trades with the power.
                FitParameter("soft_radius_m", 0.02, 0.0, 0.37, "reach"),
            ),
        ),
        # Its one number sets width and decay together, through momentum: points on the axis are enough.
        WakeFamily("jet", (FitParameter("half_width_slope", 0.13, 0.05, 0.4, "level"),)),
        WakeFamily(
            "jet-fitted",
            (
                FitParameter("decay", 4.0, 0.05, 50.0, "level"),
                FitParameter("virtual_origin_diameters", 3.0, 0.01, 60.0, "reach"),
                FitParameter("start_width_diameters", 0.5, 0.0, 5.0, "angle"),
                FitParameter("half_width_slope", 0.13, 0.002, 0.8, "angle"),
            ),
        ),
        WakeFamily("linear"),
    )
}
"""Every wake model and what can be fitted of it. Without soft_radius_m the start of `fitted` is the model's default."""


def family(name: str) -> WakeFamily:
    """The family of a wake model that can be fitted.

    Raises
    ------
    InputError
        If there is no such model, or nothing of it can be fitted.
    """
    fittable = [each.name for each in FAMILIES.values() if each.parameters]
    if name not in fittable:
        why = "has no free parameters" if name in FAMILIES else "unknown"
        raise InputError(f"wake model '{name}': {why}, can be fitted: {', '.join(fittable)}")
    return FAMILIES[name]
