"""What is to be spared at sea: points, or a ball that stands for a target of which only the place is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.scene.targets import Mesh, Region, Target

BALL_M = 0.25


def ball(middle_W_m: Array, radius_m: float) -> Target:
    """A ball that stands for a target of which only the place is known, on a bed that it touches."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    corners = np.array([[s, t * golden, 0.0] for s in (-1.0, 1.0) for t in (-1.0, 1.0)])
    corners = np.vstack([np.roll(corners, k, axis=1) for k in range(3)])
    for _ in range(2):  # halve the edges of the icosahedron twice
        hull = ConvexHull(corners)
        edges = {tuple(sorted(pair)) for f in hull.simplices for pair in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
        middles = np.array([corners[a] + corners[b] for a, b in sorted(edges)])
        corners = np.vstack([corners, middles]) / np.linalg.norm(np.vstack([corners, middles]), axis=1)[:, None]
    hull = ConvexHull(corners)
    faces = hull.simplices.astype(np.int64)
    p0, p1, p2 = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(p1 - p0, p2 - p0), p0) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Target(
        name="ball",
        mesh=Mesh(middle_W_m + radius_m * corners, faces),
        centre_W_m=middle_W_m,
        radius_m=radius_m,
        bed_z_m=float(middle_W_m[2]) + radius_m,
    )


def ball_points(middle_W_m: Array, radius_m: float) -> Region:
    """Fifteen points of a ball, of one weight each: its middle, and an octahedron and a cube on its surface."""
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) / math.sqrt(3.0)
    points = middle_W_m + radius_m * np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3), cube])
    return Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ProtectedRegion:
    """Where the target is: a place in the autopilot's frame, or so far ahead of the bow as the session begins.

    Parameters
    ----------
    place_W_m : ndarray, shape (3,), or None
        North, east, down from the autopilot's origin.
    ahead_m : float
        From the front of the vehicle's box, where no place is given.
    points : Region or None
        In the vehicle's level frame as the session begins, in place of a ball's.
    """

    place_W_m: Array | None = None
    ahead_m: float = 0.4
    points: Region | None = None

    def found(self, start: BodyState, length_m: float, camera_z_m: float) -> tuple[Array, float, Region]:
        """Middle and radius in W, and the points that stand for its water."""
        level = Pose(start.X_WB.p_m, quat_from_euler(0.0, 0.0, float(euler_from_quat(start.X_WB.q)[2])))
        if self.points is not None:
            places = level.apply(self.points.points_W_m)
            middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
            radius = max(float(np.linalg.norm(places - middle, axis=1).max()), 0.01)
            spared = Region(points_W_m=places, weights=self.points.weights, distance_m=self.points.distance_m)
            return middle, radius, spared
        if self.place_W_m is not None:
            return self.place_W_m, BALL_M, ball_points(self.place_W_m, BALL_M)
        radius = min(BALL_M, 0.5 * self.ahead_m)
        middle = level.apply(np.array([0.5 * length_m + self.ahead_m, 0.0, camera_z_m]))
        return middle, radius, ball_points(middle, radius)
