"""Motion blur of the camera's true motion while the shutter is open.

The depth of every pixel is known, so a frame at another instant is the middle frame, warped. The photograph is the mean
of such frames. Strips that only other frames see, behind an edge or outside of the image, take the nearest pixel. A
rolling shutter exposes row by row, top row first: each row is the mean of frames over its own time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.camera import IDEAL, Camera, pixel_at, ray_at
from wakewise.vision.imaging.renderer import BAND_ROWS, Image, in_threads

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


@dataclass(frozen=True, kw_only=True)
class Shutter:
    """When rows see, as shares of the time that the poses span: one row for `open`, the rows begin over `rolling`.

    A global shutter is open for all of it. What the two leave lies half before and half after, so that the row in the
    middle is always exposed about the middle.
    """

    open: float = 1.0
    rolling: float = 0.0

    def __post_init__(self) -> None:
        if not (self.open > 0.0 and self.rolling >= 0.0 and self.open + self.rolling <= 1.0 + 1e-9):
            raise InputError(
                f"shutter: open {self.open:g}, rolling {self.rolling:g}, must be more than 0 and at least 0, together 1"
            )

    def fraction(self, row: float, within: float) -> float:
        """Share of the time that has passed when `within` of the exposure of a row is, `row` from 0, top, to 1."""
        return 0.5 + self.rolling * (row - 0.5) + self.open * (within - 0.5)


GLOBAL = Shutter()
"""All rows at once, over all of the time."""


def motion_blur(
    image: Image, depth_m: Image, camera: Camera, poses: Sequence[Pose], shutter: Shutter = GLOBAL
) -> Image:
    """Average the frames of an exposure, each warped from the one at its middle.

    `image`, shape (h, w, 3): linear radiance from `pose_at(poses, 0.5)`. `depth_m`, shape (h, w): depth along the
    optical axis, infinite where nothing is seen. `poses`: X_WC evenly spaced over the exposure and the readout, the
    first and last at its ends. `shutter`: which part of that time each row sees. Returns shape (h, w, 3):
    `image` itself if nothing moves by more than 0.02 px.
    """
    # The 0.1 % nearest pixels may move a little farther per frame than STEP_PX.
    near = float(np.quantile(depth_m[::8, ::8], 0.001))
    motion = motion_px(camera, poses, min(near, 1e3))
    if motion < STILL_PX:
        return image
    if shutter != GLOBAL:
        return _by_rows(image, depth_m, camera, poses, shutter, motion)
    # An odd number, so that the middle frame is the view itself.
    frames = int(np.clip(2 * math.ceil(0.5 * (motion / STEP_PX - 1.0)) + 1, 3, MOST_FRAMES))
    middle = pose_at(poses, 0.5)
    turns, shifts = np.empty((frames, 3, 3)), np.empty((frames, 3))
    for k in range(frames):
        X_KM = pose_at(poses, (k + 0.5) / frames).inverse() @ middle
        turns[k], shifts[k] = X_KM.R, X_KM.p_m
    out, planes = np.empty_like(image), np.empty((3, *depth_m.shape), np.float32)
    lens = np.append(camera.row, 1.0 / camera.row[1:3])
    h = camera.height
    bands = range(0, h, BAND_ROWS)
    in_threads(lambda first: _split(first, min(first + BAND_ROWS, h), planes, image), bands)
    in_threads(
        lambda first: _average(first, min(first + BAND_ROWS, h), out, planes, depth_m, turns, shifts, lens), bands
    )
    return out


TABLE = 33
"""Instants at which the camera's motion is tabled for a rolling shutter; between them it is a straight line, which at
half a degree over the whole leaves 1e-8 of a pixel's focal length."""


def _by_rows(
    image: Image, depth_m: Image, camera: Camera, poses: Sequence[Pose], shutter: Shutter, motion: float
) -> Image:
    """`motion_blur` of a shutter that rolls, or that is open for a part of the time only."""
    frames = int(np.clip(math.ceil(motion * shutter.open / STEP_PX), 1, MOST_FRAMES))
    middle = pose_at(poses, 0.5)
    turns, shifts = np.empty((TABLE, 3, 3)), np.empty((TABLE, 3))
    for k in range(TABLE):
        X_KM = pose_at(poses, k / (TABLE - 1)).inverse() @ middle
        turns[k], shifts[k] = X_KM.R, X_KM.p_m
    out, planes = np.empty_like(image), np.empty((3, *depth_m.shape), np.float32)
    lens, h = np.append(camera.row, 1.0 / camera.row[1:3]), camera.height
    bands = range(0, h, BAND_ROWS)
    in_threads(lambda first: _split(first, min(first + BAND_ROWS, h), planes, image), bands)

    def band(first: int) -> None:
        last = min(first + BAND_ROWS, h)
        _roll(first, last, frames, shutter.open, shutter.rolling, out, planes, depth_m, turns, shifts, lens)

    in_threads(band, bands)
    return out


