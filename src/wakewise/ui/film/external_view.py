"""The view from outside: the trial's own scene with the vehicle in it, its wash as streaks, silt, and all in water.

What does not move is rendered once by `wakewise.vision.imaging`. For each instant the vehicle is ray-cast into it with
its shadow on the bed, water and silt are laid over both, and the tracers of the wash are drawn on top as light, hidden
where something stands before them. The water of this view is the clearest ocean's, so that the far side shows; the silt
is the trial's own.

Where the film is watched from: far enough to see the whole flight, on the side where the target is covered least.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, look_at
from wakewise.core.interfaces import ScalarGrid
from wakewise.core.jit.njit import njit
from wakewise.ui.film.wash import LIFE_S, Tracers
from wakewise.ui.reports.vehicle.hull import Hull
from wakewise.vision.imaging import (
    Lights,
    PinholeCamera,
    Render,
    Scene,
    SiltOptics,
    attenuate,
    haze_between,
    render,
    water_optics,
)
from wakewise.vision.imaging.sensor import srgb_encode

WATER_TYPE = "IB"
FOV_RAD = math.radians(38.0)
FASTEST_M_S = 0.30
"""Speed at the upper end of the streaks' colours."""
SPEED_STOPS = (
    (0.0, (0.05, 0.24, 0.36)),
    (0.12, (0.10, 0.55, 0.72)),
    (0.35, (0.55, 0.92, 0.95)),
    (0.65, (1.0, 0.90, 0.62)),
    (1.0, (1.0, 0.46, 0.22)),
)
"""Colours of speeds from 0 to the fastest, as displayed."""
SEE_THROUGH = 0.55
"""How much of the vehicle's cover of the target is taken away, so that the target is never lost."""
_GAIN = 0.58
_SHADOW = 0.62
_SAMPLES = 3
_VEHICLE_SAMPLES = 2
_SKY = np.array(
    [
        [0.0, 0.0, -1.0],
        [0.45, 0.0, -0.9],
        [-0.45, 0.0, -0.9],
        [0.0, 0.45, -0.9],
        [0.0, -0.45, -0.9],
        [0.3, 0.3, -0.9],
        [-0.3, -0.3, -0.9],
        [0.3, -0.3, -0.9],
        [-0.3, 0.3, -0.9],
    ]
)

