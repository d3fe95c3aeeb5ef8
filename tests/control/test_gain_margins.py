"""Margins of the sampled loop: closed forms, agreement with simulation, and what the paper's gains need."""

import numpy as np
import pytest

from wakewise.control.gain_margins import (
    Axis,
    Gains,
    desired_gains,
    margins,
    open_loop,
    stable_gain_scale,
    vehicle_axes,
)
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle

PAPER_GAINS = Gains(kp=150.0, kd=80.0, ki=20.0)


def simulate(axis, gains, dt, lag, delay, seconds=30.0, fine=200):
    """Step answer of one axis integrated in small Euler steps, with a queue for the delay; written independently."""
    h = dt / fine
    p, v, thrust, integral = 0.0, 0.0, 0.0, 0.0
    queue = [0.0] * round(delay / h)
    command, out = 0.0, []
    for k in range(int(seconds / h)):
        if k % fine == 0:
            error = 1.0 - p
            command = gains.kp * error - gains.kd * v + gains.ki * integral
            integral += dt * error
            out.append(p)
        queue.append(command)
        pushed = queue.pop(0)
        acceleration = (thrust - axis.drag * v - axis.stiffness * p) / axis.mass
        thrust += h / lag * (pushed - thrust)
        p += h * v
        v += h * acceleration
    return np.array(out)


def test_a_double_integrator_under_pd_has_the_textbook_phase_margin():
    """Fast sampling, no lag: L = (kd s + kp)/(m s^2); its phase where |L| = 1 is atan(kd w / kp) - pi."""
    axis, gains = Axis(mass=10.0, drag=0.0, stiffness=0.0), Gains(kp=40.0, kd=40.0, ki=0.0)
    a = (gains.kd / axis.mass) ** 2
    w = np.sqrt(0.5 * (a + np.sqrt(a * a + 4.0 * (gains.kp / axis.mass) ** 2)))
    found = margins(axis, gains, 1e-3, 1e-4, 0.0)
    assert found.stable
    assert found.phase_rad == pytest.approx(np.arctan(gains.kd * w / gains.kp), abs=0.01)


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.04])
def test_the_sampled_model_is_the_simulated_loop(delay):
    """The exact matrices and a fine integration give the same step answer."""
    axis, gains, dt, lag = Axis(mass=8.3, drag=4.0, stiffness=1.0), Gains(kp=60.0, kd=50.0, ki=8.0), 0.02, 0.1
    A, b, c = open_loop(axis, gains, dt, lag, delay)
    x, out = np.zeros(len(A)), []
    x[0] = 0.0
    for _ in range(100):
        out.append(x[0])
        # The reference enters through the error: c holds the gains of -error for position and integral.
        command = -(c @ x) + gains.kp
        following = A @ x + b * command
        following[3] -= dt
        x = following
    expected = simulate(axis, gains, dt, lag, delay, seconds=2.0)
    np.testing.assert_allclose(out, expected, atol=5e-3)


def test_the_gain_margin_is_where_the_loop_goes_unstable():
    """A gain just below the upper margin is stable, and just above it is not."""
    axis = Axis(mass=8.3, drag=4.0, stiffness=0.0)
    found = margins(axis, PAPER_GAINS, 0.02, 0.1, 0.04)
    for factor, stable in ((0.97, True), (1.03, False)):
        k = found.gain_up * factor
        scaled = Gains(kp=PAPER_GAINS.kp * k, kd=PAPER_GAINS.kd * k, ki=PAPER_GAINS.ki * k)
        assert margins(axis, scaled, 0.02, 0.1, 0.04).stable is stable


def test_moments_get_the_bandwidth_of_forces():
    """K (I + I_a)/(m + m_a) leaves gain over inertia unchanged, axis by axis."""
    axes = vehicle_axes(load_vehicle("paper"))
    gains = desired_gains(axes, PAPER_GAINS)
    for i in range(3):
        assert gains[3 + i].kp / axes[3 + i].mass == pytest.approx(gains[i].kp / axes[i].mass)


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_scaled_gains_keep_their_margins_and_no_faster_ones_do(name):
    """At the scale every axis has 6 dB and 40 deg; a scaled axis made 3 % faster has not."""
    vehicle = load_vehicle(name)
    axes = vehicle_axes(vehicle)
    scale = stable_gain_scale(vehicle, PAPER_GAINS, 0.02, 0.12, 0.04)
    lag = float(vehicle.time_constants_s.max())
    assert np.all((scale > 0.2) & (scale <= 1.0))
    for i, (axis, desired, s) in enumerate(zip(axes, desired_gains(axes, PAPER_GAINS), scale, strict=True)):
        delay = 0.12 if i < 3 else 0.04
        assert margins(axis, desired.slowed(float(s)), 0.02, lag, delay).enough
        if s < 1.0:
            assert not margins(axis, desired.slowed(1.03 * float(s)), 0.02, lag, delay).enough


def test_the_papers_gains_are_too_stiff_for_the_papers_vehicle():
    """With 0.1 s of thruster lag and 40 ms of estimate delay no axis keeps 40 deg; surge is left about 20."""
    axes = vehicle_axes(load_vehicle("paper"))
    found = [margins(a, g, 0.02, 0.1, 0.04) for a, g in zip(axes, desired_gains(axes, PAPER_GAINS), strict=True)]
    assert not any(m.enough for m in found)
    assert np.degrees(found[0].phase_rad) == pytest.approx(20.0, abs=2.0)


def test_a_loop_that_no_bandwidth_can_steady_is_refused():
    """An integral without damping has no margin at any speed: one line says which axis."""
    with pytest.raises(InputError, match="no stable bandwidth"):
        stable_gain_scale(load_vehicle("paper"), Gains(kp=0.0, kd=0.0, ki=20.0), 0.02, 0.12, 0.04)