@njit(nogil=True)
def _split(first: int, last: int, planes: Any, image: Any) -> None:
    """An image (h, w, 3) as planes (3, h, w): along a plane's rows several pixels go through at once."""
    for y in range(first, last):
        for x in range(image.shape[1]):
            planes[0, y, x], planes[1, y, x], planes[2, y, x] = image[y, x, 0], image[y, x, 1], image[y, x, 2]


_HALF, _ONE = np.float32(0.5), np.float32(1.0)
_THREE_HALVES, _TWO, _FIVE_HALVES = np.float32(1.5), np.float32(2.0), np.float32(2.5)


@njit(inline="always")
def _cubic(t: Any) -> Any:
    """Weights of four neighbours at a fraction t: cubic convolution (Keys 1981, doi 10.1109/TASSP.1981.1163711).

    Linear weights would soften every frame of a hardly moving camera by more than the motion does.
    """
    return (
        ((-_HALF * t + _ONE) * t - _HALF) * t,
        (_THREE_HALVES * t - _FIVE_HALVES) * t * t + _ONE,
        ((-_THREE_HALVES * t + _TWO) * t + _HALF) * t,
        (_HALF * t - _HALF) * t * t,
    )


@njit
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


@njit
def _source(
    lens: Any, turns: Any, shifts: Any, k: int, x: int, y: int, qx: float, qy: float, depth_m: Any
) -> tuple[float, float]:
    """Place q in the middle frame that frame k sees at pixel (x, y): seen_k(q) = p, by fixed-point steps from q."""
    h, w = depth_m.shape
    for _ in range(4):
        i = min(max(int(qx), 0), w - 1)
        j = min(max(int(qy), 0), h - 1)
        sx, sy = _seen_at(lens, turns, shifts, k, qx, qy, 1.0 / depth_m[j, i])
        ex, ey = x + 0.5 - sx, y + 0.5 - sy
        qx += ex
        qy += ey
        if abs(ex) + abs(ey) < 0.01:
            break
    return qx, qy


@njit
def _sources(lens: Any, turns: Any, shifts: Any, k: int, y: int, depth_m: Any, nearness: Any, qx: Any, qy: Any) -> None:
    """Write `_source` of a row of pixels.

    Two steps at the pixel's own depth, a whole row at once, are all where depth hardly changes on the way: the first
    leaves a thousandth of the motion. Elsewhere, and through lenses, single pixels go on.
    """
    h, w = depth_m.shape
    if lens[0] != IDEAL:
        for x in range(w):
            qx[x], qy[x] = _source(lens, turns, shifts, k, x, y, x + 0.5, y + 0.5, depth_m)
        return
    own = depth_m[y]
    for x in range(w):
        nearness[x] = 1.0 / own[x]
    t00, t01, t02, t10, t11, t12 = (
        turns[k, 0, 0], turns[k, 0, 1], turns[k, 0, 2], turns[k, 1, 0], turns[k, 1, 1], turns[k, 1, 2],
    )  # fmt: skip
    t20, t21, t22, s0, s1, s2 = turns[k, 2, 0], turns[k, 2, 1], turns[k, 2, 2], shifts[k, 0], shifts[k, 1], shifts[k, 2]
    fx, fy, cx, cy, per_fx, per_fy = lens[1], lens[2], lens[3], lens[4], lens[14], lens[15]
    for x in range(w):
        rx, ry, near = (x + 0.5 - cx) * per_fx, (y + 0.5 - cy) * per_fy, nearness[x]
        px, py = rx, ry
        for _ in range(2):
            per_z = 1.0 / max(t20 * rx + t21 * ry + t22 + s2 * near, 1e-3)
            sx = (t00 * rx + t01 * ry + t02 + s0 * near) * per_z
            sy = (t10 * rx + t11 * ry + t12 + s1 * near) * per_z
            rx += px - sx
            ry += py - sy
        qx[x], qy[x] = cx + fx * rx, cy + fy * ry
    # A change of nearness moves a point by this much, in pixels.
    gain = fx * (abs(s0) + abs(s1) + abs(s2))
    for x in range(w):
        i = min(max(int(qx[x]), 0), w - 1)
        j = min(max(int(qy[x]), 0), h - 1)
        if not gain * abs(1.0 / depth_m[j, i] - nearness[x]) < 0.01:
            qx[x], qy[x] = _source(lens, turns, shifts, k, x, y, x + 0.5, y + 0.5, depth_m)


@njit
def _add_run(total: Any, pixels: Any, across: Any, down: Any) -> None:
    """Add to `total` (m,) the values between pixels (m + 3,) of one row at fractions `across`, times `down`."""
    for x in range(total.shape[0]):
        a0, a1, a2, a3 = _cubic(across[x])
        total[x] += down[x] * (a0 * pixels[x] + a1 * pixels[x + 1] + a2 * pixels[x + 2] + a3 * pixels[x + 3])


