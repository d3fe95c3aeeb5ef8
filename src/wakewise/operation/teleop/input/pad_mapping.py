"""What each stick and button of a gamepad does, and from what a pad says to `Controls`; any pad, no device needed.

Names are SDL's for pads that it knows (`leftx`, `a`, `dpup`) and numbers for all others (`axis0`, `button3`,
`hat0up`). Sticks count as -1 to 1, right and towards the pilot positive, triggers as 0 to 1, buttons as 0 or 1.
As YAML, where only what differs from the defaults need be given and `-` turns a sense round:

    pad: Extreme 3D            # part of the pad's name; any pad where it is left out
    dead_zone: 0.12
    axes:
      forward: -axis1
      down: [triggerright, -triggerleft]
      turn: {of: axis2, dead_zone: 0.2}
    buttons:
      button0: capture
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import yaml_file
from wakewise.operation.teleop.input.controls import ACTIONS, CONTROL_AXES, apply_dead_zone

STICKS = ("leftx", "lefty", "rightx", "righty", "triggerleft", "triggerright")
"""SDL's names of a known pad's axes, in its order."""
BUTTONS = (
    "a", "b", "x", "y", "back", "guide", "start", "leftstick", "rightstick", "leftshoulder", "rightshoulder", "dpup",
    "dpdown", "dpleft", "dpright",
)  # fmt: skip
"""SDL's names of a known pad's buttons, in its order."""
DEAD_ZONE = 0.12
"""Share of a stick's way that counts as centred; worn pads rest up to a tenth off."""
_NUMBERED = re.compile(r"axis\d+|button\d+|hat\d+(up|down|left|right)")


@dataclass(frozen=True, kw_only=True)
class PadState:
    """What a pad says at one instant: its name, and each of its sticks and buttons by name."""

    name: str
    values: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class AxisBinding:
    """One stick, trigger or button that moves an axis.

    `rest` is what it says untouched: -1 for a trigger of a pad that SDL does not know.
    """

    of: str
    sign: float = 1.0
    dead_zone: float = DEAD_ZONE
    rest: float = 0.0

    def share(self, state: PadState) -> float:
        """Share of full stick, -1 to 1."""
        raw = state.values.get(self.of, 0.0)
        raw = (raw - self.rest) / (1.0 - self.rest) if self.rest else raw
        return self.sign * float(apply_dead_zone([raw], self.dead_zone)[0])


def _parts(*names: str) -> tuple[AxisBinding, ...]:
    return tuple(AxisBinding(of=name.removeprefix("-"), sign=-1.0 if name.startswith("-") else 1.0) for name in names)


@dataclass(frozen=True, kw_only=True)
class PadMapping:
    """What moves each axis, in the order of `CONTROL_AXES`, and what each button asks for.

    The defaults are those of the cockpit's page: left stick forward and sideways, right stick turn and depth, the
    cross tilts.
    """

    pad: str = ""
    axes: tuple[tuple[AxisBinding, ...], ...] = (
        _parts("-lefty"),
        _parts("leftx"),
        _parts("righty"),
        _parts("rightx"),
        _parts("dpup", "-dpdown"),
    )
    buttons: Mapping[str, str] = field(
        default_factory=lambda: {
            "a": "capture",
            "b": "hold",
            "x": "precise",
            "y": "operator",
            "leftshoulder": "gain_down",
            "rightshoulder": "gain_up",
            "start": "scan",
        }
    )
    source: str = "the default mapping"

    def check(self, state: PadState) -> None:
        """Refuse a pad that this mapping is not for.

        Raises InputError if the pad has another name, or lacks what the mapping asks of it.
        """
        if self.pad and self.pad.lower() not in state.name.lower():
            raise InputError(f"gamepad '{state.name}': {self.source} is for '{self.pad}'")
        asked = [part.of for parts in self.axes for part in parts] + list(self.buttons)
        if missing := [name for name in asked if name not in state.values]:
            raise InputError(
                f"gamepad '{state.name}': {self.source} asks for {missing[0]}, it has {_listed(state.values)}"
            )

    def sticks(self, state: PadState) -> Array:
        """Axes as shares of full stick, shape (5,), dead zones taken out."""
        shares = [sum(part.share(state) for part in parts) for parts in self.axes]
        return np.clip(np.array(shares), -1.0, 1.0)

    def held(self, state: PadState) -> frozenset[str]:
        """Buttons with something to ask for that are down."""
        return frozenset(name for name in self.buttons if state.values.get(name, 0.0) > 0.5)


