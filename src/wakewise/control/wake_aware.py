"""The controller that spends spare thrusters on keeping its jets away from the target, one instant at a time."""

from __future__ import annotations

from wakewise.arrays import Array
from wakewise.control.allocation import Allocation, Layout, Weights, compile_layout, gentle_allocation, least_thrusts
from wakewise.control.loop import TrackingController
from wakewise.control.settings import ControlSettings
from wakewise.control.tracker import make_tracker
from wakewise.control.view import WakeView
from wakewise.interfaces import WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle


def vehicle_layout(vehicle: Vehicle) -> Layout:
    """Allocation matrix and limits of a vehicle, ready for use."""
    return compile_layout(vehicle.allocation_matrix, vehicle.thrust_lower_N, vehicle.thrust_upper_N)


def wake_aware(vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings) -> TrackingController:
    """`wake-aware`: the same tracker as `dp`, and the gentlest thrusts that make the same wrench.

    D is divided by the sum of the region's weights, so that the cost does not depend on how many points sample it.
    """
    layout = vehicle_layout(vehicle)
    view = WakeView.of(vehicle, region, wake, settings.wake.sum)
    weights = Weights(
        disturbance=settings.w_disturbance / view.total_weight, effort=settings.w_effort, previous=settings.w_previous
    )

    def allocate(wrench_B: Array, gram: Array | None, previous_N: Array) -> Allocation:
        if gram is None:
            return least_thrusts(layout, wrench_B)
        return gentle_allocation(layout, wrench_B, gram, weights, previous_N)

    return TrackingController(
        name="wake-aware",
        tracker=make_tracker(vehicle, settings),
        view=view,
        allocate=allocate,
        hold_s=settings.hold_s,
    )
