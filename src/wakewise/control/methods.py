"""Methods by name: what each cares for, and how one is made, ours or one from outside.

- `dp`: dynamic positioning, a PID with the least thrusts.
- `pseudo-inverse`: the motion of `wake-aware`, wrench for wrench, made with the least thrusts (an ablation).
- `unaware`: the planner without a disturbance term.
- `smooth`: the same with a price on change of thrust.
- `linear`: `wake-aware` that believes in the `linear` wake model (an ablation).
- `instant`: the PID of `dp` with the gentlest thrusts of each instant.
- `wake-aware`: model predictive control of the target's water, the exact allocator behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wakewise.control.dynamic_positioning import dynamic_positioning
from wakewise.control.instant import instant
from wakewise.control.pseudo_inverse import planned_pseudo_inverse
from wakewise.control.settings import ControlSettings
from wakewise.control.unaware import smooth, unaware
from wakewise.control.wake_aware import linear, planned
from wakewise.errors import InputError
from wakewise.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.targets import Region
from wakewise.vehicles import Vehicle

Maker = Callable[[Vehicle, Region, WakeModel, ControlSettings, Surroundings | None], Controller[Any]]

_MAKERS: dict[str, Maker] = {
    "dp": dynamic_positioning,
    "pseudo-inverse": planned_pseudo_inverse,
    "unaware": unaware,
    "smooth": smooth,
    "linear": linear,
    "instant": instant,
    "wake-aware": planned,
}

METHODS: tuple[str, ...] = tuple(_MAKERS)
"""Names that `make_controller` knows; the first is the baseline."""


def make_controller(
    method: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings | None = None,
    surroundings: Surroundings | None = None,
) -> Controller[Any]:
    """Controller of that name for a nominal vehicle, a region to spare and a wake model.

    The methods that plan keep clear of `surroundings`; without them, of the sphere round the region's surface alone.

    Raises
    ------
    InputError
        If there is no such method, or the gains have no stable bandwidth on this vehicle.
    """
    if method not in _MAKERS:
        raise InputError(f"method '{method}': unknown, allowed: {', '.join(METHODS)}")
    return _MAKERS[method](vehicle, region, wake, settings or ControlSettings(), surroundings)
