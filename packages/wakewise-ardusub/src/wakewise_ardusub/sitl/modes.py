"""Flight modes: what MANUAL, STABILIZE and ALT_HOLD make of the pilot's demands; simple loops of the documented kind.

MANUAL hands the demands on. STABILIZE holds roll and pitch at the angles asked for, and the heading while the yaw stick
is let go: the angle's error times ATC_ANG_*_P is a rate, its error in a PID (ATC_RAT_*) a demand. ALT_HOLD holds the
depth as well while the throttle is let go: the depth's error times PSC_POSZ_P is a velocity, its error times PSC_VELZ_P
an acceleration, and a PI of what is missing of that the throttle. Those loops go on while a script overrides the
outputs, so what they have summed up jumps out when the override ends, unless the mode was entered anew: then depth and
heading are those of that moment, and the sum is what gives the throttle of the mode before, as in ArduSub.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import euler_from_quat
from wakewise_ardusub.link.protocol import ALT_HOLD, MANUAL, STABILIZE
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.sitl.parameters import ParameterTable
from wakewise_ardusub.sitl.sticks import PilotDemands

MODES = {MANUAL: "MANUAL", STABILIZE: "STABILIZE", ALT_HOLD: "ALT_HOLD"}
"""Modes that the stand-in flies."""
YAW_RATE_RAD_S = math.radians(200.0)
"""Yaw rate of a full stick at ACRO_YAW_P's own value."""
CENTRED = 0.05
_AXES = ("RLL", "PIT", "YAW")
_PER_MILLE, _CM = 1e-3, 1e2


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeControllers:
    """Memory of the loops; `heading_rad` and `depth_m` are held, None until there is something to hold.

    `throttle` is what was last asked of the attitude's loops; MANUAL goes past them and leaves it as it was.
    """

    rate_sum: Array = field(default_factory=lambda: np.zeros(3))
    rate_error: Array | None = None
    heading_rad: float | None = None
    depth_m: float | None = None
    climb_sum: float = 0.0
    throttle: float = 0.0

    def entered(self, mode: int) -> ModeControllers:
        """Afresh in a mode; ALT_HOLD goes on with the throttle of before."""
        return ModeControllers(throttle=self.throttle, climb_sum=-self.throttle if mode == ALT_HOLD else 0.0)


def apply_mode(
    mode: int,
    loops: ModeControllers,
    demands: PilotDemands,
    motion: PhysicsState,
    parameters: ParameterTable,
    dt_s: float,
) -> tuple[ModeControllers, PilotDemands]:
    """Demands on the mixer in a mode, and the loops after it."""
    if mode == MANUAL:
        return ModeControllers(throttle=loops.throttle), demands
    loops, turns = _attitude(loops, demands, motion, parameters, dt_s)
    after = replace(demands, roll=turns[0], pitch=turns[1], yaw=turns[2])
    if mode == ALT_HOLD:
        loops, throttle = _depth(loops, demands.throttle, motion, parameters, dt_s)
        after = replace(after, throttle=throttle)
    return replace(loops, throttle=after.throttle), after


def _attitude(
    loops: ModeControllers, demands: PilotDemands, motion: PhysicsState, parameters: ParameterTable, dt_s: float
) -> tuple[ModeControllers, list[float]]:
    angles = euler_from_quat(motion.q_WB)
    largest = math.radians(parameters.value("ANGLE_MAX", otherwise=4500.0) * 1e-2)
    steered = abs(demands.yaw) > CENTRED
    heading = angles[2] if steered or loops.heading_rad is None else loops.heading_rad
    wished = (demands.roll * largest, demands.pitch * largest, heading)
    p = [parameters.value(f"ATC_ANG_{axis}_P", otherwise=6.0) for axis in _AXES]
    rates = np.array([p[i] * _wrapped(wished[i] - angles[i]) for i in range(3)])
    if steered:
        rates[2] = demands.yaw * YAW_RATE_RAD_S * parameters.value("ACRO_YAW_P", otherwise=3.375) / 3.375
    error = rates - motion.omega_B_rad_s
    gains = [[parameters.value(f"ATC_RAT_{axis}_{part}", otherwise=0.0) for axis in _AXES] for part in "PID"]
    most = np.array([parameters.value(f"ATC_RAT_{axis}_IMAX", otherwise=0.444) for axis in _AXES])
    total = np.clip(loops.rate_sum + np.array(gains[1]) * error * dt_s, -most, most)
    slope = np.zeros(3) if loops.rate_error is None else (error - loops.rate_error) / dt_s
    turns = np.clip(np.array(gains[0]) * error + total + np.array(gains[2]) * slope, -1.0, 1.0)
    return replace(loops, rate_sum=total, rate_error=error, heading_rad=heading), turns.tolist()


def _depth(
    loops: ModeControllers, throttle: float, motion: PhysicsState, parameters: ParameterTable, dt_s: float
) -> tuple[ModeControllers, float]:
    depth, down = float(motion.p_WB_m[2]), float(motion.v_W_m_s[2])
    dead = 1e-3 * parameters.value("THR_DZ", otherwise=100.0)
    steered = abs(throttle) > dead
    held = depth if steered or loops.depth_m is None else loops.depth_m
    wished = parameters.value("PSC_POSZ_P", otherwise=3.0) * (held - depth)
    if steered:
        wished = -throttle * parameters.value("PILOT_SPEED_UP", otherwise=50.0) / _CM
    # Gains of the last loop count per mille of the throttle's half range for cm/s2.
    scale = _PER_MILLE * _CM
    missing = parameters.value("PSC_VELZ_P", otherwise=8.0) * (wished - down)
    most = _PER_MILLE * parameters.value("PSC_ACCZ_IMAX", otherwise=100.0) * 2.0
    total = loops.climb_sum + scale * parameters.value("PSC_ACCZ_I", otherwise=0.1) * missing * dt_s
    total = max(-most, min(most, total))
    sinking = scale * parameters.value("PSC_ACCZ_P", otherwise=0.5) * missing + total
    return replace(loops, depth_m=held, climb_sum=total), max(-1.0, min(1.0, -sinking))


def _wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
