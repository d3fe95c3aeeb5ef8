"""What a vehicle said last, channel by channel, and how old it is: by the same reading of messages as for logs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise_ardusub.logs.channels import HELD_S, MODES, is_parameter, valid_or_nan
from wakewise_ardusub.logs.identity import VehicleIdentity
from wakewise_ardusub.logs.mavlink import AUTOPILOT, ClockModel, record_message

_SLACK_S = 1e-9


@dataclass
class LatestSamples:
    """The last sample of each channel of one system, and its parameters."""

    samples: dict[str, tuple[float, tuple[float, ...]]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    identity: VehicleIdentity = field(default_factory=VehicleIdentity)

    def put(self, channel: str, time_s: float, values: Iterable[float]) -> None:
        """Keep a sample in place of the last."""
        self.samples[channel] = (time_s, valid_or_nan(channel, values))

    def parameter(self, name: str, value: float) -> None:
        """Keep a parameter under a name that can be one."""
        if is_parameter(name, value):
            self.parameters[name] = value

    def beat(self, mav_type: int, autopilot: int) -> None:
        """Keep what the last heartbeat says the vehicle is."""
        self.identity = VehicleIdentity(mav_type=mav_type, autopilot=autopilot)


class _AsStamped:
    """The clock of who hears messages as they come: its own stamps are the time."""

    def at(self, stamp_s: float, boot_s: float | None = None) -> float:  # noqa: ARG002  (as `Stamped` has it)
        return stamp_s


class VehicleListener:
    """Hears one vehicle.

    Parameters
    ----------
    system : int, optional
        MAVLink system id of the vehicle; the first whose servo outputs are heard if not given.
    parameters : mapping, optional
        The autopilot's, as known beforehand.
    clock : Stamped, optional
        Makes times of stamps; they are taken as they are if not given.
    """

    def __init__(
        self, system: int | None = None, parameters: Mapping[str, float] | None = None, clock: ClockModel | None = None
    ) -> None:
        self.system = system
        self.clock: ClockModel = clock or _AsStamped()
        self.messages = 0
        self._before = dict(parameters or {})
        self._said: dict[int, LatestSamples] = {}

    def vessel(self, system: int) -> LatestSamples:
        """Where a system's samples go."""
        return self._said.setdefault(system, LatestSamples())

    def hear(self, stamp_s: float, system: int, component: int, name: str, fields: Mapping[str, Any]) -> None:
        """Take in one message; one whose fields make no sense is passed over."""
        try:
            record_message(self, stamp_s, system, component, name, fields)
        except (KeyError, TypeError, ValueError):
            return
        self.messages += 1
        if self.system is None and component == AUTOPILOT and name == "SERVO_OUTPUT_RAW":
            self.system = system

    @property
    def parameters(self) -> dict[str, float]:
        """The vehicle's: as known beforehand, and as heard since."""
        return self._before | (self._own.parameters if self._own is not None else {})

    @property
    def identity(self) -> VehicleIdentity:
        """What the vehicle says it is."""
        return self._own.identity if self._own is not None else VehicleIdentity()

    @property
    def others(self) -> tuple[int, ...]:
        """Systems with servo outputs that are not the vehicle."""
        return tuple(sorted(s for s, said in self._said.items() if s != self.system and "servo" in said.samples))

    def age_s(self, channel: str, now_s: float) -> float:
        """Seconds since a channel was heard; infinite where it never was."""
        sample = None if self._own is None else self._own.samples.get(channel)
        return math.inf if sample is None else now_s - sample[0]

    def last(self, channel: str, now_s: float) -> Array | None:
        """The last sample of a channel, None where there is none or it is too old (`HELD_S`)."""
        if self._own is None or self.age_s(channel, now_s) > HELD_S[channel] + _SLACK_S:
            return None
        return np.array(self._own.samples[channel][1])

    def number(self, channel: str, now_s: float) -> float | None:
        """The last sample of a channel of one number, None where it is not known."""
        value = self.last(channel, now_s)
        return None if value is None or not math.isfinite(value[0]) else float(value[0])

    def mode(self, now_s: float) -> str | None:
        """The flight mode in words."""
        number = self.number("mode", now_s)
        modes = {} if self.identity.is_other else MODES
        return None if number is None else modes.get(int(number), f"mode {int(number)}")

    def pose(self, now_s: float) -> Pose | None:
        """Where the vehicle is and how it lies, by the autopilot's own estimate; None where it does not know."""
        position, attitude = self.last("position", now_s), self.last("attitude", now_s)
        if position is None or attitude is None or not np.isfinite([*position, *attitude]).all():
            return None
        return Pose(position, quat_from_euler(*attitude))

    @property
    def _own(self) -> LatestSamples | None:
        return None if self.system is None else self._said.get(self.system)
