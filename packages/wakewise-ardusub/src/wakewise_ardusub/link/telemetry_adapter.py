"""MAVLink messages to `Measurement`s for the estimator, each at the time at which it was made.

**Clocks.** A message carries a time of its sender's clock. `SenderClock` estimates the offset to ours from the message
with the least delay of the last ones, up to the least travel time. After a jump of the sender's clock its messages are
refused until `SETTLED` of them are consistent.

**Frames.** The autopilot's local frame is NED and its body FRD, as ours are; `pose_messages` converts what sensors
send. A position without an attitude gets the autopilot's attitude, extrapolated by its rates to the same instant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.geometry import Pose, quat_from_euler, quat_integrate
from wakewise.core.interfaces import Measurement
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.pose_messages import SENSED_POSES, finite, sensed_pose
from wakewise_ardusub.link.protocol import AUTOPILOT_COMPONENT

AHEAD_S, BEHIND_S = 1.0, 1.0
"""A message from the future by more than this, or older than that, says that a clock jumped."""
SETTLED = 10
"""Messages in a row that a clock must fit after it jumped."""
COMPARED = 250
"""Messages over which clocks are compared; what is older is forgotten, since clocks drift."""
ATTITUDE_S = 0.1
"""How far an attitude is carried on to the instant of a position."""


@dataclass(frozen=True, kw_only=True)
class SenderClock:
    """A sender's clock against ours, from when messages were made and came.

    `quickest_s` is the least of came less made over the last messages, `before_s` over those before them.
    """

    quickest_s: float = math.inf
    before_s: float = math.inf
    compared: int = 0
    settling: int = 0
    jumps: int = 0

    def at(self, made_s: float, came_s: float) -> tuple[SenderClock, float | None, float]:
        """The clock after a message, when it was made by ours (None: refused) and by how much it jumped, 0 if not."""
        took_s, least_s = came_s - made_s, min(self.quickest_s, self.before_s)
        if math.isinf(least_s):
            return SenderClock(quickest_s=took_s, compared=1, jumps=self.jumps), came_s, 0.0
        late_s = took_s - least_s
        if not -AHEAD_S <= late_s <= BEHIND_S:
            new = SenderClock(quickest_s=took_s, compared=1, settling=SETTLED, jumps=self.jumps + 1)
            return new, None, -late_s
        forget = self.compared >= COMPARED
        after = replace(
            self,
            quickest_s=took_s if forget else min(self.quickest_s, took_s),
            before_s=self.quickest_s if forget else self.before_s,
            compared=1 if forget else self.compared + 1,
            settling=max(self.settling - 1, 0),
        )
        if self.settling:
            return after, None, 0.0
        return after, min(made_s + min(after.quickest_s, after.before_s), came_s), 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeSample:
    """The autopilot's attitude and rates at an instant of our clock."""

    time_s: float
    q_WB: Array
    omega_B_rad_s: Array

    def at(self, time_s: float) -> Array:
        """The attitude carried on to another instant, shape (4,)."""
        return quat_integrate(self.q_WB, self.omega_B_rad_s, time_s - self.time_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class TelemetryAdapter:
    """What turning messages into measurements remembers: clocks by sender, the last attitude, the last jump."""

    clocks: Mapping[tuple[int, int, bool], SenderClock] = field(default_factory=lambda: MappingProxyType({}))
    attitude: AttitudeSample | None = None
    sensed_s: float = -math.inf
    """When a sensor's own pose came last; then the autopilot's estimate, which is made of it, is left aside."""
    jump: str = ""
    jump_s: float = -math.inf


def to_measurements(
    known: TelemetryAdapter, said: MavlinkMessage, came_s: float, system: int
) -> tuple[TelemetryAdapter, tuple[Measurement, ...]]:
    """The memory after a message, and what it measured; times are on the clock of `came_s`.

    Messages of other vehicles, and such that say nonsense, measure nothing.
    """
    try:
        return _measured(known, said, came_s, system)
    except (KeyError, TypeError, ValueError, OverflowError):
        return known, ()


def _measured(
    known: TelemetryAdapter, said: MavlinkMessage, came_s: float, system: int
) -> tuple[TelemetryAdapter, tuple[Measurement, ...]]:
    name, get = said.name, said.fields
    if said.system != system:
        return known, ()
    autopilot = said.component == AUTOPILOT_COMPONENT
    if name in SENSED_POSES:
        made_s = 1e-6 * float(get["usec" if name == "VISION_POSITION_ESTIMATE" else "time_usec"])
    elif autopilot and name in ("ATTITUDE", "LOCAL_POSITION_NED"):
        made_s = 1e-3 * float(get["time_boot_ms"])
    elif autopilot and name == "RAW_IMU":
        made_s = 1e-6 * float(get["time_usec"])
    else:
        return known, ()
    # Milliseconds since boot and microseconds of another epoch are two clocks, though one program may send both.
    key = (said.system, said.component, name in SENSED_POSES)
    clock, time_s, jump_s = known.clocks.get(key, SenderClock()).at(made_s, came_s)
    known = replace(known, clocks=MappingProxyType({**known.clocks, key: clock}))
    if jump_s:
        words = f"the clock of component {said.component} of system {said.system} jumped by {jump_s:+.2f} s"
        return replace(known, jump=words, jump_s=came_s), ()
    if time_s is None:
        return replace(known, jump_s=came_s), ()
    if name == "ATTITUDE":
        q, omega = quat_from_euler(*finite(get, "roll", "pitch", "yaw")), _rates(get)
        return (
            replace(known, attitude=AttitudeSample(time_s=time_s, q_WB=q, omega_B_rad_s=omega)),
            (Measurement(time_s=time_s, omega_B_rad_s=omega),),
        )
    if name == "RAW_IMU":
        force = 1e-3 * GRAVITY_M_S2 * finite(get, "xacc", "yacc", "zacc")
        return known, ((Measurement(time_s=time_s, force_B_m_s2=force),) if np.any(force) else ())
    if name == "LOCAL_POSITION_NED":
        turned = known.attitude
        if came_s - known.sensed_s < BEHIND_S or turned is None or abs(time_s - turned.time_s) > ATTITUDE_S:
            return known, ()
        X_WB = Pose(finite(get, "x", "y", "z"), turned.at(time_s))
    else:
        X_WB = sensed_pose(name, get)
    sensed_s = known.sensed_s if name == "LOCAL_POSITION_NED" else came_s
    return replace(known, sensed_s=sensed_s), (Measurement(time_s=time_s, X_WB=X_WB),)


def _rates(fields: Mapping[str, Any]) -> Array:
    return finite(fields, "rollspeed", "pitchspeed", "yawspeed")
