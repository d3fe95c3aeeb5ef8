"""Six-degree-of-freedom motion: laws that hold for any vehicle, a readable twin, and states computed by others.

energy never grows without thrust | C does no work | D takes energy | a trimmed vehicle rests
current = a moving frame          | kernel = textbook matrices       | Runge-Kutta is of fourth order
"""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.geometry import matrix_from_quat, quat_from_euler, skew
from wakewise.vehicles import (
    RigidBody,
    Vehicle,
    acceleration,
    compile_body,
    coriolis_wrench,
    damping_wrench,
    load_vehicle,
    restoring_wrench,
    rigid_body_mass,
    step_rk4,
    vehicle_names,
)

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))
STILL = np.zeros(3)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def crooked(vehicle: Vehicle) -> Vehicle:
    """A vehicle with nothing symmetric, so that every term of the equations counts."""
    rng = np.random.default_rng(7)
    root = 0.3 * rng.normal(size=(6, 6))
    water = vehicle.hydrodynamics
    return replace(
        vehicle,
        p_BG_m=np.array([0.02, -0.01, 0.03]),
        p_BB_m=np.array([-0.01, 0.015, -0.02]),
        inertia_kg_m2=vehicle.inertia_kg_m2 + np.array([[0.02, 0.01, 0.0], [0.01, 0.02, -0.01], [0.0, -0.01, 0.02]]),
        hydrodynamics=replace(
            water, added_mass=water.added_mass + root @ root.T, linear_damping=water.linear_damping + root.T @ root
        ),
    )


@pytest.fixture(scope="module", params=[*vehicle_names(), "crooked"])
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return crooked(load_vehicle("paper")) if request.param == "crooked" else load_vehicle(request.param)


def random_state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    q = rng.normal(size=4)
    return rng.normal(size=3), q / np.linalg.norm(q), rng.normal(size=6)


def textbook_coriolis(mass: Array, nu: Array) -> Array:
    """C(nu) from any symmetric mass matrix (Fossen 2021, theorem on the parametrisation of C, chapter 3)."""
    C = np.zeros((6, 6))
    C[:3, 3:] = -skew(mass[:3, :3] @ nu[:3] + mass[:3, 3:] @ nu[3:])
    C[3:, :3] = C[:3, 3:]
    C[3:, 3:] = -skew(mass[3:, :3] @ nu[:3] + mass[3:, 3:] @ nu[3:])
    return C


def textbook_acceleration(
    vehicle: Vehicle, rho: float, g: float, q: Array, nu: Array, wrench: Array, current: Array
) -> Array:
    """The equations as printed, with matrices: the slow twin of the kernel."""
    R = matrix_from_quat(q)
    nu_c = np.concatenate([R.T @ current, np.zeros(3)])
    nu_c_dot = np.concatenate([-np.cross(nu[3:], nu_c[:3]), np.zeros(3)])
    nu_r = nu - nu_c
    M_RB, M_A = rigid_body_mass(vehicle), vehicle.hydrodynamics.added_mass
    # Rigid body with the absolute velocity in the form of C_RB that depends on the angular velocity alone.
    S_w, m, S_G = skew(nu[3:]), vehicle.mass_kg, skew(vehicle.p_BG_m)
    C_RB = np.zeros((6, 6))
    C_RB[:3, :3] = m * S_w
    C_RB[:3, 3:] = -m * S_w @ S_G
    C_RB[3:, :3] = m * S_G @ S_w
    I_B = vehicle.inertia_kg_m2 - m * S_G @ S_G
    C_RB[3:, 3:] = -skew(I_B @ nu[3:])
    D = vehicle.hydrodynamics.linear_damping + vehicle.hydrodynamics.quadratic_damping @ np.diag(np.abs(nu_r))
    weight, buoyancy = R.T @ [0, 0, m * g], R.T @ [0, 0, -rho * g * vehicle.displaced_volume_m3]
    restoring = np.concatenate(
        [weight + buoyancy, np.cross(vehicle.p_BG_m, weight) + np.cross(vehicle.p_BB_m, buoyancy)]
    )
    right = wrench + restoring - C_RB @ nu - textbook_coriolis(M_A, nu_r) @ nu_r - D @ nu_r + M_A @ nu_c_dot
    return np.linalg.solve(M_RB + M_A, right)


