"""Sight: what a photograph shows well, held against slow twins and against rays."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions import SurfacePatches, VisibilityCriteria, patches_of
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.visibility import BEST, WINDOW_SPACINGS, _nearest, view_quality, well_visible
from wakewise.scene.targets import Mesh, coral, place_on_bed
from wakewise.vision.evaluation import SurfaceSamples, count_views
from wakewise.vision.imaging import PinholeCamera

CAMERA = PinholeCamera(1280, 960, math.radians(80.0))
CORAL = place_on_bed("branching", coral("branching"), 1.5)
PATCHES = patches_of(CORAL.mesh, CORAL.bed_z_m)
NEED = VisibilityCriteria()


def at(azimuth_deg: float, elevation_deg: float, range_m: float = 0.5) -> Pose:
    return camera_pose(CORAL.centre_W_m, math.radians(azimuth_deg), math.radians(elevation_deg), range_m)


def plate(z_m: float, half_m: float, facing: float = 1.0) -> trimesh.Trimesh:
    """A thin square at a depth before a camera that looks along z; nine by nine squares, seen from smaller z."""
    grid = np.linspace(-half_m, half_m, 10)
    x, y = (g.ravel() for g in np.meshgrid(grid, grid))
    corner = np.arange(81) + np.arange(81) // 9
    a, b, c, d = corner, corner + 1, corner + 10, corner + 11
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    mesh = trimesh.Trimesh(np.stack([x, y, np.full(100, z_m)], 1), faces, process=False)
    if facing * mesh.face_normals[0, 2] > 0:
        mesh.invert()
    return mesh


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(0, 20), (100, 40), (250, 60)])
def test_rays_see_the_same(azimuth_deg: float, elevation_deg: float) -> None:
    """On a branching coral the raster and embreex's rays differ on fewer than one sample in a hundred."""
    X_WC = at(azimuth_deg, elevation_deg)
    surface = SurfaceSamples(points_m=PATCHES.points_W_m, normals=PATCHES.normals)
    rays = count_views(surface, CORAL.mesh, X_WC.p_m[None], min_cosine=math.cos(NEED.incidence_rad)) > 0
    shown = well_visible(PATCHES, X_WC, CAMERA, NEED)
    assert (shown != rays).mean() < 0.01
    assert rays.sum() > 500


def test_nothing_that_faces_away_is_shown() -> None:
    """Whatever is shown faces the camera by the incidence that is asked for."""
    X_WC = at(30, 30)
    way = X_WC.p_m - PATCHES.points_W_m
    cosine = np.einsum("ij,ij->i", way, PATCHES.normals) / np.linalg.norm(way, axis=1)
    assert cosine[well_visible(PATCHES, X_WC, CAMERA, NEED)].min() >= math.cos(NEED.incidence_rad)


def test_what_stands_behind_something_is_not_shown() -> None:
    """Of a wall behind a smaller plate just what the plate leaves free is shown; the plate alone hides nothing."""
    wall, screen = plate(0.6, 0.1), plate(0.4, 0.04)
    both = trimesh.util.concatenate([wall, screen])
    patches = patches_of(Mesh(both.vertices, both.faces), None, 300, 10)
    shown = well_visible(patches, Pose(np.zeros(3)), CAMERA, NEED)
    back = patches.points_W_m[:, 2] > 0.5
    # The plate's edge, seen from the camera, falls on the wall at 4 cm times 0.6 / 0.4.
    edge = np.abs(patches.points_W_m[:, :2]).max(axis=1) - 0.06
    assert shown[~back].all()
    assert not shown[back & (edge < -0.003)].any()
    assert shown[back & (edge > 0.003)].all()


def test_only_what_is_in_the_picture_is_shown() -> None:
    """Of a wall wider than the picture what projects into it is shown, but for the margin."""
    wall = plate(0.5, 0.8)
    patches = patches_of(Mesh(wall.vertices, wall.faces), None, 300, 10)
    need = replace(NEED, margin=0.05, incidence_rad=math.radians(80.0))
    shown = well_visible(patches, Pose(np.zeros(3)), CAMERA, need)
    pixels = CAMERA.project(patches.points_W_m)
    inside = ((pixels >= 64) & (pixels <= np.array([1280, 960]) - 64)).all(axis=1)
    assert (shown == inside).all()
    assert 0.1 < inside.mean() < 0.9


