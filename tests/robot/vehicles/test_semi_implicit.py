"""The semi-implicit step: second order, and stable at any drag and any length of step."""

from dataclasses import replace

import numpy as np
import pytest
from energy_balance import mechanical_energy
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_vehicles import ALL_VEHICLES, LEVEL, STILL, neutral, random_state, vehicle_named

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles import Vehicle, compile_body, load_vehicle, step_rk4, step_semi_implicit


@pytest.fixture(scope="module", params=ALL_VEHICLES)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return vehicle_named(request.param)


def with_linear_drag(vehicle: Vehicle, rate_per_s: float) -> Vehicle:
    """A vehicle in treacle: every motion dies at about this rate."""
    drag = rate_per_s * compile_body(vehicle).mass_matrix
    return replace(vehicle, hydrodynamics=replace(vehicle.hydrodynamics, linear_damping=drag))


def test_halving_the_step_cuts_the_error_by_four() -> None:
    # No sign of the velocity changes here, so that |u| u is smooth.
    body = compile_body(vehicle_named("crooked"))
    wrench, current = np.array([8.0, 5.0, 6.0, 0.4, 0.4, 0.4]), np.array([-0.2, -0.1, -0.1])
    start = np.array([0.5, 0.4, 0.3, 0.4, 0.3, 0.5])

    def end(step, steps: int) -> Array:
        p, q, nu = np.zeros(3), LEVEL, start
        for _ in range(steps):
            p, q, nu = step(body, p, q, nu, wrench, current, 0.4 / steps)
        return np.concatenate([p, q, nu])

    exact = end(step_rk4, 400)
    errors = [np.linalg.norm(end(step_semi_implicit, steps) - exact) for steps in (40, 80, 160)]
    assert 3.6 < errors[0] / errors[1] < 4.4
    assert 3.8 < errors[1] / errors[2] < 4.2


def test_stiff_drag_with_a_step_at_which_runge_kutta_blows_up(vehicle: Vehicle) -> None:
    """Motion dies at 200 per second, the step is 0.1 s: one method leaves all bounds, the other finds the balance."""
    body = compile_body(neutral(with_linear_drag(vehicle, 200.0), arm_m=0.0))
    wrench = body.linear_damping @ np.full(6, 0.05)

    def end(step) -> Array:
        p, q, nu = np.zeros(3), LEVEL, np.full(6, 0.5)
        for _ in range(60):
            p, q, nu = step(body, p, q, nu, wrench, STILL, 0.1)
        return nu

    assert not np.abs(end(step_rk4)).max() < 1e6
    settled = end(step_semi_implicit)
    p, q, nu = np.zeros(3), LEVEL, settled
    for _ in range(1200):
        p, q, nu = step_rk4(body, p, q, nu, wrench, STILL, 0.005)
    assert np.allclose(settled, nu, rtol=0.0, atol=1e-4 * np.abs(nu).max())


def test_a_stiff_motion_dies_within_a_step_and_does_not_ring(vehicle: Vehicle) -> None:
    body = compile_body(neutral(with_linear_drag(vehicle, 1e6), arm_m=0.0))
    p, _, nu = step_semi_implicit(body, np.zeros(3), LEVEL, np.full(6, 0.5), np.zeros(6), STILL, 0.1)
    assert np.abs(nu).max() < 1e-4
    assert np.abs(p).max() < 1e-4


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 100_000), exponent=st.floats(-3.0, 3.0), speed=st.floats(0.01, 100.0))
def test_however_long_the_step_the_relative_motion_loses_energy(
    vehicle: Vehicle, seed: int, exponent: float, speed: float
) -> None:
    body = compile_body(neutral(vehicle, arm_m=0.0))
    rng = np.random.default_rng(seed)
    p, q, nu = random_state(rng)
    current, nu = 0.5 * rng.normal(size=3), speed * nu
    for _ in range(3):
        before = mechanical_energy(body, p, q, nu, current).kinetic_J
        p, q, nu = step_semi_implicit(body, p, q, nu, np.zeros(6), current, 10.0**exponent)
        # What is left beside a current can be smaller than the rounding of the current's own energy.
        rounding = 1e-14 * float(np.trace(body.mass_matrix)) * (1.0 + float(current @ current))
        assert mechanical_energy(body, p, q, nu, current).kinetic_J <= before * (1.0 + 1e-10) + rounding


def test_a_push_from_rest_never_overshoots_the_speed_that_drag_allows() -> None:
    """Quadratic drag is nothing at rest: a method that linearises there shoots far past the terminal speed."""
    vehicle = (
        load_vehicle("bluerov2-heavy-gazebo") if "bluerov2-heavy-gazebo" in ALL_VEHICLES else load_vehicle("paper")
    )
    body = compile_body(neutral(vehicle))
    push = np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    a, b = body.quadratic_damping[0], body.linear_damping[0, 0]
    terminal = (np.sqrt(b * b + 4.0 * a * push[0]) - b) / (2.0 * a)
    for dt in np.geomspace(0.01, 100.0, 20):
        _, _, nu = step_semi_implicit(body, np.zeros(3), LEVEL, np.zeros(6), push, STILL, dt)
        assert 0.0 < nu[0] <= terminal


def test_a_vehicle_adrift_is_carried_exactly_by_the_current(vehicle: Vehicle) -> None:
    body = compile_body(neutral(vehicle, arm_m=0.0))
    _, q, _ = random_state(np.random.default_rng(1))
    current = np.array([0.4, -0.3, 0.1])
    nu = np.concatenate([matrix_from_quat(q).T @ current, np.zeros(3)])
    p, r, mu = step_semi_implicit(body, np.zeros(3), q, nu, np.zeros(6), current, 10.0)
    assert np.allclose(p, 10.0 * current, rtol=0.0, atol=1e-10)
    assert np.allclose(r, q, rtol=0.0, atol=1e-10)
    assert np.allclose(mu, nu, rtol=0.0, atol=1e-10)
