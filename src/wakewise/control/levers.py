"""What gentle control may use beyond the free jet of one instant; each lever has its own switch.

Water near the target is stirred in more ways than a free jet's: jets that strike the bed run along it to the target's
foot, jets that meet join, and what leaves a thruster now may arrive much later, carried by the current. The levers tell
a controller of this. None of them knows the simulated world's truth: the current is the estimator's, or what a user
states.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from wakewise.core.arrays import Array, IntArray
from wakewise.core.settings import Settings
from wakewise.scene.targets import Region

BED_POINTS, BED_RADIUS_M, BED_WEIGHT = 80, 0.3, 0.5
"""How many bed points there are: enough for one in a square of 6 cm; how far from the target's foot they reach: three
of a coral's own radii; and their weight together, over that of the region: the bed counts half of the target."""
BED_HEIGHTS_M = (0.01, 0.03)
"""Bed points lie between these heights: where a wall jet half a metre from its strike point is fastest."""
GOLDEN_RAD = float(np.pi * (3.0 - np.sqrt(5.0)))
"""Angle of a sunflower's spiral, which spreads points evenly over a disk (H. Vogel, Math. Biosci. 44 (1979) 179)."""

Component = Annotated[float, Field(ge=-1.0, le=1.0)]
Velocity = tuple[Component, Component, Component]


class LeverSettings(Settings):
    """Switches of the levers; those that the tank bore out are on (docs/research-log/0014), all off is the paper's."""

    bed: bool = Field(default=False, description="also keep the water still on the bed around the target")
    spare: bool = Field(
        default=True, description="share out the plan's wrench anew at every step by the exact allocator"
    )
    meet: bool = Field(
        default=True, description="count what jets become that meet: they join and run on between them; needs spare"
    )
    drift: bool = Field(
        default=True, description="follow the jets as the current bends, stops and brings them; needs spare"
    )
    doubt: bool = Field(
        default=True, description="hold that some of the jets go elsewhere than they are reckoned to; needs spare"
    )
    thrift: bool = Field(
        default=True,
        description="gentle shares only as far as they are worth their power, and bounded by what there is to save",
    )
    posture: bool | None = Field(
        default=None,
        description="lean the body as its thrusters like it where the camera's joint keeps the view (mission.aim: "
        "auto); null: where there is a joint",
    )
    drift_m_s: Velocity | None = Field(
        default=None, description="that current, north, east, down, if it is stated; null: as the estimator finds it"
    )

    @model_validator(mode="after")
    def _stated_current_can_act(self) -> LeverSettings:
        if self.drift_m_s is not None and not self.drift:
            raise ValueError("drift_m_s is stated but drift is off; leave it null, or turn drift on")
        if self.drift_m_s is not None and not any(self.drift_m_s):
            raise ValueError("drift_m_s is no current at all; null takes the estimator's, drift: false does without")
        return self


def with_bed_points(region: Region, levers: LeverSettings, bed_z_m: float | None = None) -> Region:
    """The region and, if the lever is on, a disk of points just above the bed around the target's foot.

    Parameters
    ----------
    region : Region
    levers : LeverSettings
    bed_z_m : float, optional
        Depth of the bed; the lowest point of the region where it is not known.

    Returns
    -------
    Region
        The weights of the bed points add up to `BED_WEIGHT` times those of the region.
    """
    if not levers.bed:
        return region
    foot = region.points_W_m[_surface(region), :2].mean(axis=0)
    bed = float(region.points_W_m[:, 2].max()) if bed_z_m is None else bed_z_m
    k = np.arange(BED_POINTS)
    reach = BED_RADIUS_M * np.sqrt((k + 0.5) / BED_POINTS)
    low, high = BED_HEIGHTS_M
    # Heights by the golden ratio, so that every part of the disk has low and high points.
    height = low + (high - low) * ((k + 1) * 0.6180339887498949 % 1.0)
    ring = np.stack(
        [foot[0] + reach * np.cos(GOLDEN_RAD * k), foot[1] + reach * np.sin(GOLDEN_RAD * k), bed - height], axis=1
    )
    share = BED_WEIGHT * float(region.weights.sum()) / BED_POINTS
    return _joined(region, ring, np.full(BED_POINTS, share), reach)


def _surface(region: Region) -> IntArray:
    """Numbers of the points on the target's surface; of all points where none is."""
    found = np.flatnonzero(region.distance_m <= 0.0)
    return found if len(found) else np.arange(len(region.weights))


def _joined(region: Region, points_W_m: Array, weights: Array, distance_m: Array) -> Region:
    """The region and more points of water, none of them on the target's surface, whatever their distance."""
    return Region(
        points_W_m=np.concatenate([region.points_W_m, points_W_m]),
        weights=np.concatenate([region.weights, weights]),
        # What reads surface points must not take them for it.
        distance_m=np.concatenate([region.distance_m, np.maximum(distance_m, 1e-3)]),
    )
