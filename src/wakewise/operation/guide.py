"""Coverage of a flight before its first photograph: patches of the surveyed target, and the reachable views."""

from __future__ import annotations

from wakewise.operation.parts import Parts
from wakewise.scene.missions import Coverage, patches_of, reachable_views


def begin_coverage(parts: Parts, ranges_m: tuple[float, ...] | None = None) -> Coverage:
    """Coverage before the first photograph, with the views that this vehicle can reach; computed in about a second.

    Views lie at `ranges_m` from the surveyed target's centre, by default at `mission.standoff_m`.
    """
    target, mission = parts.surveyed_target, parts.scenario.mission
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
