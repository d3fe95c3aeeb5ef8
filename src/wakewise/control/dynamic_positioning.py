"""`dp`: dynamic positioning by PID and the least thrusts, the baseline of every comparison."""

from __future__ import annotations

from wakewise.allocation import Allocation, Layout, min_norm_allocation
from wakewise.control.loop import TrackingController, vehicle_layout
from wakewise.control.settings import ControlSettings
from wakewise.control.tracker import make_tracker
from wakewise.core.arrays import Array
from wakewise.core.interfaces import WakeModel
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel


def dynamic_positioning(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,  # noqa: ARG001
) -> TrackingController:
    """`dp`: the tracker with the least thrusts; the wake model is only asked what D they cause."""
    return with_least_thrusts("dp", vehicle_layout(vehicle), vehicle, region, wake, settings)


def with_least_thrusts(
    name: str, layout: Layout, vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> TrackingController:
    """The tracker with the least thrusts of a layout, which may allow thrusters less than the vehicle's does."""

    def allocate(wrench_B: Array, gram: Array | None, _: Array) -> Allocation:
        return min_norm_allocation(layout, wrench_B, gram)

    return TrackingController(
        name=name,
        tracker=make_tracker(vehicle, settings),
        view=InfluenceModel.of(vehicle, region, wake, settings.superposition),
        allocate=allocate,
    )
