"""The controller that spends spare thrusters on keeping its jets away from the target, one instant at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from wakewise.allocation import Allocation, min_norm_allocation
from wakewise.control.levers import with_bed_points
from wakewise.control.loop import TrackingController
from wakewise.control.poised import poised
from wakewise.control.settings import ControlSettings
from wakewise.control.spare import watching
from wakewise.control.thrift import sharer_of, weights_of
from wakewise.control.tracker import make_tracker
from wakewise.core.arrays import Array
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.planning.surroundings import around_target
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import bed_of
from wakewise.wake.influence import InfluenceMatrices, InfluenceModel


def instant_allocator(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> TrackingController:
    """The same tracker as `dp`, and the gentlest thrusts that make the same wrench.

    D is divided by the sum of the region's weights, so that the cost does not depend on how many points sample it.
    Where D has no weight, the least thrusts: what a planner without a disturbance term falls back on is `dp`.
    """
    sharer = sharer_of(vehicle, settings)
    layout = sharer.layout
    view = InfluenceModel.of(vehicle, region, wake, settings.superposition)
    weights = weights_of(settings, view.total_weight)

    def allocate(wrench_B: Array, gram: Array | None, previous_N: Array) -> Allocation:
        if gram is None or weights.disturbance == 0.0:
            return min_norm_allocation(layout, wrench_B, gram)
        return sharer.shares(wrench_B, InfluenceMatrices(gram=gram, sent=gram), weights, view.total_weight, previous_N)

    return TrackingController(
        name="instant",
        tracker=make_tracker(vehicle, settings),
        view=view,
        allocate=allocate,
    )


def instant(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`instant`: the tracker, and the gentlest thrusts for its wrench, one instant at a time."""
    seen = with_bed_points(region, settings.levers, bed_of(wake))
    controller = instant_allocator(vehicle, seen, wake, settings)
    watch = watching(vehicle, seen, wake, settings)
    spared = replace(controller, view=watch.view, watch=watch)
    return poised(spared, watch, vehicle, settings, around or around_target(region))
