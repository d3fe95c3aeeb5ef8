"""A vehicle in plain words and numbers, ready for JSON: what it is, what its thrusters can do, what its file lacks.

The parameters of a vehicle as rows for people: value, unit, source, and whether it is an estimate or missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.robot.vehicles.check import (
    WRENCH_AXES,
    AnyVehicle,
    actuation,
    allocation_rank,
    directions,
    effective_null_space,
    failures,
    free_wrench,
    null_space_names,
    null_space_words,
    pure_wrench,
)
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.hydrodynamics import DragCase
from wakewise.robot.vehicles.mixing import ARDUSUB_FRAMES, MatrixComparison, compare_matrix, compare_with_ardusub
from wakewise.robot.vehicles.vehicle import Vehicle, thrust_steps


def check_report(vehicle: AnyVehicle, comparison: MatrixComparison | None = None) -> dict[str, Any]:
    """Say what the geometry allows, what each failure takes, and where a stated matrix disagrees.

    Without a `comparison` the matrix that the vehicle's own file ships is compared, if it ships one beside its
    geometry; else the signs of ArduSub's frame, if they agree throughout.
    """
    draft = as_draft(vehicle)
    matrix, limits = draft.allocation_matrix, draft.thrust_limits_N
    able = directions(matrix)
    why: dict[str, str] = {}
    wrench: dict[str, Any] | None = None
    if limits is None:
        why["achievable_wrench"] = "the thrust limits are not stated"
    else:
        pure, free = pure_wrench(matrix, able, *limits), free_wrench(matrix, *limits)
        wrench = {
            axis: {
                "unit": "N" if i < 3 else "N m",
                "lowest": float(pure[i, 0]),
                "highest": float(pure[i, 1]),
                "lowest_others_free": float(free[i, 0]),
                "highest_others_free": float(free[i, 1]),
            }
            for i, axis in enumerate(WRENCH_AXES)
        }
    lost = failures(draft)
    found = comparison or _own_comparison(draft)
    return {
        "name": draft.name,
        "title": draft.title,
        "thrusters": matrix.shape[1],
        "thruster_names": list(draft.thruster_names),
        "rank": able.rank,
        "under_actuated": able.rank < 6,
        "actuation": actuation(draft),
        "null_space": _null_space(draft),
        "achievable_wrench": wrench,
        "failure_rank": [f.rank for f in lost],
        "failures": [
            {
                "thruster": f.thruster,
                "name": draft.thruster_names[f.thruster - 1],
                "rank": f.rank,
                "lost": list(f.lost),
                "left_pct": None if f.left_pct is None else _percentages(f.left_pct),
                "words": _failure_words(f.lost, f.left_pct),
            }
            for f in lost
        ],
        "mixing_disagreements": [{**asdict(d), "text": d.text} for d in (found.disagreements if found else ())],
        "mixing": None
        if found is None
        else {
            "stated_by": found.stated_by,
            "compared": found.compared,
            "agree": found.agree,
            "notes": list(found.notes),
            "commands": list(found.commands),
        },
        "missing": list(draft.missing),
        "notes": list(draft.notes),
        "why": why,
    }


def describe(vehicle: AnyVehicle) -> dict[str, Any]:
    """Say what a vehicle is and can do: thrusters, rank, null space, limits, achievable wrench, sources.

    The achievable wrench is pure: the largest along one axis with every other component zero. Trim is for fresh water
    of 1000 kg/m3 and standard gravity, positive when the vehicle floats. What a draft lacks is None and listed under
    `missing`.
    """
    draft = as_draft(vehicle)
    report = check_report(draft)
    limits = draft.thrust_limits_N
    trim_N = None
    if draft.displaced_volume_m3 is not None and draft.mass_kg is not None:
        trim_N = round((TRIM_WATER_KG_M3 * draft.displaced_volume_m3 - draft.mass_kg) * GRAVITY_M_S2, 9)
    return {
        "name": draft.name,
        "title": draft.title,
        "source": draft.source,
        "does_not_claim": draft.does_not_claim,
        "size_m": _list(draft.size_m),
        "mass_kg": draft.mass_kg,
        "inertia_kg_m2": _list(draft.inertia_kg_m2),
        "displaced_volume_m3": draft.displaced_volume_m3,
        "centre_of_gravity_m": _list(draft.p_BG_m),
        "centre_of_buoyancy_m": _list(draft.p_BB_m),
        "trim_N": trim_N,
        "added_mass": _list(draft.added_mass),
        "linear_damping": _list(draft.linear_damping),
        "quadratic_damping": _list(draft.quadratic_damping),
        "camera_fov_deg": None if draft.camera_fov_rad is None else math.degrees(draft.camera_fov_rad),
        "thrusters": [
            {
                "number": number,
                "name": t.name,
                "position_m": t.p_BT_m.tolist(),
                "axis": t.axis_B.tolist(),
                "max_forward_N": t.max_forward_N,
                "max_reverse_N": t.max_reverse_N,
                "disk_area_m2": t.disk_area_m2,
                "time_constant_s": t.time_constant_s,
                "rank_without": rank,
            }
            for number, (t, rank) in enumerate(zip(draft.thrusters, report["failure_rank"], strict=False), start=1)
        ],
        "allocation_matrix": draft.allocation_matrix.tolist(),
        "limits_N": None if limits is None else {"lower": limits[0].tolist(), "upper": limits[1].tolist()},
        "provenance": [asdict(p) for p in draft.provenance],
        **{key: value for key, value in report.items() if key not in _LISTED},
    }


_LISTED = ("name", "title", "thrusters", "thruster_names", "failure_rank")
"""Fields of the check that a description lists in its own way."""


def summary_line(draft: VehicleDraft) -> str:
    """One line for a list: thrusters, rank, and whether it can fly or what its file lacks."""
    n, rank = len(draft.thruster_names), allocation_rank(draft)
    state = "can fly" if not draft.missing else f"cannot fly, lacks {', '.join(draft.missing)}"
    return f"{n} thrusters, rank {rank}{', under-actuated' if rank < 6 else ''}; {state}"


def as_draft(vehicle: AnyVehicle) -> VehicleDraft:
    """The draft itself, or the draft of a whole vehicle."""
    return VehicleDraft.of(vehicle) if isinstance(vehicle, Vehicle) else vehicle


def _own_comparison(draft: VehicleDraft) -> MatrixComparison | None:
    if not draft.thrusters:
        return None
    if draft.shipped_matrix is not None:
        return compare_matrix(draft, draft.shipped_matrix, "the matrix its own source ships")
    if len(draft.thrusters) in ARDUSUB_FRAMES:
        found = compare_with_ardusub(draft)
        return None if found.disagreements else found
    return None


def _null_space(draft: VehicleDraft) -> list[dict[str, Any]]:
    basis = effective_null_space(draft)
    return [
        {"name": name, "thrusts": column.round(12).tolist(), "words": words}
        for name, column, words in zip(null_space_names(draft), basis.T, null_space_words(draft), strict=True)
    ]


def _percentages(left_pct: Array) -> dict[str, list[float | None]]:
    return {
        axis: [None if math.isnan(value) else round(float(value), 6) + 0.0 for value in left_pct[i]]
        for i, axis in enumerate(WRENCH_AXES)
    }


def _failure_words(lost: tuple[str, ...], left_pct: Array | None) -> str:
    said = f"loses {' and '.join(lost)}" if lost else "loses no axis"
    if left_pct is None:
        return said
    worst = np.where(np.isnan(left_pct), np.inf, left_pct).min(axis=1)
    reduced = [
        f"{axis} {value:.0f} %"
        for axis, value in zip(WRENCH_AXES, worst, strict=True)
        if axis not in lost and value < 99.95
    ]
    if reduced:
        return f"{said}, keeps {', '.join(reduced)}"
    return f"{said}, every other axis as strong as before" if lost else f"{said}, every axis as strong as before"


def _list(array: Array | None) -> Any:
    return None if array is None else array.tolist()


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One row; `value` is None where the file says nothing."""

    quantity: str
    value: str | None
    unit: str
    source: str
    estimate: bool