def test_accelerations_agree_with_three_public_programs() -> None:
    """Two hundred states of von Benzon's set (rho 1000, g 9.82) within 1e-9 of the largest component."""
    path = DATA / "dynamics" / "oracle_fossen_bluerov2heavy_200.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    body = compile_body(load_vehicle("bluerov2-heavy"), 1000.0, 9.82)
    worst, rows = 0.0, 0
    with path.open() as file:
        for row in csv.DictReader(file):
            angles, nu, wrench, expected = (
                np.array([float(row[name]) for name in names.split()])
                for names in ("phi theta psi", "u v w p q r", "tauX tauY tauZ tauK tauM tauN", "du dv dw dp dq dr")
            )
            got = acceleration(body, quat_from_euler(*angles), nu, wrench, STILL)
            worst = max(worst, float(np.abs(got - expected).max() / np.abs(expected).max()))
            rows += 1
    assert rows == 200
    assert worst < 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_the_kernel_equals_the_textbook_matrices_also_in_a_current(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, q, nu = random_state(rng)
    wrench, current = 10.0 * rng.normal(size=6), 0.5 * rng.normal(size=3)
    got = acceleration(compile_body(vehicle, 1025.0, 9.8), q, nu, wrench, current)
    expected = textbook_acceleration(vehicle, 1025.0, 9.8, q, nu, wrench, current)
    assert np.abs(got - expected).max() < 1e-11 * np.abs(expected).max()


def test_the_mass_matrix_is_symmetric_and_positive_definite(vehicle: Vehicle) -> None:
    M = compile_body(vehicle).mass_matrix
    assert np.array_equal(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0.0


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_coriolis_does_no_work_and_damping_takes_energy(vehicle: Vehicle, seed: int) -> None:
    body = compile_body(vehicle)
    nu = np.random.default_rng(seed).normal(size=6)
    coriolis = coriolis_wrench(body, nu)
    assert abs(nu @ coriolis) <= 1e-13 * np.abs(coriolis).sum() * np.abs(nu).max()
    assert nu @ damping_wrench(body, nu) <= 0.0


def test_the_coriolis_wrench_is_that_of_the_matrix(vehicle: Vehicle) -> None:
    body = compile_body(vehicle)
    nu = np.random.default_rng(3).normal(size=6)
    assert np.allclose(coriolis_wrench(body, nu), -textbook_coriolis(body.mass_matrix, nu) @ nu, atol=1e-12)


def energy(body: RigidBody, p: Array, q: Array, nu: Array) -> float:
    R = matrix_from_quat(q)
    depth_G, depth_B = (p + R @ body.p_BG_m)[2], (p + R @ body.p_BB_m)[2]
    return float(0.5 * nu @ body.mass_matrix @ nu - body.weight_N * depth_G + body.buoyancy_N * depth_B)


@pytest.mark.parametrize("seed", range(3))
def test_energy_never_grows_without_thrust(vehicle: Vehicle, seed: int) -> None:
    body = compile_body(vehicle)
    p, q, nu = random_state(np.random.default_rng(seed))
    before = energy(body, p, q, nu)
    scale = abs(before)
    for _ in range(500):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.01)
        after = energy(body, p, q, nu)
        assert after <= before + 1e-7 * scale
        before = after


def test_energy_is_kept_without_drag(vehicle: Vehicle) -> None:
    water = vehicle.hydrodynamics
    body = compile_body(
        replace(
            vehicle,
            hydrodynamics=replace(water, linear_damping=np.zeros((6, 6)), quadratic_damping=np.zeros((6, 6))),
        )
    )
    p, q, nu = random_state(np.random.default_rng(1))
    start = energy(body, p, q, nu)
    for _ in range(1000):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.002)
    assert abs(energy(body, p, q, nu) - start) < 1e-7 * abs(start)


def test_a_neutral_vehicle_at_rest_stays() -> None:
    body = compile_body(load_vehicle("paper"))
    p, q, nu = np.array([1.0, 2.0, 0.5]), quat_from_euler(0.0, 0.0, 0.7), np.zeros(6)
    for _ in range(1000):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.02)
    assert np.abs(nu).max() < 1e-12
    assert np.allclose(p, [1.0, 2.0, 0.5], atol=1e-12)


