"""Photographs of things that exist in closed form, for `adversarial_photos`: a relief, a rock, and what is
done to pictures to deceive.

World z points down; cameras have x right, y down, z ahead. A photograph is computed pixel by pixel from where its ray
meets the surface, so the truth is known exactly.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import look_at
from wakewise.vision.reconstruction.photos.photo_folder import Image

R_BC = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Camera axes in those of a body that looks along x."""
WIDTH, HEIGHT, FOCAL_PX = 320, 240, 300.0
STEPS = 25
Surface = Callable[[Array, Array], tuple[Array, Array]]
"""From a camera centre, shape (3,), and rays, shape (..., 3), to grey values, 0 to 1, and distances in rays."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneCamera:
    """R_WC, shape (3, 3), p_WC_m, shape (3,), focal length in pixels of a photo of WIDTH x HEIGHT."""

    R_WC: Array
    p_WC_m: Array
    focal_px: float = FOCAL_PX

    def __post_init__(self) -> None:
        freeze(self, R_WC=(3, 3), p_WC_m=(3,))

    def rays_W(self) -> Array:
        """Direction of each pixel with unit depth, shape (HEIGHT, WIDTH, 3)."""
        u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
        rays = np.stack([(u - WIDTH / 2) / self.focal_px, (v - HEIGHT / 2) / self.focal_px, np.ones_like(u)], axis=-1)
        return np.asarray(rays @ self.R_WC.T)


def looking(eye_m: Array, at_m: Array, focal_px: float = FOCAL_PX) -> SceneCamera:
    """A camera at a place that looks at another."""
    return SceneCamera(R_WC=look_at(eye_m, at_m) @ R_BC, p_WC_m=np.asarray(eye_m, dtype=np.float64), focal_px=focal_px)


def over(n: int, focal_px: float = FOCAL_PX, step_deg: float = 12.0, range_m: float = 0.4) -> list[SceneCamera]:
    """Cameras on an arc, every second one to the side, that look down at the origin."""
    out = []
    for k in range(n):
        a, b = np.radians(step_deg * (k - (n - 1) / 2)), np.radians(20.0 if k % 2 else 8.0)
        way = np.array([-np.sin(a), -np.sin(b) * np.cos(a), np.cos(a) * np.cos(b)])
        out.append(looking(-range_m * way, np.zeros(3), focal_px))
    return out


def ring(n: int, height_deg: float = 25.0, range_m: float = 0.4, focal_px: float = FOCAL_PX) -> list[SceneCamera]:
    """Cameras on a circle about the origin, so high above it, looking at it."""
    up = np.radians(height_deg)
    turns = 2.0 * np.pi * np.arange(n) / n
    return [
        looking(
            range_m * np.array([np.cos(up) * np.cos(t), np.cos(up) * np.sin(t), -np.sin(up)]), np.zeros(3), focal_px
        )
        for t in turns
    ]


@cache
def _noise(seed: int, size: int, axes: int) -> Array:
    """Periodic grey noise with detail at many scales, 0 to 1, of so many axes."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size,) * axes, dtype=np.float32)
    for sigma in (0.9, 2.0, 5.0, 12.0):
        layer = gaussian_filter(rng.normal(size=total.shape).astype(np.float32), sigma, mode="wrap")
        total += layer / layer.std()
    total -= total.mean()
    return np.clip(0.5 + total / (6.0 * total.std()), 0.0, 1.0)


def relief(seed: int = 0, *, bumps_m: float = 0.012, cell_m: float = 0.0007, tile: int = 1024) -> Surface:
    """A wavy floor at z = 0; `tile` cells of texture repeat. No bumps make a plane."""

    def meet(centre: Array, rays: Array) -> tuple[Array, Array]:
        texture = _noise(seed, tile, 2)
        z = np.zeros(rays.shape[:-1])
        down = np.maximum(rays[..., 2], 1e-3)
        for _ in range(STEPS if bumps_m else 1):
            t = (z - centre[2]) / down
            x, y = centre[0] + t * rays[..., 0], centre[1] + t * rays[..., 1]
            z = bumps_m * np.sin(40.0 * x + seed) * np.cos(35.0 * y)
        t = (z - centre[2]) / down
        x, y = centre[0] + t * rays[..., 0], centre[1] + t * rays[..., 1]
        grey = map_coordinates(texture, [y / cell_m, x / cell_m], order=1, mode="grid-wrap")
        return np.where(rays[..., 2] > 1e-3, grey, 0.5), t

    return meet


ROCK_M = 0.1


def rock_radius(directions: Array, seed: int = 0) -> Array:
    """Distance of the rock's surface from the origin along unit directions, shape (..., 3), in m."""
    a, b = 1.0 + seed % 7, 2.0 + seed % 5
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.asarray(
        ROCK_M * (1.0 + 0.12 * np.sin(3.0 * x + a) * np.cos(4.0 * y + b) + 0.06 * np.sin(7.0 * z + 5.0 * x))
    )


def rock(seed: int = 0, cell_m: float = 0.0012) -> Surface:
    """A rock of about 0.2 m about the origin before nothing, textured throughout its volume."""

    def meet(centre: Array, rays: Array) -> tuple[Array, Array]:
        texture = _noise(seed, 192, 3)
        length = np.linalg.norm(rays, axis=-1)
        way = rays / length[..., None]
        nearest = -(way @ centre)
        gap2 = centre @ centre - nearest**2
        outer = 1.2 * ROCK_M
        near = gap2 < outer**2
        t = np.where(near, nearest - np.sqrt(np.maximum(outer**2 - gap2, 0.0)), 0.0)
        for _ in range(2 * STEPS):
            point = centre + t[..., None] * way
            away = np.linalg.norm(point, axis=-1)
            t = t + np.where(near, 0.6 * (away - rock_radius(point / away[..., None], seed)), 0.0)
            near &= t < nearest + outer
        point = centre + t[..., None] * way
        away = np.linalg.norm(point, axis=-1)
        hit = near & (np.abs(away - rock_radius(point / away[..., None], seed)) < 1e-4)
        where = np.moveaxis(point, -1, 0) / cell_m
        grey = map_coordinates(texture, where, order=1, mode="grid-wrap")
        return np.where(hit, 0.15 + 0.85 * grey, 0.02), np.where(hit, t / length, 0.0)

    return meet


def photograph(surface: Surface, camera: SceneCamera) -> Image:
    """Colours, all three alike, shape (HEIGHT, WIDTH, 3), with a little noise of the sensor."""
    grey, _ = surface(np.asarray(camera.p_WC_m), camera.rays_W())
    rng = np.random.default_rng(zlib.crc32(np.asarray(camera.p_WC_m).tobytes()))
    values = 255.0 * (0.08 + 0.84 * grey) + rng.normal(0.0, 1.0, grey.shape)
    return np.repeat(np.clip(values, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def blurred(image: Image, sigma_px: float) -> Image:
    """Out of focus."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=np.uint8)


def mirrored(image: Image) -> Image:
    """Left for right."""
    return np.ascontiguousarray(image[:, ::-1])
