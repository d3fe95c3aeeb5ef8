"""Stated matrices and mixers, compared with the allocation matrix that the geometry gives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.robot.vehicles.check import WRENCH_AXES, AnyVehicle

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

ARDUSUB_VECTORED = np.array(
    [
        [0, 0, 1, 0, -1, 1],
        [0, 0, -1, 0, -1, -1],
        [0, 0, -1, 0, 1, 1],
        [0, 0, 1, 0, 1, -1],
        [1, 0, 0, -1, 0, 0],
        [-1, 0, 0, -1, 0, 0],
    ],
    dtype=np.float64,
)
"""Motor factors of ArduSub's frame vectored, in the same columns."""

ARDUSUB_FRAMES = {8: ("vectored_6dof", ARDUSUB_VECTORED_6DOF), 6: ("vectored", ARDUSUB_VECTORED)}

ROUNDING = 1e-3
"""Entries that differ by less than this, relative to the largest of their row, agree."""

_PARASITIC = 1e-3
"""Share of a command from which a side effect is reported."""

FLU = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Signs that turn the rows of a matrix between x forward, y left, z up and x forward, y right, z down."""


@dataclass(frozen=True, kw_only=True)
class MatrixDisagreement:
    """One entry of a stated matrix that the geometry does not bear out.

    `stated` and `geometry` are values of an allocation matrix (N/N, N m/N), or signs where only signs were stated.
    """

    row: str
    thruster: int
    name: str
    stated: float
    geometry: float
    fault: str

    @property
    def reversed(self) -> bool:
        """Whether the signs are opposite."""
        return self.stated * self.geometry < 0.0

    @property
    def text(self) -> str:
        """One line for people."""
        who = str(self.thruster) if self.name == str(self.thruster) else f"{self.thruster} ({self.name})"
        return (
            f"row {self.row}, thruster {who}: file says {self.stated:+.4g}, geometry says {self.geometry:+.4g}, "
            f"{self.fault}"
        )


@dataclass(frozen=True, kw_only=True)
class MatrixComparison:
    """A stated matrix against the geometry: how many entries were compared, which disagree, and what explains it.

    `commands` says what else each single command makes with this geometry, one line per command.
    """

    stated_by: str
    compared: int
    disagreements: tuple[MatrixDisagreement, ...]
    notes: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()

    @property
    def agree(self) -> int:
        """Number of entries that agree."""
        return self.compared - len(self.disagreements)


def factors_as_wrench(factors: Array) -> Array:
    """Turn ArduSub's motor factors, shape (n, 6), into signs of an allocation matrix, shape (6, n)."""
    roll, pitch, yaw, throttle, forward, lateral = np.asarray(factors, dtype=np.float64).T
    return np.stack([forward, lateral, -throttle, roll, pitch, yaw])


def mixing_disagreements(vehicle: AnyVehicle, factors: Array, height_m: float = 0.0) -> list[MatrixDisagreement]:
    """Compare a mixer's signs, ArduSub's columns, shape (n, 6), with the allocation matrix built from the geometry.

    `height_m` is the z coordinate of the point about which moments are taken.

    Raises InputError if the mixer does not have one row per thruster.
    """
    n = vehicle.allocation_matrix.shape[1]
    if np.shape(factors) != (n, 6):
        raise InputError(f"motor factors: shape {np.shape(factors)}, allowed ({n}, 6), a row per thruster")
    return _entries(vehicle, np.sign(factors_as_wrench(factors)), _signs(vehicle, height_m), np.full(6, 0.5))


def compare_with_ardusub(vehicle: AnyVehicle) -> MatrixComparison:
    """Compare with the signs of ArduSub's vectored frame that has as many motors; see `compare_signs`.

    Raises InputError if ArduSub has no vectored frame with as many motors.
    """
    n = vehicle.allocation_matrix.shape[1]
    if n not in ARDUSUB_FRAMES:
        known = " or ".join(map(str, sorted(ARDUSUB_FRAMES)))
        raise InputError(f"ArduSub's vectored frames have {known} motors, vehicle {vehicle.name} has {n} thrusters")
    frame, factors = ARDUSUB_FRAMES[n]
    return compare_signs(vehicle, factors_as_wrench(factors), f"ArduSub, frame {frame} (signs)")


