"""From a scene and a pose to linear radiance, depth and the target's share of every pixel.

Two passes over bands of the image. The first casts one ray through each pixel's centre: it gives the depth, exactly,
and the bed's colour from maps already filtered to the pixel's footprint. The second casts `samples` x `samples` rays
where one is not enough: on target and stones, whose colour is computed rather than filtered, and where neighbouring
pixels see different things. Bands keep the rays in the processor's cache and the memory small at any image size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.vision.imaging.bed_view import draw_bed, project_bed
from wakewise.vision.imaging.camera import Camera
from wakewise.vision.imaging.lens import IDEAL
from wakewise.vision.imaging.scene import BED, Scene
from wakewise.vision.imaging.shading import aim, average, needs_supersampling, overlay
from wakewise.vision.imaging.tile_culling import TILE_PX, tile_sphere_overlap

Image = NDArray[np.float32]
LAMP_REFERENCE_M = 0.5
"""Where the lamps' irradiance is stated."""
BAND_RAYS = 32768
"""Rays cast at a time."""
BAND_ROWS = 32
"""Rows of an image that a thread takes at a time; those of the noise are part of what a seed gives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lights:
    """Light on the scene, relative to a reference irradiance on a level open surface at the target.

    `ambient` is what the sky gives there and `panels` what the tank's LED panels give. `lamps_C_m`, shape (k, 3), are
    the vehicle's lamps in the camera frame, pointing along the optical axis; together they give the irradiance `lamp`
    on a card facing them from 0.5 m.
    """

    ambient: float = 1.0
    panels: float = 0.0
    lamp: float = 0.35
    lamps_C_m: Array

    def __post_init__(self) -> None:
        freeze(self, lamps_C_m=(None, 3))
        if not min(self.ambient, self.panels, self.lamp) >= 0.0:
            raise InputError(
                f"lights: ambient {self.ambient:g}, panels {self.panels:g}, lamp {self.lamp:g}, none may be negative"
            )

    @property
    def from_above(self) -> float:
        """Irradiance of sky and panels together."""
        return self.ambient + self.panels


@dataclass(frozen=True, kw_only=True, eq=False)
class Render:
    """What reaches the camera in perfectly clear water.

    `radiance` (h, w, 3) linear RGB relative to a white level card under the reference light; `lamp_radiance`
    (h, w, 3), the part of it that the lamps gave; `depth_m` (h, w) along the optical axis at the pixel's centre,
    infinite where nothing is hit; `target_fraction` (h, w), the target's share of the pixel's samples.
    """

    radiance: Image
    lamp_radiance: Image
    depth_m: Image
    target_fraction: Image


def render(scene: Scene, camera: Camera, X_WC: Pose, lights: Lights, samples: int = 2) -> Render:
    """Render one view without any water between.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    X_WC : Pose
    lights : Lights
    samples : int
        Rays across a pixel, squared in all, where one ray is not enough; 1 to 8.

    Raises
    ------
    InputError
        If `samples` is out of range.
    """
    if not 1 <= samples <= 8:
        raise InputError(f"render: samples {samples}, allowed 1 to 8")
    R, origin = X_WC.R, X_WC.p_m - scene.foot_W_m
    h, w, row = camera.height, camera.width, camera.row
    lamps = lights.lamps_C_m @ R.T + origin
    # Each lamp's share, so that all together give `lamp` at the reference distance.
    power = lights.lamp * LAMP_REFERENCE_M**2 / max(1, len(lamps))
    light = np.float32(lights.ambient) * scene.daylight + np.float32(lights.panels) * scene.panel_light
    radiance, lamp_radiance = np.zeros((h, w, 3), np.float32), np.zeros((h, w, 3), np.float32)
    fraction, depth = np.zeros((h, w), np.float32), np.full((h, w), np.inf, np.float32)
    kind = np.full((h, w), -1, np.int8)
    flat = (radiance.reshape(-1, 3), lamp_radiance.reshape(-1, 3), fraction.reshape(-1))

    n = len(scene.bed.lines_m)
    of_bed = slice(scene.first_bed_vertex, scene.first_bed_vertex + n * n)
    attributes = np.concatenate([scene.normals[of_bed], light[of_bed, :1]], axis=1)
    crossings, boxes = np.empty((n, n, 5)), np.empty((*scene.bed.tops_m.shape, 4))
    if row[0] == IDEAL:
        project_bed(scene.bed, row, R, origin, crossings, boxes)
    tiles = np.empty((-(-h // TILE_PX), -(-w // TILE_PX)), np.bool_)
    spheres_C = np.column_stack([(scene.spheres_F_m[:, :3] - origin) @ R, scene.spheres_F_m[:, 3]])
    tile_sphere_overlap(row, w, h, spheres_C, tiles)

    def cast(pixels: NDArray[np.int64], across: int) -> tuple[Any, ...]:
        most = len(pixels) * across**2
        starts, ways = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32)
        which, spreads = np.empty(most, np.int64), np.empty(most, np.float32)
        count = aim(pixels, across, w, row, R, origin, scene.top_m, starts, ways, which, spreads)
        hits = scene.solids.run(starts[:count], ways[:count], output=True)
        return (
            which, starts, ways, spreads, hits["geomID"], hits["primID"], hits["u"], hits["v"], hits["tfar"],
            scene.faces, scene.first_face, scene.normals, light, scene.moved_m, scene.seed,
        )  # fmt: skip

    rows = max(TILE_PX, BAND_RAYS // w // TILE_PX * TILE_PX)

    def first(begin: int) -> None:
        end = min(begin + rows, h)
        draw_bed(
            begin, end, row, R, origin, scene.bed, crossings, boxes, attributes, scene.bed_maps, power, lamps, kind,
            depth, radiance, lamp_radiance, BED,
        )  # fmt: skip
        near = np.repeat(np.repeat(tiles[begin // TILE_PX : -(-end // TILE_PX)], TILE_PX, axis=0), TILE_PX, axis=1)
        pixels = np.flatnonzero(near[: end - begin, :w]) + begin * w
        if len(pixels):
            which, *met = cast(pixels, 1)
            overlay(
                pixels, row, w, which, *met, R, power, lamps, samples == 1, kind.reshape(-1), depth.reshape(-1), *flat
            )

    in_threads(first, range(0, h, rows))
    if samples > 1:
        again = np.empty((h, w), np.bool_)
        in_threads(lambda y: needs_supersampling(kind, depth, y, min(y + rows, h), again), range(0, h, rows))
        more = np.flatnonzero(again)
        step = max(1, BAND_RAYS // samples**2)

        def second(begin: int) -> None:
            pixels = more[begin : begin + step]
            average(
                pixels, samples, *cast(pixels, samples), scene.bed, attributes, scene.bed_maps, R, power, lamps, *flat
            )

        in_threads(second, range(0, len(more), step))
    return Render(radiance=radiance, lamp_radiance=lamp_radiance, depth_m=depth, target_fraction=fraction)


def in_threads(work: Callable[[int], Any], items: Iterable[int]) -> None:
    """Do the work on as many threads as numba uses; Embree and the kernels release the interpreter's lock."""
    items = list(items)
    threads = min(numba.get_num_threads(), len(items))
    if threads <= 1:
        for item in items:
            work(item)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, items):
            pass
