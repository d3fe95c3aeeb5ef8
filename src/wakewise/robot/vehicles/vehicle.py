"""The vehicle as a frozen record, and what follows from its geometry alone: allocation matrix and null space.

The joint that tilts a camera in its housing: stops, rate, and where the camera is at an angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import finite_number, instance_of
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.thrusters.thrust_curve import ThrustSteps
from wakewise.robot.thrusters.thrust_table import library_curve
from wakewise.robot.thrusters.thruster import Thruster
from wakewise.robot.vehicles.hydrodynamics import DragCase, Hydrodynamics


@dataclass(frozen=True, kw_only=True, eq=False)
class TiltJoint:
    """A hinge about the camera's own right axis.

    A positive angle looks up, as a positive pitch of the body does; at zero the camera is as its mount states it.

    `low_rad`, `high_rad`: the stops. `rate_rad_s`: how fast it turns. `p_BJ_m`, shape (3,): a point of the hinge from
    the body origin; None: it goes through the camera's centre of projection. Raises InputError if the range does not
    hold zero, the rate is not positive, or a number is not finite.
    """

    low_rad: float
    high_rad: float
    rate_rad_s: float
    p_BJ_m: Array | None = None

    def __post_init__(self) -> None:
        for field in ("low_rad", "high_rad", "rate_rad_s"):
            finite_number(getattr(self, field), f"camera_tilt: {field}")
        low, high = math.degrees(self.low_rad), math.degrees(self.high_rad)
        if not -90.0 <= low <= 0.0 <= high <= 90.0 or not low < high:
            raise InputError(f"camera_tilt: range {low:g} to {high:g} deg, must hold 0 and lie within -90 to 90")
        if self.rate_rad_s <= 0.0:
            raise InputError(f"camera_tilt: rate {math.degrees(self.rate_rad_s):g} deg/s, must be finite and above 0")
        if self.p_BJ_m is not None:
            freeze(self, p_BJ_m=(3,))

    def within(self, tilt_rad: float) -> float:
        """The angle nearest to a commanded one between the stops."""
        return min(max(tilt_rad, self.low_rad), self.high_rad)

    def towards(self, tilt_rad: float, desired_rad: float, dt_s: float) -> float:
        """The angle after a time at the joint's rate towards a commanded angle or its stop."""
        way = self.within(desired_rad) - tilt_rad
        return tilt_rad + math.copysign(min(abs(way), self.rate_rad_s * dt_s), way)

    def mount(self, X_BC: Pose, tilt_rad: float) -> Pose:
        """Camera mount at an angle, from that at zero."""
        if tilt_rad == 0.0:
            return X_BC
        c, s = math.cos(tilt_rad), math.sin(tilt_rad)
        R_BC = X_BC.R @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        pivot = X_BC.p_m if self.p_BJ_m is None else self.p_BJ_m
        return Pose.from_matrix(R_BC, pivot + R_BC @ (X_BC.R.T @ (X_BC.p_m - pivot)))

    def slide_m(self, X_BC: Pose, tilt_rad: float) -> Array:
        """How the camera's place in the body changes per radian of tilt, shape (3,)."""
        if self.p_BJ_m is None:
            return np.zeros(3)
        return np.cross(X_BC.R[:, 0], self.mount(X_BC, tilt_rad).p_m - self.p_BJ_m)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where one group of a vehicle's numbers comes from, and whether they are estimates."""

    group: str
    source: str
    estimate: bool

    def __post_init__(self) -> None:
        instance_of(self.group, str, "provenance: group")
        instance_of(self.source, str, "provenance: source")
        instance_of(self.estimate, bool, "provenance: estimate")


@dataclass(frozen=True, kw_only=True)
class CurveChoice:
    """Which thrust table of the package the vehicle's thrusters follow, and at what supply voltage."""

    table: str
    supply_V: float

    def __post_init__(self) -> None:
        instance_of(self.table, str, "thruster_curve: table")
        finite_number(self.supply_V, "thruster_curve: supply_V", above=0.0)


