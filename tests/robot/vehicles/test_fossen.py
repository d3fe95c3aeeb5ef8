"""The book's matrices: their own identities, and that the compiled kernels compute the same motion."""

from dataclasses import replace

import numpy as np
import pytest
from moving_vehicles import ALL_VEHICLES, fast_state, vehicle_named

from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles import (
    Vehicle,
    acceleration,
    compile_body,
    coriolis_wrench,
    damping_wrench,
    fossen,
    restoring_wrench,
    step_rk4,
    step_semi_implicit,
)

RHO, GRAVITY = 1025.0, 9.8


@pytest.fixture(scope="module", params=ALL_VEHICLES)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return vehicle_named(request.param)


@pytest.mark.parametrize("seed", range(6))
def test_the_kernels_compute_the_textbook_acceleration_also_in_a_current(vehicle: Vehicle, seed: int) -> None:
    _, q, nu, wrench, current = fast_state(vehicle, np.random.default_rng(seed))
    got = acceleration(compile_body(vehicle, RHO, GRAVITY), q, nu, wrench, current)
    expected = fossen.acceleration(vehicle, RHO, GRAVITY, matrix_from_quat(q), nu, wrench, current)
    assert np.abs(got - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("kernel", "twin"), [(step_rk4, fossen.step_rk4), (step_semi_implicit, fossen.step_semi_implicit)]
)
def test_the_kernels_take_the_textbook_steps(vehicle: Vehicle, kernel, twin, seed: int) -> None:
    start = fast_state(vehicle, np.random.default_rng(seed))
    got = np.concatenate(kernel(compile_body(vehicle, RHO, GRAVITY), *start, 0.05))
    expected = np.concatenate(twin(vehicle, RHO, GRAVITY, *start, 0.05))
    assert np.abs(got - expected).max() < 1e-12 * np.abs(expected).max()


def test_each_wrench_is_that_of_its_matrix(vehicle: Vehicle) -> None:
    body = compile_body(vehicle, RHO, GRAVITY)
    _, q, nu, _, _ = fast_state(vehicle, np.random.default_rng(3))
    C, D = fossen.coriolis_matrix(body.mass_matrix, nu), fossen.damping_matrix(vehicle, nu)
    g = fossen.restoring_vector(vehicle, matrix_from_quat(q), RHO, GRAVITY)
    for got, expected in (
        (coriolis_wrench(body, nu), -C @ nu),
        (damping_wrench(body, nu), -D @ nu),
        (restoring_wrench(body, q), -g),
    ):
        assert np.abs(got - expected).max() <= 1e-12 * np.abs(expected).max()


def test_both_forms_of_the_rigid_bodys_coriolis_matrix_are_skew_and_push_alike(vehicle: Vehicle) -> None:
    _, _, nu, _, _ = fast_state(vehicle, np.random.default_rng(4))
    by_omega = fossen.rigid_body_coriolis(vehicle, nu)
    by_momentum = fossen.coriolis_matrix(fossen.rigid_body_mass(vehicle), nu)
    scale = np.abs(by_omega).max()
    for C in (by_omega, by_momentum):
        assert np.abs(C + C.T).max() <= 1e-12 * scale
    assert np.abs((by_omega - by_momentum) @ nu).max() <= 1e-12 * np.abs(by_omega @ nu).max()


def test_the_rigid_body_is_that_of_its_point_masses() -> None:
    """M_RB and C_RB of masses at points give the momentum and its change that Newton gives each of them."""
    rng = np.random.default_rng(0)
    masses, points = rng.uniform(0.5, 2.0, size=20), 0.3 * rng.normal(size=(20, 3))
    m, centre = masses.sum(), masses @ points / masses.sum()
    arms = points - centre
    inertia = np.einsum("n,nk,nk->", masses, arms, arms) * np.eye(3) - np.einsum("n,ni,nj->ij", masses, arms, arms)
    vehicle = vehicle_named("paper")
    vehicle = replace(vehicle, mass_kg=float(m), p_BG_m=centre, inertia_kg_m2=inertia)
    nu, nu_dot = rng.normal(size=6), rng.normal(size=6)
    v, w, a, alpha = nu[:3], nu[3:], nu_dot[:3], nu_dot[3:]
    pulls = masses[:, None] * (a + np.cross(w, v) + np.cross(alpha, points) + np.cross(w, np.cross(w, points)))
    expected = np.concatenate([pulls.sum(axis=0), np.cross(points, pulls).sum(axis=0)])
    got = fossen.rigid_body_mass(vehicle) @ nu_dot + fossen.rigid_body_coriolis(vehicle, nu) @ nu
    assert np.allclose(got, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
