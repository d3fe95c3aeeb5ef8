"""Controllers that do not care for the target: what the gentle ones are measured against."""

from __future__ import annotations

from wakewise.arrays import Array
from wakewise.control.allocation import Allocation, Layout, compile_layout, least_thrusts
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


def dynamic_positioning(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> TrackingController:
    """`dp`: the tracker with the least thrusts; the wake model is only asked what D they cause."""
    layout = vehicle_layout(vehicle)

    def allocate(wrench_B: Array, gram: Array | None, _: Array) -> Allocation:
        return least_thrusts(layout, wrench_B, gram)

    return TrackingController(
        name="dp",
        tracker=make_tracker(vehicle, settings),
        view=WakeView.of(vehicle, region, wake, settings.wake.sum),
        allocate=allocate,
        hold_s=settings.hold_s,
    )
