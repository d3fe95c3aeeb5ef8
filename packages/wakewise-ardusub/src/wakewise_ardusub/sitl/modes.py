"""Flight modes of the simulated autopilot, from the pilot's sticks and buttons to one pulse per motor.

**Sticks.** A demand is the stick times the gain (JS_GAIN_DEFAULT); the pulse is 1500 us plus up to 400 us times it. The
last sticks stay valid until the failsafe of the pilot's input.

**Modes.** MANUAL passes the demands on. STABILIZE holds roll and pitch at the commanded angles, and the heading while
the yaw stick is neutral: the angle's error times ATC_ANG_*_P is a rate, its error in a PID (ATC_RAT_*) a demand.
ALT_HOLD also holds the depth while the throttle is neutral: the depth's error times PSC_POSZ_P is a velocity, its error
times PSC_VELZ_P an acceleration, and a PI of the remaining error the throttle. The controllers run on while a script
overrides the outputs, so their integrals act when the override ends, unless the mode was entered anew: then depth and
heading are those of that moment, and the integral gives the throttle of the mode before, as in ArduSub. GUIDED follows
targets (`guided.py`); of the sticks yaw alone acts. POSHOLD also holds the place while forward and lateral are neutral.

**Buttons.** BTNn_FUNCTION and, while a shift button is held, BTNn_SFUNCTION: arming, disarming, modes and shift. Mount,
lights, gain, trim, input hold, relays and servos are not simulated.

**Mixer.** ArduSub's vectored frames: roll, pitch and throttle are summed and divided by the largest sum where that is
above 1; yaw, forward and lateral likewise; both are added and limited to 1 (sources: `wakewise.control.motor_mix`).
MOT_n_DIRECTION mirrors a motor's pulse about 1500 us.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import euler_from_quat
from wakewise.robot.vehicles.mixing import ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF
from wakewise_ardusub.link.parameters import (
    ARM,
    ARM_TOGGLE,
    BUTTONS,
    DISARM,
    MODE_FUNCTIONS,
    NONE,
    SHIFT,
    parameters_of,
)
from wakewise_ardusub.link.protocol import ALT_HOLD, FULL_US, MANUAL, MIDDLE_US, POSHOLD, STABILIZE
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.sitl.guided import GuidedTarget, hold_here, horizontal_demands, turned_to
from wakewise_ardusub.sitl.own_parameters import FRAME_VECTORED, ParameterTable

if TYPE_CHECKING:
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot


STICK_FULL = 1000.0
THROTTLE_MIDDLE = 500.0
_EXTENSIONS_PITCH, _EXTENSIONS_ROLL = 1, 2


@dataclass(frozen=True, kw_only=True)
class PilotDemands:
    """What is asked of the mixer, each in [-1, 1]; forward, right and up are positive."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    throttle: float = 0.0
    forward: float = 0.0
    lateral: float = 0.0


def demands_of(
    x: int, y: int, z: int, r: int, *, pitch: int = 0, roll: int = 0, extensions: int = 0, gain: float, throttle: float
) -> PilotDemands:
    """Demands of MANUAL_CONTROL's numbers at a gain, and at one of the throttle on top; numbers out of range count as
    the end of their range.
    """
    return PilotDemands(
        roll=_share(roll) * gain if extensions & _EXTENSIONS_ROLL else 0.0,
        pitch=_share(pitch) * gain if extensions & _EXTENSIONS_PITCH else 0.0,
        yaw=_share(r) * gain,
        throttle=max(-1.0, min(1.0, (max(0, min(1000, z)) - THROTTLE_MIDDLE) / THROTTLE_MIDDLE)) * gain * throttle,
        forward=_share(x) * gain,
        lateral=_share(y) * gain,
    )


def _share(value: int) -> float:
    return max(-1.0, min(1.0, value / STICK_FULL))


