"""The equations of motion as the book prints them, with matrices: the readable twin of the compiled kernels.

T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021. Every matrix is about the
body origin, expressed in B, in the order surge, sway, heave, roll, pitch, yaw. Slow and plain on purpose: `dynamics`
does the same a hundred times faster, and the tests hold both together. One thing is done otherwise than in the kernels,
so that each checks the other: the rigid body moves with its absolute velocity and only the added mass with the velocity
relative to the water, M_RB dnu/dt + C_RB(nu) nu + M_A dnu_r/dt + C_A(nu_r) nu_r + D(nu_r) nu_r + g(q) = tau.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat, quat_multiply, skew
from wakewise.robot.vehicles.vehicle import Vehicle


def rigid_body_mass(vehicle: Vehicle) -> Array:
    """M_RB about the body origin, shape (6, 6); S(p_BG) couples force and turning (chapter 3)."""
    m, S_G = vehicle.mass_kg, skew(vehicle.p_BG_m)
    inertia_B = vehicle.inertia_kg_m2 - m * (S_G @ S_G)
    return np.block([[m * np.eye(3), -m * S_G], [m * S_G, inertia_B]])


def mass_matrix(vehicle: Vehicle) -> Array:
    """M = M_RB + M_A, shape (6, 6); symmetric and positive definite."""
    return rigid_body_mass(vehicle) + vehicle.hydrodynamics.added_mass


def rigid_body_coriolis(vehicle: Vehicle, nu: Array) -> Array:
    """C_RB(nu), shape (6, 6), in the form that depends on the angular velocity alone (chapter 3)."""
    m, S_G, S_w = vehicle.mass_kg, skew(vehicle.p_BG_m), skew(nu[3:])
    inertia_B = vehicle.inertia_kg_m2 - m * (S_G @ S_G)
    return np.block([[m * S_w, -m * S_w @ S_G], [m * S_G @ S_w, -skew(inertia_B @ nu[3:])]])


def coriolis_matrix(mass: Array, nu: Array) -> Array:
    """C(nu), shape (6, 6) and skew, of any symmetric mass matrix: C_A of M_A, or C of M (chapters 3 and 6)."""
    S_v, S_w = skew(mass[:3] @ nu), skew(mass[3:] @ nu)
    return np.block([[np.zeros((3, 3)), -S_v], [-S_v, -S_w]])


def damping_matrix(vehicle: Vehicle, nu_r: Array) -> Array:
    """D(nu_r) = D_l + D_q diag(abs(nu_r)), shape (6, 6) (chapter 6)."""
    water = vehicle.hydrodynamics
    return water.linear_damping + water.quadratic_damping @ np.diag(np.abs(nu_r))


def restoring_vector(vehicle: Vehicle, R_WB: Array, rho: float, gravity: float) -> Array:
    """g(eta), shape (6,), of weight at the centre of gravity and buoyancy at the centre of buoyancy (chapter 4)."""
    f_g = R_WB.T @ np.array([0.0, 0.0, vehicle.mass_kg * gravity])
    f_b = R_WB.T @ np.array([0.0, 0.0, -rho * gravity * vehicle.displaced_volume_m3])
    return -np.concatenate([f_g + f_b, np.cross(vehicle.p_BG_m, f_g) + np.cross(vehicle.p_BB_m, f_b)])


def acceleration(
    vehicle: Vehicle, rho: float, gravity: float, R_WB: Array, nu: Array, wrench_B: Array, current_W: Array
) -> Array:
    """dnu/dt, shape (6,), in water of density rho that moves uniformly with velocity `current_W`, shape (3,)."""
    nu_c = np.concatenate([R_WB.T @ current_W, np.zeros(3)])
    # Constant in the world, the current turns against the body (chapter 10).
    nu_c_dot = np.concatenate([-skew(nu[3:]) @ nu_c[:3], np.zeros(3)])
    nu_r = nu - nu_c
    M_A = vehicle.hydrodynamics.added_mass
    tau = (
        wrench_B
        - rigid_body_coriolis(vehicle, nu) @ nu
        - coriolis_matrix(M_A, nu_r) @ nu_r
        - damping_matrix(vehicle, nu_r) @ nu_r
        - restoring_vector(vehicle, R_WB, rho, gravity)
        + M_A @ nu_c_dot
    )
    return np.linalg.solve(mass_matrix(vehicle), tau)


def step_rk4(
    vehicle: Vehicle,
    rho: float,
    gravity: float,
    p_WB: Array,
    q_WB: Array,
    nu: Array,
    wrench_B: Array,
    current_W: Array,
    dt: float,
) -> tuple[Array, Array, Array]:
    """Classical Runge-Kutta step of position, quaternion and twist; arguments as in `dynamics.step_rk4`."""

    def rate(x: Array) -> Array:
        q, v = x[3:7], x[7:]
        # Stages lie off the unit sphere: this quadratic form of R is the one that the kernels continue there.
        R_WB = np.eye(3) + 2.0 * q[0] * skew(q[1:]) + 2.0 * skew(q[1:]) @ skew(q[1:])
        turning = 0.5 * quat_multiply(q, np.concatenate([[0.0], v[3:]]))
        dv = acceleration(vehicle, rho, gravity, R_WB, v, wrench_B, current_W)
        return np.concatenate([R_WB @ v[:3], turning, dv])

    x = np.concatenate([p_WB, q_WB, nu])
    k1 = rate(x)
    k2 = rate(x + 0.5 * dt * k1)
    k3 = rate(x + 0.5 * dt * k2)
    k4 = rate(x + dt * k3)
    x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x[:3], x[3:7] / np.linalg.norm(x[3:7]), x[7:]


def step_semi_implicit(
    vehicle: Vehicle,
    rho: float,
    gravity: float,
    p_WB: Array,
    q_WB: Array,
    nu: Array,
    wrench_B: Array,
    current_W: Array,
    dt: float,
) -> tuple[Array, Array, Array]:
    """Semi-implicit step as `semi_implicit` describes it; arguments as in `dynamics.step_semi_implicit`."""
    M, gamma = mass_matrix(vehicle), 1.0 - 1.0 / np.sqrt(2.0)

    def N(nu_r: Array) -> Array:
        return coriolis_matrix(M, nu_r) + damping_matrix(vehicle, nu_r)

    def tau(q: Array) -> Array:
        return wrench_B - restoring_vector(vehicle, matrix_from_quat(q), rho, gravity)

    def turn(q: Array, omega: Array, duration: float) -> Array:
        q = quat_multiply(q, np.concatenate([[1.0], 0.5 * duration * omega]))
        return q / np.linalg.norm(q)

    nu_0 = nu - np.concatenate([matrix_from_quat(q_WB).T @ current_W, np.zeros(3)])
    nu_m = np.linalg.solve(M + 0.5 * dt * N(nu_0), M @ nu_0 + 0.5 * dt * tau(q_WB))
    q_m = turn(q_WB, nu_m[3:], 0.5 * dt)

    E, force = M + gamma * dt * N(nu_m), tau(q_m)
    k1 = np.linalg.solve(E, force - N(nu_m) @ nu_0)
    k2 = np.linalg.solve(E, force - N(nu_m) @ (nu_0 + (1.0 - gamma) * dt * k1))
    first = nu_0 + gamma * dt * k1
    last = nu_0 + dt * ((1.0 - gamma) * k1 + gamma * k2)
    mean = (1.0 - gamma) * first + gamma * last
    p = p_WB + dt * (matrix_from_quat(q_m) @ mean[:3] + current_W)
    q = turn(q_WB, mean[3:], dt)
    return p, q, last + np.concatenate([matrix_from_quat(q).T @ current_W, np.zeros(3)])