@njit
def _add_frame(totals: Any, planes: Any, columns: Any, rows: Any, across: Any, down: Any) -> None:
    """Add to `totals` (3, w) the values of the planes at pixels `columns`, `rows` plus fractions `across` and `down`.

    Pixels that lie the same number of whole pixels away from their sources are done together.
    """
    _, h, w = planes.shape
    first = 0
    while first < w:
        i, j = columns[first], rows[first]
        last = first + 1
        if i >= 1:
            while last < w and columns[last] - last == i - first and rows[last] == j and columns[last] + 2 < w:
                last += 1
        if i >= 1 and i + 2 < w:
            for n in range(4):
                m = min(max(j + n - 1, 0), h - 1)
                for c in range(3):
                    _add_run(
                        totals[c, first:last], planes[c, m, i - 1 : i + last - first + 2], across[first:last],
                        down[n, first:last],
                    )  # fmt: skip
        else:
            a = _cubic(across[first])
            for n in range(4):
                m = min(max(j + n - 1, 0), h - 1)
                for s in range(4):
                    at = min(max(i + s - 1, 0), w - 1)
                    for c in range(3):
                        totals[c, first] += down[n, first] * a[s] * planes[c, m, at]
        first = last


@njit(nogil=True)
def _average(first: int, last: int, out: Any, planes: Any, depth_m: Any, turns: Any, shifts: Any, lens: Any) -> None:
    """Mean over frames k of image[q_k(p)], where q_k solves seen_k(q) = p, in rows first..last-1."""
    h, w = depth_m.shape
    frames = turns.shape[0]
    totals, down = np.empty((3, w), np.float32), np.empty((4, w), np.float32)
    qx, qy, nearness = np.empty(w), np.empty(w), np.empty(w)
    columns, rows, across = np.empty(w, np.int64), np.empty(w, np.int64), np.empty(w, np.float32)
    share, dark = np.float32(1.0 / frames), np.float32(0.0)
    for y in range(first, last):
        totals[:] = planes[:, y]
        for k in range(frames):
            if k == frames // 2:
                continue
            _sources(lens, turns, shifts, k, y, depth_m, nearness, qx, qy)
            for x in range(w):
                u = min(max(qx[x] - 0.5, 0.0), w - 1.0)
                v = min(max(qy[x] - 0.5, 0.0), h - 1.0)
                columns[x], rows[x] = int(u), int(v)
                across[x] = u - columns[x]
                down[0, x], down[1, x], down[2, x], down[3, x] = _cubic(np.float32(v - rows[x]))
            _add_frame(totals, planes, columns, rows, across, down)
        for x in range(w):
            for c in range(3):
                out[y, x, c] = max(totals[c, x], dark) * share


@njit(nogil=True)
def _roll(
    first: int, last: int, frames: int, share_open: float, rolling: float, out: Any, planes: Any, depth_m: Any,
    turns: Any, shifts: Any, lens: Any,
) -> None:  # fmt: skip
    """As `_average`, each row over its own time, from motion tabled over all of it, turns (n, 3, 3), shifts (n, 3)."""
    h, w = depth_m.shape
    n = turns.shape[0]
    totals, down = np.empty((3, w), np.float32), np.empty((4, w), np.float32)
    qx, qy, nearness = np.empty(w), np.empty(w), np.empty(w)
    columns, rows, across = np.empty(w, np.int64), np.empty(w, np.int64), np.empty(w, np.float32)
    turn, shift = np.empty((1, 3, 3)), np.empty((1, 3))
    share, dark = np.float32(1.0 / frames), np.float32(0.0)
    for y in range(first, last):
        totals[:] = dark
        for k in range(frames):
            at = 0.5 + rolling * ((y + 0.5) / h - 0.5) + share_open * ((k + 0.5) / frames - 0.5)
            place = min(max(at, 0.0), 1.0) * (n - 1)
            j = min(int(place), n - 2)
            t = place - j
            for a in range(3):
                shift[0, a] = (1.0 - t) * shifts[j, a] + t * shifts[j + 1, a]
                for b in range(3):
                    turn[0, a, b] = (1.0 - t) * turns[j, a, b] + t * turns[j + 1, a, b]
            _sources(lens, turn, shift, 0, y, depth_m, nearness, qx, qy)
            for x in range(w):
                u = min(max(qx[x] - 0.5, 0.0), w - 1.0)
                v = min(max(qy[x] - 0.5, 0.0), h - 1.0)
                columns[x], rows[x] = int(u), int(v)
                across[x] = u - columns[x]
                down[0, x], down[1, x], down[2, x], down[3, x] = _cubic(np.float32(v - rows[x]))
            _add_frame(totals, planes, columns, rows, across, down)
        for x in range(w):
            for c in range(3):
                out[y, x, c] = max(totals[c, x], dark) * share
