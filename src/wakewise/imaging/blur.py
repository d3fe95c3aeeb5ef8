"""Motion blur from the camera's true motion while the shutter is open.

Every pixel's depth is known, so the motion field is exact for what the middle view sees: a frame taken at another
instant is the middle frame moved by it. The photograph is the mean of such frames. Strips that only the other frames
see, behind an edge or outside of the image, are filled with the nearest thing seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit, prange

from wakewise.errors import InputError
from wakewise.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.imaging.camera import Camera
from wakewise.imaging.lens import IDEAL, pixel_at, ray_at
from wakewise.imaging.renderer import Image

STEP_PX = 1.0
"""Largest motion between two averaged frames, no wider than a pixel, so that a point's trail shows no beads."""
STILL_PX = 0.02
"""Motion below which a frame counts as still."""
MOST_FRAMES = 65
FAR_M = 1e4
"""What is nowhere is taken to be this far."""


def pose_at(poses: Sequence[Pose], fraction: float) -> Pose:
    """Pose at a fraction, 0 to 1, of the exposure, between poses evenly spaced in time (lines and great circles)."""
    if not poses:
        raise InputError("exposure: no pose given, at least one is needed")
    place = min(max(fraction, 0.0), 1.0) * (len(poses) - 1)
    i = min(int(place), max(len(poses) - 2, 0))
    if len(poses) == 1 or place == i:
        return poses[i]
    a, b, t = poses[i], poses[i + 1], place - i
    turn = rotvec_from_quat(quat_multiply(quat_conjugate(a.q), b.q))
    return Pose((1.0 - t) * a.p_m + t * b.p_m, quat_multiply(a.q, quat_from_rotvec(t * turn)))


def motion_px(camera: Camera, poses: Sequence[Pose], depth_m: float) -> float:
    """Longest path in pixels that a point seen in the middle view at `depth_m` takes during the exposure."""
    middle = pose_at(poses, 0.5)
    w, h = camera.width, camera.height
    grid = np.array([[x, y] for x in (0.0, 0.5 * w, w) for y in (0.0, 0.5 * h, h)])
    points_W = middle.apply(camera.unproject(grid, np.full(len(grid), depth_m)))
    track = np.stack([camera.project(pose.inverse().apply(points_W)) for pose in poses])
    path = np.linalg.norm(np.diff(track, axis=0), axis=2).sum(axis=0)
    return float(np.nanmax(path, initial=0.0))


def motion_blur(image: Image, depth_m: Image, camera: Camera, poses: Sequence[Pose]) -> Image:
    """Average the frames of an exposure, each warped from the one at its middle.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3)
        Linear radiance from `pose_at(poses, 0.5)`.
    depth_m : ndarray, shape (h, w)
        Depth along the optical axis, infinite where nothing is seen.
    camera : Camera
    poses : sequence of Pose
        X_WC evenly spaced over the exposure, the first and last at its ends.

    Returns
    -------
    ndarray, shape (h, w, 3)
        `image` itself if nothing moves by more than 0.02 px.
    """
    # The 0.1 % nearest pixels may move a little farther per frame than STEP_PX.
    near = float(np.quantile(depth_m[::8, ::8], 0.001))
    motion = motion_px(camera, poses, min(near, 1e3))
    if motion < STILL_PX:
        return image
    # An odd number, so that the middle frame is the view itself.
    frames = int(np.clip(2 * math.ceil(0.5 * (motion / STEP_PX - 1.0)) + 1, 3, MOST_FRAMES))
    middle = pose_at(poses, 0.5)
    turns, shifts = np.empty((frames, 3, 3)), np.empty((frames, 3))
    for k in range(frames):
        X_KM = pose_at(poses, (k + 0.5) / frames).inverse() @ middle
        turns[k], shifts[k] = X_KM.R, X_KM.p_m
    out = np.empty_like(image)
    row = camera.row
    _average(out, image, 1.0 / depth_m, turns, shifts, np.append(row, 1.0 / row[1:3]))
    return out


@njit(cache=True, inline="always", error_model="numpy")
def _cubic(t: float) -> tuple[float, float, float, float]:
    """Weights of four neighbours at a fraction t: cubic convolution (Keys 1981, doi 10.1109/TASSP.1981.1163711).

    Linear weights would soften every frame of a hardly moving camera by more than the motion does.
    """
    return (
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    )


