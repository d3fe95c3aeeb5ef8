"""Drag as one source has it: a vehicle believes one set of damping, its true drag may be another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles.hydrodynamics import AS_BELIEVED, DRAWN
from wakewise.robot.vehicles.vehicle import Vehicle


def possible_drags(vehicle: Vehicle, case: str) -> tuple[str, ...]:
    """Names of the sets of drag that a choice may come to: all there are for `drawn`, else the one that it names.

    Raises
    ------
    InputError
        If the vehicle has no such case.
    """
    names = (AS_BELIEVED, *(c.name for c in vehicle.drag_cases))
    if case not in (*names, DRAWN):
        raise InputError(
            f"tank.mismatch.drag: {case!r}, {vehicle.name} has no such case, allowed {', '.join((*names, DRAWN))}"
        )
    return names if case == DRAWN else (case,)


def with_drag(vehicle: Vehicle, case: str, rng: np.random.Generator | None = None) -> Vehicle:
    """The vehicle with the drag of a case: its name, `as-believed`, or `drawn`, which takes one of all, each alike.

    Raises
    ------
    InputError
        If the vehicle has no such case.
    """
    names = possible_drags(vehicle, case)
    case = names[int((rng or np.random.default_rng(0)).integers(len(names)))]
    if case == AS_BELIEVED:
        return vehicle
    chosen = next(c for c in vehicle.drag_cases if c.name == case)
    water = replace(
        vehicle.hydrodynamics, linear_damping=chosen.linear_damping, quadratic_damping=chosen.quadratic_damping
    )
    return replace(vehicle, hydrodynamics=water)


def with_each_drag(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """The vehicle with each set of drag that it may have, the believed one first."""
    return tuple(with_drag(vehicle, case) for case in possible_drags(vehicle, DRAWN))


def drag_coefficients(vehicle: Vehicle, speed_m_s: float) -> Array:
    """Drag in surge, sway and heave at a speed over 1/2 rho u^2 times the frontal area of the box, shape (3,).

    For water of 1000 kg/m3. A plain box has 1.05 (see the library's files); linear terms make it grow as 1/u.
    """
    length, width, height = vehicle.size_m
    areas = np.array([width * height, length * height, length * width])
    water = vehicle.hydrodynamics
    linear, quadratic = (np.diag(matrix)[:3] for matrix in (water.linear_damping, water.quadratic_damping))
    return np.asarray((linear * speed_m_s + quadratic * speed_m_s**2) / (500.0 * speed_m_s**2 * areas))
