"""`wake-aware`: model predictive control of the target's water, with the exact allocator behind it.

The planner weighs the disturbance of the region over its horizon; the levers share each plan's wrench out anew, and
count water beside the target's own, such as what the current will bring there. That only moves spare thrusts: a plan
that is told of it leaves its path for water that nobody photographs. `linear` is the same with the belief in a linear
wake model, an ablation.
"""

from __future__ import annotations

from typing import Any

from wakewise.control.levers import with_bed_points
from wakewise.control.poised import poised
from wakewise.control.receding import planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.control.spare import respared, watching
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.planning.surroundings import around_target
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import bed_of, free_jet, wake_model


def planned(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`wake-aware`: the receding-horizon planner with the levers of the settings."""
    return _planned("wake-aware", vehicle, region, wake, settings, around)


def linear(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,  # noqa: ARG001
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`linear`: as `wake-aware`, believing in the `linear` wake model, whatever the settings say."""
    return _planned("linear", vehicle, region, wake_model("linear"), settings, around)


def _planned(
    name: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None,
) -> Controller[Any]:
    levers = settings.levers
    seen = with_bed_points(region, levers, bed_of(wake))
    solid = around or around_target(region)
    if not levers.spare:
        controller = planning_controller(vehicle, seen, wake, settings, name=name, surroundings=solid)
        return poised(controller, watching(vehicle, seen, wake, settings), vehicle, settings, solid)
    # The motion spares the target alone: points beside it move only spare thrusts.
    controller = planning_controller(vehicle, region, free_jet(wake), settings, name=name, surroundings=solid)
    spared = respared(controller, vehicle, seen, wake, settings)
    return poised(spared, spared.watch, vehicle, settings, solid)
