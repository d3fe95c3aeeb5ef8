"""Controller, filter and vehicle in one loop: the baseline holds its station and does not ring."""

import numpy as np
import pytest

from wakewise.control import ControlSettings, Gains, desired_gains, make_controller, make_pid, vehicle_axes
from wakewise.core.geometry import Pose, quat_from_euler, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import BodyState, Goal, Measurement
from wakewise.estimation import ErrorStateFilter
from wakewise.robot.thrusters import saturate, thruster_lag
from wakewise.robot.vehicles import compile_body, load_vehicle, perturbed, step_rk4
from wakewise.scene.targets import Region
from wakewise.wake import wake_model

REGION = Region(points_W_m=np.array([[0.0, 0.0, 1.4], [0.05, 0.0, 1.35]]), weights=np.ones(2), distance_m=np.zeros(2))


def hold(name, method, *, trim_N, current_m_s, error_pct=0.0, gyro_bias=0.003, seconds=50.0, gain=1.0, late_steps=0):
    """Hold a pose for a while; returns position errors (n, 3), attitude goal errors, and thrusts (n, 8)."""
    rng = np.random.default_rng(4)
    vehicle, settings = load_vehicle(name), ControlSettings()
    plant = perturbed(
        vehicle,
        rng,
        mass_pct=error_pct,
        damping_pct=2 * error_pct,
        added_mass_pct=2 * error_pct,
        thrust_pct=error_pct,
        trim_N=trim_N,
    )
    body, current = compile_body(plant), np.array([current_m_s, 0.0, 0.0])
    controller, filter_ = (
        make_controller(method, vehicle, REGION, wake_model("jet"), settings),
        ErrorStateFilter(vehicle),
    )
    dt = 1.0 / settings.rate_hz
    goal = Goal(X_WB=Pose(np.array([-0.4, 0.1, 1.0]), quat_from_euler(0.0, 0.0, 0.4)))
    p, q, nu = goal.X_WB.p_m, goal.X_WB.q, np.zeros(6)
    estimate = BodyState(X_WB=goal.X_WB)
    control, filtered, thrusts = controller.init(), filter_.init(estimate), np.zeros(len(vehicle.thrusters))
    queue, pose_due, positions, history, orders = [], 1.0 / 62.0, [], [], []
    for k in range(round(seconds / dt)):
        control, command = controller.step(control, dt, estimate, goal)
        orders.append(gain * command.thrusts_N)
        wanted = saturate(orders[max(k - late_steps, 0)], vehicle.thrust_lower_N, vehicle.thrust_upper_N)
        for sub in range(2):
            thrusts = thruster_lag(thrusts, wanted, plant.time_constants_s, dt / 2)
            wrench = vehicle.allocation_matrix @ (plant.thrust_gains * thrusts)
            p, q, nu = step_rk4(body, p, q, nu, wrench, current, dt / 2)
            t = k * dt + (sub + 1) * dt / 2
            if t >= pose_due - 1e-9:
                pose_due += 1.0 / 62.0
                turned = quat_multiply(q, quat_from_rotvec(np.radians(0.2) * rng.normal(size=3)))
                queue.append((t + 0.03, Measurement(time_s=t, X_WB=Pose(p + 0.002 * rng.normal(size=3), turned))))
        now = (k + 1) * dt
        arrived = tuple(m for due, m in queue if due <= now + 1e-9)
        queue = [(due, m) for due, m in queue if due > now + 1e-9]
        gyro = nu[3:] + gyro_bias + 0.002 * rng.normal(size=3)
        arrived += (Measurement(time_s=now, omega_B_rad_s=gyro, depth_m=float(p[2] + 0.005 * rng.normal())),)
        filtered, estimate = filter_.step(filtered, dt, arrived, command.thrusts_N)
        positions.append(p - goal.X_WB.p_m)
        history.append(thrusts)
    return np.array(positions), np.array(history)


def rms(x):
    return float(np.sqrt(np.mean(np.sum(x**2, axis=1))))


@pytest.mark.parametrize(
    ("name", "method", "trim_N", "current_m_s"),
    [
        pytest.param("paper", "dp", 1.0, 0.0, marks=pytest.mark.slow),
        ("paper", "dp", -1.0, 0.05),
        ("paper", "wake-aware", -1.0, 0.05),
        ("bluerov2-heavy", "dp", -1.0, 0.05),
    ],
)
def test_station_is_held_within_millimetres_without_ringing(name, method, trim_N, current_m_s):
    """Noise, lag, trim, current and a vehicle 10 to 20 % off: < 5 mm rms, nothing grows, no line in the thrusts."""
    errors, thrusts = hold(name, method, trim_N=trim_N, current_m_s=current_m_s, error_pct=10.0)
    settled = errors[1250:]
    assert rms(settled) < 0.005
    first, last = settled[:625] - settled[:625].mean(0), settled[625:] - settled[625:].mean(0)
    assert rms(last) < 1.5 * rms(first)
    # A limit cycle puts most of the thrust's variance into one narrow line; sensor noise spreads it.
    waves = np.abs(np.fft.rfft(thrusts[1250:] - thrusts[1250:].mean(0), axis=0)) ** 2
    power = waves.sum(axis=1)[3:]
    lines = np.convolve(power, np.ones(5), mode="valid")
    # 25.2 % in `wake-aware`'s flight since plans average the load's moment, over .3 s or .5 s alike.
    assert lines.max() < 0.3 * power.sum()


def test_the_loop_keeps_its_gain_margin_in_flight():
    """With every thruster twice as strong as believed (6 dB) the station is still held without growth."""
    errors, _ = hold("paper", "dp", trim_N=0.0, current_m_s=0.0, gain=2.0, seconds=30.0)
    assert rms(errors[750:]) < 0.01
    assert rms(errors[1125:]) < 1.5 * rms(errors[750:1125])


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_the_loop_keeps_its_phase_margin_in_flight(name):
    """Commands late by 15 degrees of phase where the stiffest axis crosses over: the station is held without growth."""
    vehicle, settings = load_vehicle(name), ControlSettings()
    axes, scale = vehicle_axes(vehicle)[:3], make_pid(vehicle, settings).gain_scale[:3]
    # Above the corner of the PD the loop is kd/(m s): it crosses one there.
    desired = desired_gains(vehicle_axes(vehicle), Gains(kp=0.0, kd=settings.kd_N_s_m, ki=0.0))
    crossover = max(g.kd * s / axis.mass for g, s, axis in zip(desired[:3], scale, axes, strict=True))
    late = round(np.radians(15.0) / crossover * settings.rate_hz)
    assert late >= 1
    errors, _ = hold(name, "dp", trim_N=0.0, current_m_s=0.0, late_steps=late, seconds=30.0)
    # Of the 30 deg that the tracker is designed for the filter takes half: reckoning with slow errors of poses, it
    # believes its model for longer, which knows of no lateness (docs/research-log/0030).
    assert rms(errors[750:]) < 0.01
    assert rms(errors[1125:]) < 1.5 * rms(errors[750:1125])
