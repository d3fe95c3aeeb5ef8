"""Energy and power: what the wrench puts in and drag takes out is what the motion gains, for every vehicle.

energy never grows without thrust | no drag, no loss | balance closes to the integrator's error | rates = differences
"""

import numpy as np
import pytest
from energy_balance import mechanical_energy, mechanical_power
from moving_vehicles import ALL_VEHICLES, STILL, fast_state, random_state, vehicle_named, without_drag

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec, quat_multiply
from wakewise.robot.vehicles import (
    RigidBody,
    Vehicle,
    acceleration,
    compile_body,
    fossen,
    step_rk4,
    step_semi_implicit,
)


@pytest.fixture(scope="module", params=ALL_VEHICLES)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return vehicle_named(request.param)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("step", "dt", "error"), [(step_rk4, 0.01, 1e-7), (step_semi_implicit, 0.002, 1e-7)])
def test_energy_never_grows_without_thrust_in_still_water(
    vehicle: Vehicle, step, dt: float, error: float, seed
) -> None:
    body = compile_body(vehicle)
    p, q, nu = random_state(np.random.default_rng(seed))
    start = mechanical_energy(body, p, q, nu)
    before, scale = start.total_J, start.kinetic_J + abs(start.potential_J)
    for _ in range(500):
        p, q, nu = step(body, p, q, nu, np.zeros(6), STILL, dt)
        after = mechanical_energy(body, p, q, nu).total_J
        assert after <= before + error * scale
        before = after


def test_energy_is_kept_without_drag(vehicle: Vehicle) -> None:
    body = compile_body(without_drag(vehicle))
    p, q, nu = random_state(np.random.default_rng(1))
    start = mechanical_energy(body, p, q, nu)
    for _ in range(1000):
        p, q, nu = step_rk4(body, p, q, nu, np.zeros(6), STILL, 0.002)
    end = mechanical_energy(body, p, q, nu).total_J
    assert abs(end - start.total_J) < 1e-7 * (start.kinetic_J + abs(start.potential_J))


def imbalance(body: RigidBody, start: tuple[Array, Array, Array, Array, Array], steps: int) -> float:
    """Gain of energy in 0.25 s less the integral of the power (Simpson), relative to all work done."""
    p, q, nu, wrench, current = start
    half = 0.125 / steps
    gained, put_in, work = mechanical_energy(body, p, q, nu, current).total_J, 0.0, 0.0
    for _ in range(steps):
        for k in range(3):
            now = mechanical_power(body, q, nu, wrench, current)
            weight = half / 3.0 * (4.0 if k == 1 else 1.0)
            put_in += weight * now.net_W
            work += weight * (abs(now.wrench_W) + now.dissipated_W)
            if k < 2:
                p, q, nu = step_rk4(body, p, q, nu, wrench, current, half)
    gained = mechanical_energy(body, p, q, nu, current).total_J - gained
    return abs(gained - put_in) / work


@pytest.mark.parametrize("seed", range(2))
def test_the_balance_of_energy_closes_also_in_a_current(vehicle: Vehicle, seed: int) -> None:
    # Steps of 0.6 ms: where a velocity changes its sign, abs(u) u has a kink and the integrator is of third order only.
    start = fast_state(vehicle, np.random.default_rng(seed))
    assert imbalance(compile_body(vehicle), start, 200) < 1e-7


def test_the_balance_closes_to_the_error_of_the_integrator() -> None:
    """Halving the step cuts what is missing by sixteen (no velocity changes its sign here)."""
    vehicle = vehicle_named("crooked")
    body = compile_body(vehicle)
    q, wrench = np.array([1.0, 0.0, 0.0, 0.0]), np.array([8.0, 5.0, 6.0, 0.4, 0.4, 0.4])
    start = (np.zeros(3), q, np.array([0.5, 0.4, 0.3, 0.4, 0.3, 0.5]), wrench, np.array([-0.2, -0.1, -0.1]))
    assert 10.0 < imbalance(body, start, 3) / imbalance(body, start, 6) < 25.0


@pytest.mark.parametrize("seed", range(3))
def test_the_power_is_the_rate_of_the_energy(vehicle: Vehicle, seed: int) -> None:
    """Differences of the energy along the tangent of the motion, no integrator involved."""
    body = compile_body(vehicle)
    p, q, nu, wrench, current = fast_state(vehicle, np.random.default_rng(seed))
    rate, h = acceleration(body, q, nu, wrench, current), 1e-5

    def at(t: float) -> float:
        turned = quat_multiply(q, quat_from_rotvec(t * nu[3:]))
        return mechanical_energy(body, p + t * matrix_from_quat(q) @ nu[:3], turned, nu + t * rate, current).total_J

    now = mechanical_power(body, q, nu, wrench, current)
    scale = abs(now.wrench_W) + now.dissipated_W + abs(now.current_W)
    assert abs((at(h) - at(-h)) / (2.0 * h) - now.net_W) < 1e-5 * scale
    assert now.dissipated_W > 0.0


def test_body_and_water_share_the_kinetic_energy_as_their_masses_say(vehicle: Vehicle) -> None:
    body = compile_body(vehicle)
    p, q, nu = random_state(np.random.default_rng(3))
    got = mechanical_energy(body, p, q, nu)
    rigid = 0.5 * nu @ fossen.rigid_body_mass(vehicle) @ nu
    assert np.isclose(got.rigid_J, rigid, rtol=1e-12)
    assert np.isclose(got.added_mass_J, 0.5 * nu @ vehicle.hydrodynamics.added_mass @ nu, rtol=1e-12)
    assert got.kinetic_J > 0.0


def test_lifting_a_heavy_vehicle_stores_its_net_weight_times_the_height(vehicle: Vehicle) -> None:
    body = compile_body(vehicle)
    p, q, nu = random_state(np.random.default_rng(4))
    low, high = (mechanical_energy(body, p - [0.0, 0.0, up], q, nu).potential_J for up in (0.0, 2.0))
    assert np.isclose(high - low, 2.0 * (body.weight_N - body.buoyancy_N), rtol=0.0, atol=1e-9 * body.weight_N)