GUIDED = 4
MODES = {MANUAL: "MANUAL", STABILIZE: "STABILIZE", ALT_HOLD: "ALT_HOLD", GUIDED: "GUIDED", POSHOLD: "POSHOLD"}
"""Modes that the stand-in flies."""
NEEDS_PLACE = (GUIDED, POSHOLD)
"""Modes that are refused without a position."""
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
    target: GuidedTarget | None = None
    velocity_sum: Array = field(default_factory=lambda: np.zeros(2))

    def entered(self, mode: int) -> ModeControllers:
        """Afresh in a mode; modes that hold a depth go on with the throttle of before, those that hold a place with
        what pushed against the current.
        """
        carried = -self.throttle if mode in (ALT_HOLD, *NEEDS_PLACE) else 0.0
        pushed = self.velocity_sum if mode in NEEDS_PLACE else np.zeros(2)
        return ModeControllers(throttle=self.throttle, climb_sum=carried, velocity_sum=pushed)


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
    if mode in NEEDS_PLACE:
        return _place(mode, loops, demands, motion, parameters, dt_s)
    loops, turns = _attitude(loops, demands, motion, parameters, dt_s)
    after = replace(demands, roll=turns[0], pitch=turns[1], yaw=turns[2])
    if mode == ALT_HOLD:
        loops, throttle = _depth(loops, demands.throttle, motion, parameters, dt_s)
        after = replace(after, throttle=throttle)
    return replace(loops, throttle=after.throttle), after


def _place(
    mode: int,
    loops: ModeControllers,
    demands: PilotDemands,
    motion: PhysicsState,
    parameters: ParameterTable,
    dt_s: float,
) -> tuple[ModeControllers, PilotDemands]:
    """GUIDED follows its target, POSHOLD the place where it was entered or the sticks were let go."""
    target = loops.target
    steered = mode == POSHOLD and max(abs(demands.forward), abs(demands.lateral)) > CENTRED
    if target is None or steered:
        target = hold_here(motion, motion.time_s)
    target = target.advanced(motion.time_s, dt_s)
    heading = loops.heading_rad
    if mode == GUIDED and heading is not None:
        heading = turned_to(target, heading, euler_from_quat(motion.q_WB)[2], dt_s)
    loops, turns = _attitude(replace(loops, heading_rad=heading), demands, motion, parameters, dt_s)
    total, forward, lateral = horizontal_demands(target, loops.velocity_sum, motion, parameters, dt_s)
    if mode == POSHOLD and abs(demands.throttle) > 1e-3 * parameters.value("THR_DZ", otherwise=100.0):
        loops, throttle = _depth(loops, demands.throttle, motion, parameters, dt_s)
    else:
        held = loops.depth_m if mode == POSHOLD else None if target.place_W_m is None else float(target.place_W_m[2])
        sought = replace(loops, depth_m=held)
        loops, throttle = _depth(sought, 0.0, motion, parameters, dt_s, float(target.velocity_W_m_s[2]))
    after = PilotDemands(
        roll=turns[0],
        pitch=turns[1],
        yaw=turns[2],
        throttle=throttle,
        forward=demands.forward if steered else forward,
        lateral=demands.lateral if steered else lateral,
    )
    return replace(loops, target=target, velocity_sum=total, throttle=throttle), after


