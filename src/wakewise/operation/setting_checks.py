"""Switches that are set and cannot act: what a scenario asks for that its method, vehicle or pilot has no use for.

A setting that contradicts itself is refused where it is made (`control.levers`). One that merely has no effect here is
said before the flight, so that nobody reads a difference into it that is none: the same settings are flown with many
methods, and most of them are somebody's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.control import METHODS
from wakewise.planning import PlanSettings

if TYPE_CHECKING:
    from wakewise.operation.scenario import Scenario
    from wakewise.robot.vehicles import Vehicle

PLANNING = frozenset({"pseudo-inverse", "unaware", "smooth", "linear", "wake-aware"})
"""Our methods that plan."""
MITIGATION_METHODS = frozenset({"pseudo-inverse", "linear", "instant", "wake-aware"})
"""Our methods that use levers; of these all but `instant` need `spare` for all of them but the bed."""
_AFTER_SPARE = ("meet", "drift", "doubt", "thrift")


def ineffective_settings(scenario: Scenario, vehicle: Vehicle) -> tuple[str, ...]:
    """What is set and does nothing, a sentence each, with the field's name; nothing is known of a method from outside.

    Levers are on by default, so a method without levers is only told of the one that is not.
    """
    control, method, found = scenario.control, scenario.method, []
    if method in METHODS:
        levers = control.levers
        if method in MITIGATION_METHODS & PLANNING and not levers.spare:
            on = [name for name in _AFTER_SPARE if getattr(levers, name)]
            if on:
                found.append(
                    f"control.levers.{', '.join(on)}: nothing without control.levers.spare, which {method} shares by"
                )
        if levers.bed and method not in MITIGATION_METHODS:
            found.append(f"control.levers.bed: nothing for {method}, which has no levers")
        if method not in PLANNING:
            if control.obstacles:
                found.append(f"control.obstacles: not kept clear of by {method}, which does not plan")
            if control.plan != PlanSettings():
                found.append(f"control.plan: nothing for {method}, which does not plan")
        if control.person is not None and method != "manual" and scenario.pilot not in ("human", "assisted"):
            found.append(f"control.person: nobody flies {method} by hand with the pilot {scenario.pilot}")
    if control.pulse_s is not None and vehicle.thrust_steps is None:
        found.append(f"control.pulse_s: the thrusters of {vehicle.name} hold any thrust, so none is sent as pulses")
    return tuple(found)