Image = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class ExternalView:
    """A fixed view of a trial; make it with `ExternalView.build`."""

    camera: PinholeCamera
    X_WC: Pose
    still: Render
    hull: Hull
    lights: Lights
    grains: SiltOptics
    embree: Any
    bed_points_W_m: Image
    balance_m: float

    @classmethod
    def build(
        cls, scene: Scene, camera: PinholeCamera, X_WC: Pose, hull: Hull, lights: Lights, grains: SiltOptics
    ) -> ExternalView:
        """Render what does not move; lamps are left out, since they go with the vehicle."""
        unlit = replace(lights, lamp=0.0)
        still = render(scene, camera, X_WC, unlit, _SAMPLES)
        embree = EmbreeScene()
        TriangleMesh(embree, hull.vertices_B_m.astype(np.float32), hull.faces.astype(np.int32))
        rows, columns = np.mgrid[1 : camera.height : 2, 1 : camera.width : 2]
        depth = still.depth_m[rows, columns]
        rays = camera.rays(np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float64))
        points = X_WC.apply(rays * np.minimum(depth, 100.0).reshape(-1, 1)).reshape(*depth.shape, 3)
        return cls(
            camera=camera, X_WC=X_WC, still=still, hull=hull, lights=unlit, grains=grains, embree=embree,
            bed_points_W_m=points.astype(np.float32), balance_m=float(np.linalg.norm(X_WC.p_m - scene.foot_W_m)),
        )  # fmt: skip

    def picture(self, X_WB: Pose, silt: ScalarGrid | None, tracers: Tracers | None) -> tuple[NDArray[np.uint8], Image]:
        """RGB picture, shape (h, w, 3), and depth in m, shape (h, w), with the vehicle at a pose."""
        view = self._with_vehicle(X_WB)
        water = water_optics(WATER_TYPE)
        haze = haze_between(self.camera, self.X_WC, water, self.grains, silt, self.lights, reach_m=6.0)
        radiance, _ = attenuate(view, self.camera, haze, water, self.lights.from_above, self.grains)
        shown = _display(radiance * self._balance)
        if tracers is not None and len(tracers.age_s):
            glow = self._streaks(tracers, view.depth_m)
            # Light on light: screen, so that nothing burns out.
            shown = 1.0 - (1.0 - shown) * np.exp(-glow)
        return np.round(255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8), view.depth_m

    @property
    def _balance(self) -> Image:
        """Gains that give most of the colour back which the water takes on the way to the target."""
        lost: Array = np.exp(0.8 * self.balance_m * water_optics(WATER_TYPE).signal_per_m)
        return lost.astype(np.float32)

    def project(self, points_W_m: Array) -> tuple[Array, Array]:
        """Pixels, shape (n, 2), NaN behind the camera, and depths in m, shape (n,), of points of the world."""
        points_C = self.X_WC.inverse().apply(points_W_m)
        return self.camera.project(points_C), points_C[:, 2]

    def _with_vehicle(self, X_WB: Pose) -> Render:
        """The still scene with the vehicle and its shadow."""
        radiance = self.still.radiance * self._shadow(X_WB)[..., None]
        depth = self.still.depth_m.copy()
        box = self._box(X_WB)
        if box is not None:
            colour, cover, near = self._cast(X_WB, box)
            x0, y0, x1, y1 = box
            part = np.s_[y0:y1, x0:x1]
            alpha = cover * (1.0 - SEE_THROUGH * self.still.target_fraction[part])
            radiance[part] = (
                radiance[part] * (1.0 - alpha[..., None]) + colour * (alpha / np.maximum(cover, 1e-6))[..., None]
            )
            depth[part] = np.where(cover > 0.5, near, depth[part])
        zero = np.zeros_like(radiance)
        return Render(radiance=radiance, lamp_radiance=zero, depth_m=depth, target_fraction=self.still.target_fraction)

    def _box(self, X_WB: Pose) -> tuple[int, int, int, int] | None:
        """Rectangle of pixels that holds the vehicle: left, top, right, bottom."""
        low, high = self.hull.vertices_B_m.min(axis=0), self.hull.vertices_B_m.max(axis=0)
        corners = np.array(
            [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        )
        pixels, _ = self.project(X_WB.apply(corners))
        if not np.isfinite(pixels).all():
            return None
        x0, y0 = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 1, 0)
        x1 = min(int(np.ceil(pixels[:, 0].max())) + 1, self.camera.width)
        y1 = min(int(np.ceil(pixels[:, 1].max())) + 1, self.camera.height)
        return None if x1 <= x0 or y1 <= y0 else (int(x0), int(y0), x1, y1)

    def _cast(self, X_WB: Pose, box: tuple[int, int, int, int]) -> tuple[Image, Image, Image]:
        """Colour times cover, cover, and depth of the vehicle over a rectangle, where nothing stands before it."""
        x0, y0, x1, y1 = box
        n = _VEHICLE_SAMPLES
        xs = x0 + (np.arange((x1 - x0) * n) + 0.5) / n
        ys = y0 + (np.arange((y1 - y0) * n) + 0.5) / n
        grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        X_BC = X_WB.inverse() @ self.X_WC
        ways = self.camera.rays(grid) @ X_BC.R.T
        starts = np.broadcast_to(X_BC.p_m.astype(np.float32), ways.shape)
        hit = self.embree.run(np.ascontiguousarray(starts), ways.astype(np.float32), output=True)
        face, far = np.asarray(hit["primID"]), np.asarray(hit["tfar"], np.float64)
        behind = np.repeat(np.repeat(self.still.depth_m[y0:y1, x0:x1], n, axis=0), n, axis=1).ravel()
        seen = np.flatnonzero((face >= 0) & (far < behind))
        colour = np.zeros((len(grid), 3), np.float32)
        if len(seen):
            f = face[seen]
            weights = np.stack([1.0 - hit["u"][seen] - hit["v"][seen], hit["u"][seen], hit["v"][seen]], axis=1)
            normals = np.einsum("nk,nkd->nd", weights, self.hull.normals[f])
            way = ways[seen]
            normals *= -np.sign(np.sum(normals * way, axis=1, keepdims=True) + 1e-12)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
            place = X_BC.p_m + far[seen, None] * way
            colour[seen] = self.hull.colours[f] * self._light(place, normals, X_WB)[:, None]
        shape = (y1 - y0, n, x1 - x0, n)
        cover = np.zeros(len(grid), np.float32)
        cover[seen] = 1.0
        depth = np.where(cover > 0, far, np.inf).reshape(shape).min(axis=(1, 3))
        mean_colour = colour.reshape(*shape, 3).mean(axis=(1, 3))
        return mean_colour, cover.reshape(shape).mean(axis=(1, 3)), depth.astype(np.float32)

    def _light(self, points_B_m: Array, normals_B: Array, X_WB: Pose) -> Array:
        """Light on the vehicle, shape (n,): sky above, bed below, a soft key light from the upper left of the view."""
        up_B, key_B = X_WB.R.T @ np.array([0.0, 0.0, -1.0]), X_WB.R.T @ (self.X_WC.R @ np.array([-0.55, -0.75, -0.35]))
        up = normals_B @ up_B
        start = (points_B_m + 2e-3 * normals_B).astype(np.float32)
        lit = np.ones(len(start))
        for sky in _SKY[:5] @ X_WB.R:
            way = np.ascontiguousarray(np.broadcast_to(sky.astype(np.float32), start.shape))
            lit -= (np.asarray(self.embree.run(start, way, query="OCCLUDED")) >= 0) / 5.0
        sky_light = (0.25 + 0.75 * lit) * (0.5 + 0.5 * up)
        key = np.clip(normals_B @ (key_B / np.linalg.norm(key_B)), 0.0, 1.0)
        return np.asarray(
            self.lights.from_above
            * (0.10 + 0.75 * sky_light + 0.38 * key * (0.3 + 0.7 * lit) + 0.16 * np.clip(-up, 0, 1))
        )

    def _shadow(self, X_WB: Pose) -> Image:
        """What share of the light the vehicle leaves to each pixel, shape (h, w)."""
        h, w = self.bed_points_W_m.shape[:2]
        points = self.bed_points_W_m.reshape(-1, 3)
        reach = float(np.linalg.norm(self.hull.vertices_B_m, axis=1).max())
        # The slanting part of the sky's light throws the shadow as far as half the height above the bed.
        drop = np.maximum(points[:, 2] - X_WB.p_m[2], 0.0)
        near = np.flatnonzero(np.hypot(points[:, 0] - X_WB.p_m[0], points[:, 1] - X_WB.p_m[1]) < reach + 0.55 * drop)
        left = np.ones(h * w, np.float32)
        if len(near):
            start = ((points[near] - X_WB.p_m) @ X_WB.R).astype(np.float32)
            dark = np.zeros(len(near), np.float32)
            for sky in _SKY @ X_WB.R:
                way = np.ascontiguousarray(np.broadcast_to(sky.astype(np.float32), start.shape))
                dark += np.asarray(self.embree.run(start, way, query="OCCLUDED")) >= 0
            left[near] = 1.0 - _SHADOW * dark / len(_SKY)
        soft = cv2.GaussianBlur(left.reshape(h, w), (0, 0), 2.5)
        return np.asarray(cv2.resize(soft, (self.camera.width, self.camera.height), interpolation=cv2.INTER_LINEAR))

    def _streaks(self, tracers: Tracers, depth_m: Image) -> Image:
        """Light of the tracers, shape (h, w, 3)."""
        n, places, _ = tracers.trail_W_m.shape
        pixels, away = self.project(tracers.trail_W_m.reshape(-1, 3))
        pace = np.clip(tracers.speed_m_s / FASTEST_M_S, 0.0, 1.0)
        strength = np.clip(tracers.age_s / 0.15, 0.0, 1.0) * (1.0 - tracers.age_s / LIFE_S) * (0.10 + 0.9 * pace**0.6)
        glow: Image = np.zeros((self.camera.height, self.camera.width, 3), np.float32)
        _draw(
            glow, pixels.reshape(n, places, 2), away.reshape(n, places), strength, speed_colours(tracers.speed_m_s),
            depth_m,
        )  # fmt: skip
        return np.asarray(1.2 * glow + 1.3 * cv2.GaussianBlur(glow, (0, 0), 2.2), np.float32)


