"""Pictures of a coloured surface or cloud from the side, drawn into plain pixels; works on paper and without a GPU."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import cv2
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from wakewise.core.arrays import Array, BoolArray
from wakewise.ui.reports.svg_style import NOT_COUNTED, NOT_COVERED, data_uri, error_colours, rgb
from wakewise.ui.reports.trial import TrialMesh

SAMPLES_PER_PIXEL = 4
# Light over the viewer's left shoulder: right, up, toward the viewer.
_LIGHT = np.array([-0.45, 0.65, 0.62])


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """Where the viewer stands: `azimuth_deg` from north over east, `elevation_deg` above the horizon."""

    name: str
    azimuth_deg: float
    elevation_deg: float

    @property
    def axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors in the world (NED): right, up, toward the viewer, shape (3,) each."""
        a, e = np.radians(self.azimuth_deg), np.radians(self.elevation_deg)
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        return right, np.cross(toward, right), toward


SIDES = (
    Viewpoint(name="from the north", azimuth_deg=0, elevation_deg=20),
    Viewpoint(name="from the east", azimuth_deg=90, elevation_deg=20),
    Viewpoint(name="from the south", azimuth_deg=180, elevation_deg=20),
    Viewpoint(name="from the west", azimuth_deg=270, elevation_deg=20),
    Viewpoint(name="from above", azimuth_deg=180, elevation_deg=89.9),
)
OUTLOOK = Viewpoint(name="from the south-east", azimuth_deg=138, elevation_deg=23)
"""From where the 3D scene is seen at first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewBounds:
    """What all views show, so that they can be laid side by side: `centre_m` in the middle, `radius_m` to the edge."""

    centre_m: Array
    radius_m: float

    @classmethod
    def around(cls, points_m: Array) -> ViewBounds:
        """Frame that holds points, shape (n, 3), from every side."""
        centre = 0.5 * (points_m.min(axis=0) + points_m.max(axis=0))
        return cls(centre_m=centre, radius_m=1.04 * float(np.linalg.norm(points_m - centre, axis=1).max()))


def coverage_colours(coverage_m: Array, counts: BoolArray) -> Array:
    """Colours of the true surface by distance to the model: blue where it is far, grey where nothing counts."""
    colours = error_colours(coverage_m, beyond=NOT_COVERED)
    colours[~counts] = rgb(NOT_COUNTED)
    return colours


class Drawing:
    """A mesh that is drawn from many sides, in one or more colourings."""

    def __init__(self, surface: TrialMesh) -> None:
        self._faces, self._normals = surface.faces, _vertex_normals(surface)
        self._scene = rtcore_scene.EmbreeScene()
        TriangleMesh(self._scene, surface.vertices_m.astype(np.float32), surface.faces.astype(np.int32))

    def pictures(self, colours: Array, views: tuple[Viewpoint, ...], frame: ViewBounds, pixels: int) -> list[str]:
        """PNG data URIs of the mesh, lit, with a colour per vertex, shape (n, 3); orthographic, clear background."""
        side = pixels * int(np.sqrt(SAMPLES_PER_PIXEL))
        step = (np.arange(side) + 0.5) / side * 2.0 - 1.0
        across, along = (grid.reshape(-1, 1) for grid in np.meshgrid(step, -step))
        pictures = []
        for right, up, toward in (view.axes for view in views):
            start = frame.centre_m + frame.radius_m * (across * right + along * up + 2.0 * toward)
            rays = np.repeat(-toward[None].astype(np.float32), len(start), axis=0)
            hit = self._scene.run(start.astype(np.float32), rays, output=True)
            seen = np.flatnonzero(np.asarray(hit["primID"]) >= 0)
            face, u, v = (np.asarray(hit[name])[seen] for name in ("primID", "u", "v"))
            weights = np.stack([1.0 - u - v, u, v], axis=1)
            corners = self._faces[face]
            normals = np.einsum("nk,nkd->nd", weights, self._normals[corners])
            image = np.zeros((side * side, 4))
            image[seen, :3] = np.einsum("nk,nkd->nd", weights, colours[corners]) * _shade(normals, right, up, toward)
            image[seen, 3] = 1.0
            pictures.append(_png(image.reshape(side, side, 4), pixels))
        return pictures


def draw_surface(
    surface: TrialMesh, colours: Array, views: tuple[Viewpoint, ...], frame: ViewBounds, pixels: int
) -> list[str]:
    """PNG data URIs of a lit mesh with a colour per vertex, shape (n, 3); orthographic, clear background."""
    return Drawing(surface).pictures(colours, views, frame, pixels)


def draw_cloud(
    points_m: Array, colours: Array, views: tuple[Viewpoint, ...], frame: ViewBounds, pixels: int
) -> list[str]:
    """PNG data URIs of a cloud with a colour per point, shape (n, 3): nearest dot on top; orthographic."""
    side = pixels * int(np.sqrt(SAMPLES_PER_PIXEL))
    offset = (points_m - frame.centre_m) / frame.radius_m
    dot = [(i, j) for i in range(-2, 3) for j in range(-2, 3)]
    pictures = []
    for right, up, toward in (view.axes for view in views):
        order = np.argsort(offset @ toward)
        column = ((offset[order] @ right + 1.0) * 0.5 * side).astype(int)
        row = ((1.0 - offset[order] @ up) * 0.5 * side).astype(int)
        # No normals to light: what is farther from the viewer is darker instead.
        depth = np.clip(0.8 + 0.25 * (offset[order] @ toward), 0.5, 1.0)
        paint = np.concatenate([colours[order] * depth[:, None], np.ones((len(order), 1))], axis=1)
        rows = np.stack([row + i for i, _ in dot], axis=1).reshape(-1)
        columns = np.stack([column + j for _, j in dot], axis=1).reshape(-1)
        inside = (rows >= 0) & (rows < side) & (columns >= 0) & (columns < side)
        image = np.zeros((side, side, 4))
        image[rows[inside], columns[inside]] = np.repeat(paint, len(dot), axis=0)[inside]
        pictures.append(_png(image, pixels))
    return pictures


def _vertex_normals(surface: TrialMesh) -> Array:
    corners = surface.vertices_m[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack(
        [np.bincount(surface.faces.ravel(), np.repeat(normal[:, k], 3), len(surface.vertices_m)) for k in range(3)],
        axis=1,
    )
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def _shade(normals: Array, right: Array, up: Array, toward: Array) -> Array:
    """Brightness, shape (n, 1): soft light from the upper left; a surface is lit on whichever side is seen."""
    facing = np.where((normals @ toward)[:, None] < 0, -normals, normals)
    light = _LIGHT / np.linalg.norm(_LIGHT)
    lambert = np.clip(facing @ np.stack([right, up, toward], axis=1) @ light, 0.0, 1.0)
    return (0.5 + 0.5 * lambert)[:, None]


def _png(image: Array, pixels: int) -> str:
    """Average the samples of every pixel and encode; colours are weighted by how much of the pixel they fill."""
    n = image.shape[0] // pixels
    mean = image.reshape(pixels, n, pixels, n, 4).mean(axis=(1, 3))
    alpha = mean[..., 3:]
    colour = np.divide(mean[..., :3], alpha, out=np.zeros_like(mean[..., :3]), where=alpha > 0)
    bytes_ = np.round(255 * np.concatenate([colour[..., ::-1], alpha], axis=2)).astype(np.uint8)
    return data_uri(cv2.imencode(".png", bytes_, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes(), "image/png")


def png_pixels(source: str) -> Array:
    """RGBA pixels, shape (h, w, 4), from 0 to 1, of a PNG data URI."""
    content = np.frombuffer(base64.b64decode(source.partition(",")[2]), np.uint8)
    return np.asarray(cv2.cvtColor(cv2.imdecode(content, cv2.IMREAD_UNCHANGED), cv2.COLOR_BGRA2RGBA) / 255.0)