def compare_signs(vehicle: AnyVehicle, stated: Array, stated_by: str) -> MatrixComparison:
    """Compare the signs of a stated mixer, shape (6, n), FRD, with moments about the height of horizontal thrusters.

    Motor factors such as ArduSub's give horizontal thrusters no roll or pitch, that is, they take them as level with
    the point that the vehicle turns about. Where they sit above or below the origin, the notes say which zeros are
    zeros only about that height.

    Raises InputError if the shape differs from that of the matrix built from the geometry.
    """
    _require_shape(vehicle, stated, stated_by)
    stated, height_m = np.sign(stated), _horizontal_height(vehicle)
    at_origin = _entries(vehicle, stated, _signs(vehicle, 0.0), np.full(6, 0.5))
    found = _entries(vehicle, stated, _signs(vehicle, height_m), np.full(6, 0.5))
    notes = []
    if at_origin and not found:
        where = "below" if height_m > 0.0 else "above"
        notes.append(
            f"moments are taken {abs(1000.0 * height_m):.0f} mm {where} the origin, level with the horizontal "
            f"thrusters, as motor factors imply; about the origin {len(at_origin)} zeros of the mixer would be small "
            f"couplings: {_summary(at_origin)}"
        )
    notes += _explanations(stated, _signs(vehicle, height_m), found)
    return MatrixComparison(
        stated_by=stated_by,
        compared=stated.size,
        disagreements=tuple(found),
        notes=tuple(notes),
        commands=command_effects(vehicle, stated.T),
    )


def compare_matrix(vehicle: AnyVehicle, stated: Array, stated_by: str) -> MatrixComparison:
    """Compare a stated allocation matrix, shape (6, n), FRD, moments about the origin, entry by entry.

    Raises InputError if the shape differs from that of the matrix built from the geometry.
    """
    _require_shape(vehicle, stated, stated_by)
    matrix = vehicle.allocation_matrix
    found = _entries(vehicle, stated, matrix, _tolerance(stated, matrix)[:, 0])
    return MatrixComparison(
        stated_by=stated_by,
        compared=stated.size,
        disagreements=tuple(found),
        notes=tuple(_explanations(stated, matrix, found)),
        commands=command_effects(vehicle, np.asarray(np.linalg.pinv(stated), dtype=np.float64)),
    )


def command_effects(vehicle: AnyVehicle, thrusts: Array) -> tuple[str, ...]:
    """What each single command of a mixer makes beside its own axis with this geometry, in % of what it is to make.

    `thrusts`, shape (n, 6): thrusts of each command, a column for each of surge, sway, heave, roll, pitch, yaw. Returns
    a line for each command with side effects of at least 0.1 %: forces in N and moments in N m about the centre of
    gravity (the origin where it is not known), per N or N m of the commanded axis.
    """
    centre, where = vehicle.p_BG_m, "the centre of gravity"
    if centre is None:
        centre, where = np.zeros(3), "the origin, as the centre of gravity is not known"
    made = moments_about(vehicle.allocation_matrix, centre) @ thrusts
    lines = []
    for i, axis in enumerate(WRENCH_AXES):
        if abs(made[i, i]) < 1e-9:
            continue
        shares = made[:, i] / made[i, i]
        beside = [j for j in range(6) if j != i and abs(shares[j]) >= _PARASITIC]
        if beside:
            said = ", ".join(f"{WRENCH_AXES[j]} {100.0 * shares[j]:+.1f} %" for j in beside)
            unit = "N" if i < 3 else "N m"
            lines.append(f"{axis} alone also makes {said} (N or N m per {unit} of {axis}, moments about {where})")
    return tuple(lines)


def compare_either_frame(vehicle: AnyVehicle, stated: Array, stated_by: str) -> MatrixComparison:
    """Compare a matrix whose frame is not sure: as it is, or turned between z up and z down if that agrees better."""
    plain = compare_matrix(vehicle, stated, stated_by)
    turned = compare_matrix(vehicle, stated * FLU[:, None], stated_by)
    if len(turned.disagreements) >= len(plain.disagreements):
        return plain
    note = (
        f"turned between y left, z up and y right, z down, since so {turned.agree} of {turned.compared} entries agree "
        f"and otherwise {plain.agree}"
    )
    return replace(turned, notes=(note, *turned.notes))


def moments_about(matrix: Array, point_B_m: Array) -> Array:
    """Allocation matrix with moments taken about another point of the body, shape (6, n)."""
    moved = matrix.copy()
    moved[3:] -= np.cross(point_B_m, matrix[:3].T).T
    return moved


def _require_shape(vehicle: AnyVehicle, stated: Array, stated_by: str) -> None:
    wanted = vehicle.allocation_matrix.shape
    if stated.shape != wanted:
        raise InputError(f"{stated_by}: shape {stated.shape}, allowed {wanted}, six rows and a column per thruster")


