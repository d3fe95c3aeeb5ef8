"""Methods by name: what each cares for, and how one is made, ours or one from outside.

- `dp`: dynamic positioning, a PID with the least thrusts.
- `manual`: a person at two sticks, with the autopilot that such vehicles have (see `wakewise.operation.teleop.input`).
- `ardusub`: the loops and the mixer that such vehicles are shipped with, holding the mission's pose.
- `bow-rule`: `dp` whose bow thrusters never blow ahead.
- `pseudo-inverse`: the motion of `wake-aware`, wrench for wrench, made with the least thrusts (an ablation).
- `unaware`: the planner without a disturbance term.
- `smooth`: the same with a price on change of thrust.
- `linear`: `wake-aware` that believes in the `linear` wake model (an ablation).
- `instant`: the PID of `dp` with the gentlest thrusts of each instant, with the weights and levers of `wake-aware`.
- `wake-aware`: model predictive control of the target's water, the exact allocator behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

from wakewise.control.ardusub import ardusub
from wakewise.control.bow_rule import bow_rule
from wakewise.control.dynamic_positioning import dynamic_positioning
from wakewise.control.instant import instant
from wakewise.control.manual import manual
from wakewise.control.pseudo_inverse import planned_pseudo_inverse
from wakewise.control.settings import ControlSettings
from wakewise.control.unaware import smooth, unaware
from wakewise.control.wake_aware import linear, planned
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.core.plugins import find
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlTask:
    """What a controller is made for; a method from outside is made by a callable that takes this alone.

    Parameters
    ----------
    vehicle : Vehicle
        As it is believed to be.
    region : Region
        The water to spare.
    wake : WakeModel
        What is believed of the jets.
    settings : ControlSettings
    surroundings : Surroundings or None
        What to keep clear of.
    """

    vehicle: Vehicle
    region: Region
    wake: WakeModel
    settings: ControlSettings
    surroundings: Surroundings | None = None


Maker = Callable[[Vehicle, Region, WakeModel, ControlSettings, Surroundings | None], Controller[Any]]

MAKERS: dict[str, Maker] = {
    "dp": dynamic_positioning,
    "bow-rule": bow_rule,
    "manual": manual,
    "ardusub": ardusub,
    "pseudo-inverse": planned_pseudo_inverse,
    "unaware": unaware,
    "smooth": smooth,
    "linear": linear,
    "instant": instant,
    "wake-aware": planned,
}

METHODS: tuple[str, ...] = tuple(MAKERS)
"""Names of our own methods; the first is the baseline."""


def make_controller(
    method: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings | None = None,
    surroundings: Surroundings | None = None,
) -> Controller[Any]:
    """Controller of that name for a nominal vehicle, a region to spare and a wake model.

    `method` is one of `METHODS`, a name that an installed package offers (entry points `wakewise.controllers`), or
    ``package.module:make``; those from outside are made by a callable of one `ControlTask`.
    The methods that plan keep clear of `surroundings`; without them, of the sphere round the region's surface alone.

    Raises
    ------
    InputError
        If there is no such method, or the gains have no stable bandwidth on this vehicle.
    """
    chosen = settings or ControlSettings()
    if method in MAKERS:
        return MAKERS[method](vehicle, region, wake, chosen, surroundings)
    make = cast("Callable[[ControlTask], Controller[Any]]", find("method", method, MAKERS).maker)
    return make(ControlTask(vehicle=vehicle, region=region, wake=wake, settings=chosen, surroundings=surroundings))
