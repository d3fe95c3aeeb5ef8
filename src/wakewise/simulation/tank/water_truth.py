"""Ground truth of the water for a trial: speeds, pressure and shear at the target, silt in the camera's view.

It is evaluated at fixed places: on the target's surface, on the bed beside it, in the water round it.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.interfaces import Flow, ScalarGrid, WaterTruth
from wakewise.core.jit.njit import njit
from wakewise.scene.targets import Target
from wakewise.simulation.tank.grains import Swell, beam_attenuation_per_m, friction_velocity_m_s
from wakewise.simulation.tank.sediment import SHEAR_HEIGHT_M, SiltProperties

_BED_HEIGHTS_M = (0.010, 0.015, 0.020)
_BED_POINTS = 90
_WATER_SPACING_M = 0.05


def surface_points(target: Target, count: int, rng: np.random.Generator) -> Array:
    """Points spread over the part of the target above the bed, evenly by area and stratified, shape (count, 3).

    One point is drawn in each of `count` equal shares of the area, faces in the order of the mesh.
    """
    return surface_samples(target, count, rng)[0]


def surface_samples(target: Target, count: int, rng: np.random.Generator) -> tuple[Array, Array, IntArray]:
    """As `surface_points`, with the area vector that each point stands for, outward, (count, 3), and its face."""
    corners = target.mesh.vertices_m[target.mesh.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    # Faces with their middle in the bed are buried, or the foot that stands on it: no water passes there.
    area = np.where(corners.mean(axis=1)[:, 2] < target.bed_z_m - 1e-4, area, 0.0)
    sums = np.cumsum(area)
    picks = (np.arange(count) + rng.uniform(size=count)) / count * sums[-1]
    face = np.minimum(np.searchsorted(sums, picks, side="right"), len(area) - 1)
    a, b = rng.uniform(size=(2, count))
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a), np.where(fold, 1 - b, b)
    one, two, three = (corners[face, k] for k in range(3))
    points: Array = one + a[:, None] * (two - one) + b[:, None] * (three - one)
    points[:, 2] = np.minimum(points[:, 2], target.bed_z_m)
    normals = np.cross(two - one, three - one)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points, float(sums[-1]) / count * normals, face


def bed_points(centre_W_m: Array, bed_z_m: float, radius_m: float) -> Array:
    """Points 1 to 2 cm above the bed, evenly over a disk about the target's foot (sunflower spiral), shape (n, 3)."""
    k = np.arange(_BED_POINTS) + 0.5
    r, turn = radius_m * np.sqrt(k / _BED_POINTS), k * math.pi * (3 - math.sqrt(5))
    height = np.resize(np.array(_BED_HEIGHTS_M), _BED_POINTS)
    return np.stack([centre_W_m[0] + r * np.cos(turn), centre_W_m[1] + r * np.sin(turn), bed_z_m - height], axis=1)


def water_points(target: Target, radius_m: float) -> Array:
    """Nodes of a cubic lattice in the water within a radius of the target's centre, shape (n, 3)."""
    steps = np.arange(-math.floor(radius_m / _WATER_SPACING_M), math.floor(radius_m / _WATER_SPACING_M) + 1)
    x, y = steps * _WATER_SPACING_M, steps * _WATER_SPACING_M
    up = np.arange(math.ceil((radius_m + target.radius_m) / _WATER_SPACING_M)) * _WATER_SPACING_M
    grid = np.stack(np.meshgrid(x, y, up, indexing="ij"), axis=-1).reshape(-1, 3)
    foot = np.array([target.centre_W_m[0], target.centre_W_m[1], target.bed_z_m])
    points = foot + grid * np.array([1.0, 1.0, -1.0])
    near = np.linalg.norm(points - target.centre_W_m, axis=1) <= radius_m
    inside: Array = points[near & (points[:, 2] >= 0.0)]
    return inside


CLOSE_M = 0.3
"""Bed and water within this of the target count as being at it."""
HABITAT_M = 0.2
"""Bed within this of the target's foot, where moving grains bury or scour what grows there."""

FRAME_S = 1 / 30
"""Time between the two pictures that a tracer's way is measured over."""

OVER_M_S = 0.01
"""Excess beyond which a place of the surface counts as washed: a round figure below the currents that targets live in,
2 to 30 cm/s in the worlds of the library."""
STILL_M_S = 1e-4
"""Ambient water slower than this has no speed to be beyond."""

_PROBES = 300
_TRACERS = 60
_RAYS = 60
_RAY_STEPS = 24


