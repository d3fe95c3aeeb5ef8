"""Fusion of depth maps: a point is kept if enough other maps agree with it and few see through it.

Points in one cell of a grid become their mean, in one pass over all points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.jit.njit import njit
from wakewise.vision.reconstruction.dense.stereo import DepthImage, DepthMap
from wakewise.vision.reconstruction.photos.photo_folder import Image

N = TypeVar("N", bound=np.generic)
AT_ONCE = 250_000
"""Points whose neighbours are searched at once."""


@njit(nogil=True)
def _agree(
    depth: DepthImage,
    wanted: BoolArray,
    camera: Array,
    others: DepthImage,
    places: IntArray,
    cameras: Array,
    relative: Array,
    tolerance_px: float,
) -> tuple[Array, IntArray, IntArray]:
    """Depth averaged over the maps that agree, their number, and the number that sees through the point.

    `camera` is (focal, cx, cy, baseline, R_CW row by row, centre), shape (16,); `cameras` one row per other map, whose
    depths lie in `others` from `places[k, 0]` on, `places[k, 1]` rows of `places[k, 2]` each: a list of arrays costs
    reference counts at every access, which took longer than the geometry. `relative` takes points of this camera's
    frame into the others': rotation row by row and shift, shape (k, 12).
    """
    height, width = depth.shape
    mean = np.zeros((height, width))
    votes = np.zeros((height, width), np.int64)
    against = np.zeros((height, width), np.int64)
    f, cx, cy, base = camera[0], camera[1], camera[2], camera[3]
    columns = np.empty(width, np.int64)
    x, y, z, across, down, away = (
        np.empty(width), np.empty(width), np.empty(width), np.empty(width), np.empty(width), np.empty(width),
    )  # fmt: skip
    total, sum_z = np.empty(width), np.empty(width)
    for v in range(height):
        count = 0
        for u in range(width):
            if wanted[v, u]:
                columns[count] = u
                count += 1
        for i in range(count):
            z[i] = float(depth[v, columns[i]])
            x[i], y[i] = (columns[i] - cx) / f * z[i], (v - cy) / f * z[i]
            total[i] = (f * base / (z[i] * z[i])) ** 2
            sum_z[i] = total[i] * z[i]
        for k in range(len(cameras)):
            focal, ox, oy, start = cameras[k, 0], cameras[k, 1], cameras[k, 2], places[k, 0]
            high, wide, per_focal = places[k, 1], places[k, 2], 1.0 / cameras[k, 0]
            m, t = relative[k, :9], relative[k, 9:]
            # In a short loop over the row, so that several points go through at once.
            for i in range(count):
                zo = m[6] * x[i] + m[7] * y[i] + m[8] * z[i] + t[2]
                scaled = focal / zo
                across[i] = scaled * (m[0] * x[i] + m[1] * y[i] + m[2] * z[i] + t[0]) + ox
                down[i] = scaled * (m[3] * x[i] + m[4] * y[i] + m[5] * z[i] + t[1]) + oy
                away[i] = zo
            for i in range(count):
                if not (away[i] > 0.0 and -0.5 <= across[i] < wide and -0.5 <= down[i] < high):
                    continue
                col, row = int(across[i] + 0.5), int(down[i] + 0.5)
                if row >= high or col >= wide:
                    continue
                seen = float(others[start + row * wide + col])
                if seen <= 0.0:
                    continue
                # What the other map sees there, taken back into this one.
                px, py, pz = (col - ox) * per_focal * seen - t[0], (row - oy) * per_focal * seen - t[1], seen - t[2]
                back = m[2] * px + m[5] * py + m[8] * pz
                if back <= 0.0:
                    continue
                if abs(f * base * (1.0 / back - 1.0 / z[i])) < tolerance_px:
                    bu = f / back * (m[0] * px + m[3] * py + m[6] * pz) + cx - columns[i]
                    bv = f / back * (m[1] * px + m[4] * py + m[7] * pz) + cy - v
                    if bu * bu + bv * bv < 4.0:
                        votes[v, columns[i]] += 1
                        w = (focal * cameras[k, 3] / (seen * seen)) ** 2
                        total[i] += w
                        sum_z[i] += w * back
                        continue
                if focal * cameras[k, 3] * (1.0 / away[i] - 1.0 / seen) > 3.0 * tolerance_px:
                    against[v, columns[i]] += 1  # the other map sees something well behind
        for i in range(count):
            mean[v, columns[i]] = sum_z[i] / total[i]
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


def fuse(
    maps: Mapping[int, DepthMap] | Sequence[DepthMap],
    index: int,
    neighbours: list[int],
    agreeing: int,
    tolerance_px: float,
) -> Array:
    """Points that other maps confirm, shape (n, 9): position, colour (red first, 0 to 1), unit direction to the camera.

    `maps`: depth maps by number: `index` whole, the neighbours with their depths. `neighbours`: which maps may vote;
    the map of the same two photos the other way round is not independent and must not be among them. `agreeing`: votes
    needed; a point is also dropped where more maps see through it than agree.
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
    turns = [maps[k].R_CW @ own.R_CW.T for k in neighbours]
    shifts = [maps[k].R_CW @ (own.p_WC_m - maps[k].p_WC_m) for k in neighbours]
    relative = np.concatenate([np.array(turns).reshape(-1, 9), np.array(shifts)], axis=1)
    mean, votes, against = _agree(own.depth_m, own.wanted, camera, others, places, cameras, relative, tolerance_px)
    return _gather(mean, votes, against, own.wanted, own.colours, camera, agreeing)


