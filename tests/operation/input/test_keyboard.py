"""Keys as sticks."""

import numpy as np
import pytest

from wakewise.operation.teleop.input.controls import CONTROL_AXES
from wakewise.operation.teleop.input.keyboard import KEYS, PUSH_PER_S, key_axes

CENTRE = np.zeros(5)


def test_every_axis_has_keys_both_ways() -> None:
    """No axis is pushed one way only."""
    assert {(axis, sign) for axis, sign in KEYS.values()} == {(a, s) for a in CONTROL_AXES for s in (1.0, -1.0)}


def test_a_tap_is_a_small_push_and_a_held_key_full_stick() -> None:
    """Out in a ramp, full in the end, centred soon after it is let go."""
    tapped = key_axes({"KeyW"}, CENTRE, 0.1)
    assert tapped.tolist() == pytest.approx([0.1 * PUSH_PER_S, 0, 0, 0, 0])
    assert key_axes({"KeyW"}, tapped, 1.0)[0] == 1.0
    assert not key_axes(set(), np.ones(5), 0.1).any()


def test_steps_of_time_do_not_matter() -> None:
    """Ten short steps are one long one, also where the axis turns round on the way."""
    axes = np.array([0.5, -0.3, 0.0, 1.0, 0.2])
    keys = {"KeyS", "KeyD", "ArrowUp", "KeyE"}
    stepped = axes
    for _ in range(10):
        stepped = key_axes(keys, stepped, 0.02)
    assert stepped == pytest.approx(key_axes(keys, axes, 0.2))


def test_opposite_keys_cancel_and_others_do_nothing() -> None:
    """Both ways at once is centred; a letter that is no key of flight, a clock set back: nothing moves."""
    assert not key_axes({"KeyW", "KeyS", "KeyZ"}, CENTRE, 1.0).any()
    assert key_axes({"KeyW"}, CENTRE, -1.0).tolist() == [0.0] * 5
