"""The flight as a 3D scene in one HTML page: path, cameras, vehicle, target, bed and the model coloured by its error.

The page is viser's own client with the scene inside, so it needs no network. World is NED in the trial folder; the
scene is east, north, up with the bed at zero height.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import AsyncIterator, Iterator, Sequence
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import trimesh
import viser
import websockets.asyncio.server

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_multiply
from wakewise.robot.importers import any_vehicle
from wakewise.robot.vehicles import Vehicle
from wakewise.ui.reports.errors import ModelErrors
from wakewise.ui.reports.media import coloured_model, thumbnail
from wakewise.ui.reports.svg_style import error_colours
from wakewise.ui.reports.trial import Trial, TrialMesh
from wakewise.ui.reports.vehicle.hull import hull_of
from wakewise.ui.reports.views import OUTLOOK

# NED to ENU: swap x and y, turn z round; a half turn about the line between x and y.
R_UW = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
Q_UW = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])

PLAYBACK_S = 30.0
FRAMES = 240
MAX_FACES = 90_000
MAX_POINTS = 50_000
FRUSTUM_M = 0.03
FOV_RAD = float(np.radians(40.0))
FILL = 1.0
"""Where a ball round the target would touch the edges of the picture at 1; targets are rarely balls."""

PATH_RGB, CAMERA_RGB, PLANNED_RGB = (11, 114, 133), (217, 86, 43), (120, 135, 145)
HULL_RGB, TRUTH_RGB = (247, 200, 89), (196, 200, 198)


def upright(points_W_m: Array, bed_z_m: float) -> Array:
    """East, north and height above the bed in m, shape (..., 3), of world points (NED), same shape."""
    return np.asarray(points_W_m) @ R_UW.T + np.array([0.0, 0.0, bed_z_m])


def scene_html(trial: Trial, errors: ModelErrors | None) -> str | None:
    """Whole HTML page with the scene of a trial; None if there is nothing with a place to show."""
    path = trial.positions("true")
    path = path if np.isfinite(path).any() else trial.positions("est")
    if len(path) == 0 and not trial.photographs and trial.truth is None:
        return None
    with scene_server((0.0, 0.0, 1.0)) as server:
        _aim(server, trial)
        _bed(server, trial)
        _target(server, trial, errors)
        _cameras(server, trial)
        return _fly(server, trial, path)


@contextlib.contextmanager
def scene_server(up: Sequence[float]) -> Iterator[viser.ViserServer]:
    """A viser server without a port, with light and the direction that is up; silent, and stopped after the block."""
    # viser prints to standard output, which belongs to the output of the command.
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with without_server():
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            server.scene.set_up_direction((up[0], up[1], up[2]))
            server.scene.configure_environment_map(None)  # it would be fetched from the network
            server.scene.add_light_ambient("/light", intensity=1.3)
            yield server
        finally:
            server.stop()


def aim_camera(server: viser.ViserServer, centre: Array, position: Array, up: Sequence[float], near: float) -> None:
    """Set the view with which the scene opens: the point looked at, the camera's place, and what is nearest."""
    camera = server.initial_camera
    camera.look_at, camera.position, camera.up = tuple(centre.tolist()), tuple(position.tolist()), tuple(up)
    camera.fov, camera.near = FOV_RAD, near


def matt_mesh(
    vertices: Array, faces: IntArray, rgba: Array, roughness: float = 0.9, normals: Array | None = None
) -> trimesh.Trimesh:
    """A mesh with a colour per vertex, uint8, shape (n, 4).

    Without a material of its own, glTF takes a mesh for bare metal, which is black without an environment map.
    """
    mesh = trimesh.Trimesh(vertices, faces, vertex_normals=normals, process=False)
    material = trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=roughness)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    mesh.visual.vertex_attributes["color"] = rgba
    return mesh


