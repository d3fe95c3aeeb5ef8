"""Margins of the whole loop, the filter's own dynamics included: what the controller's delay stands for is enough."""

import numpy as np
import pytest
from scipy.linalg import expm

from wakewise.control import ControlSettings, Gains, loop_margins, make_tracker, vehicle_axes, wished_gains
from wakewise.estimation import FilterSettings, filter_gains
from wakewise.vehicles import load_vehicle

LATENCY_S = 0.03


def whole_loop(axis, gains, lag_s, dt):
    """One axis with its filter, cut between command and thruster: x+ = A x + b u, closed by u = -c x.

    States: position, velocity, thrust, positions of one and two samples ago; the filter's position, velocity,
    unmodelled acceleration and thrust; integral. The filter hears the command itself, as it does in flight, and a pose
    at each step, 30 ms old (between two samples).
    """
    move = filter_gains(FilterSettings(pose_rate_hz=1.0 / dt)).move
    rate = np.zeros((4, 4))
    rate[:3, :3] = [[0, 1, 0], [-axis.stiffness / axis.mass, -axis.drag / axis.mass, 1 / axis.mass], [0, 0, -1 / lag_s]]
    rate[2, 3] = 1 / lag_s
    step, row = expm(rate * dt), np.eye(10)
    c = gains.kp * row[5] + gains.kd * row[6] + gains.ki * row[9]
    A, b = np.zeros((10, 10)), np.zeros(10)
    A[:3, :3], b[:3] = step[:3, :3], step[:3, 3]
    A[3, 0] = A[4, 3] = 1.0
    older = LATENCY_S / dt - 1.0
    seen = (1 - older) * row[0] + older * row[3]
    kept = np.exp(-dt / lag_s)
    push = -c + (row[8] + c) * (lag_s / dt) * (1 - kept)
    a = (push - axis.drag * row[6] - axis.stiffness * row[5]) / axis.mass + row[7]
    p, v = row[5] + row[6] * dt + a * dt**2 / 2, row[6] + a * dt
    surprise = seen - (p - v * LATENCY_S + a * LATENCY_S**2 / 2)
    A[5], A[6], A[7] = p + move[0] * surprise, v + move[1] * surprise, row[7] + move[2] * surprise
    A[8], A[9] = -c + kept * (row[8] + c), row[9] + dt * row[5]
    return A, b, c


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_filter_and_controller_together_keep_their_margins(name):
    """Each force axis has 6 dB and 40 deg with the default gains, the default filter and 30 ms of latency."""
    vehicle, settings = load_vehicle(name), ControlSettings()
    axes, scale = vehicle_axes(vehicle), make_tracker(vehicle, settings).gain_scale
    wished = wished_gains(axes, Gains(kp=settings.kp_N_m, kd=settings.kd_N_s_m, ki=settings.ki_N_m_s))
    lag_s = float(vehicle.time_constants_s.max())
    for i in range(3):
        found = loop_margins(*whole_loop(axes[i], wished[i].slowed(float(scale[i])), lag_s, 1.0 / settings.rate_hz))
        assert found.enough, (i, found)
