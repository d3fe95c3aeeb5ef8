"""Six-degree-of-freedom motion: laws that hold for any vehicle, and states computed by others.

M = M' > 0 | C does no work | D takes energy | a trimmed vehicle rests | current = a moving frame
"""

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_vehicles import ALL_VEHICLES, LEVEL, STILL, neutral, random_state, vehicle_named

from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_euler
from wakewise.robot.vehicles import (
    Vehicle,
    acceleration,
    compile_body,
    coriolis_wrench,
    damping_wrench,
    load_vehicle,
    restoring_wrench,
    step_rk4,
    step_semi_implicit,
)

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
STEPS = [step_rk4, step_semi_implicit]


@pytest.fixture(scope="module", params=ALL_VEHICLES)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return vehicle_named(request.param)


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


@pytest.mark.parametrize("step", STEPS)
def test_a_neutral_vehicle_at_rest_stays_for_a_minute(vehicle: Vehicle, step) -> None:
    body = compile_body(neutral(vehicle))
    start = np.array([1.0, 2.0, 0.5])
    p, q, nu = start, quat_from_euler(0.0, 0.0, 0.7), np.zeros(6)
    for _ in range(3000):
        p, q, nu = step(body, p, q, nu, np.zeros(6), STILL, 0.02)
    assert np.abs(nu).max() < 1e-12
    assert np.allclose(p, start, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("step", STEPS)
def test_with_both_centres_in_one_point_a_neutral_vehicle_rests_in_any_attitude(vehicle: Vehicle, step) -> None:
    body = compile_body(neutral(vehicle, arm_m=0.0))
    p, q, nu = np.zeros(3), quat_from_euler(1.1, -0.7, 2.0), np.zeros(6)
    for _ in range(500):
        p, q, nu = step(body, p, q, nu, np.zeros(6), STILL, 0.02)
    assert np.abs(nu).max() < 1e-11
    assert np.allclose(q, quat_from_euler(1.1, -0.7, 2.0), rtol=0.0, atol=1e-10)


def test_a_tilted_vehicle_rights_itself() -> None:
    body = compile_body(load_vehicle("paper"))
    p, q, nu = np.zeros(3), quat_from_euler(0.6, -0.4, 0.0), np.zeros(6)
    for _ in range(6000):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.02)
    assert matrix_from_quat(q)[2, 2] > 0.999


def test_a_vehicle_adrift_moves_with_the_current_and_stays_with_it(vehicle: Vehicle) -> None:
    """At the current's own velocity nothing but weight and buoyancy acts, also while turning in the world."""
    body = compile_body(vehicle)
    _, q, _ = random_state(np.random.default_rng(5))
    current = np.array([0.3, -0.2, 0.1])
    nu = np.concatenate([matrix_from_quat(q).T @ current, np.zeros(3)])
    rest = acceleration(body, q, np.zeros(6), np.zeros(6), STILL)
    assert np.allclose(acceleration(body, q, nu, np.zeros(6), current), rest, atol=1e-12)


@pytest.mark.parametrize("step", STEPS)
def test_a_constant_current_is_a_moving_frame(vehicle: Vehicle, step) -> None:
    """A path in a current is the path in still water carried along, to the accuracy of the integrator."""
    body = compile_body(vehicle)
    rng = np.random.default_rng(2)
    p0, q0, nu0 = random_state(rng)
    current, wrench, dt, steps = np.array([0.4, -0.3, 0.1]), rng.normal(size=6), 0.002, 500
    p, q, nu = p0, q0, nu0
    a, r, mu = p0, q0, nu0 + np.concatenate([matrix_from_quat(q0).T @ current, np.zeros(3)])
    for _ in range(steps):
        p, q, nu = step(body, p, q, nu, wrench, STILL, dt)
        a, r, mu = step(body, a, r, mu, wrench, current, dt)
    assert np.allclose(a - current * dt * steps, p, atol=1e-8)
    assert np.allclose(r, q, atol=1e-8)
    assert np.allclose(matrix_from_quat(r) @ mu[:3] - current, matrix_from_quat(q) @ nu[:3], atol=1e-8)


@pytest.mark.parametrize("step", STEPS)
def test_the_quaternion_keeps_its_length_and_the_inputs_are_left_alone(step) -> None:
    body = compile_body(load_vehicle("paper"))
    p, q, nu = np.zeros(3), LEVEL.copy(), np.full(6, 2.0)
    _, turned, _ = step(body, p, q, nu, np.zeros(6), STILL, 0.05)
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


def test_a_quaternion_of_no_length_is_no_attitude() -> None:
    """Runge-Kutta refuses it instead of going on with NaN."""
    zero, body = np.zeros(6), compile_body(vehicle_named("bluerov2"))
    with pytest.raises(ZeroDivisionError):
        step_rk4(body, np.zeros(3), np.zeros(4), zero, zero, np.zeros(3), 0.01)
