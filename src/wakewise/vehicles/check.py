"""What a vehicle's geometry allows: achievable wrenches, what is left after a failure, and other people's mixers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from wakewise.arrays import Array
from wakewise.errors import InputError, StageError
from wakewise.vehicles.vehicle import Vehicle

WRENCH_AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")

ARDUSUB_VECTORED_6DOF = np.array(
    [
        [0, 0, 1, 0, -1, 1],
        [0, 0, -1, 0, -1, -1],
        [0, 0, -1, 0, 1, 1],
        [0, 0, 1, 0, 1, -1],
        [1, -1, 0, -1, 0, 0],
        [-1, -1, 0, -1, 0, 0],
        [1, 1, 0, -1, 0, 0],
        [-1, 1, 0, -1, 0, 0],
    ],
    dtype=np.float64,
)
"""Motor factors of ArduSub's frame vectored_6dof (ArduPilot, AP_Motors6DOF): a row per motor, columns roll, pitch,
yaw, throttle (up), forward, lateral (right)."""


@dataclass(frozen=True, kw_only=True)
class MixingDisagreement:
    """One entry of a stated mixer whose sign is not what the geometry gives."""

    thruster: str
    axis: str
    stated: int
    geometry: int

    @property
    def reversed(self) -> bool:
        """Whether the signs are opposite; otherwise one of them is zero, that is, a coupling is left out."""
        return self.stated * self.geometry < 0


def factors_as_wrench(factors: Array) -> Array:
    """Turn ArduSub's motor factors, shape (n, 6), into signs of an allocation matrix, shape (6, n)."""
    roll, pitch, yaw, throttle, forward, lateral = np.asarray(factors, dtype=np.float64).T
    return np.stack([forward, lateral, -throttle, roll, pitch, yaw])


def mixing_disagreements(vehicle: Vehicle, factors: Array, tolerance: float = 1e-6) -> list[MixingDisagreement]:
    """Compare a mixer's signs, ArduSub's columns, shape (n, 6), with the allocation matrix built from the geometry.

    Raises
    ------
    InputError
        If the mixer does not have one row per thruster.
    """
    n = len(vehicle.thrusters)
    if np.shape(factors) != (n, 6):
        raise InputError(f"motor factors: shape {np.shape(factors)}, allowed ({n}, 6), a row per thruster")
    stated = np.sign(factors_as_wrench(factors)).astype(int)
    matrix = vehicle.allocation_matrix
    geometry = np.where(np.abs(matrix) > tolerance, np.sign(matrix), 0.0).astype(int)
    return [
        MixingDisagreement(
            thruster=vehicle.thrusters[j].name,
            axis=WRENCH_AXES[i],
            stated=int(stated[i, j]),
            geometry=int(geometry[i, j]),
        )
        for j in range(n)
        for i in range(6)
        if stated[i, j] != geometry[i, j]
    ]


def allocation_rank(vehicle: Vehicle) -> int:
    """Number of independent wrench components that the thrusters can make, 6 if all."""
    return int(np.linalg.matrix_rank(vehicle.allocation_matrix, tol=1e-9))


def failure_rank(vehicle: Vehicle) -> list[int]:
    """Rank that is left when each thruster alone fails, one number per thruster."""
    matrix = vehicle.allocation_matrix
    return [
        int(np.linalg.matrix_rank(np.delete(matrix, j, axis=1), tol=1e-9)) if matrix.shape[1] > 1 else 0
        for j in range(matrix.shape[1])
    ]


def achievable_wrench(vehicle: Vehicle) -> Array:
    """Largest pure wrench along each axis with every other component zero, within the thrust limits.

    Returns
    -------
    ndarray, shape (6, 2)
        Column 0 is the most negative and column 1 the most positive value, in N and N m.
    """
    matrix = vehicle.allocation_matrix
    n = matrix.shape[1]
    bounds = [*zip(vehicle.thrust_lower_N, vehicle.thrust_upper_N, strict=True), (0.0, None)]
    cost = np.zeros(n + 1)
    cost[n] = -1.0
    result = np.zeros((6, 2))
    for axis in range(6):
        for column, sign in enumerate((-1.0, 1.0)):
            direction = np.zeros((6, 1))
            direction[axis] = -sign
            solved = linprog(cost, A_eq=np.hstack([matrix, direction]), b_eq=np.zeros(6), bounds=bounds)
            if solved.x is None or not solved.success:
                raise StageError(f"achievable {WRENCH_AXES[axis]}: linear program failed ({solved.message})")
            result[axis, column] = sign * float(solved.x[n])
    return result


def null_space_names(vehicle: Vehicle) -> list[str]:
    """Words for the columns of `Vehicle.null_space`, such as "horizontal squeeze" and "vertical twist".

    Thrusters that push within 45 degrees of the body's z axis count as vertical. A fight that stretches or presses
    the frame (its first moment, the sum of thrust times position times axis, is not zero) is a squeeze; one that only
    warps it is a twist.
    """
    names = []
    positions, axes = vehicle.thruster_positions_B_m, vehicle.thruster_axes_B
    for vector in vehicle.null_space.T:
        used = np.abs(vector) > 1e-9
        upright = np.abs(axes[used, 2]) > np.sqrt(0.5)
        plane = "vertical" if upright.all() else "mixed" if upright.any() else "horizontal"
        moment = np.einsum("n,ni,nj->ij", vector, positions, axes)
        stress = np.abs(moment + moment.T).max()
        span = float(np.abs(positions[used]).max())
        names.append(f"{plane} {'squeeze' if stress > 1e-6 * span else 'twist'}")
    return names
