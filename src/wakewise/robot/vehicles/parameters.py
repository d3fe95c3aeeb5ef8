"""The parameters of a vehicle as rows for people: value, unit, source, and whether it is an estimate or missing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.hydrodynamics import DragCase
from wakewise.robot.vehicles.vehicle import thrust_steps


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
        row(
            "thruster_curve",
            "thrust table",
            None if curve is None else f"{curve.table} at {curve.supply_V:g} V",
            "",
        ),
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
