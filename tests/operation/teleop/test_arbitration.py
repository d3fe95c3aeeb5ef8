"""What sticks lead a commanded velocity to: gently, and yet soon felt."""

import numpy as np
import pytest

from wakewise.operation.teleop.arbitration import BRAKING_M_S2, filtered_velocity

DT_S = 0.02


def led(v, command, until=lambda v: False):
    """Speeds, step by step, until as commanded or as told; and the largest change of acceleration a second."""
    v, a, speeds, jerk = np.array(v), np.zeros(3), [], 0.0
    while not (np.array_equal(v, command) or until(v)):
        before = a
        v, a = filtered_velocity(v, a, np.array(command), DT_S)
        jerk = max(jerk, np.linalg.norm(a - before) / DT_S)
        speeds.append(np.linalg.norm(v))
    return speeds, jerk


@pytest.mark.parametrize(("speed", "soon_s"), [(0.03, 0.25), (0.05, 0.35), (0.1, 0.5)])
def test_a_stick_is_soon_felt(speed, soon_s):
    """63 % of a push of 0.03, 0.05 and 0.1 m/s is commanded within 0.25, 0.35 and 0.5 s."""
    speeds, _ = led([0.0, 0.0, 0.0], [speed, 0.0, 0.0], until=lambda v: v[0] >= 0.63 * speed)
    assert len(speeds) * DT_S <= soon_s


def test_a_stop_is_as_long_as_a_steady_one():
    """From 0.3 m/s to rest it takes the way of steady braking, within 2 %, at a jerk of 0.8 m/s3."""
    speeds, jerk = led([0.0, 0.3, 0.0], [0.0, 0.0, 0.0])
    way_m = DT_S * (0.15 + sum(speeds))
    assert way_m == pytest.approx(0.3**2 / (2.0 * BRAKING_M_S2), rel=0.02) and jerk <= 0.8 + 1e-6


def test_a_chattering_stick_is_nothing_to_run_after():
    """Pushes to and fro of 0.05 m/s, each a fifth of a second, change the velocity by less than 0.1 m/s2 rms."""
    v, a, changes = np.zeros(3), np.zeros(3), []
    for k in range(500):
        v, a = filtered_velocity(v, a, np.array([0.05 * (-1.0) ** (k // 10), 0.0, 0.0]), DT_S)
        changes.append(a[0])
    assert np.sqrt(np.mean(np.square(changes[50:]))) < 0.1
