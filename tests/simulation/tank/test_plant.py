"""The plant: equilibrium, lag and limits, gains, the floor, collisions."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat
from wakewise.core.interfaces import BodyState
from wakewise.robot.thrusters import saturate, thruster_lag
from wakewise.robot.vehicles import compile_body, load_vehicle, perturbed, step_rk4
from wakewise.simulation.tank import VehiclePlant
from wakewise.simulation.water.currents import AmbientSum, SteadyCurrent

REAL = load_vehicle("paper")
VEHICLE = REAL.with_ideal_thrusters()
SIZE_M = (6.0, 5.0, 1.5)
ROCK = np.array([[0.0, 0.0, 1.4], [0.0, 0.1, 1.5], [0.1, 0.0, 1.5]])


def _plant(p=(-1.0, 0.0, 0.8), vehicle=VEHICLE, current=(0, 0, 0), nu=(0, 0, 0, 0, 0, 0), ambient=None, **more):
    start = BodyState(X_WB=Pose(np.array(p, dtype=float)), nu_B=np.array(nu, dtype=float))
    return VehiclePlant(
        vehicle,
        start,
        density_kg_m3=1000.0,
        ambient=ambient or AmbientSum(parts=(SteadyCurrent(velocity_W_m_s=np.array(current, dtype=float)),)),
        size_m=SIZE_M,
        target_W_m=ROCK,
        **more,
    )


def test_without_thrust_a_vehicle_drifts_with_the_current():
    """After two minutes it moves as the water does."""
    plant = _plant(current=(0.03, 0.0, 0.0))
    for _ in range(6000):
        plant.step(np.zeros(8), 0.02)
    assert (plant.state.X_WB.R @ plant.state.nu_B[:3])[0] == pytest.approx(0.03, rel=0.15)


def test_thrust_lags_and_is_limited():
    """After one time constant 63 % of a step has come; no command exceeds the limits."""
    plant, tau = _plant(), VEHICLE.time_constants_s[0]
    for _ in range(20):
        plant.step(np.full(8, 1.0), tau / 20)
    assert plant.thrusts_N == pytest.approx(np.full(8, 1 - np.exp(-1)), rel=1e-6)
    for _ in range(100):
        plant.step(np.full(8, -1e4), 0.02)
    assert plant.thrusts_N == pytest.approx(VEHICLE.thrust_lower_N, rel=1e-6)


def test_true_gains_make_true_thrust():
    """What the thrusters deliver is the command times the plant's own gains."""
    own = perturbed(VEHICLE, np.random.default_rng(0), thrust_pct=20.0)
    plant = _plant(vehicle=own)
    for _ in range(200):
        plant.step(np.full(8, 0.5), 0.02)
    assert plant.thrusts_N == pytest.approx(0.5 * own.thrust_gains, rel=1e-6)
    assert np.ptp(plant.thrusts_N) > 0.01


def test_a_compiled_step_is_its_readable_twin():
    """Clipped commands, the exact lag, gains, the mean of both ends, and Runge-Kutta with the public functions."""
    rng = np.random.default_rng(3)
    own = perturbed(VEHICLE, rng, mass_pct=5, damping_pct=30, added_mass_pct=20, thrust_pct=5, trim_N=0.5)
    current = np.array([0.03, 0.02, 0.0])
    plant = _plant(p=(-1.5, 0.2, 0.7), vehicle=own, current=current, nu=(0.1, -0.05, 0.02, 0.1, 0.0, 0.2))
    body, motors, impulse = compile_body(own), np.zeros(8), np.zeros((8, 2))
    p, q, nu = plant.state.X_WB.p_m, plant.state.X_WB.q, plant.state.nu_B
    for dt in (0.005, 0.003, 0.01, 0.02):
        commands = rng.normal(size=8) * 2.0
        commands[0] = 1e4
        plant.step(commands, dt)
        before = motors
        motors = thruster_lag(
            before, saturate(commands, own.thrust_lower_N, own.thrust_upper_N), own.time_constants_s, dt
        )
        thrusts = own.thrust_gains * 0.5 * (before + motors)
        impulse += dt * np.stack([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)], axis=1)
        v_W = matrix_from_quat(q) @ nu[:3]
        p, q, nu = step_rk4(body, p, q, nu, own.allocation_matrix @ thrusts, current, dt)
        R = matrix_from_quat(q)
        np.testing.assert_allclose(plant.state.X_WB.p_m, p, atol=1e-12)
        np.testing.assert_allclose(plant.state.X_WB.q, q, atol=1e-12)
        np.testing.assert_allclose(plant.state.nu_B, nu, atol=1e-12)
        np.testing.assert_allclose(plant.thrusts_N, own.thrust_gains * motors, atol=1e-12)
        felt = R.T @ ((R @ nu[:3] - v_W) / dt - [0.0, 0.0, 9.80665])
        np.testing.assert_allclose(plant.force_B_m_s2, felt, atol=1e-8)
    np.testing.assert_allclose(plant.take_impulse_N_s(), impulse, atol=1e-12)


