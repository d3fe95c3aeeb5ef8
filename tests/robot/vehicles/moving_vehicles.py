"""Vehicles and states that the tests of motion share: the whole library, and one vehicle with nothing symmetric."""

from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles import Vehicle, compile_body, load_vehicle, vehicle_names

STILL = np.zeros(3)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
ALL_VEHICLES = [*vehicle_names(), "crooked"]


def vehicle_named(name: str) -> Vehicle:
    return crooked(load_vehicle("paper")) if name == "crooked" else load_vehicle(name)


def crooked(vehicle: Vehicle) -> Vehicle:
    """A vehicle with nothing symmetric, so that every term of the equations counts."""
    rng = np.random.default_rng(7)
    root = 0.3 * rng.normal(size=(6, 6))
    lift = 0.2 * rng.normal(size=(6, 6))
    water = vehicle.hydrodynamics
    return replace(
        vehicle,
        p_BG_m=np.array([0.02, -0.01, 0.03]),
        p_BB_m=np.array([-0.01, 0.015, -0.02]),
        inertia_kg_m2=vehicle.inertia_kg_m2 + np.array([[0.02, 0.01, 0.0], [0.01, 0.02, -0.01], [0.0, -0.01, 0.02]]),
        hydrodynamics=replace(
            water,
            added_mass=water.added_mass + root @ root.T,
            linear_damping=water.linear_damping + root.T @ root + lift - lift.T,
        ),
    )


def neutral(vehicle: Vehicle, rho: float = 1000.0, arm_m: float = 0.01) -> Vehicle:
    """A trimmed copy: as heavy as the water that it displaces, buoyancy `arm_m` right above the centre of gravity."""
    return replace(
        vehicle,
        displaced_volume_m3=vehicle.mass_kg / rho,
        p_BB_m=vehicle.p_BG_m - np.array([0.0, 0.0, arm_m]),
    )


def without_drag(vehicle: Vehicle) -> Vehicle:
    nothing = np.zeros((6, 6))
    return replace(
        vehicle,
        hydrodynamics=replace(vehicle.hydrodynamics, linear_damping=nothing, quadratic_damping=nothing),
    )


def random_state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    q = rng.normal(size=4)
    return rng.normal(size=3), q / np.linalg.norm(q), rng.normal(size=6)


def fast_state(vehicle: Vehicle, rng: np.random.Generator) -> tuple[Array, Array, Array, Array, Array]:
    """Position, attitude, twist, wrench and current with every relative velocity away from the kink of abs(u) u."""
    p, q, _ = random_state(rng)
    current = 0.3 * rng.normal(size=3)
    nu = rng.choice([-1.0, 1.0], size=6) * rng.uniform(0.6, 2.0, size=6)
    nu[:3] += matrix_from_quat(q).T @ current
    wrench = compile_body(vehicle).mass_matrix @ rng.normal(size=6)
    return p, q, nu, wrench, current
