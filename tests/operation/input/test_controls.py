"""What hands do: axes within full stick, actions that somebody knows, devices made harmless."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input import CENTRED, Controls
from wakewise.operation.teleop.input.controls import apply_dead_zone


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=9))
def test_shaped_axes_are_always_within_full_stick(raw: list[float]) -> None:
    """Whatever a device says, the axes are five numbers from -1 to 1."""
    axes = Controls(axes=apply_dead_zone(raw)).axes
    assert len(axes) == 5 and all(-1.0 <= axis <= 1.0 for axis in axes)


def test_dead_zone_is_taken_out_and_the_rest_is_stretched() -> None:
    """Just beyond the dead zone little is asked for, at full stick all; signs are kept."""
    axes = apply_dead_zone([0.05, -0.0501, 1.0, -1.0, math.nan])
    assert axes[0] == 0.0 and -0.001 < axes[1] < 0.0
    np.testing.assert_array_equal(axes[2:], [1.0, -1.0, 0.0])


@pytest.mark.parametrize("axes", [[1.1, 0, 0, 0, 0], [math.nan, 0, 0, 0, 0]])
def test_axes_beyond_full_stick_are_refused(axes: list[float]) -> None:
    """A record holds no axis beyond full stick, and none that is not a number."""
    with pytest.raises(InputError, match="axes"):
        Controls(axes=np.array(axes))


def test_unknown_action_is_refused() -> None:
    """What is pressed must have a meaning."""
    with pytest.raises(InputError, match="'dance' is not one of capture"):
        Controls(axes=np.zeros(5), pressed=("dance",))


def test_hands_off_asks_for_nothing() -> None:
    """Centred means that no axis asks for anything."""
    assert CENTRED.centred and not Controls(axes=np.array([0, 0, 0, 0, 0.1])).centred