def add_points(
    server: viser.ViserServer,
    name: str,
    points: Array,
    colours: Array | tuple[int, int, int],
    size: float,
    visible: bool,
    shape: Literal["circle", "diamond", "square"] = "circle",
    most: int = MAX_POINTS,
) -> None:
    """Add at most `most` of the points, shape (n, 3), in colours from 0 to 1, shape (n, 3), or in one RGB."""
    step = max(1, -(-len(points) // most))
    server.scene.add_point_cloud(
        name,
        points=points[::step].astype(np.float32),
        colors=colours if isinstance(colours, tuple) else as_bytes(colours[::step]),
        point_size=size,
        point_shape=shape,
        precision="float32",
        visible=visible,
    )


@contextlib.contextmanager
def without_server() -> Iterator[None]:
    """Keep viser's server from listening: nobody is to connect, and a report needs no port, not even a local one."""

    @contextlib.asynccontextmanager
    async def closed(*_: object, **__: object) -> AsyncIterator[SimpleNamespace]:
        yield SimpleNamespace(server=SimpleNamespace(sockets=()))

    library: Any = websockets.asyncio.server
    served = library.serve
    library.serve = closed
    try:
        yield
    finally:
        library.serve = served


def _aim(server: viser.ViserServer, trial: Trial) -> None:
    """Open on the target, which fills the view; without one on all that was flown."""
    seen = trial.truth if trial.truth is not None else trial.model
    if seen is not None:
        points = upright(seen.vertices_m[np.unique(seen.faces)], trial.bed_z_m)
    else:
        points = upright(np.array([shot.X_WC_true.p_m for shot in trial.photographs if shot.X_WC_true]), trial.bed_z_m)
    # Of a model with strays, nearly all.
    low, high = np.quantile(points, (0.002, 0.998), axis=0) if len(points) else (np.zeros(3), np.ones(3))
    centre, reach = 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 0.02)
    distance = FILL * reach / np.sin(0.5 * FOV_RAD)
    aim_camera(server, centre, centre + distance * (R_UW @ OUTLOOK.axes[2]), (0.0, 0.0, 1.0), near=0.005)


def _bed(server: viser.ViserServer, trial: Trial) -> None:
    # North runs up the scene, so the tank's length is the grid's height. The page's own ground, light or dark, shows.
    height, width = (3.0, 3.0) if trial.settings is None else trial.settings.tank.size_m[:2]
    server.scene.add_grid(
        "/bed", width=width, height=height, plane="xy", cell_size=0.1, section_size=0.5, cell_thickness=0.6,
        cell_color=(172, 168, 152), section_color=(150, 144, 126), plane_color=(200, 190, 160), plane_opacity=0.4,
        shadow_opacity=0.25, position=(0.0, 0.0, -0.002),
    )  # fmt: skip


def _target(server: viser.ViserServer, trial: Trial, errors: ModelErrors | None) -> None:
    """One surface is in sight at first: the model in colour, else by its error, else its points, else the truth."""
    scene = server.scene
    found = coloured_model(trial)
    if errors is not None and errors.model is not None and errors.model_accuracy_m is not None:
        model, chosen = decimated(errors.model)
        rgba = _linear(error_colours(errors.model_accuracy_m[chosen]))
        mesh = matt_mesh(upright(model.vertices_m, trial.bed_z_m), model.faces, rgba)
        scene.add_mesh_trimesh("/model by error", mesh, visible=found is None)
    if found is not None:
        whole, colours = found
        model, chosen = decimated(whole)
        mesh = matt_mesh(upright(model.vertices_m, trial.bed_z_m), model.faces, _linear(colours[chosen]))
        scene.add_mesh_trimesh("/model in colour", mesh)
    if errors is not None:
        points, shown = upright(errors.points_m, trial.bed_z_m), errors.model is None and found is None
        add_points(server, "/model points by error", points, error_colours(errors.accuracy_m), 0.0011, shown)
    elif trial.cloud_m is not None:
        points = upright(trial.cloud_m, trial.bed_z_m)
        add_points(server, "/model points", points, TRUTH_RGB, 0.0015, found is None, "square")
    if trial.truth is not None:
        truth, _ = decimated(trial.truth)
        scene.add_mesh_simple(
            "/true target",
            vertices=upright(truth.vertices_m, trial.bed_z_m).astype(np.float32),
            faces=truth.faces.astype(np.uint32),
            color=TRUTH_RGB,
            side="double",
            visible=found is None and errors is None and trial.cloud_m is None,
        )


def decimated(mesh: TrialMesh, max_faces: int = MAX_FACES) -> tuple[TrialMesh, IntArray]:
    """A mesh light enough for a page, and for each of its vertices the index of the one that it was.

    Vertices that share a cell of a grid become one; the cells grow until at most `max_faces` triangles are left.
    """
    keep, faces = np.unique(mesh.faces, return_inverse=True)
    keep, faces = keep.astype(np.int64), faces.reshape(-1, 3).astype(np.int64)
    offset = mesh.vertices_m[keep] - mesh.vertices_m[keep].min(axis=0)
    cell_m = float(offset.max()) / 400.0
    chosen, corners = keep, faces
    while len(corners) > max_faces:
        cells = np.floor(offset / cell_m).astype(np.int64)
        spans = cells.max(axis=0) + 1
        numbers = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]  # rows of cells sort far slower
        _, first, shared = np.unique(numbers, return_index=True, return_inverse=True)
        corners = shared.reshape(-1)[faces].astype(np.int64)
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        chosen = keep[first]
        cell_m *= 1.25
    return TrialMesh(vertices_m=mesh.vertices_m[chosen], faces=corners), chosen


