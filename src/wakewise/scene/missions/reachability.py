"""Next views: poses on spheres about the target from which the vehicle can photograph without collision."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions.aim import CameraAim
from wakewise.scene.missions.clearance import TankBounds, gaps_of
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.visibility import CameraIntrinsics, SurfacePatches, VisibilityCriteria, view_quality

AZIMUTHS = 24
ELEVATIONS_DEG = (10.0, 25.0, 40.0, 55.0, 70.0)
"""Steps of 15 degrees, near the angle that our stereo likes best between two views (13)."""

LEAST_WAY_M, LEAST_TURN_DEG = 0.03, 5.0
"""What need not be said to a person."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidateViews:
    """Camera places about a centre, and how well a photograph from each would show what."""

    centre_W_m: Array  # shape (3,)
    places: Array  # shape (c, 3): azimuth, elevation (rad) and range (m) of each; see `orbit.py`
    quality: NDArray[np.uint8]  # shape (c, n): how well each shows the samples of the patches, as `view_quality`

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,), places=(None, 3))

    @classmethod
    def none(cls, patches: SurfacePatches) -> CandidateViews:
        """No view at all: coverage is counted, but nothing can be said of where to go."""
        n = len(patches.points_W_m)
        return cls(centre_W_m=np.zeros(3), places=np.empty((0, 3)), quality=np.empty((0, n), dtype=np.uint8))

    def pose(self, number: int) -> Pose:
        """X_WC of a view, looking at the centre without roll."""
        azimuth, elevation, range_m = (float(value) for value in self.places[number])
        return camera_pose(self.centre_W_m, azimuth, elevation, range_m)

    def points_W_m(self) -> Array:
        """Where the views are, shape (c, 3)."""
        azimuth, elevation, range_m = self.places.T
        level = range_m * np.cos(elevation)
        offsets = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -range_m * np.sin(elevation)], axis=1)
        return np.asarray(self.centre_W_m + offsets)

    def ways_m(self, p_W_m: Array) -> Array:
        """Way from a place, shape (3,), to each view round the target and not through it; shape (c,).

        The arc between the two directions at the mean range, and the change of range, as two legs of a triangle.
        """
        here = place_of(p_W_m, self.centre_W_m)
        direction = np.array(
            [math.cos(here[1]) * math.cos(here[0]), math.cos(here[1]) * math.sin(here[0]), -math.sin(here[1])]
        )
        ranges = self.places[:, 2]
        cosine = ((self.points_W_m() - self.centre_W_m) @ direction) / ranges
        arc = np.arccos(np.clip(cosine, -1.0, 1.0)) * 0.5 * (ranges + here[2])
        return np.hypot(arc, ranges - here[2])


def place_of(p_W_m: Array, centre_W_m: Array) -> Array:
    """Azimuth, elevation (rad) and range (m) of a place about a centre, shape (3,)."""
    north, east, down = np.asarray(p_W_m, dtype=np.float64) - centre_W_m
    level = math.hypot(north, east)
    return np.array([math.atan2(east, north), math.atan2(-down, level), math.hypot(level, down)])


def direction_words(X_WC: Pose, view: Pose, centre_W_m: Array) -> str:
    """How to get from a camera's pose to a view, for a person who faces the target: round it, up or down, nearer.

    What is below `LEAST_WAY_M` or `LEAST_TURN_DEG` is left out. Left and right are those of someone who looks at the
    target, and lengths are along the arc.
    """
    here, there = place_of(X_WC.p_m, centre_W_m), place_of(view.p_m, centre_W_m)
    round_rad = math.remainder(there[0] - here[0], 2.0 * math.pi)
    # From north over east the camera passes to the left of what it looks at.
    steps = [
        (round_rad * there[2] * math.cos(there[1]), "left", "right"),
        (float(X_WC.p_m[2] - view.p_m[2]), "up", "down"),
        (float(here[2] - there[2]), "closer", "back"),
    ]
    said = [
        f"{more if way > 0.0 else less} {abs(way):.{1 if abs(way) >= 0.1 else 2}f} m"
        for way, more, less in steps
        if abs(way) >= LEAST_WAY_M
    ]
    if said:
        said[0] = f"go {said[0]}"
    look_deg = math.degrees(_pitch(view) - _pitch(X_WC))
    if abs(look_deg) >= LEAST_TURN_DEG:
        said.append(f"look {'up' if look_deg > 0.0 else 'down'} {abs(look_deg):.0f} deg")
    return ", ".join(said) if said else "take a photograph from here"


def _pitch(X_WC: Pose) -> float:
    """Angle of a camera's axis above the horizon."""
    return math.asin(float(np.clip(-X_WC.R[2, 2], -1.0, 1.0)))


def reachable_views(
    patches: SurfacePatches,
    camera: CameraIntrinsics,
    *,
    centre_W_m: Array,
    ranges_m: tuple[float, ...],
    aim: CameraAim,
    size_m: Array,
    bounds: TankBounds,
    target_W_m: Array,
    clearance_m: float,
    need: VisibilityCriteria | None = None,
) -> CandidateViews:
    """Views on spheres of these ranges at which the hull keeps clear of floor, walls, surface and target.

    Takes about five milliseconds a view, half a second in all for one range.

    - `centre_W_m`, shape (3,): what the views look at.
    - `ranges_m`: distances of the camera from it.
    - `aim`, `size_m`, `bounds`, `target_W_m`, `clearance_m`: as `check_clearance` has them.

    Raises InputError if a range is not above zero.
    """
    if not all(math.isfinite(r) and r > 0.0 for r in ranges_m):
        raise InputError(f"coverage: ranges {ranges_m} m, each must be above 0")
    need = need or VisibilityCriteria()
    places, quality = [], []
    for range_m in ranges_m:
        for elevation_deg in ELEVATIONS_DEG:
            elevation = math.radians(elevation_deg)
            for azimuth in 2.0 * math.pi / AZIMUTHS * np.arange(AZIMUTHS):
                X_WC = camera_pose(centre_W_m, float(azimuth), elevation, range_m)
                X_WB = X_WC @ aim.mount(aim.tilt(-elevation)[0]).inverse()
                if min(gaps_of(X_WB, size_m, bounds, target_W_m).values()) >= clearance_m:
                    places.append((float(azimuth), elevation, range_m))
                    quality.append(view_quality(patches, X_WC, camera, need))
    if not places:
        return CandidateViews.none(patches)
    return CandidateViews(centre_W_m=centre_W_m, places=np.array(places), quality=np.array(quality))