def parameters(draft: VehicleDraft) -> list[ParameterRow]:
    """All parameters of a vehicle but the places of its thrusters, in the order of a vehicle file."""
    origin = {p.group: p for p in draft.provenance}

    def row(group: str, quantity: str, value: str | None, unit: str) -> ParameterRow:
        found = origin.get(group)
        stated = value is not None
        return ParameterRow(
            quantity=quantity,
            value=value,
            unit=unit,
            source=(draft.source if found is None else found.source) if stated else "",
            estimate=stated and found is not None and found.estimate,
        )

    curve, camera = draft.curve, draft.X_BC
    rows = [
        row("body", "size: length, width, height", _vector(draft.size_m), "m"),
        row("body", "mass", _scalar(draft.mass_kg), "kg"),
        row("inertia", "inertia about the centre of gravity", _matrix(draft.inertia_kg_m2), "kg m2"),
        row("buoyancy", "displaced volume", _scalar(draft.displaced_volume_m3), "m3"),
        row("buoyancy", "centre of gravity", _vector(draft.p_BG_m), "m"),
        row("buoyancy", "centre of buoyancy", _vector(draft.p_BB_m), "m"),
    ]
    for group, quantity, matrix, linear, turning in (
        ("added_mass", "added mass", draft.added_mass, "kg", "kg m2"),
        ("damping", "linear damping", draft.linear_damping, "N s/m", "N m s"),
        ("damping", "quadratic damping", draft.quadratic_damping, "N s2/m2", "N m s2"),
    ):
        first, last = (None, None) if matrix is None else (matrix[:3, :3], matrix[3:, 3:])
        rows.append(row(group, f"{quantity}: surge, sway, heave", _matrix(first), linear))
        rows.append(row(group, f"{quantity}: roll, pitch, yaw", _matrix(last), turning))
        if matrix is not None and (matrix[:3, 3:].any() or matrix[3:, :3].any()):
            largest = max(np.abs(matrix[:3, 3:]).max(), np.abs(matrix[3:, :3]).max())
            unit = "kg m" if group == "added_mass" else "N s"
            rows.append(row(group, f"{quantity}: coupling of the two", f"up to {largest:g}", unit))
    rows += [r for case in draft.drag_cases for r in _drag_case(case)]
    rows += [
        row("thruster_limits", "thrust forward", _alike([t.max_forward_N for t in draft.thrusters]), "N"),
        row("thruster_limits", "thrust in reverse", _alike([t.max_reverse_N for t in draft.thrusters]), "N"),
        row("thruster_disk", "propeller diameter", _alike([_diameter(t.disk_area_m2) for t in draft.thrusters]), "m"),
        row("thruster_lag", "time constant of thrust", _alike([t.time_constant_s for t in draft.thrusters]), "s"),
        row("thruster_curve", "thrust table", None if curve is None else f"{curve.table} at {curve.supply_V:g} V", ""),
        *_least(draft, row),
        row(
            "thruster_layout",
            "places and axes of thrusters",
            f"{len(draft.thrusters)}" if draft.thrusters else None,
            "",
        ),
        row("camera_mount", "camera place", None if camera is None else _vector(camera.p_m), "m"),
        row("camera_mount", "camera looks along", None if camera is None else _vector(camera.R[:, 2].round(6)), ""),
        *_tilt(draft, row),
        row(
            "camera_lens",
            "horizontal field of view",
            None if draft.camera_fov_rad is None else f"{math.degrees(draft.camera_fov_rad):.4g}",
            "deg",
        ),
    ]
    return [r for r in rows if r.value is not None or r.quantity != "thrust table"]


