"""Laws of the 3D scene."""

from __future__ import annotations

import dataclasses
import shutil
import socket
from pathlib import Path
from unittest.mock import MagicMock, patch

import numpy as np
import pytest
import trimesh
import yaml

from wakewise.core.geometry import matrix_from_quat
from wakewise.ui.reports.errors import ModelErrors, model_errors
from wakewise.ui.reports.scene3d import Q_UW, R_UW, decimated, scene_html, upright
from wakewise.ui.reports.trial import Trial, TrialMesh, read_trial
from wakewise.vision.texturing.textured import y_up_vertices


def test_the_scene_is_east_north_up() -> None:
    """North goes to y, east to x, the bed to zero height; the quaternion says the same; nothing is mirrored."""
    np.testing.assert_allclose(upright(np.array([1.0, 2.0, 1.2]), 1.5), [2.0, 1.0, 0.3])
    np.testing.assert_allclose(matrix_from_quat(Q_UW), R_UW, atol=1e-15)
    assert np.linalg.det(R_UW) > 0


def test_the_scene_is_one_page_and_keeps_standard_output_clean(
    made_up: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The greeting of viser does not reach the command line's answer."""
    html = scene_html(read_trial(made_up), None)
    assert html is not None
    assert html.lstrip().lower().startswith("<!doctype html")
    assert capfd.readouterr().out == ""


def layers(trial: Trial, errors: ModelErrors | None) -> tuple[dict[str, bool], MagicMock]:
    """Every layer that the scene is given, and whether it is in sight at first; and the server that got them."""
    with patch("wakewise.ui.reports.scene3d.viser.ViserServer") as made:
        scene_html(trial, errors)
    server = made.return_value
    calls = [call for call in server.scene.method_calls if call[0].startswith("add_") and call[1]]
    return {str(args[0]): bool(kwargs.get("visible", True)) for _, args, kwargs in calls}, server


def with_colours(made_up: Path, tmp_path: Path) -> Trial:
    """The made-up trial with a mesh.glb."""
    folder = tmp_path / "coloured"
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("*.html", "images"))
    trial = read_trial(folder)
    assert trial.model is not None
    mesh = trimesh.Trimesh(y_up_vertices(trial.model.vertices_m, trial.bed_z_m), trial.model.faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial())
    mesh.visual.vertex_attributes["color"] = np.tile(np.array([100, 50, 25, 255], np.uint8), (len(mesh.vertices), 1))
    (folder / "mesh.glb").write_bytes(trimesh.Scene({"model": mesh}).export(file_type="glb", include_normals=True))
    return trial


def test_the_scene_opens_on_the_model_in_colour_and_nothing_hides_it(made_up: Path, tmp_path: Path) -> None:
    """Of model, flight, photographs and vehicle only the model in colour is in sight; the others can be switched on."""
    trial = with_colours(made_up, tmp_path)
    seen, _ = layers(trial, model_errors(trial))
    assert {name for name, visible in seen.items() if visible and name.count("/") == 1} == {
        "/light", "/bed", "/model in colour",
    }  # fmt: skip
    off = {"/model by error", "/model points by error", "/true target", "/photographs", "/planned viewpoints", "/path"}
    assert off | {"/vehicle"} <= {name for name, visible in seen.items() if not visible}


def test_without_colours_the_next_best_surface_is_in_sight(made_up: Path) -> None:
    """The model by its error, else the true target; never two surfaces in one place."""
    trial = read_trial(made_up)
    surfaces = ("/model in colour", "/model by error", "/model points by error", "/model points", "/true target")
    for errors, shown in ((model_errors(trial), "/model by error"), (None, "/model points")):
        seen, _ = layers(trial, errors)
        assert [name for name in surfaces if seen.get(name)] == [shown]
    bare = dataclasses.replace(trial, cloud_m=None, model=None)
    seen, _ = layers(bare, None)
    assert [name for name in surfaces if seen.get(name)] == ["/true target"]


def test_the_model_fills_the_view(made_up: Path) -> None:
    """The camera looks at the target's middle, from so near that a ball round it touches the picture's edges."""
    trial = read_trial(made_up)
    assert trial.truth is not None
    _, server = layers(trial, None)
    corners = upright(trial.truth.vertices_m, trial.bed_z_m)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    at, eye = np.array(server.initial_camera.look_at), np.array(server.initial_camera.position)
    np.testing.assert_allclose(at, middle, atol=0.005)
    radius = 0.5 * np.linalg.norm(np.ptp(corners, axis=0))
    half = np.arcsin(radius / np.linalg.norm(eye - at))
    assert 0.9 < half / (0.5 * server.initial_camera.fov) < 1.1


def test_the_bed_has_the_tanks_size_whatever_the_target_is_scaled_to(made_up: Path, tmp_path: Path) -> None:
    """A target's own size_m is not the tank's: the grid is as wide as the tank is, east, and as long, north."""
    folder = tmp_path / "scaled"
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("*.html", "images"))
    tree = yaml.safe_load((folder / "scenario.yaml").read_text())
    trimesh.creation.icosphere(2, 0.1).export(tmp_path / "ball.ply")
    tree |= {"target": {"kind": str(tmp_path / "ball.ply"), "size_m": 0.25}, "tank": {"size_m": [7, 4, 1.7]}}
    (folder / "scenario.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    _, server = layers(read_trial(folder), None)
    grid = server.scene.add_grid.call_args.kwargs
    assert (grid["width"], grid["height"]) == (4.0, 7.0)


def test_no_port_is_opened_for_a_scene(made_up: Path) -> None:
    """Neither on the network nor on this machine: nothing is bound while the page is made."""
    bound: list[object] = []
    bind = socket.socket.bind

    def told(sock: socket.socket, address: object) -> None:
        bound.append(address)
        bind(sock, address)

    with patch("socket.socket.bind", told):
        assert scene_html(read_trial(made_up), None) is not None
    assert bound == []


def test_a_trial_without_places_has_no_scene(made_up: Path) -> None:
    """Nothing to show gives nothing, not an empty stage."""
    trial = read_trial(made_up)
    bare = dataclasses.replace(trial, steps=None, photographs=(), truth=None, planned=(), cloud_m=None)
    assert scene_html(bare, None) is None


def test_a_heavy_mesh_becomes_light_and_keeps_its_shape() -> None:
    """Fewer triangles than allowed, every vertex one of the old ones, hardly less volume; a light mesh is kept."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    heavy = TrialMesh(vertices_m=np.asarray(ball.vertices), faces=np.asarray(ball.faces, np.int64))
    light, chosen = decimated(heavy, max_faces=6000)
    assert 2000 < len(light.faces) <= 6000
    np.testing.assert_array_equal(light.vertices_m, heavy.vertices_m[chosen])
    volume = trimesh.Trimesh(light.vertices_m, light.faces, process=False).volume
    assert 0.95 * ball.volume < volume < 1.05 * ball.volume
    assert len(decimated(heavy)[0].faces) == len(heavy.faces)