def speed_colours(speed_m_s: Array) -> Array:
    """Colours from 0 to 1, shape (n, 3), of speeds, shape (n,)."""
    pace = np.clip(np.asarray(speed_m_s, np.float64) / FASTEST_M_S, 0.0, 1.0)
    stops = np.array([stop for stop, _ in SPEED_STOPS])
    colours = np.array([colour for _, colour in SPEED_STOPS])
    return np.stack([np.interp(pace, stops, colours[:, k]) for k in range(3)], axis=1)


def _display(radiance: Image) -> Image:
    """Displayed values from 0 to 1 of linear radiance: a film's soft shoulder, then sRGB."""
    x = _GAIN * np.maximum(radiance, 0.0)
    return srgb_encode((x * (1.0 + x / 6.25) / (1.0 + 0.72 * x)).astype(np.float64)).astype(np.float32)


@njit
def _draw(glow: Any, pixels: Any, away_m: Any, strength: Any, colours: Any, depth_m: Any) -> None:
    """Add every trail as dots half a pixel apart, fainter toward its end, where nothing stands before it."""
    h, w, _ = glow.shape
    n, places, _ = pixels.shape
    for i in range(n):
        if strength[i] <= 0.0:
            continue
        for k in range(places - 1):
            ax, ay, bx, by = pixels[i, k, 0], pixels[i, k, 1], pixels[i, k + 1, 0], pixels[i, k + 1, 1]
            # Comparisons with NaN, which is what is behind the camera, are false.
            if not (abs(ax) < 1e5 and abs(bx) < 1e5 and abs(ay) < 1e5 and abs(by) < 1e5):
                continue
            length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
            dots = max(1, int(length * 2.0))
            for m in range(dots):
                t = (m + 0.5) / dots
                x, y = ax + t * (bx - ax) - 0.5, ay + t * (by - ay) - 0.5
                c, r = math.floor(x), math.floor(y)
                if c < 0 or r < 0 or c >= w - 1 or r >= h - 1:
                    continue
                if away_m[i, k] + t * (away_m[i, k + 1] - away_m[i, k]) > depth_m[r, c] + 0.01:
                    continue
                fade = 1.0 - (k + t) / (places - 1)
                light = strength[i] * fade * (min(length, 1.0) / max(1.0, dots * 0.5))
                u, v = x - c, y - r
                for dr in range(2):
                    for dc in range(2):
                        weight = light * (u if dc else 1.0 - u) * (v if dr else 1.0 - v)
                        for band in range(3):
                            glow[r + dr, c + dc, band] += weight * colours[i, band]


