"""Where the film is watched from: far enough to see the whole flight, on the side where the target is covered least."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, look_at
from wakewise.vision.imaging import PinholeCamera

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
