"""Ways to a place at rest within bounds."""

import math

import numpy as np
import pytest

from wakewise.control.motion_profile import limit_slew, profile_step, profile_step_moving, unwrap_near


@pytest.mark.parametrize("rate", [-0.5, 0.0, 0.8])
def test_a_place_is_come_to_at_rest_within_the_bounds(rate):
    """From any rate: never faster than allowed once it was slower, no harder change, less than 1 % beyond it."""
    value, rates, values = 0.0, [rate], [0.0]
    for _ in range(400):
        value, rate = profile_step(value, rate, 1.0, 0.02, 0.6, 0.8)
        rates.append(rate)
        values.append(value)
    assert values[-1] == 1.0 and rates[-1] == 0.0
    assert np.abs(np.diff(rates)).max() <= 0.8 * 0.02 + 1e-12
    assert max(values) < 1.01 + (0.09 if rates[0] > 0.6 else 0.0)


def test_what_moves_is_caught_up_with_and_then_followed_exactly():
    """A desired value on a sine: from half a radian behind, exact within a few seconds."""
    value, rate, off = 0.5, 0.0, []
    for k in range(1, 500):
        t = 0.02 * k
        value, rate = profile_step_moving(value, rate, 0.2 * math.sin(t), 0.2 * math.cos(t), 0.02, 0.6, 0.8)
        off.append(abs(value - 0.2 * math.sin(t)))
    assert off[0] > 0.4 and max(off[200:]) == 0.0


def test_a_rate_changes_no_faster_than_allowed():
    """Both ways, and exactly there in the end."""
    assert limit_slew(0.0, 1.0, 0.02, 0.8) == pytest.approx(0.016)
    assert limit_slew(0.0, -1.0, 0.02, 0.8) == pytest.approx(-0.016)
    assert limit_slew(0.99, 1.0, 0.02, 0.8) == 1.0


def test_turns_are_the_nearest():
    """Across half a turn, angles go on rather than back."""
    assert unwrap_near(-3.1, 3.1) == pytest.approx(2.0 * math.pi - 3.1)
    assert unwrap_near(0.1, 100.0 * math.pi) == pytest.approx(100.0 * math.pi + 0.1)
