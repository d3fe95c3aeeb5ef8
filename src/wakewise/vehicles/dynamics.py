"""Rigid-body motion in water with six degrees of freedom, stepped by a Runge-Kutta method.

Equations: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021: rigid body
(chapter 3), restoring forces (4), added mass and damping (6), constant and irrotational currents (10). With the
velocity relative to the water, nu_r = nu - nu_c, they read

    (M_RB + M_A) dnu_r/dt + (C_RB(nu_r) + C_A(nu_r)) nu_r + D(nu_r) nu_r + g(q) = tau,    dnu/dt = dnu_r/dt + dnu_c/dt,

exact for a current constant in the world, where dnu_c/dt = (-omega x R_BW v_c, 0). The Coriolis terms are evaluated
through the momentum h = (M_RB + M_A) nu_r, which is Kirchhoff's form of the same equations. Every wrench here is
what acts *on the vehicle*, about the body origin, expressed in B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError
from wakewise.geometry import skew
from wakewise.vehicles.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody:
    """A vehicle's parameters as plain arrays for the kernels; make one with `compile_body`.

    `mass_matrix` is M_RB + M_A about the body origin, shape (6, 6); `quadratic_damping` is a diagonal, shape (6,).
    `packed`, shape (6, 21), is what the kernels read: mass matrix, its inverse, linear damping, quadratic damping,
    (weight, buoyancy), (centre of gravity, centre of buoyancy).
    """

    mass_matrix: Array
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
            linear_damping=(6, 6),
            quadratic_damping=(6,),
            p_BG_m=(3,),
            p_BB_m=(3,),
            packed=(6, 21),
        )


def rigid_body_mass(vehicle: Vehicle) -> Array:
    """M_RB about the body origin, shape (6, 6); S(p_BG) couples force and turning."""
    mass = np.zeros((6, 6))
    S_G = skew(vehicle.p_BG_m)
    mass[:3, :3] = vehicle.mass_kg * np.eye(3)
    mass[:3, 3:] = -vehicle.mass_kg * S_G
    mass[3:, :3] = vehicle.mass_kg * S_G
    mass[3:, 3:] = vehicle.inertia_kg_m2 - vehicle.mass_kg * (S_G @ S_G)
    return mass


def compile_body(vehicle: Vehicle, water_density_kg_m3: float = 1000.0, gravity_m_s2: float = 9.80665) -> RigidBody:
    """Collect what the equations need of a vehicle in water of one density.

    Raises
    ------
    InputError
        If density or gravity is not positive.
    """
    for name, value in (("water_density_kg_m3", water_density_kg_m3), ("gravity_m_s2", gravity_m_s2)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value:g}, must be finite and more than 0")
    mass = rigid_body_mass(vehicle) + vehicle.hydrodynamics.added_mass
    mass = 0.5 * (mass + mass.T)
    linear = vehicle.hydrodynamics.linear_damping
    quadratic = np.diag(vehicle.hydrodynamics.quadratic_damping)
    weight_N = vehicle.mass_kg * gravity_m_s2
    buoyancy_N = water_density_kg_m3 * gravity_m_s2 * vehicle.displaced_volume_m3
    packed = np.zeros((6, 21))
    packed[:, 0:6] = mass
    packed[:, 6:12] = np.linalg.inv(mass)
    packed[:, 12:18] = linear
    packed[:, 18] = quadratic
    packed[:2, 19] = weight_N, buoyancy_N
    packed[:3, 20] = vehicle.p_BG_m
    packed[3:, 20] = vehicle.p_BB_m
    return RigidBody(
        mass_matrix=mass,
        linear_damping=linear,
        quadratic_damping=quadratic,
        weight_N=weight_N,
        buoyancy_N=buoyancy_N,
        p_BG_m=vehicle.p_BG_m,
        p_BB_m=vehicle.p_BB_m,
        packed=packed,
    )


def acceleration(body: RigidBody, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array) -> Array:
    """Rate of the twist, dnu_B/dt.

    Parameters
    ----------
    q_WB : ndarray, shape (4,)
        Unit quaternion.
    nu_B : ndarray, shape (6,)
        Twist relative to the world.
    wrench_B : ndarray, shape (6,)
        Wrench of thrusters, tether and so on; weight, buoyancy and water are added here.
    current_W_m_s : ndarray, shape (3,)
        Velocity of the water, constant in the world.

    Returns
    -------
    ndarray, shape (6,), in m/s2 and rad/s2
    """
    state, inputs = _pack(np.zeros(3), q_WB, nu_B, wrench_B, current_W_m_s)
    rate = np.empty(13)
    _rate_kernel(body.packed, state, inputs, rate)
    return rate[7:]


def step_rk4(
    body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array, dt_s: float
) -> tuple[Array, Array, Array]:
    """Advance position (3,), quaternion (4,) and twist (6,) by `dt_s` with wrench and current held constant.

    Classical Runge-Kutta of fourth order; the quaternion is normalised at the end of the step. Parameters as in
    `acceleration`.
    """
    state, inputs = _pack(p_WB_m, q_WB, nu_B, wrench_B, current_W_m_s)
    _step_kernel(body.packed, state, inputs, float(dt_s))
    return state[:3], state[3:7], state[7:]


def restoring_wrench(body: RigidBody, q_WB: Array) -> Array:
    """Wrench of weight and buoyancy on the vehicle, shape (6,); it is -g(eta) in Fossen's notation.

    Thrusters that hold the vehicle still must supply the negative of this.
    """
    wrench = np.zeros(6)
    _add_restoring(body.packed, np.array(q_WB, dtype=np.float64), wrench)
    return wrench


def damping_wrench(body: RigidBody, nu_r_B: Array) -> Array:
    """Wrench of drag on the vehicle, -D(nu_r) nu_r, shape (6,), at a twist relative to the water, shape (6,)."""
    wrench = np.zeros(6)
    _add_damping(body.packed, np.array(nu_r_B, dtype=np.float64), wrench)
    return wrench


def coriolis_wrench(body: RigidBody, nu_r_B: Array) -> Array:
    """Coriolis and centripetal wrench, -C(nu_r) nu_r with C = C_RB + C_A, shape (6,); it does no work."""
    wrench = np.zeros(6)
    _add_coriolis(body.packed, np.array(nu_r_B, dtype=np.float64), wrench)
    return wrench


def _pack(p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array) -> tuple[Array, Array]:
    # Fresh writable arrays, so that the kernels are compiled once and not again for read-only arguments.
    state = np.empty(13)
    state[:3] = p_WB_m
    state[3:7] = q_WB
    state[7:] = nu_B
    inputs = np.empty(9)
    inputs[:6] = wrench_B
    inputs[6:] = current_W_m_s
    return state, inputs


@njit(cache=True)
def _add_restoring(packed: Array, q: Array, wrench: Array) -> None:
    w, x, y, z = q[0], q[1], q[2], q[3]
    # World's down expressed in B: the third row of R_WB.
    dx, dy, dz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    weight, buoyancy = packed[0, 19], packed[1, 19]
    wrench[0] += (weight - buoyancy) * dx
    wrench[1] += (weight - buoyancy) * dy
    wrench[2] += (weight - buoyancy) * dz
    ax = packed[0, 20] * weight - packed[3, 20] * buoyancy
    ay = packed[1, 20] * weight - packed[4, 20] * buoyancy
    az = packed[2, 20] * weight - packed[5, 20] * buoyancy
    wrench[3] += ay * dz - az * dy
    wrench[4] += az * dx - ax * dz
    wrench[5] += ax * dy - ay * dx


@njit(cache=True)
def _add_damping(packed: Array, nu_r: Array, wrench: Array) -> None:
    for i in range(6):
        drag = packed[i, 18] * abs(nu_r[i]) * nu_r[i]
        for j in range(6):
            drag += packed[i, 12 + j] * nu_r[j]
        wrench[i] -= drag


@njit(cache=True)
def _add_coriolis(packed: Array, nu_r: Array, wrench: Array) -> None:
    h = np.zeros(6)
    for i in range(6):
        for j in range(6):
            h[i] += packed[i, j] * nu_r[j]
    u, v, w, p, q, r = nu_r[0], nu_r[1], nu_r[2], nu_r[3], nu_r[4], nu_r[5]
    wrench[0] -= q * h[2] - r * h[1]
    wrench[1] -= r * h[0] - p * h[2]
    wrench[2] -= p * h[1] - q * h[0]
    wrench[3] -= q * h[5] - r * h[4] + v * h[2] - w * h[1]
    wrench[4] -= r * h[3] - p * h[5] + w * h[0] - u * h[2]
    wrench[5] -= p * h[4] - q * h[3] + u * h[1] - v * h[0]


@njit(cache=True)
def _rate_kernel(packed: Array, state: Array, inputs: Array, rate: Array) -> None:
    w, x, y, z = state[3], state[4], state[5], state[6]
    r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    u, v, s = state[7], state[8], state[9]
    rate[0] = r00 * u + r01 * v + r02 * s
    rate[1] = r10 * u + r11 * v + r12 * s
    rate[2] = r20 * u + r21 * v + r22 * s
    p, q, r = state[10], state[11], state[12]
    rate[3] = 0.5 * (-x * p - y * q - z * r)
    rate[4] = 0.5 * (w * p + y * r - z * q)
    rate[5] = 0.5 * (w * q - x * r + z * p)
    rate[6] = 0.5 * (w * r + x * q - y * p)

    cx, cy, cz = inputs[6], inputs[7], inputs[8]
    bx = r00 * cx + r10 * cy + r20 * cz
    by = r01 * cx + r11 * cy + r21 * cz
    bz = r02 * cx + r12 * cy + r22 * cz
    nu_r = state[7:13].copy()
    nu_r[0] -= bx
    nu_r[1] -= by
    nu_r[2] -= bz
    wrench = inputs[:6].copy()
    _add_restoring(packed, state[3:7], wrench)
    _add_damping(packed, nu_r, wrench)
    _add_coriolis(packed, nu_r, wrench)
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += packed[i, 6 + j] * wrench[j]
        rate[7 + i] = total
    # The current is constant in the world, so in B it turns against the body.
    rate[7] -= q * bz - r * by
    rate[8] -= r * bx - p * bz
    rate[9] -= p * by - q * bx


@njit(cache=True)
def _step_kernel(packed: Array, state: Array, inputs: Array, dt_s: float) -> None:
    k = np.empty((4, 13))
    middle = np.empty(13)
    _rate_kernel(packed, state, inputs, k[0])
    for stage in range(1, 4):
        reach = dt_s if stage == 3 else 0.5 * dt_s
        for i in range(13):
            middle[i] = state[i] + reach * k[stage - 1, i]
        _rate_kernel(packed, middle, inputs, k[stage])
    for i in range(13):
        state[i] += dt_s / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    norm = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2 + state[6] ** 2)
    for i in range(3, 7):
        state[i] /= norm
