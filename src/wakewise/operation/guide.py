"""The coverage guide of a flight: from what the crew believes of the target, never from the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.scene.missions import Coverage, patches_of, reachable_views

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts


def begin_coverage(parts: Parts, ranges_m: tuple[float, ...] | None = None) -> Coverage:
    """Coverage before the first photograph, with the views that this vehicle can reach.

    Takes about a second, most of it for what each view would show.

    Parameters
    ----------
    parts : Parts
        Patches are those of its `found_target`: the shape is known, the place as well as it was surveyed.
    ranges_m : tuple of float, optional
        Distances of the views from the target's centre; by default the mission's `standoff_m`.
    """
    target, mission = parts.found_target, parts.scenario.mission
    patches = patches_of(target.mesh, target.bed_z_m)
    views = reachable_views(
        patches,
        parts.camera,
        centre_W_m=target.centre_W_m,
        ranges_m=ranges_m or (mission.standoff_m,),
        aim=parts.aim,
        size_m=parts.vehicle.size_m,
        bounds=parts.bounds,
        target_W_m=target.mesh.vertices_m,
        clearance_m=mission.clearance_m,
    )
    return Coverage.begin(patches, views)