class ExcessFlow(Flow, Protocol):
    """Water with its velocity split into ambient flow and the thrusters' part."""

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        ...

    def ambient_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        ...


class TargetProbes:
    """The places where a trial's water is looked at; drawn once, so that all methods are judged at the same ones."""

    def __init__(self, target: Target, rng: np.random.Generator) -> None:
        self._centre = target.centre_W_m
        self._bed_z = target.bed_z_m
        self.surface_W_m = surface_points(target, _PROBES, rng)
        self.bed_W_m = bed_points(target.centre_W_m, target.bed_z_m, CLOSE_M)
        self._floor_W_m = self.bed_W_m * [1.0, 1.0, 0.0] + [0.0, 0.0, target.bed_z_m]
        self._habitat = lengths((self._floor_W_m - target.centre_W_m) * [1.0, 1.0, 0.0]) <= HABITAT_M
        self._water_W_m = water_points(target, CLOSE_M)
        self._all_W_m = np.concatenate([self.surface_W_m, self.bed_W_m, self._floor_W_m])
        self._steady: tuple[ExcessFlow, Array] | None = None  # a water whose ambient motion is steady, and that motion

    def measure(
        self,
        water: ExcessFlow,
        laws: SiltProperties,
        silt: ScalarGrid | None,
        camera_W_m: Array,
        density_kg_m3: float,
        swell: Swell | None = None,
        time_s: float = 0.0,
    ) -> WaterTruth:
        """Look at all of them.

        - `silt`: concentration in kg/m3; None for clear water.
        - `swell`: the wave that is part of the ambient water, at `time_s`.
        - Shapes: `camera_W_m` (3,).
        """
        excess = water.excess_velocity(self._all_W_m)
        ambient = self._ambient_m_s(water)
        n, m = len(self.surface_W_m), len(self.surface_W_m) + len(self.bed_W_m)
        beyond, whole = lengths(excess), excess + ambient
        at_target, at_bed = beyond[:n], beyond[n:m]
        pressure = 0.5 * density_kg_m3 * lengths(whole[:n]) ** 2
        on_bed, swell_Pa = whole[m:] * [1.0, 1.0, 0.0], np.zeros(len(whole) - m)
        if swell is not None:
            floor = self._floor_W_m[:, :2]
            on_bed[:, :2] -= swell.speed_m_s(floor, time_s)[:, None] * swell.ahead
            swell_Pa = swell.stress_Pa(floor, time_s)
        star = friction_velocity_m_s(lengths(on_bed), SHEAR_HEIGHT_M, laws.grain_m)
        stress_Pa = np.hypot(density_kg_m3 * star**2, swell_Pa)
        every = max(n // _TRACERS, 1)
        drift_m_s = float(lengths(ambient[:n]).mean())
        return WaterTruth(
            target_speed_mean_m_s=float(at_target.mean()),
            target_speed_p95_m_s=_p95(at_target),
            bed_speed_p95_m_s=_p95(at_bed),
            turbidity_per_m=self.turbidity_per_m(laws, silt),
            target_pressure_mean_Pa=float(pressure.mean()),
            target_pressure_p95_Pa=_p95(pressure),
            bed_shear_p95_Pa=_p95(stress_Pa),
            tracer_speed_mean_m_s=float(
                tracer_speeds_m_s(water, self.surface_W_m[::every], whole[:n:every], FRAME_S, self._bed_z).mean()
            ),
            ray_optical_depth=self.ray_optical_depth(laws, silt, camera_W_m),
            target_over_1cm_s=float((at_target > OVER_M_S).mean()),
            target_over_ambient=float((at_target > drift_m_s).mean()) if drift_m_s > STILL_M_S else math.nan,
            bed_over_threshold=float((stress_Pa[self._habitat] > laws.threshold_Pa).mean()),
        )

    def _ambient_m_s(self, water: ExcessFlow) -> Array:
        """Velocity without thrusters at all places, shape (n, 3); asked for once of water that says it is steady."""
        if self._steady is None or self._steady[0] is not water:
            velocity = water.ambient_velocity(self._all_W_m)
            if not getattr(water, "steady", False):
                return velocity
            self._steady = water, velocity
        return self._steady[1]

    def turbidity_per_m(self, laws: SiltProperties, silt: ScalarGrid | None) -> float:
        """Mean beam attenuation by silt near the target's centre, 1/m."""
        if silt is None:
            return 0.0
        return _attenuation(laws, float(concentration_at(silt, self._water_W_m).mean()))

    def ray_optical_depth(self, laws: SiltProperties, silt: ScalarGrid | None, camera_W_m: Array) -> float:
        """Line integral of the beam attenuation by silt from the camera to the target, mean over rays."""
        if silt is None:
            return 0.0
        every = max(len(self.surface_W_m) // _RAYS, 1)
        ends = self.surface_W_m[::every]
        facing = (ends - self._centre) @ (camera_W_m - self._centre) > 0.0
        ends = ends[facing] if facing.any() else ends
        return _attenuation(laws, _along_rays(*silt.levels, ends, camera_W_m))


def tracer_speeds_m_s(water: Flow, starts_W_m: Array, velocities_m_s: Array, frame_s: float, bed_z_m: float) -> Array:
    """Distance that tracers go in the flow of this instant over the time of one frame, divided by it, shape (n,).

    The midpoint rule; `velocities_m_s` are those at the starts, both shape (n, 3). A tracer does not enter the bed.
    """
    middle = starts_W_m + 0.5 * frame_s * velocities_m_s
    middle[:, 2] = np.minimum(middle[:, 2], bed_z_m)
    speed: Array = lengths(water.velocity(middle))
    return speed


@njit
def lengths(vectors: Array) -> Array:
    """Lengths, shape (n,), of vectors, shape (n, 3); for few in a seventh of the time of `numpy.linalg.norm`."""
    out = np.empty(vectors.shape[0])
    for i in range(vectors.shape[0]):
        out[i] = math.sqrt(vectors[i, 0] ** 2 + vectors[i, 1] ** 2 + vectors[i, 2] ** 2)
    return out


def concentration_at(silt: ScalarGrid, points_W_m: Array) -> Array:
    """Concentration at the node nearest to each point, shape (n,), of the outer grid outside the inner one."""
    found: Array = _at_nodes(*silt.levels, np.ascontiguousarray(points_W_m))
    return found


@njit
def _at_nodes(
    values: Array, origin: Array, spacing: float, outer: Array, outer_origin: Array, outer_spacing: float, points: Array
) -> Array:
    found = np.empty(points.shape[0])
    for p in range(points.shape[0]):
        found[p] = _at_node(values, origin, spacing, points[p, 0], points[p, 1], points[p, 2])
        if found[p] < 0.0:
            found[p] = max(_at_node(outer, outer_origin, outer_spacing, points[p, 0], points[p, 1], points[p, 2]), 0.0)
    return found


@njit
def _at_node(values: Array, origin: Array, spacing: float, x: float, y: float, z: float) -> float:
    """Value of the node nearest to a place; -1 outside the grid."""
    i, j = round((x - origin[0]) / spacing), round((y - origin[1]) / spacing)
    k = round((z - origin[2]) / spacing)
    if 0 <= i < values.shape[0] and 0 <= j < values.shape[1] and 0 <= k < values.shape[2]:
        return values[i, j, k]
    return -1.0


@njit
def _along_rays(
    values: Array, origin: Array, spacing: float, outer: Array, outer_origin: Array, outer_spacing: float, ends: Array,
    eye: Array,
) -> float:  # fmt: skip
    """Line integral of a field from an eye to places, shape (n, 3), by the midpoint rule; mean over them."""
    total = 0.0
    for r in range(ends.shape[0]):
        dx, dy, dz = ends[r, 0] - eye[0], ends[r, 1] - eye[1], ends[r, 2] - eye[2]
        sum_ = 0.0
        for k in range(_RAY_STEPS):
            s = (k + 0.5) / _RAY_STEPS
            x, y, z = eye[0] + s * dx, eye[1] + s * dy, eye[2] + s * dz
            found = _at_node(values, origin, spacing, x, y, z)
            if found < 0.0:
                found = max(_at_node(outer, outer_origin, outer_spacing, x, y, z), 0.0)
            sum_ += found
        total += sum_ / _RAY_STEPS * np.sqrt(dx * dx + dy * dy + dz * dz)
    return total / ends.shape[0]


def _p95(values: Array) -> float:
    """As `numpy.quantile` at 0.95, whose many rules take longer than a few hundred values."""
    ordered = np.sort(values)
    place = 0.95 * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return float(ordered[below] + (place - below) * (ordered[above] - ordered[below]))


def _attenuation(laws: SiltProperties, amount: float) -> float:
    return float(beam_attenuation_per_m(amount, laws.grain_m, laws.grain_density_kg_m3))