def test_a_tilted_vehicle_rights_itself() -> None:
    body = compile_body(load_vehicle("paper"))
    p, q, nu = np.zeros(3), quat_from_euler(0.6, -0.4, 0.0), np.zeros(6)
    for _ in range(6000):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.02)
    assert matrix_from_quat(q)[2, 2] > 0.999


def test_a_vehicle_adrift_moves_with_the_current_and_stays_with_it(vehicle: Vehicle) -> None:
    """At the current's own velocity nothing but weight and buoyancy acts, also while turning in the world."""
    body = compile_body(vehicle)
    rng = np.random.default_rng(5)
    _, q, _ = random_state(rng)
    current = np.array([0.3, -0.2, 0.1])
    nu = np.concatenate([matrix_from_quat(q).T @ current, np.zeros(3)])
    rest = acceleration(body, q, np.zeros(6), np.zeros(6), STILL)
    assert np.allclose(acceleration(body, q, nu, np.zeros(6), current), rest, atol=1e-12)


def test_a_constant_current_is_a_moving_frame(vehicle: Vehicle) -> None:
    """A path in a current is the path in still water carried along, to the accuracy of the integrator."""
    body = compile_body(vehicle)
    rng = np.random.default_rng(2)
    p0, q0, nu0 = random_state(rng)
    current, wrench, dt, steps = np.array([0.4, -0.3, 0.1]), rng.normal(size=6), 0.002, 500
    p, q, nu = p0, q0, nu0
    a, r, mu = p0, q0, nu0 + np.concatenate([matrix_from_quat(q0).T @ current, np.zeros(3)])
    for _ in range(steps):
        p, q, nu = step_rk4(body, p, q, nu, wrench, STILL, dt)
        a, r, mu = step_rk4(body, a, r, mu, wrench, current, dt)
    assert np.allclose(a - current * dt * steps, p, atol=1e-8)
    assert np.allclose(r, q, atol=1e-8)
    assert np.allclose(matrix_from_quat(r) @ mu[:3] - current, matrix_from_quat(q) @ nu[:3], atol=1e-8)


def test_halving_the_step_cuts_the_error_by_sixteen() -> None:
    # No sign of the velocity changes here, so that |u| u is smooth.
    body = compile_body(crooked(load_vehicle("paper")))
    wrench = np.array([8.0, 5.0, 6.0, 0.4, 0.4, 0.4])
    start = np.array([0.5, 0.4, 0.3, 0.4, 0.3, 0.5])

    def end(steps: int) -> Array:
        p, q, nu = np.zeros(3), LEVEL, start
        for _ in range(steps):
            p, q, nu = step_rk4(body, p, q, nu, wrench, STILL, 0.4 / steps)
        return np.concatenate([p, q, nu])

    exact = end(640)
    ratio = np.linalg.norm(end(10) - exact) / np.linalg.norm(end(20) - exact)
    assert 12.0 < ratio < 22.0


def test_the_quaternion_keeps_its_length_and_the_inputs_are_left_alone() -> None:
    body = compile_body(load_vehicle("paper"))
    p, q, nu = np.zeros(3), LEVEL.copy(), np.full(6, 2.0)
    _, turned, _ = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.05)
    assert np.isclose(np.linalg.norm(turned), 1.0, atol=1e-15)
    assert np.array_equal(q, LEVEL)
    assert np.array_equal(nu, np.full(6, 2.0))


def test_weight_pulls_down_at_g_and_buoyancy_up() -> None:
    vehicle = load_vehicle("paper")
    body = compile_body(vehicle, 1100.0, 10.0)
    assert np.allclose(restoring_wrench(body, LEVEL), [0, 0, 45.0 - 49.5, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize(("rho", "g"), [(0.0, 9.8), (float("nan"), 9.8), (1000.0, -1.0)])
def test_water_without_density_or_gravity_is_refused(rho: float, g: float) -> None:
    with pytest.raises(InputError, match="more than 0"):
        compile_body(load_vehicle("paper"), rho, g)