def _attitude(
    loops: ModeControllers, demands: PilotDemands, motion: PhysicsState, parameters: ParameterTable, dt_s: float
) -> tuple[ModeControllers, list[float]]:
    angles = euler_from_quat(motion.q_WB)
    largest = math.radians(parameters.value("ANGLE_MAX", otherwise=4500.0) * 1e-2)
    steered = abs(demands.yaw) > CENTRED
    heading = angles[2] if steered or loops.heading_rad is None else loops.heading_rad
    desired = (demands.roll * largest, demands.pitch * largest, heading)
    p = [parameters.value(f"ATC_ANG_{axis}_P", otherwise=6.0) for axis in _AXES]
    rates = np.array([p[i] * _wrapped(desired[i] - angles[i]) for i in range(3)])
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
    loops: ModeControllers,
    throttle: float,
    motion: PhysicsState,
    parameters: ParameterTable,
    dt_s: float,
    sinks_m_s: float = 0.0,
) -> tuple[ModeControllers, float]:
    depth, down = float(motion.p_WB_m[2]), float(motion.v_W_m_s[2])
    dead = 1e-3 * parameters.value("THR_DZ", otherwise=100.0)
    steered = abs(throttle) > dead
    held = depth if steered or loops.depth_m is None else loops.depth_m
    desired = sinks_m_s + parameters.value("PSC_POSZ_P", otherwise=3.0) * (held - depth)
    if steered:
        desired = -throttle * parameters.value("PILOT_SPEED_UP", otherwise=50.0) / _CM
    # Gains of the last loop count per mille of the throttle's half range for cm/s2.
    scale = _PER_MILLE * _CM
    missing = parameters.value("PSC_VELZ_P", otherwise=8.0) * (desired - down)
    most = _PER_MILLE * parameters.value("PSC_ACCZ_IMAX", otherwise=100.0) * 2.0
    total = loops.climb_sum + scale * parameters.value("PSC_ACCZ_I", otherwise=0.1) * missing * dt_s
    total = max(-most, min(most, total))
    sinking = scale * parameters.value("PSC_ACCZ_P", otherwise=0.5) * missing + total
    return replace(loops, depth_m=held, climb_sum=total), max(-1.0, min(1.0, -sinking))


def _wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


class ButtonHandler:
    """Remembers which buttons are down: one acts as it goes down."""

    def __init__(self) -> None:
        self._before = 0

    def take(self, board: SimulatedAutopilot, buttons: int) -> None:
        """Buttons as bits, as the last sticks have them."""
        pressed, self._before = buttons & ~self._before, buttons
        if not pressed:
            return
        shifted = any(buttons & 1 << b and _function(board.parameters, b) == SHIFT for b in range(BUTTONS))
        for button in range(BUTTONS):
            if pressed & 1 << button:
                _act(board, _function(board.parameters, button, shifted=shifted))


def can_disarm(parameters: ParameterTable) -> bool:
    """Whether some button disarms: without one ArduSub refuses to arm, whatever ARMING_CHECK says."""
    plain = {_function(parameters, button) for button in range(BUTTONS)}
    shifted = {_function(parameters, button, shifted=True) for button in range(BUTTONS)} if SHIFT in plain else set()
    return bool((plain | shifted) & {ARM_TOGGLE, DISARM})


def _function(parameters: ParameterTable, button: int, *, shifted: bool = False) -> int:
    return round(parameters.value(parameters_of(button)[shifted], otherwise=NONE))


def _act(board: SimulatedAutopilot, function: int) -> None:
    if function == ARM or (function == ARM_TOGGLE and not board.armed):
        board.arm()
    elif function in (DISARM, ARM_TOGGLE):
        board.disarm("button")
    elif function in MODE_FUNCTIONS:
        board.set_mode(MODE_FUNCTIONS[function])


def factors_of(parameters: ParameterTable) -> Array:
    """Motor factors of the frame, shape (n, 6): roll, pitch, yaw, throttle, forward, lateral."""
    frame = parameters.value("FRAME_CONFIG", otherwise=FRAME_VECTORED)
    return ARDUSUB_VECTORED if frame == FRAME_VECTORED else ARDUSUB_VECTORED_6DOF


def directions_of(parameters: ParameterTable, motors: int) -> Array:
    """MOT_n_DIRECTION of each motor, shape (n,): 1 or -1."""
    said = [parameters.value(f"MOT_{i + 1}_DIRECTION", otherwise=1.0) for i in range(motors)]
    return np.where(np.array(said) < 0.0, -1.0, 1.0)


def motor_pulses_us(demands: PilotDemands, factors: Array, directions: Array) -> list[int]:
    """Pulse of each motor, shape (n,), for demands."""
    asked = np.array(
        [demands.roll, demands.pitch, demands.yaw, demands.throttle, demands.forward, demands.lateral], dtype=np.float64
    )
    groups = [factors[:, own] @ asked[own] for own in ([0, 1, 3], [2, 4, 5])]
    mixed = sum(group / max(1.0, float(np.abs(group).max())) for group in groups)
    outputs = directions * np.clip(mixed, -1.0, 1.0)
    return [int(pulse) for pulse in np.round(MIDDLE_US + FULL_US * outputs)]
