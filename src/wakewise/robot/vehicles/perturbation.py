"""A plant's own parameters: near those of the controller's model, but not the same.

Drag as one source has it: the controller's model has one set of damping, the true drag may be another.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.robot.vehicles.hydrodynamics import NOMINAL, RANDOM, Hydrodynamics
from wakewise.robot.vehicles.vehicle import Vehicle


def perturbed(
    vehicle: Vehicle,
    rng: np.random.Generator,
    *,
    mass_pct: float = 0.0,
    damping_pct: float = 0.0,
    added_mass_pct: float = 0.0,
    thrust_pct: float = 0.0,
    trim_N: float = 0.0,
    water_density_kg_m3: float = TRIM_WATER_KG_M3,
    gravity_m_s2: float = GRAVITY_M_S2,
) -> Vehicle:
    """Draw a vehicle whose parameters differ from the nominal by factors uniform in 1 +- pct/100.

    Mass and inertia share one factor; damping and added mass have one factor per degree of freedom (for added mass
    and linear damping F A F with F the square roots, which keeps symmetry and definiteness); each thruster has its
    own gain (`Vehicle.thrust_gains`: newton delivered per newton commanded). A vehicle is ballasted in the water, so
    an error in its mass leaves its trim alone: the displaced volume follows the mass, and `trim_N` alone shifts the
    buoyancy, positive = floats more than the nominal.

    The number of draws does not depend on the arguments, so one seed gives one vehicle however much is perturbed.

    Raises InputError if a percentage is outside [0, 90] or the trim leaves no displaced volume.
    """
    percentages = {
        "mass_pct": mass_pct,
        "damping_pct": damping_pct,
        "added_mass_pct": added_mass_pct,
        "thrust_pct": thrust_pct,
    }
    for name, value in percentages.items():
        if not 0.0 <= value <= 90.0:
            raise InputError(f"{name}: {value:g}, must be from 0 to 90")
    n = len(vehicle.thrusters)
    draws = rng.uniform(-0.01, 0.01, size=1 + 6 + 6 + n)
    mass_factor = 1.0 + mass_pct * draws[0]
    damping_factors = 1.0 + damping_pct * draws[1:7]
    added_factors = 1.0 + added_mass_pct * draws[7:13]
    gains = 1.0 + thrust_pct * draws[13:]

    mass_kg = vehicle.mass_kg * mass_factor
    volume_m3 = vehicle.displaced_volume_m3 + (mass_kg - vehicle.mass_kg) / water_density_kg_m3
    volume_m3 += trim_N / (water_density_kg_m3 * gravity_m_s2)
    if not volume_m3 > 0.0:
        raise InputError(f"trim_N: {trim_N:g} leaves a displaced volume of {volume_m3:g} m3, it must stay positive")
    water = vehicle.hydrodynamics
    added_root = np.diag(np.sqrt(added_factors))
    damping_root = np.diag(np.sqrt(damping_factors))
    return replace(
        vehicle,
        mass_kg=mass_kg,
        inertia_kg_m2=vehicle.inertia_kg_m2 * mass_factor,
        displaced_volume_m3=volume_m3,
        hydrodynamics=Hydrodynamics(
            added_mass=added_root @ water.added_mass @ added_root,
            linear_damping=damping_root @ water.linear_damping @ damping_root,
            quadratic_damping=np.diag(damping_factors * np.diag(water.quadratic_damping)),
        ),
        thrusters=tuple(replace(t, gain=t.gain * float(g)) for t, g in zip(vehicle.thrusters, gains, strict=True)),
    )


def possible_drags(vehicle: Vehicle, case: str) -> tuple[str, ...]:
    """Names of the sets of drag that a choice may come to: all there are for `drawn`, else the one that it names.

    Raises InputError if the vehicle has no such case.
    """
    names = (NOMINAL, *(c.name for c in vehicle.drag_cases))
    if case not in (*names, RANDOM):
        raise InputError(
            f"tank.mismatch.drag: {case!r}, {vehicle.name} has no such case, allowed {', '.join((*names, RANDOM))}"
        )
    return names if case == RANDOM else (case,)


def with_drag(vehicle: Vehicle, case: str, rng: np.random.Generator | None = None) -> Vehicle:
    """The vehicle with the drag of a case: its name, `nominal`, or `random`, which takes one of all, each alike.

    Raises InputError if the vehicle has no such case.
    """
    names = possible_drags(vehicle, case)
    case = names[int((rng or np.random.default_rng(0)).integers(len(names)))]
    if case == NOMINAL:
        return vehicle
    chosen = next(c for c in vehicle.drag_cases if c.name == case)
    water = replace(
        vehicle.hydrodynamics, linear_damping=chosen.linear_damping, quadratic_damping=chosen.quadratic_damping
    )
    return replace(vehicle, hydrodynamics=water)


def with_each_drag(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """The vehicle with each set of drag that it may have, that of the controller's model first."""
    return tuple(with_drag(vehicle, case) for case in possible_drags(vehicle, RANDOM))


def drag_coefficients(vehicle: Vehicle, speed_m_s: float) -> Array:
    """Drag in surge, sway and heave at a speed over 1/2 rho u^2 times the frontal area of the box, shape (3,).

    For water of 1000 kg/m3. A plain box has 1.05 (see the library's files); linear terms make it grow as 1/u.
    """
    length, width, height = vehicle.size_m
    areas = np.array([width * height, length * height, length * width])
    water = vehicle.hydrodynamics
    linear, quadratic = (np.diag(matrix)[:3] for matrix in (water.linear_damping, water.quadratic_damping))
    return np.asarray((linear * speed_m_s + quadratic * speed_m_s**2) / (500.0 * speed_m_s**2 * areas))
