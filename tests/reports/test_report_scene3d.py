"""Laws of the 3D scene."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import trimesh

from wakewise.geometry import matrix_from_quat
from wakewise.reports.scene3d import Q_UW, R_UW, lightened, scene_html, upright
from wakewise.reports.trial import Surface, read_trial


def test_the_scene_is_east_north_up() -> None:
    """North goes to y, east to x, the bed to zero height; the quaternion says the same; nothing is mirrored."""
    np.testing.assert_allclose(upright(np.array([1.0, 2.0, 1.2]), 1.5), [2.0, 1.0, 0.3])
    np.testing.assert_allclose(matrix_from_quat(Q_UW), R_UW, atol=1e-15)
    assert np.linalg.det(R_UW) > 0


def test_the_scene_is_one_page_and_keeps_standard_output_clean(made_up: Path, capfd: object) -> None:
    """The greeting of viser does not reach the command line's answer."""
    html = scene_html(read_trial(made_up), None)
    assert html is not None
    assert html.lstrip().lower().startswith("<!doctype html")
    assert capfd.readouterr().out == ""  # type: ignore[attr-defined]


def test_a_trial_without_places_has_no_scene(made_up: Path) -> None:
    """Nothing to show gives nothing, not an empty stage."""
    trial = read_trial(made_up)
    bare = dataclasses.replace(trial, steps=None, photographs=(), truth=None, planned=(), cloud_m=None)
    assert scene_html(bare, None) is None


def test_a_heavy_mesh_becomes_light_and_keeps_its_shape() -> None:
    """Fewer triangles than allowed, every vertex one of the old ones, hardly less volume; a light mesh is kept."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    heavy = Surface(vertices_m=np.asarray(ball.vertices), faces=np.asarray(ball.faces, np.int64))
    light, chosen = lightened(heavy, max_faces=6000)
    assert 2000 < len(light.faces) <= 6000
    np.testing.assert_array_equal(light.vertices_m, heavy.vertices_m[chosen])
    volume = trimesh.Trimesh(light.vertices_m, light.faces, process=False).volume
    assert 0.95 * ball.volume < volume < 1.05 * ball.volume
    assert len(lightened(heavy)[0].faces) == len(heavy.faces)