@dataclass(frozen=True, kw_only=True)
class LeastThrust:
    """Thrusts below which a vehicle's thrusters give none, as magnitudes, where no table says so."""

    forward_N: float
    reverse_N: float

    def __post_init__(self) -> None:
        finite_number(self.forward_N, "thruster_least: forward_N", least=0.0)
        finite_number(self.reverse_N, "thruster_least: reverse_N", least=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Vehicle:
    """Parameters of one vehicle; body frame B is FRD.

    `name`, `title`: short name for files, and a name for people. `source`, `does_not_claim`: where the numbers come
    from, and what must not be concluded from them. `size_m`, shape (3,): length, width and height of the box around the
    vehicle, centred on the body origin. `inertia_kg_m2`, shape (3, 3): about the centre of gravity, in the axes of B.
    `p_BG_m`, `p_BB_m`, shape (3,): centre of gravity and centre of buoyancy from the body origin. `X_BC`: camera mount;
    the camera frame has OpenCV axes (x right, y down, z forward). `tilt`: what tilts the camera; None where it is
    fixed. `camera_fov_rad`: horizontal field of view in water. `curve`: table of thrust against pulse width; its least
    thrust and its steps of a microsecond are the thrusters'. `least_thrust`: least thrusts, where no table says so;
    neither: thrust is continuous through zero. `drag_cases`: damping as other sources have it, which the true vehicle
    may have. `provenance`: source of each group of numbers. Raises InputError if a number is not finite, mass or volume
    is not positive, the inertia is not symmetric positive definite, or there are no thrusters or two of one name, or
    there is no such table or voltage.
    """

    name: str
    title: str
    source: str
    does_not_claim: str
    size_m: Array
    mass_kg: float
    inertia_kg_m2: Array
    displaced_volume_m3: float
    p_BG_m: Array
    p_BB_m: Array
    hydrodynamics: Hydrodynamics
    thrusters: tuple[Thruster, ...]
    X_BC: Pose
    tilt: TiltJoint | None = None
    camera_fov_rad: float = math.pi / 2
    curve: CurveChoice | None = None
    least_thrust: LeastThrust | None = None
    drag_cases: tuple[DragCase, ...] = ()
    provenance: tuple[Provenance, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, size_m=(3,), inertia_kg_m2=(3, 3), p_BG_m=(3,), p_BB_m=(3,))
        for field in ("mass_kg", "displaced_volume_m3", "camera_fov_rad"):
            require_positive(field, getattr(self, field))
        require_fov(self.camera_fov_rad)
        require_size(self.size_m)
        require_inertia(self.inertia_kg_m2)
        instance_of(self.X_BC, Pose, "X_BC")
        instance_of(self.hydrodynamics, Hydrodynamics, "hydrodynamics")
        require_kinds(self)
        tuple_of(self.thrusters, Thruster, "thrusters")
        if not self.thrusters:
            raise InputError("thrusters: none, there must be at least one")
        require_different_names([t.name for t in self.thrusters])
        _ = self.thrust_steps

    @cached_property
    def allocation_matrix(self) -> Array:
        """Wrench about the body origin per newton of each thruster, shape (6, n); built from the geometry."""
        return _read_only(np.stack([t.wrench_per_newton_B for t in self.thrusters], axis=1))

    @cached_property
    def thrust_lower_N(self) -> Array:
        """Lowest thrust of each thruster (negative), shape (n,)."""
        return _read_only(np.array([-t.max_reverse_N for t in self.thrusters]))

    @cached_property
    def thrust_upper_N(self) -> Array:
        """Highest thrust of each thruster, shape (n,)."""
        return _read_only(np.array([t.max_forward_N for t in self.thrusters]))

    @cached_property
    def thrust_gains(self) -> Array:
        """Newton delivered per newton commanded, shape (n,); ones unless these are a plant's parameters."""
        return _read_only(np.array([t.gain for t in self.thrusters]))

    @cached_property
    def time_constants_s(self) -> Array:
        """First-order lag of each thruster, shape (n,)."""
        return _read_only(np.array([t.time_constant_s for t in self.thrusters]))

    @cached_property
    def thruster_positions_B_m(self) -> Array:
        """Disk centres from the body origin, shape (n, 3)."""
        return _read_only(np.stack([t.p_BT_m for t in self.thrusters]))

    @cached_property
    def thruster_axes_B(self) -> Array:
        """Unit directions of the force for positive thrust, shape (n, 3)."""
        return _read_only(np.stack([t.axis_B for t in self.thrusters]))

    @cached_property
    def disk_areas_m2(self) -> Array:
        """Swept areas, shape (n,)."""
        return _read_only(np.array([t.disk_area_m2 for t in self.thrusters]))

    @cached_property
    def thrust_steps(self) -> ThrustSteps | None:
        """What each thruster can hold, the same for all; None where thrust is continuous through zero."""
        return thrust_steps(self.curve, self.least_thrust)

    def X_BC_at(self, tilt_rad: float) -> Pose:
        """Camera mount at an angle of the tilt joint; the mount itself where the camera is fixed."""
        return self.X_BC if self.tilt is None else self.tilt.mount(self.X_BC, tilt_rad)

    @property
    def least_thrusts_N(self) -> tuple[float, float]:
        """Smallest thrusts that can be held, forward and reverse, as magnitudes; zeros where there is no gap."""
        steps = self.thrust_steps
        return (0.0, 0.0) if steps is None else (steps.least_forward_N, steps.least_reverse_N)

    def with_ideal_thrusters(self) -> Vehicle:
        """The same vehicle with thrust that is continuous through zero."""
        return replace(self, curve=None, least_thrust=None)

    @cached_property
    def null_space(self) -> Array:
        """Thrusts that make no wrench, as orthonormal columns, shape (n, k); see `readable_null_space`."""
        return _read_only(readable_null_space(self.allocation_matrix))


def thrust_steps(curve: CurveChoice | None, least: LeastThrust | None) -> ThrustSteps | None:
    """What thrusters can hold by their table, else by their stated least thrusts; None where neither is known.

    Raises InputError if there is no such table, it does not hold the voltage, or a least thrust is negative.
    """
    if curve is not None:
        return ThrustSteps.of_curve(library_curve(curve.table), curve.supply_V)
    if least is not None:
        return ThrustSteps(least_forward_N=least.forward_N, least_reverse_N=least.reverse_N)
    return None


def require_kinds(record: Any) -> None:
    """Refuse a vehicle, or a draft of one, whose words, records or lists are something else.

    Raises InputError naming the field.
    """
    for field in ("name", "title", "source", "does_not_claim"):
        instance_of(getattr(record, field), str, field)
    kinds: tuple[tuple[str, type], ...] = (("tilt", TiltJoint), ("curve", CurveChoice), ("least_thrust", LeastThrust))
    for field, kind in kinds:
        if getattr(record, field) is not None:
            instance_of(getattr(record, field), kind, field)
    tuple_of(record.drag_cases, DragCase, "drag_cases")
    tuple_of(record.provenance, Provenance, "provenance")


def tuple_of(value: Any, kind: type, field: str) -> None:
    """Refuse what is no tuple of one kind of record."""
    if not isinstance(value, tuple):
        raise InputError(f"{field}: a {type(value).__name__}, must be a tuple of {kind.__name__}")
    for one in value:
        instance_of(one, kind, field)


def require_positive(field: str, value: float) -> None:
    """Refuse a number that is not finite or not more than 0."""
    finite_number(value, field, above=0.0)


def require_fov(camera_fov_rad: float) -> None:
    """Refuse a field of view that no lens with straight lines has."""
    if not 0.0 < finite_number(camera_fov_rad, "camera_fov_rad") < math.pi:
        raise InputError(f"camera_fov_rad: {camera_fov_rad:g}, must be more than 0 and less than pi")


def require_size(size_m: Array) -> None:
    """Refuse a box, shape (3,), without extent."""
    if np.any(size_m <= 0.0):
        raise InputError(f"size_m: {size_m.tolist()}, every length must be more than 0")


def require_inertia(inertia_kg_m2: Array) -> None:
    """Refuse an inertia, shape (3, 3), that is not symmetric and positive definite."""
    lowest = float(np.linalg.eigvalsh(0.5 * (inertia_kg_m2 + inertia_kg_m2.T))[0])
    tolerance = 1e-9 * float(np.abs(inertia_kg_m2).max())
    if lowest <= 0.0 or not np.allclose(inertia_kg_m2, inertia_kg_m2.T, rtol=0.0, atol=tolerance):
        raise InputError(
            f"inertia_kg_m2: smallest eigenvalue {lowest:g}, the matrix must be symmetric and positive definite"
        )


def require_different_names(names: list[str]) -> None:
    """Refuse thrusters that share a name."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"thrusters: {', '.join(twice)} named more than once, names must differ")


def readable_null_space(matrix: Array, tolerance: float = 1e-9) -> Array:
    """Orthonormal basis of the null space of a matrix, shape (m, n), with as many exact zeros as reduction finds.

    The singular vectors give the space; its reduced echelon form gives vectors that a person can read, such as four
    horizontal thrusters alone; Gram-Schmidt then makes them orthonormal (and leaves vectors that share no thruster as
    they are). In each column the first entry that is not zero is positive.

    Returns ndarray, shape (n, k).
    """
    _, singular, Vt = np.linalg.svd(matrix, full_matrices=True)
    rank = int(np.sum(singular > tolerance * max(1.0, float(singular[0]))))
    rows = Vt[rank:].copy()
    k, n = rows.shape
    done = 0
    for column in range(n):
        if done == k:
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[pivot, column]) < 1e-7:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(k) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    # The sparsest first, since orthogonalising one vector against another fills it up.
    rows = rows[np.argsort(np.sum(np.abs(rows) > 1e-9, axis=1), kind="stable")]
    basis = np.zeros((n, k))
    for i in range(k):
        vector = rows[i] - basis[:, :i] @ (basis[:, :i].T @ rows[i])
        vector = vector / np.linalg.norm(vector)
        vector[np.abs(vector) < 1e-12] = 0.0
        first = vector[np.flatnonzero(vector)[0]]
        basis[:, i] = vector * np.sign(first)
    return basis


def _read_only(array: Array) -> Array:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
