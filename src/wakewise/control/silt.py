"""The bed as the levers state it: what a method counts of the silt that its jets lift into the camera's view."""

from __future__ import annotations

import numpy as np

from wakewise.control.levers import LeverSettings
from wakewise.errors import InputError
from wakewise.interfaces import WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import bed_of
from wakewise.wake.silt import BEDS, SiltView

RAYS = 12
"""Rays to the target that are looked along; the plume is wider than the target, so a few do."""


def silt_view(vehicle: Vehicle, region: Region, wake: WakeModel, levers: LeverSettings) -> SiltView | None:
    """What `levers.silt` asks for: a bed, and rays from the vehicle's camera to the region's surface; None if nothing.

    Raises
    ------
    InputError
        If silt is to count and the wake model knows of no bed.
    """
    if levers.silt == "none":
        return None
    bed_z_m = bed_of(wake)
    if bed_z_m is None:
        raise InputError(
            f"control.levers.silt: '{levers.silt}', but wake model {wake.name} knows of no bed; "
            "allowed: none, or control.wake.floor true"
        )
    surface = region.points_W_m[region.distance_m <= 0.0]
    points = surface if len(surface) else region.points_W_m
    seen = points[np.linspace(0, len(points) - 1, min(RAYS, len(points))).astype(np.int64)]
    return SiltView(
        bed=BEDS[levers.silt],
        bed_z_m=bed_z_m,
        eye_B_m=vehicle.X_BC.p_m,
        seen_W_m=seen,
        positions_B_m=vehicle.thruster_positions_B_m,
        axes_B=vehicle.thruster_axes_B,
        areas_m2=vehicle.disk_areas_m2,
    )