def test_jets_leave_from_the_disks_of_the_moved_vehicle():
    """Disk positions and axes turn and move with the body."""
    plant = _plant()
    origins, axes = plant.disks()
    assert origins == pytest.approx(plant.state.X_WB.apply(VEHICLE.thruster_positions_B_m))
    assert axes == pytest.approx(VEHICLE.thruster_axes_B @ plant.state.X_WB.R.T)


def test_a_sinking_vehicle_stops_on_the_floor_and_says_so():
    """It never passes the floor, and reports it."""
    heavy = replace(VEHICLE, displaced_volume_m3=0.9 * VEHICLE.displaced_volume_m3)
    plant = _plant(vehicle=heavy)
    lowest = 0.0
    for _ in range(600):
        plant.step(np.zeros(8), 0.02)
        lowest = max(lowest, plant.state.X_WB.apply(plant._surroundings.corners_B_m)[:, 2].max())
    assert lowest <= SIZE_M[2] + 1e-9
    assert plant.touches() == "the floor"


def test_a_vertex_of_the_target_in_the_hull_is_a_collision():
    """Beside the rock there is none, over it there is."""
    plant = _plant(p=(-0.3, 0.0, 1.3), nu=np.array([0.5, 0, 0, 0, 0, 0]))
    assert plant.touches() == ""
    for _ in range(100):
        plant.step(np.zeros(8), 0.01)
        if plant.touches():
            break
    assert plant.touches() == "the target"


def test_the_target_stops_the_vehicle():
    """Flown into the rock, it stays outside it, loses the speed towards it and keeps the one along it."""
    plant = _plant(p=(-0.4, 0.0, 1.3), nu=np.array([0.5, 0.1, 0, 0, 0, 0]))
    seen = set()
    for _ in range(150):
        plant.step(np.zeros(8), 0.005)
        seen.add(plant.contact)
        inside = np.abs((ROCK - plant.state.X_WB.p_m) @ plant.state.X_WB.R) < VEHICLE.size_m / 2 - 1e-9
        assert not np.any(np.all(inside, axis=1))
    assert "the target" in seen
    velocity = plant.state.X_WB.R @ plant.state.nu_B[:3]
    assert velocity[0] < 0.01
    assert velocity[1] > 0.02


def test_walls_stop_the_vehicle():
    """Driven into a wall, no corner of its hull passes it, and the contact is named."""
    plant = _plant(p=(2.5, 0.0, 0.8), nu=np.array([0.8, 0, 0, 0, 0, 0]))
    forward = np.linalg.lstsq(VEHICLE.allocation_matrix, np.array([8.0, 0, 0, 0, 0, 0]), rcond=None)[0]
    for _ in range(400):
        plant.step(forward, 0.005)
        corners = plant.state.X_WB.apply(plant._surroundings.corners_B_m)
        assert corners[:, 0].max() <= 3.0 + 1e-9
    assert plant.contact == "a wall"