@njit(cache=True, inline="always", error_model="numpy")
def _seen_at(lens: Any, turns: Any, shifts: Any, k: int, qx: float, qy: float, nearness: float) -> tuple[float, float]:
    """Pixel at which another frame sees what the middle one sees in the pixel (qx, qy) at 1 / nearness."""
    if lens[0] == IDEAL:
        rx, ry = (qx - lens[3]) * lens[14], (qy - lens[4]) * lens[15]
        x = turns[k, 0, 0] * rx + turns[k, 0, 1] * ry + turns[k, 0, 2] + shifts[k, 0] * nearness
        y = turns[k, 1, 0] * rx + turns[k, 1, 1] * ry + turns[k, 1, 2] + shifts[k, 1] * nearness
        z = max(turns[k, 2, 0] * rx + turns[k, 2, 1] * ry + turns[k, 2, 2] + shifts[k, 2] * nearness, 1e-3)
        per_z = 1.0 / z
        return lens[3] + lens[1] * x * per_z, lens[4] + lens[2] * y * per_z
    depth = 1.0 / max(nearness, 1.0 / FAR_M)
    sx, sy, z0 = ray_at(lens, qx, qy)
    sx, sy = sx * (depth - z0), sy * (depth - z0)
    x = turns[k, 0, 0] * sx + turns[k, 0, 1] * sy + turns[k, 0, 2] * depth + shifts[k, 0]
    y = turns[k, 1, 0] * sx + turns[k, 1, 1] * sy + turns[k, 1, 2] * depth + shifts[k, 1]
    z = turns[k, 2, 0] * sx + turns[k, 2, 1] * sy + turns[k, 2, 2] * depth + shifts[k, 2]
    return pixel_at(lens, x, y, max(z, lens[13] + 1e-3))


@njit(cache=True, parallel=True, error_model="numpy")
def _average(out: Any, image: Any, nearness: Any, turns: Any, shifts: Any, lens: Any) -> None:
    """Mean over frames k of image[q_k(p)], where q_k solves seen_k(q) = p by fixed-point steps from q = p."""
    h, w = nearness.shape
    frames = turns.shape[0]
    for y in prange(h):
        for x in range(w):
            red, green, blue = image[y, x, 0], image[y, x, 1], image[y, x, 2]
            for k in range(frames):
                if k == frames // 2:
                    continue
                qx, qy = x + 0.5, y + 0.5
                for _ in range(4):
                    i = min(max(int(qx), 0), w - 1)
                    j = min(max(int(qy), 0), h - 1)
                    sx, sy = _seen_at(lens, turns, shifts, k, qx, qy, nearness[j, i])
                    ex, ey = x + 0.5 - sx, y + 0.5 - sy
                    qx += ex
                    qy += ey
                    if abs(ex) + abs(ey) < 0.01:
                        break
                u = min(max(qx - 0.5, 0.0), w - 1.0)
                v = min(max(qy - 0.5, 0.0), h - 1.0)
                i, j = int(u), int(v)
                a0, a1, a2, a3 = _cubic(u - i)
                b0, b1, b2, b3 = _cubic(v - j)
                i0, i2, i3 = max(i - 1, 0), min(i + 1, w - 1), min(i + 2, w - 1)
                for n in range(4):
                    weight = b0 if n == 0 else b1 if n == 1 else b2 if n == 2 else b3
                    m = min(max(j + n - 1, 0), h - 1)
                    c0, c1, c2, c3 = weight * a0, weight * a1, weight * a2, weight * a3
                    red += c0 * image[m, i0, 0] + c1 * image[m, i, 0] + c2 * image[m, i2, 0] + c3 * image[m, i3, 0]
                    green += c0 * image[m, i0, 1] + c1 * image[m, i, 1] + c2 * image[m, i2, 1] + c3 * image[m, i3, 1]
                    blue += c0 * image[m, i0, 2] + c1 * image[m, i, 2] + c2 * image[m, i2, 2] + c3 * image[m, i3, 2]
            out[y, x, 0] = max(red, 0.0) / frames
            out[y, x, 1] = max(green, 0.0) / frames
            out[y, x, 2] = max(blue, 0.0) / frames