def _signs(vehicle: AnyVehicle, height_m: float) -> Array:
    """Signs of the geometry's matrix with moments about the point at z = `height_m`, zero where it is rounding."""
    matrix = moments_about(vehicle.allocation_matrix, np.array([0.0, 0.0, height_m]))
    return np.where(np.abs(matrix) > _tolerance(matrix, matrix), np.sign(matrix), 0.0)


def _horizontal_height(vehicle: AnyVehicle) -> float:
    flat = [float(t.p_BT_m[2]) for t in vehicle.thrusters if abs(float(t.axis_B[2])) < np.sqrt(0.5)]
    return float(np.mean(flat)) if flat else 0.0


def _tolerance(a: Array, b: Array) -> Array:
    largest = np.maximum(np.abs(a).max(axis=1), np.abs(b).max(axis=1))
    # A row that is all but empty is measured by the others of its kind, or rounding would fill it.
    floor = np.repeat([largest[:3].max(), largest[3:].max()], 3)
    return np.array(ROUNDING * np.maximum(largest, floor))[:, None]


def _entries(vehicle: AnyVehicle, stated: Array, geometry: Array, tolerance: Array) -> list[MatrixDisagreement]:
    names = [t.name for t in vehicle.thrusters] or [str(j + 1) for j in range(stated.shape[1])]
    found = []
    for j in range(stated.shape[1]):
        for i in range(6):
            said, built = float(stated[i, j]), float(geometry[i, j])
            if abs(said - built) <= tolerance[i]:
                continue
            if abs(said) <= tolerance[i]:
                fault = "left out"
            elif abs(built) <= tolerance[i]:
                fault = "not in the geometry"
            elif said * built < 0.0:
                fault = "sign wrong"
            else:
                fault = f"off by {100.0 * (said / built - 1.0):+.1f} %"
            found.append(
                MatrixDisagreement(
                    row=WRENCH_AXES[i], thruster=j + 1, name=names[j], stated=said, geometry=built, fault=fault
                )
            )
    return found


def _explanations(stated: Array, geometry: Array, found: list[MatrixDisagreement]) -> list[str]:
    """What one cause would explain disagreements: reversed thrusters, another order, another reference point."""
    if not found:
        return []
    notes = []
    tolerance = _tolerance(stated, geometry)
    for j in range(stated.shape[1]):
        wrong = np.abs(stated[:, j] - geometry[:, j]) > tolerance[:, 0]
        if wrong.any() and np.all(np.abs(stated[:, j] + geometry[:, j]) <= tolerance[:, 0]):
            notes.append(
                f"thruster {j + 1}: the whole column has the opposite sign, so its positive thrust is the other way"
            )
    order = _best_order(stated, geometry)
    left = _count(stated[:, order], geometry, tolerance)
    if left < len(found) and not np.array_equal(order, np.arange(order.size)):
        said = ", ".join(str(int(i) + 1) for i in order)
        notes.append(f"with the file's columns in the order {said} only {left} entries disagree")
    point = _best_point(stated, geometry)
    left = _count(stated, moments_about(geometry, point), tolerance)
    if left < len(found):
        place = ", ".join(f"{value:.3f}" for value in point + 0.0)
        notes.append(f"with moments taken about ({place}) m only {left} entries disagree")
    return notes


def _count(stated: Array, geometry: Array, tolerance: Array) -> int:
    return int(np.sum(np.abs(stated - geometry) > tolerance))


def _best_order(stated: Array, geometry: Array) -> IntArray:
    cost = np.abs(stated[:, :, None] - geometry[:, None, :]).sum(axis=0)
    rows, columns = linear_sum_assignment(cost.T)
    order = np.empty(rows.size, dtype=np.int64)
    order[rows] = columns
    return order


def _best_point(stated: Array, geometry: Array) -> Array:
    """Reference point that brings the geometry's moments nearest to the stated ones (least squares), shape (3,)."""
    forces = geometry[:3].T
    # stated = geometry - point x force = geometry + [force]x point
    rows = np.concatenate([np.array([[0.0, -f[2], f[1]], [f[2], 0.0, -f[0]], [-f[1], f[0], 0.0]]) for f in forces])
    point, *_ = np.linalg.lstsq(rows, (stated[3:] - geometry[3:]).T.ravel(), rcond=None)
    return np.asarray(point)


def _summary(found: list[MatrixDisagreement]) -> str:
    rows = sorted({d.row for d in found}, key=WRENCH_AXES.index)
    thrusters = sorted({d.thruster for d in found})
    return f"{' and '.join(rows)} of thrusters {', '.join(map(str, thrusters))}"
