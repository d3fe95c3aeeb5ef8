"""Parts from outside: what they are called in the record, and a guard round a controller that nobody here has read."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wakewise.control import MAKERS, make_controller, safeguarded
from wakewise.core.errors import WakewiseError, is_strict
from wakewise.core.interfaces import BodyState, Command, Controller, Goal
from wakewise.core.plugins import find, offered
from wakewise.operation.pilot_makers import PILOTS
from wakewise.operation.worlds.makers import WORLDS, flow_name
from wakewise.scene.targets import coral_kinds
from wakewise.wake.models import OWN_MODELS, RIVALS

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts
    from wakewise.operation.scenario import Scenario

PATIENCE_S = 60.0
"""Time over and above its periods that a controller from outside may take in all; then it is not asked any more."""


def described(part: Any) -> str:
    """A part in words: its own name, if it has one, and the class or function that it is."""
    name = getattr(part, "name", None)
    kind = type(part)
    what = f"{kind.__module__}.{kind.__qualname__}"
    return f"{name} ({what})" if isinstance(name, str) and name else what


def is_builtin(part: Any) -> bool:
    """Whether a part's class is one of this package."""
    return type(part).__module__.split(".")[0] == "wakewise"


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


@dataclass(frozen=True, eq=False)
class PluginControllerState:
    """What the guard remembers: the controller's own state, the backup's, time overrun, and why it gave up."""

    inner: Any
    backup: Any
    first: bool = True
    late_s: float = 0.0
    gave_up: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PluginController:
    """A controller from outside, with `dp` at hand; implements `wakewise.core.interfaces.Controller`.

    A step that raises, or whose thrusts are not finite or not one per thruster, is flown by the backup instead and
    counted as a fallback with its reason. One that takes longer than its period is flown, since a simulated world
    waits, and counted; after `patience_s` of such waiting the backup flies the rest. Thrusts beyond the thrusters'
    limits are cut. If it is `strict`, what the controller raises is raised instead, unless it is an error of Wakewise.
    """

    name: str
    inner: Controller[Any]
    thrusters: int
    lower_N: np.ndarray
    upper_N: np.ndarray
    backup: Callable[[], Controller[Any]]
    patience_s: float = PATIENCE_S
    strict: bool = False
    clock: Callable[[], float] = time.perf_counter
    _made: list[Controller[Any]] = field(default_factory=list)

    def init(self) -> PluginControllerState:
        """State before the first step."""
        try:
            return PluginControllerState(inner=self.inner.init(), backup=None)
        except Exception as fault:  # whatever a foreign controller raises must not end the flight
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            return PluginControllerState(inner=None, backup=None, gave_up=f"{self.name}: init raised {_said(fault)}")

    def step(
        self, state: PluginControllerState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PluginControllerState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        if state.gave_up is not None:
            return self._fall_back(state, dt_s, estimate, goal, state.gave_up)
        began = self.clock()
        try:
            inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
            trouble = self._trouble(command)
        except Exception as fault:  # see above
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            inner, command, trouble = state.inner, None, f"{self.name}: raised {_said(fault)}"
        # What is compiled or read on the first step is not the controller's pace.
        took_s = 0.0 if state.first else self.clock() - began
        late_s = state.late_s + max(took_s - dt_s, 0.0)
        gave_up = None
        if late_s > self.patience_s:
            gave_up = f"{self.name}: given up, {late_s:.0f} s late in all, last {took_s:.2f} s for {dt_s:.2f} s"
        state = replace(state, inner=inner, first=False, late_s=late_s, gave_up=gave_up)
        if trouble is not None or command is None:
            return self._fall_back(state, dt_s, estimate, goal, trouble or "no command")
        thrusts = np.clip(command.thrusts_N, self.lower_N, self.upper_N)
        words = [command.fallback] if command.fallback else []
        over_N = float(np.abs(command.thrusts_N - thrusts).max())
        if over_N > 1e-9:
            words.append(f"{self.name}: thrusts {over_N:.1f} N beyond their limits, cut")
        if took_s > dt_s:
            words.append(f"{self.name}: late, {1e3 * took_s:.0f} ms of {1e3 * dt_s:.0f} allowed")
        # What the controller is told next is what was flown: the estimator gets these thrusts, too.
        return state, replace(command, thrusts_N=thrusts, fallback="; ".join(words) or None)

    def _trouble(self, command: object) -> str | None:
        if not isinstance(command, Command):
            return f"{self.name}: gave {type(command).__name__}, must be a Command"
        if command.thrusts_N.shape != (self.thrusters,):
            return f"{self.name}: gave {len(command.thrusts_N)} thrusts, needs {self.thrusters}"
        return None

    def _fall_back(
        self, state: PluginControllerState, dt_s: float, estimate: BodyState, goal: Goal, why: str
    ) -> tuple[PluginControllerState, Command]:
        if not self._made:
            self._made.append(self.backup())
        backup = self._made[0]
        inner, command = backup.step(backup.init() if state.backup is None else state.backup, dt_s, estimate, goal)
        words = f"{why}; flown by {backup.name}" + (f", {command.fallback}" if command.fallback else "")
        return replace(state, backup=inner), replace(command, fallback=words)


def with_failsafe(parts: Parts) -> Controller[Any]:
    """The flight's controller with a guard round each step; the backup of one from outside is `dp`.

    The deadline is enforced in a world that says that it does not wait for its controller (see `World`).
    """
    controller, vehicle = parts.controller, parts.vehicle
    if is_builtin(controller):
        return safeguarded(controller, vehicle, parts.control, enforce=not getattr(parts.world, "waits", True))

    def backup() -> Controller[Any]:
        return make_controller("dp", vehicle, parts.region, parts.wake, parts.control, parts.surroundings)

    return PluginController(
        name=str(getattr(controller, "name", type(controller).__name__)),
        inner=controller,
        thrusters=len(vehicle.thrusters),
        lower_N=vehicle.thrust_lower_N,
        upper_N=vehicle.thrust_upper_N,
        backup=backup,
        strict=is_strict() and getattr(parts.world, "waits", True),
    )


def _said(fault: Exception) -> str:
    """An exception in one line: kind, words, and the line of code that raised it."""
    last = fault.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    where = "" if last is None else f" ({last.tb_frame.f_code.co_filename.rsplit('/', 1)[-1]}:{last.tb_lineno})"
    text = " ".join(str(fault).split()) or "no words"
    return f"{type(fault).__name__}: {text}{where}"