def test_size_does_not_matter_when_the_pixel_grows_with_it() -> None:
    """Target, way and footprint all twice as large: the same samples are shown, and equally well."""
    larger = SurfacePatches(
        points_W_m=2 * PATCHES.points_W_m,
        normals=PATCHES.normals,
        patch=PATCHES.patch,
        area_m2=4 * PATCHES.area_m2,
        shield_W_m=2 * PATCHES.shield_W_m,
        shield_off_m=2 * PATCHES.shield_off_m,
    )
    X_WC = at(75, 35)
    quality = view_quality(larger, Pose(2 * X_WC.p_m, X_WC.q), CAMERA, replace(NEED, pixel_m=2 * NEED.pixel_m))
    own = view_quality(PATCHES, X_WC, CAMERA, NEED)
    assert ((quality > 0) != (own > 0)).sum() <= 1
    assert (np.abs(quality - own.astype(int)) > 1).sum() <= 10
    assert quality.max() > 0.9 * BEST


def test_quality_is_the_cosine_times_the_share_of_the_surroundings_that_is_shown() -> None:
    """A slow twin gives the same for all samples; what is not shown has none, and without support all have the best."""
    X_WC, points = at(200, 30), PATCHES.points_W_m
    shown = well_visible(PATCHES, X_WC, CAMERA, NEED)
    away = np.linalg.norm(points[:, None] - points[None, ::8], axis=2)
    ways = X_WC.p_m - points[::8]
    cosines = np.einsum("ni,ni->n", ways, PATCHES.normals[::8]) / np.linalg.norm(ways, axis=1)
    reach_m = WINDOW_SPACINGS * math.sqrt(PATCHES.area_m2 / len(points))
    about = np.array([shown[near < reach_m].mean() for near in away.T])
    slow = np.where(shown[::8], np.maximum(np.rint(BEST * cosines * about), 1.0), 0.0)
    quality = view_quality(PATCHES, X_WC, CAMERA, NEED)
    assert np.abs(quality[::8] - slow).max() <= 1.0
    assert (slow > 0.0).sum() > 100
    assert np.array_equal(view_quality(PATCHES, X_WC, CAMERA, replace(NEED, support=0.0)), np.where(shown, BEST, 0))


def test_nothing_is_shown_behind_the_camera_or_from_within() -> None:
    """A camera that looks away shows nothing; nor does one from which pixels are too large."""
    X_WC = at(0, 20)
    away = Pose.from_matrix(X_WC.R @ np.diag([-1.0, 1.0, -1.0]), X_WC.p_m)
    assert not well_visible(PATCHES, away, CAMERA, NEED).any()
    assert not well_visible(PATCHES, at(0, 20, 1.8), CAMERA, NEED).any()


def slow_nearest(shield: np.ndarray, f: float, left: float, top: float, step: float, grid: int) -> np.ndarray:
    """The readable twin: for every cell and triangle, whether the cell's ray goes through, and how deep."""
    near = np.zeros((grid, grid))
    for row in range(grid):
        for column in range(grid):
            ray = np.array([(left + column * step) / f, (top + row * step) / f, 1.0])
            for a, b, c in shield:
                try:
                    one, two, depth = np.linalg.solve(np.stack([a - c, b - c, -ray], axis=1), -c)
                except np.linalg.LinAlgError:
                    continue
                if one >= 0 and two >= 0 and one + two <= 1 and depth > 0:
                    near[row, column] = max(near[row, column], 1.0 / depth)
    return near


def test_the_depth_picture_is_that_of_rays_through_triangles() -> None:
    """The raster gives, to rounding, what solving for each ray and triangle gives."""
    rng = np.random.default_rng(4)
    shield = rng.uniform([-0.2, -0.2, 0.5], [0.2, 0.2, 1.0], (15, 3, 3))
    fast = _nearest(shield, np.zeros(3), np.eye(3), 500.0, 0.01, -150.0, -150.0, 300.0 / 13, 14)
    slow = slow_nearest(shield, 500.0, -150.0, -150.0, 300.0 / 13, 14)
    assert (slow > 0).sum() > 20
    assert fast == pytest.approx(slow, rel=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"incidence_rad": 2.0},
        {"pixel_m": 0.0},
        {"apart_rad": (0.5, 0.1)},
        {"apart_rad": (0.0, 0.1)},
        {"support": -1.0},
        {"support": math.nan},
    ],
)
def test_needs_that_cannot_be_are_refused(wrong: dict[str, Any]) -> None:
    """An incidence beyond a right angle, a pixel of no size, angles that do not rise, no number or less than none."""
    with pytest.raises(InputError, match="allowed"):
        VisibilityCriteria(**wrong)
