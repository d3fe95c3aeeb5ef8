"""Settings that are set and have no effect with the scenario's method, vehicle or pilot.

A setting that contradicts another is refused by its own record. One that only has no effect is logged before the
flight, because the same settings are flown with many methods.
"""

from __future__ import annotations

from wakewise.control import METHODS
from wakewise.operation.scenario.settings import Scenario
from wakewise.planning import PlanSettings
from wakewise.robot.vehicles import Vehicle

PLANNING = frozenset({"pseudo-inverse", "mpc", "mpc-smooth", "linear", "wake-aware"})
"""Methods of ours with a plan."""
MITIGATION_METHODS = frozenset({"pseudo-inverse", "linear", "allocation-only", "wake-aware"})
"""Methods of ours with null-space allocation; with a plan, `null_space` turns all of it off but the bed."""
BY_HAND = frozenset({"manual", "manual-careful"})
"""Methods of ours in which a modelled person flies."""
_NEED_NULL_SPACE = ("merging_jets", "advection", "power_limit")


def ineffective_settings(scenario: Scenario, vehicle: Vehicle) -> tuple[str, ...]:
    """Fields that are set and have no effect, one sentence each; none of a method from outside, which is not known.

    Fields of the null-space allocation are on by default, so for a method without it only `include_bed`, which is off
    by default, is named.
    """
    control, method, found = scenario.control, scenario.method, []
    if method in METHODS:
        allocation = control.allocation
        if method in MITIGATION_METHODS & PLANNING and not allocation.null_space:
            on = [name for name in _NEED_NULL_SPACE if getattr(allocation, name)]
            if on:
                found.append(
                    f"control.allocation.{', '.join(on)}: nothing without control.allocation.null_space, which "
                    f"{method} shares by"
                )
        if allocation.include_bed and method not in MITIGATION_METHODS:
            found.append(f"control.allocation.include_bed: nothing for {method}, which has no null-space stage")
        if method not in PLANNING:
            if control.obstacles:
                found.append(f"control.obstacles: not kept clear of by {method}, which does not plan")
            if control.plan != PlanSettings():
                found.append(f"control.plan: nothing for {method}, which does not plan")
        if control.operator_seed is not None and method not in BY_HAND and scenario.pilot not in ("human", "assisted"):
            found.append(f"control.operator_seed: nobody flies {method} by hand with the pilot {scenario.pilot}")
    if control.pulse_s is not None and vehicle.thrust_steps is None:
        found.append(f"control.pulse_s: the thrusters of {vehicle.name} hold any thrust, so none is sent as pulses")
    return tuple(found)