class _Rushing:
    """Water everywhere alike that speeds up steadily along x."""

    end_s, steady, uniform = np.inf, False, True

    def velocity(self, points_W_m, time_s):
        return np.tile([0.05 * time_s, 0.0, 0.0], (len(points_W_m), 1))


def test_water_that_speeds_up_takes_a_body_of_its_own_density_along():
    """Without drag, a neutrally buoyant vehicle in accelerating water moves exactly with it (Kelvin, d'Alembert)."""
    bare = replace(
        VEHICLE,
        mass_kg=1000.0 * VEHICLE.displaced_volume_m3,
        hydrodynamics=replace(
            VEHICLE.hydrodynamics, linear_damping=np.zeros((6, 6)), quadratic_damping=np.zeros((6, 6))
        ),
        p_BG_m=VEHICLE.p_BB_m,
    )
    plant = _plant(vehicle=bare, ambient=_Rushing())
    for _ in range(400):
        plant.step(np.zeros(8), 0.005)
    assert (plant.state.X_WB.R @ plant.state.nu_B[:3])[0] == pytest.approx(0.05 * 2.0, rel=0.01)


def test_forward_and_reverse_have_their_own_limits():
    """Full commands end at the forward limit one way and at the reverse limit the other."""
    lopsided = replace(
        VEHICLE, thrusters=tuple(replace(t, max_reverse_N=0.5 * t.max_forward_N) for t in VEHICLE.thrusters)
    )
    plant = _plant(vehicle=lopsided, p=(-1.0, 0.0, 0.7))
    for command in (1e3, -1e3):
        for _ in range(60):
            plant.step(np.full(8, command), 0.005)
        limit = lopsided.thrust_upper_N if command > 0 else lopsided.thrust_lower_N
        assert plant.thrusts_N == pytest.approx(limit, rel=0.15)
    assert lopsided.thrust_lower_N == pytest.approx(-0.5 * lopsided.thrust_upper_N)


@pytest.mark.parametrize(
    ("p", "what"),
    [((0, 0, 1.4), "the floor"), ((2.9, 0, 0.8), "a wall"), ((0, 0.1, 1.31), "the target"), ((0, 0, 0.0), "surface")],
)
def test_bad_starts_are_refused(p, what):
    """Starting in the floor, a wall, the target or the air is bad input, named in the message."""
    with pytest.raises(InputError, match=what):
        _plant(p=p)


@pytest.mark.parametrize("command", [0.39, 0.1, -0.35, -0.01])
def test_a_command_below_the_least_thrust_turns_no_propeller(command: float) -> None:
    """The T200 gives nothing below 0.40 N forward and 0.36 N in reverse."""
    plant = _plant(vehicle=REAL)
    for _ in range(100):
        plant.step(np.full(8, command), 0.02)
    assert not plant.thrusts_N.any()
    assert not plant.take_impulse_N_s().any()


def test_a_command_above_the_least_thrust_gives_the_nearest_pulse() -> None:
    """Whole microseconds: 1.00 N lies between 1541 and 1542 us."""
    plant = _plant(vehicle=REAL)
    for _ in range(200):
        plant.step(np.full(8, 1.0), 0.02)
    expected = REAL.thrust_steps.delivered_N(1.0)
    assert plant.thrusts_N == pytest.approx(np.full(8, expected), rel=1e-6)
    assert 0.0 < abs(float(expected) - 1.0) < 0.031


def test_both_ways_of_stepping_know_the_least_thrust() -> None:
    """Many steps at once and one after the other give the same thrusts from one command to the next."""
    whole, single = _plant(vehicle=REAL), _plant(vehicle=REAL)
    for k, command in enumerate((0.3, 0.45, -0.2, 0.9)):
        whole.advance(np.full(8, command), 0.1 * (k + 1))
        for _ in range(20):
            single.step(np.full(8, command), 0.005)
        assert whole.thrusts_N == pytest.approx(single.thrusts_N, abs=1e-12)
    assert whole.thrusts_N.max() > 0.1
