"""What a vehicle's geometry allows: its rank and null space in words, achievable wrenches, what a failure takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.vehicle import Vehicle, readable_null_space

WRENCH_AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")

WEAK = 1e-3
"""Singular values below this, relative to the largest, are rounding in a file and not a direction of thrust."""

PURE = 1e-2
"""An axis that lies within this sine of the directions the thrusters can make counts as one of them."""

AnyVehicle = Vehicle | VehicleDraft


@dataclass(frozen=True, kw_only=True, eq=False)
class RemainingAuthority:
    """What is left when one thruster gives nothing.

    `thruster`: number of the thruster that failed, from 1. `rank`: independent wrench components left. `lost`: axes
    that could be made alone before and cannot now. `left_pct`, shape (6, 2): what is left of the achievable wrench
    along each axis, negative and positive; NaN where there was none. None if the thrust limits are not known.
    """

    thruster: int
    rank: int
    lost: tuple[str, ...]
    left_pct: Array | None


@dataclass(frozen=True, kw_only=True, eq=False)
class WrenchDirections:
    """The wrench directions a matrix can make, in coordinates where a moment counts as its force at a mean lever."""

    scale: Array
    basis: Array

    @property
    def rank(self) -> int:
        """Number of independent directions."""
        return int(self.basis.shape[1])

    def holds(self, axis: int) -> bool:
        """Whether the pure axis is one of them."""
        outside = -self.basis @ self.basis[axis]
        outside[axis] += 1.0
        return float(np.linalg.norm(outside)) < PURE


def directions(matrix: Array, scale: Array | None = None, floor: float | None = None) -> WrenchDirections:
    """Find the directions that an allocation matrix, shape (6, n), can make.

    `scale` and `floor` (the smallest singular value that counts) are those of the whole vehicle when `matrix` is what
    a failure left of it.
    """
    if scale is None:
        scale = _lever_scale(matrix)
    if matrix.shape[1] == 0:
        return WrenchDirections(scale=scale, basis=np.zeros((6, 0)))
    U, singular, _ = np.linalg.svd(matrix * scale[:, None], full_matrices=False)
    if floor is None:
        floor = WEAK * float(singular[0])
    return WrenchDirections(scale=scale, basis=U[:, singular > floor])


def allocation_rank(vehicle: AnyVehicle) -> int:
    """Number of independent wrench components that the thrusters can make, 6 if all."""
    return directions(vehicle.allocation_matrix).rank


def failure_rank(vehicle: AnyVehicle) -> list[int]:
    """Rank that is left when each thruster alone fails, one number per thruster."""
    matrix = vehicle.allocation_matrix
    scale, floor = _measure(matrix)
    return [directions(np.delete(matrix, j, axis=1), scale, floor).rank for j in range(matrix.shape[1])]


def thrust_limits_N(vehicle: AnyVehicle) -> tuple[Array, Array] | None:
    """Lowest and highest thrusts, each of shape (n,); None where a draft does not state them all."""
    if isinstance(vehicle, VehicleDraft):
        return vehicle.thrust_limits_N
    return vehicle.thrust_lower_N, vehicle.thrust_upper_N


def achievable_wrench(vehicle: AnyVehicle) -> Array:
    """Largest pure wrench along each axis with every other component zero, within the thrust limits.

    Returns ndarray, shape (6, 2): column 0 is the most negative and column 1 the most positive value, in N and N m.
    Raises StageError if the limits are not known, or the linear program fails.
    """
    limits = thrust_limits_N(vehicle)
    if limits is None:
        raise StageError(f"achievable wrench of {vehicle.name}: its thrust limits are not stated")
    return pure_wrench(vehicle.allocation_matrix, directions(vehicle.allocation_matrix), *limits)


def pure_wrench(matrix: Array, able: WrenchDirections, lower_N: Array, upper_N: Array) -> Array:
    """Largest pure wrench along each axis, shape (6, 2), by a linear program in the directions that exist.

    An axis that is not one of them has zeros.
    """
    n = matrix.shape[1]
    bounds = [*zip(lower_N, upper_N, strict=True), (0.0, None)]
    rows = able.basis.T @ (matrix * able.scale[:, None])
    cost = np.zeros(n + 1)
    cost[n] = -1.0
    result = np.zeros((6, 2))
    for axis in range(6):
        if not able.holds(axis):
            continue
        for column, sign in enumerate((-1.0, 1.0)):
            direction = -sign * able.scale[axis] * able.basis[axis][:, None]
            solved = linprog(cost, A_eq=np.hstack([rows, direction]), b_eq=np.zeros(able.rank), bounds=bounds)
            if solved.x is None or not solved.success:
                raise StageError(f"achievable {WRENCH_AXES[axis]}: linear program failed ({solved.message})")
            result[axis, column] = sign * float(solved.x[n])
    return result


def free_wrench(matrix: Array, lower_N: Array, upper_N: Array) -> Array:
    """Largest wrench along each axis with the other components left to fall as they may, shape (6, 2)."""
    low, high = matrix * lower_N, matrix * upper_N
    return np.stack([np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)], axis=1)


def failures(vehicle: AnyVehicle) -> list[RemainingAuthority]:
    """What is left after each single thruster failure, one record per thruster."""
    matrix, limits = vehicle.allocation_matrix, thrust_limits_N(vehicle)
    scale, floor = _measure(matrix)
    whole = directions(matrix, scale, floor)
    full = None if limits is None else pure_wrench(matrix, whole, *limits)
    found = []
    for j in range(matrix.shape[1]):
        rest = np.delete(matrix, j, axis=1)
        able = directions(rest, scale, floor)
        left = None
        if limits is not None and full is not None:
            kept = pure_wrench(rest, able, *(np.delete(limit, j) for limit in limits))
            left = np.divide(100.0 * kept, full, out=np.full((6, 2), np.nan), where=np.abs(full) > 1e-9)
        lost = tuple(name for i, name in enumerate(WRENCH_AXES) if whole.holds(i) and not able.holds(i))
        found.append(RemainingAuthority(thruster=j + 1, rank=able.rank, lost=lost, left_pct=left))
    return found


def actuation(vehicle: AnyVehicle) -> str:
    """Say in words whether the thrusters can make every wrench, and which axes they cannot make alone."""
    matrix = vehicle.allocation_matrix
    able, n = directions(matrix), matrix.shape[1]
    if able.rank == 6:
        kind = "fully actuated, none to spare" if n == 6 else f"over-actuated by {n - 6}"
        return f"{kind}: {n} thrusters make all six axes, each alone"
    cannot = [name for i, name in enumerate(WRENCH_AXES) if not able.holds(i)]
    return f"under-actuated: {n} thrusters cannot make {', '.join(cannot)} alone"


def effective_null_space(vehicle: AnyVehicle) -> Array:
    """Thrusts that make no wrench beyond rounding in the file, as orthonormal columns, shape (n, k)."""
    matrix = vehicle.allocation_matrix
    scale, floor = _measure(matrix)
    if directions(matrix, scale, floor).rank + vehicle.null_space.shape[1] == matrix.shape[1]:
        return vehicle.null_space
    return readable_null_space(matrix * scale[:, None], WEAK)


def null_space_names(vehicle: AnyVehicle) -> list[str]:
    """Words for the columns of the null space, such as "horizontal squeeze" and "vertical twist".

    Thrusters that push within 45 degrees of the body's z axis count as vertical. A fight that stretches or presses
    the frame (its first moment, the sum of thrust times position times axis, is not zero) is a squeeze; one that only
    warps it is a twist. Two thrusters on one line are an opposed pair; without places there is only a fight. Names
    that would be alike are followed by the numbers of their thrusters.
    """
    basis = effective_null_space(vehicle)
    names = [_fight_name(vehicle, vector) for vector in basis.T]
    return [
        name if names.count(name) == 1 else f"{name} of {_numbers(np.abs(vector) > 1e-6)}"
        for name, vector in zip(names, basis.T, strict=True)
    ]


def null_space_words(vehicle: AnyVehicle) -> list[str]:
    """One plain sentence per column of the null space: which thrusters push which way."""
    said = []
    for vector in effective_null_space(vehicle).T:
        forward, reverse = _numbers(vector > 1e-6), _numbers(vector < -1e-6)
        against = f" against {reverse} in reverse" if reverse else ""
        said.append(f"thrusters {forward} forward{against} make no wrench")
    return said


def _fight_name(vehicle: AnyVehicle, vector: Array) -> str:
    used = np.abs(vector) > 1e-6
    axes = vehicle.allocation_matrix[:3].T
    upright = np.abs(axes[used, 2]) > np.sqrt(0.5) * np.linalg.norm(axes[used], axis=1)
    plane = "vertical" if upright.all() else "mixed" if upright.any() else "horizontal"
    if not vehicle.thrusters:
        return f"{plane} fight"
    positions = np.stack([t.p_BT_m for t in vehicle.thrusters])
    if int(used.sum()) == 2:
        return f"{plane} opposed pair"
    moment = np.einsum("n,ni,nj->ij", vector, positions, axes)
    stress = np.abs(moment + moment.T).max()
    span = float(np.abs(positions[used]).max())
    return f"{plane} {'squeeze' if stress > WEAK * span else 'twist'}"


def _numbers(mask: Array) -> str:
    return ", ".join(str(int(i) + 1) for i in np.flatnonzero(mask))


def _lever_scale(matrix: Array) -> Array:
    """Factors per row that turn moments into forces at the mean lever of the thrusters, shape (6,)."""
    force, moment = np.linalg.norm(matrix[:3]), np.linalg.norm(matrix[3:])
    lever = float(moment / force) if force > 0.0 and moment > 0.0 else 1.0
    return np.array([1.0, 1.0, 1.0, 1.0 / lever, 1.0 / lever, 1.0 / lever])


def _measure(matrix: Array) -> tuple[Array, float]:
    """Row factors, and the smallest singular value that counts as a direction."""
    scale = _lever_scale(matrix)
    return scale, WEAK * float(np.linalg.norm(matrix * scale[:, None], 2))
