"""A model from photographs in 3D: surface or points, and the cameras with their pictures, as one HTML page."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import cv2
import numpy as np
import trimesh
import viser

from wakewise.core.arrays import Array
from wakewise.core.geometry import quat_from_matrix
from wakewise.ui.reports.scene3d import CAMERA_RGB, MAX_POINTS, decimated, without_server
from wakewise.ui.reports.trial import TrialMesh
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction import read_cloud
from wakewise.vision.reconstruction.photo_facts import ModelStatistics, PhotoStatistics
from wakewise.vision.texturing.textured import read_textured

FOV_RAD = float(np.radians(40.0))
FRUSTUM_SHARE = 0.12
"""Size of a camera's pyramid over the median distance from camera to subject."""
_THUMB_PX, _MOST_PICTURES = 128, 120


def model_up(facts: ModelStatistics) -> Array:
    """Which way is up, a unit vector: the pictures' own where they agree on it, else against where cameras look."""
    turns = [photo.R_WC for photo in facts.photos if photo.R_WC is not None]
    if not turns:
        return np.array([0.0, 0.0, 1.0])
    upright, back = -np.mean([R[:, 1] for R in turns], axis=0), -np.mean([R[:, 2] for R in turns], axis=0)
    best = upright if np.linalg.norm(upright) > max(0.6, float(np.linalg.norm(back))) else back
    length = float(np.linalg.norm(best))
    return np.asarray(best / length, dtype=np.float64) if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def model_scene(model: Path, photos: Path, facts: ModelStatistics) -> str | None:
    """Whole HTML page with the scene of a model's folder; None if no photograph has a place."""
    placed = [photo for photo in facts.photos if photo.p_WC is not None]
    if not placed or not len(facts.points):
        return None
    eyes = np.array([photo.p_WC for photo in placed])
    middle = np.median(facts.points, axis=0)
    # viser greets on standard output, which belongs to the command line's own answer.
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with without_server():
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            up = model_up(facts)
            server.scene.set_up_direction(tuple(float(v) for v in up))
            server.scene.configure_environment_map(None)  # it would be fetched from the network
            server.scene.add_light_ambient("/light", intensity=1.3)
            seen = _subject(server, model, facts)
            distance = float(np.median(np.linalg.norm(eyes - middle, axis=1)))
            _cameras(server, photos, placed, FRUSTUM_SHARE * distance)
            _aim(server, seen, eyes, up)
            return str(server.get_scene_serializer().as_html())
        finally:
            server.stop()


def _subject(server: viser.ViserServer, model: Path, facts: ModelStatistics) -> Array:
    """Add surface, dense and sparse points; what is in sight at first, as points."""
    scene, seen = server.scene, facts.points
    surface = (model / "mesh.glb").is_file()
    if surface:
        vertices, faces, colours = read_textured(model / "mesh.glb")
        light, chosen = decimated(TrialMesh(vertices_m=vertices, faces=faces))
        mesh = trimesh.Trimesh(light.vertices_m, light.faces, process=False)
        mesh.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=0.9)
        )
        rgba = np.concatenate([colours[chosen], np.ones((len(chosen), 1))], axis=1)
        mesh.visual.vertex_attributes["color"] = np.round(255 * rgba).astype(np.uint8)
        scene.add_mesh_trimesh("/surface", mesh)
        seen = light.vertices_m
    dense = (model / "dense.ply").is_file()
    if dense:
        cloud = read_cloud(model / "dense.ply")
        step = max(1, -(-len(cloud.points_m) // MAX_POINTS))
        if not surface:
            seen = cloud.points_m
        _points(server, "/dense points", cloud.points_m[::step], cloud.colours[::step], not surface)
    _points(server, "/sparse points", facts.points, facts.colours, not surface and not dense)
    return np.asarray(seen, dtype=np.float64)


def _points(server: viser.ViserServer, name: str, points: Array, colours: Array, visible: bool) -> None:
    extent = float(np.linalg.norm(np.subtract(*np.quantile(points, (0.95, 0.05), axis=0))))
    server.scene.add_point_cloud(
        name,
        points=points.astype(np.float32),
        colors=np.round(255 * colours).astype(np.uint8),
        point_size=0.004 * extent,
        point_shape="circle",
        precision="float32",
        visible=visible,
    )


def _cameras(server: viser.ViserServer, photos: Path, placed: list[PhotoStatistics], size: float) -> None:
    every = max(1, -(-len(placed) // _MOST_PICTURES))
    for k, photo in enumerate(placed):
        if photo.R_WC is None or photo.p_WC is None:
            continue
        server.scene.add_camera_frustum(
            f"/photographs/{photo.name}", fov=float(np.radians(photo.fov_deg)), aspect=photo.aspect, scale=size,
            thickness=0.02 * size, color=CAMERA_RGB, image=_thumb(photos / photo.name) if k % every == 0 else None,
            format="jpeg", jpeg_quality=70, cast_shadow=False, receive_shadow=False,
            wxyz=quat_from_matrix(photo.R_WC), position=photo.p_WC,
        )  # fmt: skip


def _thumb(path: Path) -> Array | None:
    image = read_picture(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        return None
    height = max(1, round(_THUMB_PX * image.shape[0] / image.shape[1]))
    return np.ascontiguousarray(cv2.resize(image, (_THUMB_PX, height), interpolation=cv2.INTER_AREA)[..., ::-1])


def _aim(server: viser.ViserServer, seen: Array, eyes: Array, up: Array) -> None:
    """Open on the subject from where the cameras are, a little raised."""
    low, high = np.quantile(seen, (0.02, 0.98), axis=0)
    centre, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    way = eyes.mean(axis=0) - centre
    side = eyes[0] - centre
    way = way / max(float(np.linalg.norm(way)), 1e-9) + 0.35 * side / max(float(np.linalg.norm(side)), 1e-9)
    way = way / max(float(np.linalg.norm(way)), 1e-9)
    distance = 1.15 * reach / np.sin(0.5 * FOV_RAD)
    server.initial_camera.look_at = tuple(float(v) for v in centre)
    server.initial_camera.position = tuple(float(v) for v in centre + distance * way)
    server.initial_camera.up = tuple(float(v) for v in up)
    server.initial_camera.fov = FOV_RAD
    server.initial_camera.near = 0.005 * distance
