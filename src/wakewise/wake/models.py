"""Wake models by name, with their settings and default parameters.

- `paper`: as printed in the paper; no parameters.
- `paper-calibrated`: the gain 0.036 = (0.19 m)^2 / (1 m)^2. Gain-only fits of the paper's cone to swirling and
  swirl-free jets gave reference distances of 0.16 to 0.22 m.
- `fitted`: gain 0.6, decay power 0.85, cosine power 47, from fits to propeller jets with swirl, 1.7 to 8.3 disk
  diameters away. Swirl-free jets are narrower: cosine power 75 to 150.
- `linear`: for ablations. Speed falls as 1/r and is constant across the cone; gain 0.5 makes it equal `fitted` on the
  axis at 0.3 m.
- `jet`: the momentum-conserving round jet with published constants (`RoundJet`).
- `jet-fitted`: a Gaussian of a propeller's width (`RoundJet.of_propeller`) from the disk on, with the exit speed
  sqrt(T / (rho A)) on its axis and momentum T / rho: x0 = K sqrt(A) = 3.33 D and b0 = R sqrt(2) = 0.707 D.
- `learned`: a neural network trained on simulated jets (`wakewise.wake.learned`); no parameters, derivatives by
  differences.

Fitted values (`wakewise wake fit`) can be set in any scenario file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Self, cast

import numpy as np
from pydantic import Field, model_validator

from wakewise.core.checks import protocol_part, quoted
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.core.plugins import make, names, offered
from wakewise.core.settings import Settings
from wakewise.wake.cones import PaperJet, PowerJet
from wakewise.wake.jets import AxialJet, GaussianJet, RoundJet
from wakewise.wake.learned import learned_wake
from wakewise.wake.wall_jet import ImpingingJet

ModelName = Literal["paper", "paper-calibrated", "fitted", "linear", "jet", "jet-fitted"]
"""Our own models."""


@dataclass(frozen=True)
class _Recipe:
    """How a model is made, and which numbers it takes with which defaults."""

    make: Callable[..., AxialJet]
    numbers: dict[str, float]
    edge: bool = False


_PROPELLER = RoundJet.of_propeller()

_RECIPES: dict[str, _Recipe] = {
    "paper": _Recipe(lambda **numbers: PowerJet(label="paper", **numbers) if numbers else PaperJet(), {}, edge=True),
    "paper-calibrated": _Recipe(
        lambda **numbers: PowerJet(label="paper-calibrated", **numbers), {"gain": 0.036}, edge=True
    ),
    "fitted": _Recipe(
        lambda **numbers: PowerJet(label="fitted", **numbers),
        {"gain": 0.6, "decay_power": 0.85, "cosine_power": 47.0, "soft_radius_m": 0.0},
        edge=True,
    ),
    "linear": _Recipe(
        lambda **numbers: PowerJet(label="linear", decay_power=1.0, cosine_power=0.0, **numbers),
        {"gain": 0.5},
        edge=True,
    ),
    "jet": _Recipe(RoundJet, {"half_width_slope": 0.096}),
    "jet-fitted": _Recipe(
        GaussianJet,
        {
            "decay": _PROPELLER.decay,
            "virtual_origin_diameters": _PROPELLER.decay * float(np.sqrt(np.pi)) / 2.0,
            "start_width_diameters": float(np.sqrt(0.5)),
            "half_width_slope": _PROPELLER.half_width_slope,
        },
    ),
}


class WakeSettings(Settings):
    """Which wake model, with which numbers.

    A number left out has the model's default; a number that the model does not have is refused.
    """

    model: str = Field(
        default="jet", description="wake model that the controller believes in: a name, or package.module:make"
    )
    floor: bool = Field(default=True, description="add the wall jets that spread along the bed where jets strike it")
    edge_width_deg: float = Field(
        default=0.0, description="width of the smooth edge of a cone (deg), 0 is the sharp edge", ge=0.0, le=40.0
    )
    gain: float | None = Field(default=None, description="gain of a cone", gt=0.0)
    decay_power: float | None = Field(default=None, description="power with which a cone's speed falls", ge=0.0)
    cosine_power: float | None = Field(default=None, description="power of cos(theta) in a cone", ge=0.0)
    soft_radius_m: float | None = Field(default=None, description="softening of a cone at the disk (m)", ge=0.0)
    half_width_slope: float | None = Field(
        default=None, description="half-speed radius of a jet over the distance along it", gt=0.0
    )
    decay: float | None = Field(
        default=None, description="K of the centreline law U = K sqrt(T / rho) / (x + x0)", gt=0.0
    )
    virtual_origin_diameters: float | None = Field(
        default=None, description="x0 of a fitted jet over the disk's diameter", gt=0.0
    )
    start_width_diameters: float | None = Field(
        default=None, description="1/e width of a fitted jet at the disk over the disk's diameter", ge=0.0
    )

    @model_validator(mode="after")
    def _only_numbers_of_the_model(self) -> Self:
        recipe = _RECIPES.get(self.model, _FOREIGN)
        known = self.model in RIVALS or self.model in offered("wake model") or ":" in self.model
        if recipe is _FOREIGN and not known:
            raise ValueError(f"wake model '{self.model}': unknown, allowed: {', '.join(model_names())}")
        for name in type(self).model_fields:
            unknown = name not in recipe.numbers and name in _NUMBERS and getattr(self, name) is not None
            if unknown or (name == "edge_width_deg" and self.edge_width_deg > 0.0 and not recipe.edge):
                allowed = [*recipe.numbers, *(["edge_width_deg"] if recipe.edge else [])]
                raise ValueError(f"wake model {self.model} has no {name}, allowed: {', '.join(allowed) or 'none'}")
        return self


OWN_MODELS: tuple[str, ...] = tuple(_RECIPES)
"""Names of our own models."""

RIVALS: tuple[str, ...] = ("learned",)
"""Models that come with the package and are none of our own: trained on the water that they may be judged in."""

_FOREIGN = _Recipe(PaperJet, {})
"""What a model from outside takes from the settings: nothing; it brings its own numbers, and its own floor."""

_NUMBERS = frozenset(name for recipe in _RECIPES.values() for name in recipe.numbers)


def model_names() -> tuple[str, ...]:
    """Names of the wake models: ours, the rivals that come with them, then those that installed packages offer."""
    return tuple(names("wake model", dict.fromkeys((*_RECIPES, *RIVALS))))


def wake_model(which: str | WakeSettings, bed_z_m: float | None = None) -> WakeModel:
    """Wake model of that name with its default numbers, or as settings say.

    Parameters
    ----------
    which : str or WakeSettings
        A name of `model_names`, or ``package.module:make``, a callable without arguments that gives a `WakeModel`.
    bed_z_m : float, optional
        Depth of the bed below the surface (world z), needed for settings with `floor`.

    Raises
    ------
    InputError
        If there is no such model, a number is out of its range, or a floor is asked for without a bed.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> ahead = np.array([[0.5, 0.0, 0.0]])
    >>> jet = ww.wake_model("jet").unit_velocity(ahead, np.zeros((1, 3)), np.array([[1.0, 0, 0]]), np.array([0.005]))
    >>> jet.shape  # of one jet at one point, in m/s per square root of newton
    (1, 1, 3)
    """
    if isinstance(which, str):
        if which in RIVALS:
            return learned_wake()
        if which not in _RECIPES:
            return _from_outside(which)
        recipe = _RECIPES[which]
        return recipe.make(**recipe.numbers)
    if not isinstance(which, WakeSettings):
        raise InputError(f"wake model: {quoted(which)}, must be a name: {', '.join(model_names())}")
    if which.model in RIVALS:
        return learned_wake(_bed(which, bed_z_m))
    if which.model not in _RECIPES:
        return _from_outside(which.model)
    recipe = _RECIPES[which.model]
    chosen = {name: getattr(which, name) for name in recipe.numbers}
    numbers = {name: default if chosen[name] is None else chosen[name] for name, default in recipe.numbers.items()}
    if which.edge_width_deg > 0.0:
        numbers["edge_width_rad"] = float(np.deg2rad(which.edge_width_deg))
    jet = recipe.make(**numbers)
    floor_z_m = _bed(which, bed_z_m)
    return jet if floor_z_m is None else ImpingingJet(jet=jet, bed_z_m=floor_z_m)


def _bed(which: WakeSettings, bed_z_m: float | None) -> float | None:
    """Depth of the bed that jets run out along; None where they are wanted free."""
    if which.floor and bed_z_m is None:
        raise InputError(f"wake model {which.model}: floor is set but there is no bed, allowed: give the bed's depth")
    return bed_z_m if which.floor else None


def _from_outside(name: str) -> WakeModel:
    """A model that an installed package offers (entry points `wakewise.wake_models`), or `package.module:make`."""
    own: dict[str, Any] = dict.fromkeys((*_RECIPES, *RIVALS))
    return cast("WakeModel", make("wake model", name, own, checked=lambda made: protocol_part(made, "wake")))
