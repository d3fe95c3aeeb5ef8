"""Flakes between camera and scene, lit by daylight and lamps, mostly out of focus.

Grains of silt are far below a pixel and make haze. Specks are aggregates of some tenths of a millimetre; their number
follows the concentration of silt, with a few in clear water. Flakes that a world moves appear in several photographs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import FlakeCloud, ScalarGrid
from wakewise.core.jit.njit import njit, prange
from wakewise.vision.imaging.blur import GLOBAL, Shutter, pose_at
from wakewise.vision.imaging.camera import Camera
from wakewise.vision.imaging.optics import WaterOptics, sample_levels
from wakewise.vision.imaging.renderer import LAMP_REFERENCE_M, Image, Lights

NEAREST_M, FARTHEST_M = 0.04, 0.6
"""Range of depth in which flakes are drawn one by one."""
MEDIAN_DIAMETER_M, LOG_SPREAD = 0.4e-3, 0.4
APERTURE_M = 1.5e-3
"""Entrance pupil, of a 4 mm lens at f/2.7."""
FOCUS_M = 0.5
REFLECTANCE = 0.5
STEPS = 9
"""Instants at which a streak is drawn."""
BANDS = 16
"""Of rows, within which flakes see a rolling shutter open at one time."""


def flake_positions(
    camera: Camera,
    X_WC: Pose,
    silt: ScalarGrid | None,
    per_m3: float,
    per_kg: float,
    rng: np.random.Generator,
) -> Array:
    """Draw where flakes are, shape (n, 3) in the camera frame: a Poisson process with density per_m3 + per_kg C."""
    # A pyramid that holds the whole view: slopes to the points of the image's border.
    w, h = float(camera.width), float(camera.height)
    edge = np.linspace(0.0, 1.0, 17)
    border = [np.column_stack([edge * w, np.full(17, y)]) for y in (0.0, h)]
    border += [np.column_stack([np.full(17, x), edge * h]) for x in (0.0, w)]
    corners = camera.unproject(np.concatenate(border), np.full(68, FARTHEST_M))[:, :2] / FARTHEST_M
    low, high = corners.min(axis=0), corners.max(axis=0)
    reach_m = FARTHEST_M * float(np.sqrt(1.0 + (np.maximum(-low, high) ** 2).sum()))
    # A cloud that the camera does not see, however dense, costs no draws.
    densest = per_m3 + (per_kg * silt.largest_near(X_WC.p_m, reach_m) if silt is not None else 0.0)
    volume = float(np.prod(high - low)) * (FARTHEST_M**3 - NEAREST_M**3) / 3.0
    n = int(rng.poisson(densest * volume))
    depth = (NEAREST_M**3 + rng.random(n) * (FARTHEST_M**3 - NEAREST_M**3)) ** (1.0 / 3.0)
    points_C = np.column_stack([(low + rng.random((n, 2)) * (high - low)) * depth[:, None], depth])
    pixels = camera.project(points_C)
    inside = np.all((pixels >= 0.0) & (pixels <= (w, h)), axis=1)
    points_C = points_C[inside]
    n = len(points_C)
    keep = rng.random(n) * densest < per_m3 + per_kg * concentration(silt, X_WC.apply(points_C))
    return points_C[keep]


@dataclass(frozen=True, kw_only=True, eq=False)
class VisibleFlakes:
    """Flakes before a camera: places in its frame and velocities in the world, (n, 3), size and shade, (n,)."""

    p_C_m: Array
    v_W_m_s: Array
    size: Array
    shade: Array


def flakes_before(
    camera: Camera,
    X_WC: Pose,
    silt: ScalarGrid | None,
    per_m3: float,
    per_kg: float,
    rng: np.random.Generator,
    drifting: FlakeCloud | None = None,
) -> VisibleFlakes:
    """Flakes at the density per_m3 + per_kg C: those that drift, as many as there should be, and new ones beyond.

    New ones move as the nearest of those that drift does.
    """
    new = flake_positions(camera, X_WC, silt, per_m3, per_kg, rng)
    size, shade = rng.standard_normal(len(new)), rng.random(len(new))
    if drifting is None or not len(drifting.p_W_m):
        return VisibleFlakes(p_C_m=new, v_W_m_s=np.zeros_like(new), size=size, shade=shade)
    places = X_WC.apply(new)
    wanted = per_m3 + per_kg * concentration(silt, places)
    spare = rng.random(len(new)) * wanted < wanted - drifting.per_m3
    more = spare | ~np.asarray(drifting.covers(places, X_WC), dtype=np.bool_)
    velocity = drifting.v_W_m_s[cKDTree(drifting.p_W_m).query(places[more])[1]]
    rank = drifting.looks[:, 0] * drifting.per_m3
    p_C = X_WC.inverse().apply(drifting.p_W_m)
    old = (rank < per_m3 + per_kg * concentration(silt, drifting.p_W_m)) & (p_C[:, 2] > NEAREST_M)
    old &= p_C[:, 2] < FARTHEST_M
    return VisibleFlakes(
        p_C_m=np.concatenate([p_C[old], new[more]]),
        v_W_m_s=np.concatenate([drifting.v_W_m_s[old], velocity]),
        size=np.concatenate([drifting.looks[old, 1], size[more]]),
        shade=np.concatenate([drifting.looks[old, 2], shade[more]]),
    )


def concentration(silt: ScalarGrid | None, points_W_m: Array) -> Array:
    """Value of the grid at points, shape (n, 3) to (n,); zero without a grid."""
    if silt is None:
        return np.zeros(len(points_W_m))
    return _sample(*silt.levels, points_W_m)


def draw_flakes(
    image: Image,
    depth_m: Image,
    camera: Camera,
    poses: Sequence[Pose],
    flakes: VisibleFlakes,
    exposure_s: float,
    water: WaterOptics,
    lights: Lights,
    shutter: Shutter = GLOBAL,
) -> Image:
    """Lay flakes over a photograph, each a soft disk, streaked by its own motion and the camera's; returns a new image.

    `exposure_s` is the time that the poses span, of which `shutter` says what each row sees.
    A flake covers as much light as its shadow: the blur disk of a thin lens spreads it, with diameter
    f A |1/z - 1/z_focus| in pixels, and the cover falls by the ratio of areas. Places are those of mid-exposure.
    """
    points_C_m = flakes.p_C_m
    diameter = MEDIAN_DIAMETER_M * np.exp(LOG_SPREAD * flakes.size)
    reflectance = REFLECTANCE * (0.6 + 0.8 * flakes.shade)
    if len(points_C_m) == 0:
        return image
    z = points_C_m[:, 2]
    f = camera.focal_px
    own = 0.5 * f * diameter / z
    radius = np.sqrt(own**2 + (0.5 * f * APERTURE_M * np.abs(1.0 / z - 1.0 / FOCUS_M)) ** 2 + 0.5**2)
    away = points_C_m[:, None, :] - lights.lamps_C_m[None]
    lamp = lights.lamp * LAMP_REFERENCE_M**2 / max(1, len(lights.lamps_C_m))
    lamp_light = (lamp * np.clip(away[..., 2], 0.0, None) / (np.sum(away**2, axis=2) + 1e-4) ** 1.5).sum(axis=1)
    # A flake turned every way gathers half of the down-welling light of a level card.
    light = reflectance * (0.5 * lights.from_above + lamp_light)
    colour = light[:, None] * np.exp(-water.signal_per_m * z[:, None])
    cover = np.minimum(0.85, own**2 / radius**2)

    middle = pose_at(poses, 0.5)
    points_W = middle.apply(points_C_m)
    rows = camera.project(points_C_m)[:, 1] / camera.height
    track = _tracks(camera, poses, points_W, exposure_s * flakes.v_W_m_s, rows, shutter)
    out = image.copy()
    _splat(out, depth_m, np.nan_to_num(track, nan=-1e6), z, radius, cover, colour)
    return out


def _tracks(
    camera: Camera, poses: Sequence[Pose], points_W_m: Array, moved_W_m: Array, rows: Array, shutter: Shutter
) -> Array:
    """Pixels of points, shape (n, 3), while their rows, shape (n,), 0 top to 1, are exposed, shape (n, STEPS, 2).

    `moved_W_m` is how far each goes in the world over the time that the poses span, half of it before its middle.
    """
    track = np.empty((len(points_W_m), STEPS, 2))
    bands = (
        np.clip((rows * BANDS).astype(np.int64), 0, BANDS - 1) if shutter.rolling > 0.0 else np.zeros(len(rows), int)
    )
    for band in np.unique(bands):
        here = bands == band
        row = (band + 0.5) / BANDS
        for k in range(STEPS):
            share = shutter.fraction(row, (k + 0.5) / STEPS)
            places = points_W_m[here] + (share - 0.5) * moved_W_m[here]
            track[here, k] = camera.project(pose_at(poses, share).inverse().apply(places))
    return track


@njit(parallel=True)
def _sample(
    values: Any, origin: Any, spacing: float, outer: Any, outer_origin: Any, outer_spacing: float, points: Any
) -> Any:
    out = np.empty(points.shape[0])
    for i in prange(points.shape[0]):
        out[i] = sample_levels(
            values, origin, spacing, outer, outer_origin, outer_spacing, points[i, 0], points[i, 1], points[i, 2]
        )
    return out


@njit
def _splat(out: Any, depth_m: Any, track: Any, z: Any, radius: Any, cover: Any, colour: Any) -> None:
    """Blend flakes one after the other; a streak is drawn as overlapping disks that share the cover."""
    h, w = depth_m.shape
    for n in range(z.shape[0]):
        x0, y0 = track[n, 0]
        x1, y1 = track[n, track.shape[1] - 1]
        moved = math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
        stops = track.shape[1] if moved > 0.5 else 1
        r = radius[n]
        for s in range(stops):
            x, y = track[n, s if stops > 1 else track.shape[1] // 2]
            if not (-r < x < w + r and -r < y < h + r):
                continue
            share = cover[n] / stops
            for j in range(max(0, int(y - r - 1)), min(h, int(y + r + 2))):
                for i in range(max(0, int(x - r - 1)), min(w, int(x + r + 2))):
                    if depth_m[j, i] < z[n]:
                        continue
                    distance = math.sqrt((i + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2)
                    a = share * min(1.0, max(0.0, r + 0.5 - distance))
                    for c in range(3):
                        out[j, i, c] += a * (colour[n, c] - out[j, i, c])