def load_mapping(path: Path) -> PadMapping:
    """Mapping from a YAML file (see the top); what it leaves out is as by default.

    Raises InputError if it cannot be read, or see `mapping_of`.
    """
    return mapping_of(yaml_file(path), str(path))


def mapping_of(tree: Any, what: str = "mapping") -> PadMapping:
    """Mapping of what a file holds; `what` names it in messages.

    Raises InputError, naming what was found and what is allowed.
    """
    tree = _mapping(tree, what, ("pad", "dead_zone", "axes", "buttons"))
    pad, usual = tree.get("pad", ""), PadMapping()
    if not isinstance(pad, str):
        raise InputError(f"{what}, pad: {pad!r}, must be part of a gamepad's name")
    dead_zone = _dead_zone(tree.get("dead_zone", DEAD_ZONE), what)
    given = _mapping(tree.get("axes", {}), f"{what}, axes", CONTROL_AXES)
    axes = tuple(
        tuple(_part(one, dead_zone, f"{what}, axes.{name}") for one in _several(given[name]))
        if name in given
        else tuple(AxisBinding(of=part.of, sign=part.sign, dead_zone=dead_zone) for part in parts)
        for name, parts in zip(CONTROL_AXES, usual.axes, strict=True)
    )
    buttons = _mapping(tree.get("buttons", dict(usual.buttons)), f"{what}, buttons", None)
    for name, action in buttons.items():
        _known(name, f"{what}, buttons")
        if action not in ACTIONS:
            raise InputError(f"{what}, buttons.{name}: {action!r}, allowed are {', '.join(ACTIONS)}")
    return PadMapping(pad=pad.strip(), axes=axes, buttons=dict(buttons), source=what)


def _several(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _part(value: Any, dead_zone: float, what: str) -> AxisBinding:
    given = {"of": value} if isinstance(value, str) else _mapping(value, what, ("of", "dead_zone", "rest"))
    name = given.get("of")
    if not isinstance(name, str):
        raise InputError(f"{what}: {value!r}, must name a stick, trigger or button, such as -lefty")
    rest = given.get("rest", 0)
    if isinstance(rest, bool) or rest not in (0, -1):
        raise InputError(f"{what}, rest: {rest!r}, must be 0, or -1 for a trigger that rests there")
    of = name.strip().removeprefix("-")
    _known(of, what)
    sign = -1.0 if name.strip().startswith("-") else 1.0
    return AxisBinding(
        of=of, sign=sign, dead_zone=_dead_zone(given.get("dead_zone", dead_zone), what), rest=float(rest)
    )


def _known(name: Any, what: str) -> None:
    if not isinstance(name, str) or not (name in (*STICKS, *BUTTONS) or _NUMBERED.fullmatch(name)):
        allowed = ", ".join((*STICKS, *BUTTONS))
        raise InputError(f"{what}: {name!r} is no part of a gamepad, there are {allowed}, axis0, button0, hat0up")


def _dead_zone(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 0.9:
        raise InputError(f"{what}, dead_zone: {value!r}, must be a number from 0 to 0.9")
    return float(value)


def _mapping(value: Any, what: str, allowed: Collection[str] | None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{what}: {value!r}, must be a mapping of names")
    for key in value:
        if allowed is not None and key not in allowed:
            raise InputError(f"{what}: {key!r} is unknown, allowed are {', '.join(allowed)}")
    return value


def _listed(values: Mapping[str, float]) -> str:
    """What a pad has, shortly: names without numbers, and how many are numbered."""
    named = [name for name in values if not _NUMBERED.fullmatch(name)]
    axes, buttons = (sum(1 for n in values if re.fullmatch(rf"{kind}\d+", n)) for kind in ("axis", "button"))
    return ", ".join([*named[:4], f"{axes} axes", f"{buttons} buttons"])
