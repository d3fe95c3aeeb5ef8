"""Rigid-body motion in water with six degrees of freedom: acceleration, the wrenches in it, and steps in time.

Equations: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021: rigid body
(chapter 3), restoring forces (4), added mass and damping (6), constant and irrotational currents (10). With the
velocity relative to the water, nu_r = nu - nu_c, they read

    (M_RB + M_A) dnu_r/dt + (C_RB(nu_r) + C_A(nu_r)) nu_r + D(nu_r) nu_r + g(q) = tau,    dnu/dt = dnu_r/dt + dnu_c/dt.

The current is uniform, irrotational and constant in the world, so in body axes it is nu_c = (R_BW v_c, 0) and turns
against the body: dnu_c/dt = (-omega x R_BW v_c, 0), exactly. M_RB and M_A are full (products of inertia, centre of
gravity off the origin, coupled added mass), so are C_RB and C_A; linear damping is full, quadratic damping diagonal.
The Coriolis terms are evaluated through the momentum h = (M_RB + M_A) nu_r, which is Kirchhoff's form of the same
equations; `fossen` has them with the book's matrices. Every wrench here is what acts *on the vehicle*, about the body
origin, expressed in B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import fossen, kernels
from wakewise.robot.vehicles.fossen import rigid_body_mass
from wakewise.robot.vehicles.kernels import rk4_kernel
from wakewise.robot.vehicles.semi_implicit import semi_implicit_kernel
from wakewise.robot.vehicles.vehicle import Vehicle

__all__ = [
    "RigidBody",
    "acceleration",
    "compile_body",
    "coriolis_wrench",
    "damping_wrench",
    "pack",
    "restoring_wrench",
    "rigid_body_mass",
    "step_rk4",
    "step_semi_implicit",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody:
    """A vehicle's parameters as plain arrays for the kernels; make one with `compile_body`.

    `mass_matrix` is M_RB + M_A about the body origin, shape (6, 6), and `added_mass` the M_A in it; `quadratic_damping`
    is a diagonal, shape (6,). `packed`, shape (20, 6), is what the kernels read; see `kernels`.
    """

    mass_matrix: Array
    added_mass: Array
    linear_damping: Array
    quadratic_damping: Array
    weight_N: float
    buoyancy_N: float
    p_BG_m: Array
    p_BB_m: Array
    packed: Array

    def __post_init__(self) -> None:
        freeze(
            self,
            mass_matrix=(6, 6),
            added_mass=(6, 6),
            linear_damping=(6, 6),
            quadratic_damping=(6,),
            p_BG_m=(3,),
            p_BB_m=(3,),
            packed=(20, 6),
        )


def compile_body(
    vehicle: Vehicle, water_density_kg_m3: float = TRIM_WATER_KG_M3, gravity_m_s2: float = GRAVITY_M_S2
) -> RigidBody:
    """Collect what the equations need of a vehicle in water of one density.

    Raises InputError if density or gravity is not positive.
    """
    for name, value in (("water_density_kg_m3", water_density_kg_m3), ("gravity_m_s2", gravity_m_s2)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value:g}, must be finite and more than 0")
    mass = fossen.mass_matrix(vehicle)
    # Equal to its transpose to the last bit: the kernels read rows as columns.
    mass = 0.5 * (mass + mass.T)
    inverse = np.linalg.inv(mass)
    weight_N = vehicle.mass_kg * gravity_m_s2
    buoyancy_N = water_density_kg_m3 * gravity_m_s2 * vehicle.displaced_volume_m3
    quadratic = np.diag(vehicle.hydrodynamics.quadratic_damping)
    packed = np.zeros((20, 6))
    packed[: kernels.INVERSE] = mass
    packed[kernels.INVERSE : kernels.LINEAR] = 0.5 * (inverse + inverse.T)
    packed[kernels.LINEAR : kernels.QUADRATIC] = vehicle.hydrodynamics.linear_damping
    packed[kernels.QUADRATIC] = quadratic
    packed[kernels.STATIC, 0] = weight_N - buoyancy_N
    packed[kernels.STATIC, 1:4] = weight_N * vehicle.p_BG_m - buoyancy_N * vehicle.p_BB_m
    return RigidBody(
        mass_matrix=mass,
        added_mass=vehicle.hydrodynamics.added_mass,
        linear_damping=vehicle.hydrodynamics.linear_damping,
        quadratic_damping=quadratic,
        weight_N=weight_N,
        buoyancy_N=buoyancy_N,
        p_BG_m=vehicle.p_BG_m,
        p_BB_m=vehicle.p_BB_m,
        packed=packed,
    )


def acceleration(body: RigidBody, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array) -> Array:
    """Rate of the twist, dnu_B/dt.

    `q_WB`, shape (4,): unit quaternion. `nu_B`, shape (6,): twist relative to the world. `wrench_B`, shape (6,): wrench
    of thrusters, tether and so on; weight, buoyancy and water are added here. `current_W_m_s`, shape (3,): velocity of
    the water, constant in the world. Returns ndarray, shape (6,), in m/s2 and rad/s2.
    """
    state, inputs = pack(np.zeros(3), q_WB, nu_B, wrench_B, current_W_m_s)
    rate = np.empty(13)
    kernels.rate_kernel(body.packed, state, inputs, rate)
    return rate[7:]


def step_rk4(
    body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array, dt_s: float
) -> tuple[Array, Array, Array]:
    """Advance position (3,), quaternion (4,) and twist (6,) by `dt_s` with wrench and current held constant.

    Classical Runge-Kutta of fourth order; the quaternion is normalised at the end of the step. Parameters as in
    `acceleration`. Unstable where `dt_s` times the fastest rate of decay is more than 2.78; see `step_semi_implicit`.
    """
    state, inputs = pack(p_WB_m, q_WB, nu_B, wrench_B, current_W_m_s)
    rk4_kernel(body.packed, state, inputs, float(dt_s))
    return state[:3], state[3:7], state[7:]


def step_semi_implicit(
    body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array, dt_s: float
) -> tuple[Array, Array, Array]:
    """Advance as `step_rk4` does, with damping and Coriolis terms implicit: second order, stable at any drag.

    Without wrench, weight and buoyancy the kinetic energy relative to the water never grows, however long the step.
    The method and its sources are in `semi_implicit`.
    """
    state, inputs = pack(p_WB_m, q_WB, nu_B, wrench_B, current_W_m_s)
    factors, velocities, turns = np.empty((2, 6, 6)), np.empty((4, 6, 1)), np.empty((2, 4))
    semi_implicit_kernel(body.packed, state, inputs, float(dt_s), factors, velocities, turns)
    return state[:3], state[3:7], state[7:]


def restoring_wrench(body: RigidBody, q_WB: Array) -> Array:
    """Wrench of weight and buoyancy on the vehicle, shape (6,); it is -g(eta) in Fossen's notation.

    Thrusters that hold the vehicle still must supply the negative of this.
    """
    w, x, y, z = (float(component) for component in q_WB)
    return np.array(kernels.restoring(body.packed, kernels.rotate(-w, x, y, z, 0.0, 0.0, 1.0)))


def damping_wrench(body: RigidBody, nu_r_B: Array) -> Array:
    """Wrench of drag on the vehicle, -D(nu_r) nu_r, shape (6,), at a twist relative to the water, shape (6,)."""
    return -np.array(kernels.damping(body.packed, _six(nu_r_B)))


def coriolis_wrench(body: RigidBody, nu_r_B: Array) -> Array:
    """Coriolis and centripetal wrench, -C(nu_r) nu_r with C = C_RB + C_A, shape (6,); it does no work."""
    return -np.array(kernels.coriolis(body.packed, _six(nu_r_B)))


def pack(p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array) -> tuple[Array, Array]:
    """State, shape (13,), and inputs, shape (9,), as the kernels take them.

    Both are fresh and writable, so that the kernels are compiled once and not again for read-only arguments.
    """
    state = np.empty(13)
    state[:3] = p_WB_m
    state[3:7] = q_WB
    state[7:] = nu_B
    inputs = np.empty(9)
    inputs[:6] = wrench_B
    inputs[6:] = current_W_m_s
    return state, inputs


def _six(twist: Array) -> kernels.Six:
    u, v, w, p, q, r = (float(component) for component in twist)
    return u, v, w, p, q, r
