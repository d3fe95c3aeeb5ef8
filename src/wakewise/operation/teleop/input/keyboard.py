"""Keys as sticks: which keys are down, and how the axes follow them in a ramp, so that a tap is a small push."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wakewise.core.arrays import Array
from wakewise.operation.teleop.input.controls import CONTROL_AXES

KEYS: dict[str, tuple[str, float]] = {
    "KeyW": ("forward", 1.0),
    "KeyS": ("forward", -1.0),
    "KeyD": ("right", 1.0),
    "KeyA": ("right", -1.0),
    "ArrowDown": ("down", 1.0),
    "ArrowUp": ("down", -1.0),
    "ArrowRight": ("turn", 1.0),
    "ArrowLeft": ("turn", -1.0),
    "KeyE": ("turn", 1.0),
    "KeyQ": ("turn", -1.0),
    "KeyR": ("tilt", 1.0),
    "KeyF": ("tilt", -1.0),
}
"""What each key pushes; keys by their place on the board, named as browsers name them (`KeyboardEvent.code`)."""
PUSH_PER_S, RELEASE_PER_S = 3.0, 10.0
"""How fast an axis goes out to full stick while a key is down, and back to the middle, in shares of full stick;
estimate: a tap of 0.1 s is a third of full stick, and a key let go is centred in a tenth of a second."""


def key_axes(down: Collection[str], axes: Array, dt_s: float) -> Array:
    """Axes, shape (5,), a moment after `axes`, with these keys down; opposite keys cancel.

    `down`: keys of `KEYS`; others do nothing. `axes`, shape (5,): as they were. `dt_s`: how long ago that was, 0 or
    more.

    Returns
    -------
    ndarray, shape (5,)
        Within -1 to 1. An axis that is pushed the other way goes through the middle at the rate of release.
    """
    wished = np.zeros(len(CONTROL_AXES))
    for key in set(down) & KEYS.keys():
        axis, sign = KEYS[key]
        wished[CONTROL_AXES.index(axis)] += sign
    wished = np.clip(wished, -1.0, 1.0)
    left = np.full(len(axes), max(dt_s, 0.0))
    back = wished * axes <= 0.0  # first to the middle, and on from there in what time is left
    centred = np.sign(axes) * np.maximum(np.abs(axes) - RELEASE_PER_S * left, 0.0)
    left = np.where(back, np.maximum(left - np.abs(axes) / RELEASE_PER_S, 0.0), left)
    start = np.where(back, centred, axes)
    out: Array = np.clip(start + wished * PUSH_PER_S * left, -1.0, 1.0)
    return out