def _cameras(server: viser.ViserServer, trial: Trial) -> None:
    scene = server.scene
    aspect, fov_rad = _lens(trial)
    scene.add_frame("/photographs", show_axes=False, visible=False)
    for i, shot in enumerate(trial.photographs):
        pose = shot.X_WC_true or shot.X_WC_est
        if pose is None:
            continue
        scene.add_camera_frustum(
            f"/photographs/{i + 1:03d}", fov=fov_rad, aspect=aspect, scale=FRUSTUM_M, thickness=0.0016,
            color=CAMERA_RGB, image=thumbnail(shot.path), format="jpeg", jpeg_quality=70, cast_shadow=False,
            receive_shadow=False, wxyz=quat_multiply(Q_UW, pose.q), position=upright(pose.p_m, trial.bed_z_m),
        )  # fmt: skip
    if trial.planned:
        points = upright(np.array([pose.p_m for pose in trial.planned]), trial.bed_z_m)
        add_points(server, "/planned viewpoints", points, PLANNED_RGB, 0.008, False, "diamond")


def _lens(trial: Trial) -> tuple[float, float]:
    """Aspect ratio and vertical field of view in radians; 90 degrees across and 4:3 where the scenario is not known."""
    if trial.settings is None:
        return 4 / 3, float(2 * np.arctan(3 / 4))
    imaging = trial.settings.imaging
    aspect = imaging.width / imaging.height
    return aspect, float(2 * np.arctan(np.tan(np.radians(imaging.fov_deg) / 2) / aspect))


def _fly(server: viser.ViserServer, trial: Trial, path: Array) -> str:
    """Add the path and the vehicle, play the flight back in half a minute, and give the page."""
    scene = server.scene
    serializer = None
    if len(path) > 1:
        line = upright(path[:: max(1, len(path) // 1500)], trial.bed_z_m).astype(np.float32)
        scene.add_line_segments(
            "/path", points=np.stack([line[:-1], line[1:]], axis=1), colors=PATH_RGB, thickness=0.003,
            visible=False,
        )  # fmt: skip
        poses = _body_poses(trial)
        if poses:
            hull = scene.add_frame("/vehicle", show_axes=False, visible=False)
            _hull(server, vehicle_of(trial))
            start = poses[0]
            hull.position, hull.wxyz = upright(start.p_m, trial.bed_z_m), quat_multiply(Q_UW, start.q)
            serializer = server.get_scene_serializer()
            for pose in poses:
                with server.atomic():
                    hull.position, hull.wxyz = upright(pose.p_m, trial.bed_z_m), quat_multiply(Q_UW, pose.q)
                serializer.insert_sleep(PLAYBACK_S / len(poses))
    return (serializer or server.get_scene_serializer()).as_html()


def _body_poses(trial: Trial) -> list[Pose]:
    names = [f"true_{a}_m" for a in "xyz"] + [f"true_q{a}" for a in "wxyz"]
    if trial.steps is None or not set(names) <= set(trial.steps.columns):
        return []
    rows = trial.steps.select(names).to_numpy()
    rows = rows[np.isfinite(rows).all(axis=1)]
    pick = np.unique(np.linspace(0, len(rows) - 1, min(FRAMES, len(rows))).astype(int))
    return [Pose(rows[i, :3], rows[i, 3:]) for i in pick]


def vehicle_of(trial: Trial) -> Vehicle | None:
    """Vehicle that the scenario names; None if it is not known here."""
    name, replaced = trial.scenario.get("vehicle"), trial.scenario.get("overrides") or {}
    if not isinstance(name, str) or "vehicle" in replaced:
        return None
    try:
        return any_vehicle(name)
    except (InputError, OSError):
        return None


def _hull(server: viser.ViserServer, vehicle: Vehicle | None) -> None:
    """The vehicle as the film draws it, in its body frame; only axes where the vehicle is not known."""
    if vehicle is None:
        server.scene.add_frame("/vehicle/axes", axes_length=0.15, axes_radius=0.005)
        return
    hull = hull_of(vehicle)
    # Each face has corners of its own, so that edges stay edges and colours do not run.
    corners = hull.vertices_B_m[hull.faces].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    rgba = opaque(np.repeat(hull.colours, 3, axis=0))
    server.scene.add_mesh_trimesh("/vehicle/hull", matt_mesh(corners, faces, rgba, 0.7, hull.normals.reshape(-1, 3)))


def _linear(colours: Array) -> Array:
    """Opaque glTF vertex colours, uint8, shape (n, 4): linear light, while colours on screen follow IEC 61966-2-1."""
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    return opaque(linear)


def opaque(colours: Array) -> Array:
    """Opaque RGBA, uint8, shape (n, 4), of colours from 0 to 1, shape (n, 3)."""
    return as_bytes(np.concatenate([colours, np.ones((len(colours), 1))], axis=1))


def as_bytes(colours: Array) -> Array:
    """Colours from 0 to 1 as uint8."""
    return np.round(255 * colours).astype(np.uint8)