# Camera axes (x right, y down, z ahead) in a body that looks along its x axis.
_R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ELEVATION_RAD = float(np.radians(27.0))
_AZIMUTHS = 36
_MARGIN = 0.05


def choose_viewpoint(camera: PinholeCamera, centre_W_m: Array, path_W_m: Array, hull_radius_m: float) -> Pose:
    """Camera pose X_WC that shows a target at `centre_W_m`, shape (3,), and a path, shape (n, 3), with a hull on it."""
    low, high = path_W_m.min(axis=0), path_W_m.max(axis=0)
    focus = np.array([*centre_W_m[:2], 0.5 * (0.5 * (low[2] + high[2]) + centre_W_m[2])])
    corners = np.array(
        [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -0.6], [0, 0, 0.6]]
    )
    thin = path_W_m[:: max(1, len(path_W_m) // 150)]
    needed = np.concatenate([(thin[:, None] + hull_radius_m * corners).reshape(-1, 3), centre_W_m[None]])
    best: tuple[float, Pose] | None = None
    for azimuth in 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS:
        away = np.array(
            [np.cos(ELEVATION_RAD) * np.cos(azimuth), np.cos(ELEVATION_RAD) * np.sin(azimuth), -np.sin(ELEVATION_RAD)]
        )
        distance = _distance(camera, focus, away, needed)
        pose = _pose(focus, away, distance)
        # How long the hull stands in the line of sight, and nearness, which is size in the picture.
        line = pose.p_m - centre_W_m
        along = np.clip((thin - centre_W_m) @ line / (line @ line), 0.0, 1.0)
        gap = np.linalg.norm(thin - centre_W_m - along[:, None] * line, axis=1)
        cost = float(np.mean(gap < 0.6 * hull_radius_m)) + 0.3 * distance
        if best is None or cost < best[0] - 1e-9:
            best = (cost, pose)
    assert best is not None
    return best[1]


def _distance(camera: PinholeCamera, focus: Array, away: Array, needed: Array) -> float:
    """Least distance from the focus at which all points are in the picture."""
    near, far = 0.3, 40.0
    for _ in range(30):
        middle = 0.5 * (near + far)
        pixels = camera.project(_pose(focus, away, middle).inverse().apply(needed))
        edge = _MARGIN * np.array([camera.width, camera.height])
        size = np.array([camera.width, camera.height])
        inside = np.isfinite(pixels).all() and bool(np.all((pixels > edge) & (pixels < size - edge)))
        near, far = (near, middle) if inside else (middle, far)
    return far


def _pose(focus: Array, away: Array, distance_m: float) -> Pose:
    eye = focus + distance_m * away
    return Pose.from_matrix(look_at(eye, focus) @ _R_BODY_CAMERA, eye)
