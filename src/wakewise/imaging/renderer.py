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

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.imaging.camera import Camera
from wakewise.imaging.scene import Scene
from wakewise.imaging.shading import aim, keep_first, needs_more, shade

Image = NDArray[np.float32]
LAMP_REFERENCE_M = 0.5
"""Where the lamps' irradiance is stated."""
BAND_RAYS = 32768
"""Rays cast at a time."""


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
    radiance, lamp_radiance = np.zeros((h * w, 3), np.float32), np.zeros((h * w, 3), np.float32)
    fraction, depth = np.zeros(h * w, np.float32), np.full(h * w, np.inf, np.float32)
    kind = np.full(h * w, -1, np.int8)

    axis = np.ascontiguousarray(R[:, 2])

    def cast(pixels: NDArray[np.int64], across: int, only_bed: bool) -> tuple[NDArray[np.int64], dict[str, Any]]:
        most = len(pixels) * across**2
        starts, ways = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32)
        which, spreads = np.empty(most, np.int64), np.empty(most, np.float32)
        count = aim(pixels, across, w, row, R, origin, scene.top_m, starts, ways, which, spreads)
        hits = scene.embree.run(starts[:count], ways[:count], output=True)
        shade(
            pixels, across, which, starts, ways, spreads, hits["geomID"], hits["primID"], hits["u"], hits["v"],
            hits["tfar"], scene.faces, scene.first_face, scene.normals, light, scene.bed_maps, scene.seed, axis, power,
            lamps, only_bed, radiance, lamp_radiance, fraction,
        )  # fmt: skip
        return which, hits

    def first(begin: int) -> None:
        pixels = np.arange(begin, min(begin + BAND_RAYS, h * w))
        which, hits = cast(pixels, 1, samples > 1)
        keep_first(begin, row, w, which, hits["geomID"], hits["tfar"], kind, depth)

    in_threads(first, range(0, h * w, BAND_RAYS))
    kinds, depths = kind.reshape(h, w), depth.reshape(h, w)
    if samples > 1:
        again = np.empty((h, w), np.bool_)
        rows = max(1, BAND_RAYS // w)
        in_threads(lambda y: needs_more(kinds, depths, y, min(y + rows, h), again), range(0, h, rows))
        more = np.flatnonzero(again)
        step = max(1, BAND_RAYS // samples**2)
        in_threads(lambda k: cast(more[k : k + step], samples, False), range(0, len(more), step))
    return Render(
        radiance=radiance.reshape(h, w, 3),
        lamp_radiance=lamp_radiance.reshape(h, w, 3),
        depth_m=depths,
        target_fraction=fraction.reshape(h, w),
    )


def in_threads(work: Callable[[int], Any], items: Iterable[int]) -> None:
    """Do the work on as many threads as numba uses; Embree and the kernels release the interpreter's lock."""
    threads = numba.get_num_threads()
    if threads == 1:
        for item in items:
            work(item)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, items):
            pass
