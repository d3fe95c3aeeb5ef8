"""Many depth maps to one cloud: a point stays when enough other maps agree with it and few look through it."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from scipy.spatial import KDTree

from wakewise.arrays import Array, BoolArray, IntArray
from wakewise.reconstruction.stereo import DepthImage, DepthMap


@njit(cache=True, parallel=True)
def _agree(
    depth: DepthImage,
    wanted: BoolArray,
    camera: Array,
    others: list[DepthImage],
    cameras: Array,
    tolerance_px: float,
) -> tuple[Array, IntArray, IntArray]:
    """Depth averaged over the maps that agree, their number, and the number that look through; one pixel, one thread.

    `camera` is (focal, cx, cy, baseline, R_CW row by row, centre), shape (16,); `cameras` one row per other map.
    """
    height, width = depth.shape
    mean = np.zeros((height, width))
    votes = np.zeros((height, width), np.int64)
    against = np.zeros((height, width), np.int64)
    f, cx, cy, base = camera[0], camera[1], camera[2], camera[3]
    R, c = camera[4:13], camera[13:16]
    for v in prange(height):
        for u in range(width):
            if not wanted[v, u]:
                continue
            z = float(depth[v, u])
            x, y = (u - cx) / f * z, (v - cy) / f * z
            X = R[0] * x + R[3] * y + R[6] * z + c[0]
            Y = R[1] * x + R[4] * y + R[7] * z + c[1]
            Z = R[2] * x + R[5] * y + R[8] * z + c[2]
            weight = (f * base / (z * z)) ** 2
            total, sum_z = weight, weight * z
            for k in range(len(others)):
                o = cameras[k]
                dx, dy, dz = X - o[13], Y - o[14], Z - o[15]
                zo = o[10] * dx + o[11] * dy + o[12] * dz
                if zo <= 0.0:
                    continue
                uo = o[0] * (o[4] * dx + o[5] * dy + o[6] * dz) / zo + o[1]
                vo = o[0] * (o[7] * dx + o[8] * dy + o[9] * dz) / zo + o[2]
                col, row = int(np.floor(uo + 0.5)), int(np.floor(vo + 0.5))
                other = others[k]
                if row < 0 or col < 0 or row >= other.shape[0] or col >= other.shape[1]:
                    continue
                seen = float(other[row, col])
                if seen <= 0.0:
                    continue
                # What the other map sees there, taken back into this one.
                ox, oy = (col - o[1]) / o[0] * seen, (row - o[2]) / o[0] * seen
                ex = o[4] * ox + o[7] * oy + o[10] * seen + o[13] - c[0]
                ey = o[5] * ox + o[8] * oy + o[11] * seen + o[14] - c[1]
                ez = o[6] * ox + o[9] * oy + o[12] * seen + o[15] - c[2]
                back = R[6] * ex + R[7] * ey + R[8] * ez
                other_gap = o[0] * o[3] * (1.0 / zo - 1.0 / seen)
                if back <= 0.0:
                    continue
                gap = f * base * (1.0 / back - 1.0 / z)
                bu = f * (R[0] * ex + R[1] * ey + R[2] * ez) / back + cx - u
                bv = f * (R[3] * ex + R[4] * ey + R[5] * ez) / back + cy - v
                if abs(gap) < tolerance_px and bu * bu + bv * bv < 4.0:
                    votes[v, u] += 1
                    w = (o[0] * o[3] / (seen * seen)) ** 2
                    total += w
                    sum_z += w * back
                elif other_gap > 3.0 * tolerance_px:
                    against[v, u] += 1  # the other map sees something well behind this point: it looks through
            mean[v, u] = sum_z / total
    return mean, votes, against


def pack(depth_map: DepthMap) -> Array:
    """Camera of a depth map as the kernel wants it, shape (16,)."""
    return np.concatenate(
        [
            [depth_map.focal_px],
            depth_map.centre_px,
            [depth_map.baseline_m],
            depth_map.R_CW.ravel(),
            depth_map.p_WC_m,
        ]
    )


def fuse(
    maps: list[DepthMap], index: int, neighbours: list[int], agreeing: int, tolerance_px: float
) -> tuple[Array, Array, Array]:
    """Points that other maps confirm: positions, colours (red first, 0 to 1) and unit directions to the camera.

    Parameters
    ----------
    neighbours : list of int
        Which maps may vote; the map of the same two photos the other way round is not independent and must not be
        among them.
    agreeing : int
        Votes needed; a point is also dropped where more maps look through it than agree.
    """
    own = maps[index]
    if not neighbours:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    camera = pack(own)
    others = _typed([maps[k].depth_m for k in neighbours])
    mean, votes, against = _agree(
        own.depth_m, own.wanted, camera, others, np.array([pack(maps[k]) for k in neighbours]), tolerance_px
    )
    v, u = np.nonzero((votes >= agreeing) & (against <= votes) & own.wanted)
    z = mean[v, u]
    rays = np.stack([(u - own.centre_px[0]) / own.focal_px, (v - own.centre_px[1]) / own.focal_px, np.ones(len(u))], 1)
    points = (rays * z[:, None]) @ own.R_CW + own.p_WC_m
    colours = own.colours[v, u][:, ::-1].astype(np.float64) / 255.0
    towards = own.p_WC_m - points
    return points, colours, towards / np.linalg.norm(towards, axis=1, keepdims=True)


def _typed(arrays: list[DepthImage]) -> list[DepthImage]:
    from numba.typed import List

    out: list[DepthImage] = List(arrays)
    return out


def thin_mean(points_m: Array, values: Array, voxel_m: float) -> tuple[Array, Array, IntArray]:
    """Mean point and mean values of each occupied cell of a grid, and how many points it had."""
    cells = np.floor(points_m / voxel_m).astype(np.int64)
    cells -= cells.min(axis=0)
    spans = cells.max(axis=0) + 1
    key = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    _, row, count = np.unique(key, return_inverse=True, return_counts=True)
    both = np.concatenate([points_m, values], axis=1)
    mean = np.stack([np.bincount(row, weights=column) for column in both.T], axis=1) / count[:, None]
    return mean[:, :3], mean[:, 3:], count


def lonely(points_m: Array, neighbours: int = 12, sigmas: float = 2.0, threads: int = 1) -> BoolArray:
    """Which points are outliers: their mean distance to their nearest neighbours is far above the usual.

    R. B. Rusu et al., Towards 3D point cloud based object maps for household environments, Robotics and Autonomous
    Systems 56(11), 2008, doi 10.1016/j.robot.2008.08.005, section 4.1.
    """
    if len(points_m) <= neighbours:
        return np.zeros(len(points_m), dtype=np.bool_)
    distances = np.asarray(KDTree(points_m).query(points_m, k=neighbours + 1, workers=threads)[0])
    distance = distances[:, 1:].mean(axis=1)
    return np.asarray(distance > distance.mean() + sigmas * distance.std())
