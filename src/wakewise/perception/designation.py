"""Which body is the target: the one in a designated box, else the one nearest to the middle of the picture.

Before its points are mapped, a ball stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.geometry import Pose
from wakewise.perception.bed_plane import BedPlane
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.point_map import ray_directions
from wakewise.perception.settings import DISTANCE_STD, PerceptionSettings
from wakewise.perception.target_shape import TargetShape, ball

BOX_MARGIN = 0.15
"""A point counts as in the box up to this share of its size outside."""
STAYS, STAYS_M = 1.5, 0.03
"""The target of before is the body within so many radii, and that more, of its centre."""
SIZE_WEIGHT = 0.2
"""Slope off the axis that is forgiven to the largest body over the smallest: a stone may lie nearer to the middle."""
NEAREST_M = 0.05
LEAST_RADIUS_M = 0.02
FARTHEST = 2.0
"""The bed is taken for the target's place up to so many times the stated distance."""
SAME_BALL = 0.05
"""An assumed ball that moves or grows by less than this share of its distance is the same one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Designation:
    """A box of a picture, (left, top, right, bottom) in px of `width`; camera pose and time when it was drawn."""

    box: tuple[float, float, float, float]
    width: int
    X_WC: Pose | None = None
    since_s: float = math.inf

    def scaled(self, width: int) -> tuple[float, float, float, float]:
        """The box in px of a picture of another width."""
        left, top, right, bottom = (width / self.width * edge for edge in self.box)
        return left, top, right, bottom


@dataclass(frozen=True, kw_only=True, eq=False)
class RefusedPlace:
    """A ball, centre of shape (3,), in which the operator refused a proposed body."""

    centre_W_m: Array
    radius_m: float


def choose_body(
    places_W_m: Array,
    groups: Sequence[IntArray],
    shape: TargetShape | None,
    designation: Designation | None,
    camera: CalibratedCamera,
    X_WC: Pose,
    least: int,
    refused: Sequence[RefusedPlace] = (),
) -> IntArray | None:
    """The target among bodies; None if none is it.

    - `places_W_m`, shape (n, 3), and `groups`: points of the map, and the indices of those of each body.
    - `shape`: of the target until now; it stays the same body.
    - `least`: a designated box must hold as many points of a body.
    - `refused`: bodies whose middles lie there, or `STAYS_M` beyond, are left out.
    """
    groups = [group for group in groups if not _was_refused(places_W_m[group].mean(axis=0), refused)]
    if not groups:
        return None
    middles = np.array([places_W_m[group].mean(axis=0) for group in groups])
    if shape is not None and shape.seen:
        away = np.linalg.norm(middles - shape.centre_W_m, axis=1)
        k = int(np.argmin(away))
        return groups[k] if away[k] < STAYS * shape.radius_m + STAYS_M else None
    if designation is not None and designation.X_WC is not None:
        inside = [points_in_box(places_W_m[group], designation, camera) for group in groups]
        k = int(np.argmax(inside))
        return groups[k] if inside[k] >= least else None
    p_C = (middles - X_WC.p_m) @ X_WC.R
    ahead = p_C[:, 2] > NEAREST_M
    off_axis = np.linalg.norm(p_C[:, :2], axis=1) / np.maximum(p_C[:, 2], 1e-6)
    size = np.array([len(group) for group in groups])
    k = int(np.argmin(np.where(ahead, off_axis + SIZE_WEIGHT * (1.0 - size / size.max()), np.inf)))
    return groups[k] if ahead[k] else None


def _was_refused(middle_W_m: Array, refused: Sequence[RefusedPlace]) -> bool:
    return any(np.linalg.norm(middle_W_m - place.centre_W_m) < place.radius_m + STAYS_M for place in refused)


def points_in_box(points_W_m: Array, designation: Designation, camera: CalibratedCamera) -> int:
    """How many points, shape (n, 3), lie in the designated box, seen from where it was drawn."""
    assert designation.X_WC is not None
    left, top, right, bottom = designation.scaled(camera.width)
    wide, high = BOX_MARGIN * (right - left), BOX_MARGIN * (bottom - top)
    u, v = camera.pixels((points_W_m - designation.X_WC.p_m) @ designation.X_WC.R).T
    return int(np.sum((u > left - wide) & (u < right + wide) & (v > top - high) & (v < bottom + high)))


def assumed_ball(
    camera: CalibratedCamera,
    settings: PerceptionSettings,
    designation: Designation | None,
    bed: BedPlane | None,
    X_WC: Pose,
) -> TargetShape:
    """A ball at the stated distance along the ray of the box or the picture's middle, or where that meets the bed."""
    middle, half = np.array([[0.5 * camera.width, 0.5 * camera.height]]), None
    if designation is not None and designation.X_WC is not None:
        left, top, right, bottom = designation.scaled(camera.width)
        middle = np.array([[0.5 * (left + right), 0.5 * (top + bottom)]])
        half = 0.5 * max(right - left, bottom - top) / camera.focal_px
        X_WC = designation.X_WC
    way = ray_directions(camera.slopes(middle), X_WC)[0]
    distance = settings.assumed_distance_m
    if bed is not None and (hit := bed.hit(X_WC.p_m, way)) is not None:
        distance = min(float(np.linalg.norm(hit - X_WC.p_m)), FARTHEST * distance)
    radius = settings.assumed_radius_m if half is None else max(half * distance, LEAST_RADIUS_M)
    return ball(X_WC.p_m + distance * way, radius, DISTANCE_STD * distance)


def same_ball(before: TargetShape, now: TargetShape) -> bool:
    """Whether an assumed ball has hardly moved or grown; false where the shape of before was seen."""
    moved = float(np.linalg.norm(now.centre_W_m - before.centre_W_m)) + abs(now.radius_m - before.radius_m)
    distance_m = math.sqrt(float(now.covariance[0, 0])) / DISTANCE_STD
    return not before.seen and moved < SAME_BALL * distance_m