def outlier_mask(points_m: Array, neighbours: int = 12, sigmas: float = 2.0, threads: int = 1) -> BoolArray:
    """Which points are outliers: their mean distance to their nearest neighbours is far above the usual.

    R. B. Rusu et al., Towards 3D point cloud based object maps for household environments, Robotics and Autonomous
    Systems 56(11), 2008, doi 10.1016/j.robot.2008.08.005, section 4.1.
    """
    if len(points_m) <= neighbours:
        return np.zeros(len(points_m), dtype=np.bool_)
    tree, distance = KDTree(points_m), np.empty(len(points_m))
    for start in range(0, len(points_m), AT_ONCE):  # all at once would take four times the memory of the points
        some = slice(start, start + AT_ONCE)
        distance[some] = np.asarray(tree.query(points_m[some], neighbours + 1, workers=threads)[0])[:, 1:].mean(axis=1)
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


@njit(nogil=True)
def _slot_of(slots: NDArray[np.int32], cells: IntArray, x: int, y: int, z: int) -> int:
    """Where in the table a cell is, or the free place where it belongs (open addressing, linear probing)."""
    # Large odd multipliers, the upper bits folded down: neighbouring cells land far apart.
    mixed = x * 0x1F1F1F1F1F1F1F1 + y * 0x2E8BA2E8BA2E8BB + z * 0x37ABE8F92C45D2B
    at = (mixed ^ (mixed >> 29)) & (len(slots) - 1)
    while slots[at] >= 0:
        row = slots[at]
        if cells[row, 0] == x and cells[row, 1] == y and cells[row, 2] == z:
            break
        at = (at + 1) & (len(slots) - 1)
    return at


@njit(nogil=True)
def _rehash(slots: NDArray[np.int32], cells: IntArray, used: int) -> None:
    """Enter the cells that are in use into an empty table."""
    for row in range(used):
        slots[_slot_of(slots, cells, cells[row, 0], cells[row, 1], cells[row, 2])] = row


@njit(nogil=True)
def _add(
    slots: NDArray[np.int32],
    cells: IntArray,
    sums: Array,
    counts: IntArray,
    used: int,
    rows: Array,
    weights: IntArray,
    cell_m: float,
) -> int:
    """Add rows, whose first three columns are positions, to their cells; the number of cells afterwards."""
    columns = rows.shape[1]
    for k in range(len(rows)):
        x, y, z = np.floor(rows[k, 0] / cell_m), np.floor(rows[k, 1] / cell_m), np.floor(rows[k, 2] / cell_m)
        at = _slot_of(slots, cells, int(x), int(y), int(z))
        row = slots[at]
        if row < 0:
            row = used
            slots[at] = row
            cells[row, 0], cells[row, 1], cells[row, 2] = int(x), int(y), int(z)
            used += 1
        weight = weights[k] if len(weights) else 1
        counts[row] += weight
        for c in range(columns):
            sums[row, c] += weight * rows[k, c]
    return used


class CellMeans:
    """Running means of rows of numbers by cell; adding in the same order gives the same bytes."""

    def __init__(self, columns: int, cell_m: float) -> None:
        self._cell_m = cell_m
        self._used = 0
        self._cells = np.zeros((0, 3), dtype=np.int64)
        self._sums = np.zeros((0, columns))
        self._counts = np.zeros(0, dtype=np.int64)
        self._slots = np.full(2, -1, dtype=np.int32)

    def add(self, rows: Array, weights: IntArray | None = None) -> None:
        """Add rows, shape (n, columns), that begin with a position; each counts `weights` times, shape (n,)."""
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        self._make_room(self._used + len(rows))
        heavy = np.zeros(0, dtype=np.int64) if weights is None else np.ascontiguousarray(weights, dtype=np.int64)
        self._used = _add(
            self._slots, self._cells, self._sums, self._counts, self._used, rows, heavy, float(self._cell_m)
        )

    def __len__(self) -> int:
        return self._used

    def coarser(self) -> CellMeans:
        """The same rows in cells twice as large; one cell's mean counts as often as it had rows."""
        larger, (mean, count) = CellMeans(self._sums.shape[1], 2.0 * self._cell_m), self.means()
        larger.add(mean, count)
        return larger

    def means(self) -> tuple[Array, IntArray]:
        """Mean row of each cell, shape (m, columns), in order of the cells' places, and how many rows it had."""
        used = self._used
        cells = self._cells[:used]
        order = np.lexsort((cells[:, 2], cells[:, 1], cells[:, 0]))
        count = self._counts[:used][order]
        mean = self._sums[:used][order]
        mean /= count[:, None]
        return mean, count

    def _make_room(self, rows: int) -> None:
        if rows <= len(self._counts):
            return
        size = max(rows, 3 * len(self._counts) // 2)

        def grown(old: NDArray[N]) -> NDArray[N]:
            new = np.zeros((size, *old.shape[1:]), dtype=old.dtype)
            new[: self._used] = old[: self._used]
            return new

        self._cells, self._sums, self._counts = grown(self._cells), grown(self._sums), grown(self._counts)
        table = 1 << int(2 * size).bit_length()
        if table > len(self._slots):
            self._slots = np.full(table, -1, dtype=np.int32)
            _rehash(self._slots, self._cells, self._used)
