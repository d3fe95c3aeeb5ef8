"""Parts from outside: their names in the record, and the failsafe of a flight's controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from wakewise.control import MAKERS, ControlSettings, Pipeline, vehicle_layout, with_failsafe, with_pwm
from wakewise.control.null_space_allocation import least_thrust_allocator
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.core.plugins import find, offered
from wakewise.operation.scenario.settings import FLOWS, PILOTS, Scenario
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region, procedural_kinds
from wakewise.wake.models import OWN_MODELS, RIVALS

OURS = frozenset({"wakewise", "wakewise_ardusub", "wakewise_benchmarks", "wakewise_nerf", "wakewise_paper"})
"""Top-level packages of this project."""


def described(part: object) -> str:
    """A part in words: its own name, if it has one, and its class."""
    name = getattr(part, "name", None)
    kind = type(part)
    what = f"{kind.__module__}.{kind.__qualname__}"
    return f"{name} ({what})" if isinstance(name, str) and name else what


def is_builtin(part: object) -> bool:
    """Whether a part's class is in one of this project's packages."""
    return type(part).__module__.split(".")[0] in OURS


def external_parts(scenario: Scenario, given: Mapping[str, Any]) -> dict[str, str]:
    """Parts of a flight that are not of this project, in words: given in Python or named in the scenario."""
    found = {name: described(part) for name, part in given.items() if not is_builtin(part)}
    named: dict[str, tuple[str, str, Iterable[str]]] = {
        "controller": ("method", scenario.method, MAKERS),
        "wake": ("wake model", scenario.control.wake.model, (*OWN_MODELS, *RIVALS)),
        "world": ("world", scenario.flow_name, FLOWS),
        "pilot": ("pilot", scenario.pilot, PILOTS),
        "target": ("target", scenario.target.kind, procedural_kinds()),
        "current": ("current", scenario.tank.current.file or "", ("",)),
        "detector": ("detector", scenario.perception.detector or "", ("",)),
    }
    for part, (kind, name, builtin) in named.items():
        is_file = Path(name).expanduser().exists()
        if part in given or name in builtin or is_file or not (name in offered(kind) or ":" in name):
            continue
        origin = find(kind, name, {}).origin
        found[part] = name if origin == name else f"{name} (from {origin})"
    ending = Path(scenario.vehicle).suffix.removeprefix(".").lower()
    if "vehicle" not in given and ending in offered("vehicle format"):
        found["vehicle"] = f"{scenario.vehicle} (read by {find('vehicle format', ending, {}).origin})"
    if "wake" in found:
        found["wake"] += "; derivatives by central differences"
    return found


def flown_controller(
    controller: Controller[Any],
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    enforce: bool,
) -> Pipeline:
    """The controller with failsafe and thruster model; `enforce`: thrusts that come too late are not sent."""
    foreign, reported_by = not is_builtin(controller), None
    if foreign:
        reported_by = least_thrust_allocator(vehicle_layout(vehicle), vehicle, region, wake, settings)
    pipeline = with_failsafe(controller, vehicle, settings, enforce=enforce, foreign=foreign, reported_by=reported_by)
    return with_pwm(pipeline, vehicle, settings.pulse_s)