def _drag_case(case: DragCase) -> list[ParameterRow]:
    """What another source has for the drag of translation."""

    def row(quantity: str, matrix: Array, unit: str) -> ParameterRow:
        value = _matrix(matrix[:3, :3])
        what = f"drag case {case.name}, {quantity}: surge, sway, heave"
        return ParameterRow(quantity=what, value=value, unit=unit, source=case.source, estimate=case.estimate)

    return [row("linear", case.linear_damping, "N s/m"), row("quadratic", case.quadratic_damping, "N s2/m2")]


def _least(draft: VehicleDraft, row: Callable[..., ParameterRow]) -> list[ParameterRow]:
    """Least thrusts, by the table or as stated; no row where thrust is taken as continuous."""
    steps = thrust_steps(draft.curve, draft.least_thrust)
    if steps is None:
        return []
    group = "thruster_least" if draft.curve is None else "thruster_curve"
    return [row(group, "least thrust: forward, reverse", f"{steps.least_forward_N:g}, {steps.least_reverse_N:g}", "N")]


def _tilt(draft: VehicleDraft, row: Callable[..., ParameterRow]) -> list[ParameterRow]:
    """Stops and rate of the camera's joint; no row where the camera is fixed."""
    if draft.tilt is None:
        return []
    low, high = (math.degrees(angle) for angle in (draft.tilt.low_rad, draft.tilt.high_rad))
    return [
        row("camera_tilt", "camera tilts between", f"{low:g}, {high:g}", "deg"),
        row("camera_tilt", "camera tilts at", f"{math.degrees(draft.tilt.rate_rad_s):g}", "deg/s"),
    ]


def _scalar(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"


def _vector(value: Array | None) -> str | None:
    return None if value is None else ", ".join(f"{v:g}" for v in value + 0.0)


def _matrix(block: Array | None) -> str | None:
    """The diagonal, and how large the rest gets."""
    if block is None:
        return None
    diagonal = np.diag(block)
    rest = float(np.abs(block - np.diag(diagonal)).max())
    return f"{_vector(diagonal)}" + (f" (products up to {rest:g})" if rest > 0.0 else "")


def _diameter(area_m2: float | None) -> float | None:
    return None if area_m2 is None else round(2.0 * math.sqrt(area_m2 / math.pi), 12)


def _alike(values: list[float | None]) -> str | None:
    """One value where all thrusters have the same, else each in turn; None where none is stated."""
    if not values or all(value is None for value in values):
        return None
    if len(set(values)) == 1:
        return _scalar(values[0])
    return ", ".join("?" if value is None else f"{value:g}" for value in values)
