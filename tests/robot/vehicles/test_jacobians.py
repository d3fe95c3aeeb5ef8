"""Derivatives of the motion: equal to finite differences for every vehicle, and to each other as the step shrinks."""

from collections.abc import Callable

import numpy as np
import pytest
from moving_vehicles import ALL_VEHICLES, fast_state, vehicle_named

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.robot.vehicles import (
    RigidBody,
    Vehicle,
    acceleration,
    acceleration_jacobians,
    compile_body,
    step_rk4,
    step_rk4_jacobians,
    step_semi_implicit,
    step_semi_implicit_jacobians,
)

STEPS = [(step_rk4, step_rk4_jacobians), (step_semi_implicit, step_semi_implicit_jacobians)]


@pytest.fixture(scope="module", params=ALL_VEHICLES)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return vehicle_named(request.param)


def differences(function: Callable[[Array], Array], reach: Array) -> Array:
    """Fourth-order central differences about zero, with a reach per argument."""
    columns = []
    for k, h in enumerate(reach):
        e = np.zeros(len(reach))
        e[k] = h
        near, far = function(e) - function(-e), function(2 * e) - function(-2 * e)
        columns.append((8.0 * near - far) / (12.0 * h))
    return np.stack(columns, axis=1)


def assert_blocks_equal(got: Array, expected: Array, tolerance: float = 1e-6) -> None:
    """Each 3x3 block by itself, since forces and turns have different units and sizes."""
    for i in range(0, got.shape[0], 3):
        for j in range(0, got.shape[1], 3):
            a, b = got[i : i + 3, j : j + 3], expected[i : i + 3, j : j + 3]
            assert np.abs(a - b).max() <= tolerance * max(np.abs(a).max(), 1e-9), (i, j)


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_of_the_acceleration_are_its_differences(vehicle: Vehicle, seed: int) -> None:
    body = compile_body(vehicle, 1025.0, 9.8)
    _, q, nu, wrench, current = fast_state(vehicle, np.random.default_rng(seed))

    def moved(e: Array) -> Array:
        turned = quat_multiply(q, quat_from_rotvec(e[:3]))
        return acceleration(body, turned, nu + e[3:9], wrench + e[9:15], current + e[15:])

    force = 1e-3 * vehicle.mass_kg
    expected = differences(moved, np.concatenate([np.full(9, 1e-3), np.full(6, force), np.full(3, 1e-3)]))
    assert_blocks_equal(np.hstack(acceleration_jacobians(body, q, nu, wrench, current)), expected)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("step", "step_jacobians"), STEPS)
@pytest.mark.parametrize("dt", [0.005, 0.05])
def test_derivatives_of_a_step_are_its_differences(
    vehicle: Vehicle, step, step_jacobians, dt: float, seed: int
) -> None:
    body = compile_body(vehicle, 1025.0, 9.8)
    p, q, nu, wrench, current = fast_state(vehicle, np.random.default_rng(100 + seed))
    got = step_jacobians(body, p, q, nu, wrench, current, dt)

    def moved(e: Array) -> Array:
        turned = quat_multiply(q, quat_from_rotvec(e[3:6]))
        a, b, c = step(body, p + e[:3], turned, nu + e[6:12], wrench + e[12:], current, dt)
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(got.q_WB), b))
        return np.concatenate([a - got.p_WB_m, turn, c - got.nu_B])

    # The wrench moves things by its impulse, so its reach grows as the step shrinks.
    reach = np.concatenate([np.full(12, 1e-3), np.full(6, 1e-4 * np.diag(body.mass_matrix).mean() / dt)])
    assert_blocks_equal(np.hstack([got.by_state, got.by_wrench]), differences(moved, reach))


@pytest.mark.parametrize(("step", "step_jacobians"), STEPS)
def test_a_step_with_derivatives_is_the_same_step(vehicle: Vehicle, step, step_jacobians) -> None:
    body = compile_body(vehicle)
    start = fast_state(vehicle, np.random.default_rng(2))
    for got, expected in zip(step_jacobians(body, *start, 0.02), step(body, *start, 0.02), strict=False):
        assert np.array_equal(got, expected)


@pytest.mark.parametrize(("step", "step_jacobians"), STEPS)
def test_a_short_step_has_the_derivatives_of_the_rates(vehicle: Vehicle, step, step_jacobians) -> None:
    """(A - I) / dt tends to the derivatives of the rates, with an error that halves with the step."""
    body = compile_body(vehicle)
    p, q, nu, wrench, current = fast_state(vehicle, np.random.default_rng(3))
    rates = np.hstack(acceleration_jacobians(body, q, nu, wrench, current))

    def gap(dt: float) -> float:
        got = step_jacobians(body, p, q, nu, wrench, current, dt)
        by_state, by_wrench = (got.by_state - np.eye(12)) / dt, got.by_wrench / dt
        assert np.allclose(by_state[:3, 6:9], matrix_from_quat(q), atol=20.0 * dt)
        return float(np.abs(np.hstack([by_state[6:, 3:], by_wrench[6:]]) - rates[:, :15]).max() / np.abs(rates).max())

    assert gap(1e-4) < 0.05
    assert 1.8 < gap(2e-4) / gap(1e-4) < 2.2


def test_nothing_depends_on_where_in_the_water_the_vehicle_is(vehicle: Vehicle) -> None:
    body = compile_body(vehicle)
    for _, step_jacobians in STEPS:
        got = step_jacobians(body, *fast_state(vehicle, np.random.default_rng(4)), 0.02)
        assert np.array_equal(got.by_state[:, :3], np.eye(12)[:, :3])


def test_derivatives_at_rest_are_those_of_linear_drag() -> None:
    body: RigidBody = compile_body(vehicle_named("crooked"))
    got = acceleration_jacobians(body, np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(6), np.zeros(6), np.zeros(3))
    assert np.allclose(got.by_twist, -np.linalg.solve(body.mass_matrix, body.linear_damping), rtol=0.0, atol=1e-12)
    assert np.allclose(got.by_wrench @ body.mass_matrix, np.eye(6), rtol=0.0, atol=1e-12)
