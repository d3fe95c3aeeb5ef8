"""The textured relief with coded targets on flat places of it, photographed in closed form."""

from __future__ import annotations

import cv2
import numpy as np
import pycolmap
from relief import CENTRE, R_BC, texture

from wakewise.core.geometry import Pose, look_at

WIDTH, HEIGHT, FOCAL = 640, 480, 560.0
TAG_M = 0.036
CELL_M = 0.0007
# Middles of the targets by number, in m, at the height of the flat places.
TARGETS = {3: (-0.10, -0.07), 7: (0.11, -0.06), 12: (-0.09, 0.075), 20: (0.10, 0.08)}
SAMPLES = 2


def bar_m(one, two):
    """True distance of two targets."""
    return float(np.linalg.norm(np.subtract(TARGETS[one], TARGETS[two])))


def height(x, y):
    """Depth in m of the surface: bumps, but flat at the targets."""
    bumps = 0.02 * np.sin(40 * x) * np.cos(35 * y) + 0.03 * np.sin(11 * x + 1.0) * np.sin(9 * y)
    near = np.zeros_like(x)
    for cx, cy in TARGETS.values():
        near = np.maximum(near, np.clip(1.8 - np.hypot(x - cx, y - cy) / (0.8 * TAG_M), 0.0, 1.0))
    return 1.0 + bumps * (1.0 - near**2 * (3.0 - 2.0 * near))


def shade(x, y, tex, stretch=1.0, print_scale=1.0, family="DICT_APRILTAG_36h11"):
    """Grey levels, 0 to 1, of places on the surface."""
    column, row = (np.mod(axis / CELL_M, len(tex)).astype(np.float32) for axis in (x, y))
    grey = cv2.remap(tex.astype(np.float32), column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family))
    cells = dictionary.markerSize + 2
    for number, (cx, cy) in TARGETS.items():
        code = cv2.aruco.generateImageMarker(dictionary, number, cells) / 255.0
        side = TAG_M * print_scale
        u = ((x - cx) / (side * stretch) + 0.5) * cells
        v = ((y - cy) / side + 0.5) * cells
        paper = (u > -1) & (u < cells + 1) & (v > -1) & (v < cells + 1)
        inside = (u >= 0) & (u < cells) & (v >= 0) & (v < cells)
        grey[paper] = 1.0
        grey[inside] = code[v[inside].astype(int), u[inside].astype(int)]
    return grey


def photo(X_WC, tex, **printed):
    """Image of the surface, several rays a pixel."""
    n = SAMPLES
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = _rays(u, v, X_WC)
    z = np.ones_like(u)
    for _ in range(15):
        t = (z - X_WC.p_m[2]) / rays[..., 2]
        z = height(X_WC.p_m[0] + t * rays[..., 0], X_WC.p_m[1] + t * rays[..., 1])
    # Finer rays meet the surface where those of the pixels about them do.
    z = cv2.resize(z, (WIDTH * n, HEIGHT * n), interpolation=cv2.INTER_LINEAR)
    rays = _rays(*np.meshgrid((np.arange(WIDTH * n) + 0.5) / n, (np.arange(HEIGHT * n) + 0.5) / n), X_WC)
    t = (z - X_WC.p_m[2]) / rays[..., 2]
    x, y = X_WC.p_m[0] + t * rays[..., 0], X_WC.p_m[1] + t * rays[..., 1]
    grey = shade(x, y, tex, **printed).reshape(HEIGHT, n, WIDTH, n).mean(axis=(1, 3))
    return np.repeat((30 + 200 * grey).astype(np.uint8)[..., None], 3, axis=2)


def _rays(u, v, X_WC):
    return np.stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones_like(u)], -1) @ X_WC.R.T


def poses():
    """Eight cameras on two arcs, about 0.4 m from the surface, and one nearer and rolled."""
    out = []
    for k in range(8):
        angle, side = np.radians(14.0 * (k % 4 - 1.5)), np.radians(-18.0 if k < 4 else 16.0)
        eye = CENTRE + 0.42 * np.array([np.sin(angle), np.sin(side) * np.cos(angle), -np.cos(angle) * np.cos(side)])
        out.append(Pose.from_matrix(look_at(eye, CENTRE + np.array([0.01 * (k % 3 - 1), 0.0, 0.0])) @ R_BC, eye))
    eye = CENTRE + np.array([0.02, 0.03, -0.36])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    out.append(Pose.from_matrix(look_at(eye, CENTRE) @ R_BC @ turn, eye))
    return out


def take_photos(folder, which=range(9), **printed):
    """Write the photographs; their true poses by name."""
    folder.mkdir(parents=True, exist_ok=True)
    tex = texture()
    out = {}
    for k, X_WC in enumerate(poses()):
        if k not in which:
            continue
        cv2.imwrite(str(folder / f"{k:02d}.png"), photo(X_WC, tex, **printed))
        out[f"{k:02d}.png"] = X_WC
    return out


def true_model(folder, cameras, unit_m):
    """Leave a sparse model of the true cameras in units of `unit_m`, with points that photographs see."""
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=WIDTH, height=HEIGHT, params=[FOCAL, WIDTH / 2, HEIGHT / 2, 0.0], camera_id=1
    )
    model.add_camera_with_trivial_rig(camera)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.15, 0.15, (2, 40))
    points = np.stack([x, y, height(x, y)], axis=1)
    for number, (name, X_WC) in enumerate(sorted(cameras.items()), 1):
        seen = (points - X_WC.p_m) @ X_WC.R
        pixels = FOCAL * seen[:, :2] / seen[:, 2:] + np.array([WIDTH, HEIGHT]) / 2
        image = pycolmap.Image(name=name, keypoints=pixels, camera_id=1, image_id=number)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(X_WC.R.T), -X_WC.R.T @ X_WC.p_m / unit_m)
        model.add_image_with_trivial_frame(image, pose)
    for k, point in enumerate(points):
        track = pycolmap.Track()
        for number in range(1, len(cameras) + 1):
            track.add_element(number, k)
        model.add_point3D(point / unit_m, track, np.zeros(3, dtype=np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    model.write_binary(folder)
