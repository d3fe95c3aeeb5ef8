"""Parts from outside: what they are called in the record, and the failsafe of a flight's controller."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wakewise.control import MAKERS, Pipeline, vehicle_layout, with_failsafe, with_pwm
from wakewise.control.null_space_allocation import least_thrust_allocator
from wakewise.core.plugins import find, offered
from wakewise.operation.pilot_makers import PILOTS
from wakewise.operation.worlds.makers import WORLDS, flow_name
from wakewise.scene.targets import coral_kinds
from wakewise.wake.models import OWN_MODELS, RIVALS

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts
    from wakewise.operation.scenario import Scenario

OURS = frozenset({"wakewise", "wakewise_ardusub", "wakewise_benchmarks", "wakewise_nerf", "wakewise_paper"})
"""Top-level packages whose parts are not from outside."""


def described(part: Any) -> str:
    """A part in words: its own name, if it has one, and the class or function that it is."""
    name = getattr(part, "name", None)
    kind = type(part)
    what = f"{kind.__module__}.{kind.__qualname__}"
    return f"{name} ({what})" if isinstance(name, str) and name else what


def is_builtin(part: Any) -> bool:
    """Whether a part's class is one of this project's packages."""
    return type(part).__module__.split(".")[0] in OURS


def external_parts(parts: Parts) -> dict[str, str]:
    """Parts of a flight that are not this package's own, in words: given in Python or named in the scenario."""
    found = {name: described(part) for name, part in parts.given.items() if not is_builtin(part)}
    for name, (kind, named, own) in _named(parts.scenario).items():
        is_file = Path(named).expanduser().exists()
        if name in parts.given or named in own or is_file or not (named in offered(kind) or ":" in named):
            continue
        found[name] = f"{named} (from {find(kind, named, own).origin})"
    ending = Path(parts.scenario.vehicle).suffix.removeprefix(".").lower()
    if "vehicle" not in parts.given and ending in offered("vehicle format"):
        found["vehicle"] = f"{parts.scenario.vehicle} (read by {find('vehicle format', ending, {}).origin})"
    if "wake" in found:
        found["wake"] += "; derivatives by central differences"
    return found


def _named(scenario: Scenario) -> dict[str, tuple[str, str, Mapping[str, Any]]]:
    """Kind, name and our own ones of each part that a scenario names."""
    return {
        "controller": ("method", scenario.method, MAKERS),
        "wake": ("wake model", scenario.control.wake.model, dict.fromkeys((*OWN_MODELS, *RIVALS))),
        "world": ("world", flow_name(scenario), WORLDS),
        "pilot": ("pilot", scenario.pilot, PILOTS),
        "target": ("target", scenario.target.kind, dict.fromkeys(coral_kinds())),
        "current": ("current", scenario.tank.current.file or "", {"": None}),
    }


def flown_controller(parts: Parts) -> Pipeline:
    """The flight's controller with failsafe and thruster model.

    The deadline is enforced in a world that says that it does not wait for its controller (see `World`).
    """
    controller, vehicle, foreign = parts.controller, parts.vehicle, not is_builtin(parts.controller)
    reported_by = None
    if foreign:
        layout = vehicle_layout(vehicle)
        reported_by = least_thrust_allocator(layout, vehicle, parts.region, parts.wake, parts.control)
    pipeline = with_failsafe(
        controller,
        vehicle,
        parts.control,
        enforce=not getattr(parts.world, "waits", True),
        foreign=foreign,
        reported_by=reported_by,
    )
    return with_pwm(pipeline, vehicle, parts.control.pulse_s)
