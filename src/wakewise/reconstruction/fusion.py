"""Many depth maps to one cloud: a point stays when enough other maps agree with it and few look through it."""

from __future__ import annotations

import numpy as np
import small_gicp
from scipy.spatial import KDTree

from wakewise.arrays import Array, BoolArray, IntArray
from wakewise.compiled import njit
from wakewise.reconstruction.photos import Image
from wakewise.reconstruction.stereo import DepthImage, DepthMap


@njit(nogil=True)
def _agree(
    depth: DepthImage,
    wanted: BoolArray,
    camera: Array,
    others: DepthImage,
    places: IntArray,
    cameras: Array,
    tolerance_px: float,
) -> tuple[Array, IntArray, IntArray]:
    """Depth averaged over the maps that agree, their number, and the number that look through.

    `camera` is (focal, cx, cy, baseline, R_CW row by row, centre), shape (16,); `cameras` one row per other map, whose
    depths lie in `others` from `places[k, 0]` on, `places[k, 1]` rows of `places[k, 2]` each: a list of arrays would be
    counted up and down at every look, which took longer than the geometry.
    """
    height, width = depth.shape
    mean = np.zeros((height, width))
    votes = np.zeros((height, width), np.int64)
    against = np.zeros((height, width), np.int64)
    f, cx, cy, base = camera[0], camera[1], camera[2], camera[3]
    R, c = camera[4:13], camera[13:16]
    inverse_focal = 1.0 / cameras[:, 0]
    for v in range(height):
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
            inverse_z = 1.0 / z
            for k in range(len(cameras)):
                dx, dy, dz = X - cameras[k, 13], Y - cameras[k, 14], Z - cameras[k, 15]
                zo = cameras[k, 10] * dx + cameras[k, 11] * dy + cameras[k, 12] * dz
                if zo <= 0.0:
                    continue
                inverse_zo = 1.0 / zo
                scaled = cameras[k, 0] * inverse_zo
                uo = scaled * (cameras[k, 4] * dx + cameras[k, 5] * dy + cameras[k, 6] * dz) + cameras[k, 1]
                vo = scaled * (cameras[k, 7] * dx + cameras[k, 8] * dy + cameras[k, 9] * dz) + cameras[k, 2]
                col, row = int(np.floor(uo + 0.5)), int(np.floor(vo + 0.5))
                if row < 0 or col < 0 or row >= places[k, 1] or col >= places[k, 2]:
                    continue
                seen = float(others[places[k, 0] + row * places[k, 2] + col])
                if seen <= 0.0:
                    continue
                # What the other map sees there, taken back into this one.
                per_pixel = seen * inverse_focal[k]
                ox, oy = (col - cameras[k, 1]) * per_pixel, (row - cameras[k, 2]) * per_pixel
                ex = cameras[k, 4] * ox + cameras[k, 7] * oy + cameras[k, 10] * seen + cameras[k, 13] - c[0]
                ey = cameras[k, 5] * ox + cameras[k, 8] * oy + cameras[k, 11] * seen + cameras[k, 14] - c[1]
                ez = cameras[k, 6] * ox + cameras[k, 9] * oy + cameras[k, 12] * seen + cameras[k, 15] - c[2]
                back = R[6] * ex + R[7] * ey + R[8] * ez
                if back <= 0.0:
                    continue
                inverse_back = 1.0 / back
                gap = f * base * (inverse_back - inverse_z)
                bu = f * inverse_back * (R[0] * ex + R[1] * ey + R[2] * ez) + cx - u
                bv = f * inverse_back * (R[3] * ex + R[4] * ey + R[5] * ez) + cy - v
                if abs(gap) < tolerance_px and bu * bu + bv * bv < 4.0:
                    votes[v, u] += 1
                    w = (cameras[k, 0] * cameras[k, 3] / (seen * seen)) ** 2
                    total += w
                    sum_z += w * back
                elif cameras[k, 0] * cameras[k, 3] * (inverse_zo - 1.0 / seen) > 3.0 * tolerance_px:
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


@njit(nogil=True)
def _gather(
    depth: Array,
    votes: IntArray,
    against: IntArray,
    wanted: BoolArray,
    colours: Image,
    camera: Array,
    agreeing: int,
) -> Array:
    """What is confirmed, shape (n, 9): position, colour (red first, 0 to 1), unit direction to the camera."""
    height, width = depth.shape
    count = 0
    for v in range(height):
        for u in range(width):
            if wanted[v, u] and votes[v, u] >= agreeing and against[v, u] <= votes[v, u]:
                count += 1
    rows = np.empty((count, 9))
    f, cx, cy = camera[0], camera[1], camera[2]
    R, c = camera[4:13], camera[13:16]
    k = 0
    for v in range(height):
        for u in range(width):
            if wanted[v, u] and votes[v, u] >= agreeing and against[v, u] <= votes[v, u]:
                z = depth[v, u]
                x, y = (u - cx) / f * z, (v - cy) / f * z
                length = np.sqrt(x * x + y * y + z * z)
                for axis in range(3):
                    ray = R[axis] * x + R[3 + axis] * y + R[6 + axis] * z
                    rows[k, axis] = ray + c[axis]
                    rows[k, 3 + axis] = colours[v, u, 2 - axis] / 255.0
                    rows[k, 6 + axis] = -ray / length
                k += 1
    return rows


def fuse(maps: list[DepthMap], index: int, neighbours: list[int], agreeing: int, tolerance_px: float) -> Array:
    """Points that other maps confirm, shape (n, 9): position, colour (red first, 0 to 1), unit direction to the camera.

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
        return np.zeros((0, 9))
    camera = pack(own)
    depths = [maps[k].depth_m for k in neighbours]
    starts = np.cumsum([0, *(depth.size for depth in depths[:-1])])
    places = np.array([(start, *depth.shape) for start, depth in zip(starts, depths, strict=True)], dtype=np.int64)
    others = np.concatenate([depth.ravel() for depth in depths])
    cameras = np.array([pack(maps[k]) for k in neighbours])
    mean, votes, against = _agree(own.depth_m, own.wanted, camera, others, places, cameras, tolerance_px)
    return _gather(mean, votes, against, own.wanted, own.colours, camera, agreeing)


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


def facing_normals(points_m: Array, towards: Array, threads: int = 1) -> Array:
    """Unit normals of each point's neighbourhood, shape (n, 3), on the side that `towards` points to; it where none is.

    Each point's is found by one thread, so that their number makes no difference.
    """
    cloud = small_gicp.PointCloud(points_m)
    small_gicp.estimate_normals(cloud, num_neighbors=16, num_threads=threads)
    normals = np.array(cloud.normals())[:, :3]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.5, normals / np.maximum(length, 1e-12), towards)
    normals[np.einsum("ij,ij->i", normals, towards) < 0.0] *= -1.0
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12))
