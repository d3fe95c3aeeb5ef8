"""Settings of an operator, which can change at any time of a flight.

One record, read by the control loop at each step and written from any thread (a page, a gamepad, a script). Values are
checked when they are set.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np

from wakewise.core.errors import InputError

Mode = Literal["operator", "hold", "scan"]
MODES: tuple[Mode, ...] = ("operator", "hold", "scan")
Way = Literal["wake-aware", "direct"]
WAYS: tuple[Way, ...] = ("wake-aware", "direct")
RANGES = {"w_track": (0.5, 50.0), "gain": (0.1, 1.0)}
"""Least and largest of the dials."""
GAIN_STEP = 0.1
"""What the buttons `gain_up` and `gain_down` do."""
PRECISE_SHARE = 0.3
"""Share of the gain's speeds in precise mode; estimate: 7 cm/s at full stick and the gain of the start, less than a
mission's pace."""
TRANSIT, DELICATE = 10.0, 2.0
"""The paper's regimes on its scale of w_track: above, and below."""


@dataclass(frozen=True, kw_only=True)
class OperatorSettings:
    """The settings.

    Raises InputError if a value is none of these, naming field, value and range.

    Parameters
    ----------
    mode : "operator", "hold" or "scan"
        Source of the motion: the sticks, none, or the mission.
    method : "wake-aware" or "direct"
        How thrusts are chosen; direct is `dp`, the least thrusts.
    w_track : float
        Tracking weight, on the paper's scale (see `wakewise.control.velocity_reference`), 0.5 to 50.
    gain : float
        Share of the largest speed at full stick, 0.1 to 1.
    precise : bool
        Slower by `PRECISE_SHARE`.
    watch_target : bool
        The camera is kept on the target: by its tilt joint first, then by the body.
    orbit : bool
        The sticks move the camera along the sphere about the target; forward changes its radius.
    """

    mode: Mode = "hold"
    method: Way = "wake-aware"
    w_track: float = 5.0
    gain: float = 0.5
    precise: bool = False
    watch_target: bool = True
    orbit: bool = False

    def __post_init__(self) -> None:
        for name, allowed in (("mode", MODES), ("method", WAYS)):
            if getattr(self, name) not in allowed:
                raise InputError(f"{name}: {getattr(self, name)!r}, allowed are {', '.join(allowed)}")
        for name, (least, most) in RANGES.items():
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
            if not number or not least <= value <= most:
                raise InputError(f"{name}: {value!r}, must be a number from {least:g} to {most:g}")
        for name in ("precise", "watch_target", "orbit"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name}: {getattr(self, name)!r}, must be true or false")

    @property
    def share(self) -> float:
        """Share of the largest speeds at full stick."""
        return self.gain * (PRECISE_SHARE if self.precise else 1.0)


FIELDS: tuple[str, ...] = tuple(field.name for field in fields(OperatorSettings))
"""Names of the settings."""


class OperatorState:
    """Holds the settings; can be read and written from any thread."""

    def __init__(self, state: OperatorSettings | None = None) -> None:
        self._lock = threading.Lock()
        self._state = state or OperatorSettings()

    @property
    def state(self) -> OperatorSettings:
        """The settings now."""
        return self._state

    def set(self, **changes: Any) -> OperatorSettings:
        """Change some fields; returns the new settings.

        Raises InputError, naming field, value and range; nothing is changed then.
        """
        for name in changes:
            if name not in FIELDS:
                raise InputError(f"{name}: not a setting, allowed are {', '.join(FIELDS)}")
        with self._lock:
            self._state = replace(self._state, **changes)
            return self._state

    def press(self, action: str) -> OperatorSettings:
        """The settings after a button; buttons without effect on them are ignored."""
        with self._lock:
            self._state = apply_button(self._state, action)
            return self._state


def apply_button(state: OperatorSettings, action: str) -> OperatorSettings:
    """The settings after a button (see `wakewise.operation.teleop.input.ACTIONS`)."""
    if action in MODES:
        return replace(state, mode=action)
    if action == "precise":
        return replace(state, precise=not state.precise)
    if action in ("gain_up", "gain_down"):
        least, most = RANGES["gain"]
        step = GAIN_STEP if action == "gain_up" else -GAIN_STEP
        return replace(state, gain=min(max(round(state.gain + step, 3), least), most))
    return state


def tracking_regime(w_track: float) -> str:
    """The regime of a `w_track` by the paper: transit above 10, delicate below 2, work between."""
    return "transit" if w_track > TRANSIT else "delicate" if w_track < DELICATE else "work"


@dataclass(frozen=True, kw_only=True)
class TrackingWeightMeaning:
    """What a `w_track` means: its regime, and in percent how far the vehicle deviates and how much wash it saves.

    The percentages are None if they were not measured.
    """

    regime: str
    deviation_pct: float | None = None
    saved_pct: float | None = None


def meaning(w_track: float, measured: Mapping[float, tuple[float, float]] | None = None) -> TrackingWeightMeaning:
    """What a `w_track` means, from what was measured.

    `measured`: by w_track: velocity deviation and disturbance saved against direct allocation, in percent. In between
    they are interpolated over the logarithm, beyond they stay as at the end.
    """
    if not measured:
        return TrackingWeightMeaning(regime=tracking_regime(w_track))
    at = sorted(measured)
    where = np.log(at)
    deviation, saved = (float(np.interp(math.log(w_track), where, [measured[w][k] for w in at])) for k in (0, 1))
    return TrackingWeightMeaning(regime=tracking_regime(w_track), deviation_pct=deviation, saved_pct=saved)
