"""Simulated ArduSub autopilot: MAVLink bytes and motion in, servo pulses and bytes out, one loop at a time.

Nothing waits, sleeps or reads a clock: time is that of the physics. Failsafes act when the ground station or the pilot
falls silent while the vehicle is armed.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat
from wakewise_ardusub.link.protocol import ALT_HOLD, AUTOPILOT_COMPONENT, DEFAULT_SYSTEM, MANUAL, MIDDLE_US
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.sitl.files import MavftpServer
from wakewise_ardusub.sitl.guided import GuidedTarget, read_target
from wakewise_ardusub.sitl.mavlink_messages import BUILDERS, MessageSchedule, handle_message, parameter
from wakewise_ardusub.sitl.modes import (
    GUIDED,
    MODES,
    NEEDS_PLACE,
    ButtonHandler,
    ModeControllers,
    PilotDemands,
    apply_mode,
    can_disarm,
    directions_of,
    factors_of,
    motor_pulses_us,
)
from wakewise_ardusub.sitl.own_parameters import ParameterTable, own_parameters
from wakewise_ardusub.sitl.scripting import LuaScript
from wakewise_ardusub.sitl.sea_sensors import SeaSensors
from wakewise_ardusub.sitl.servos import OUTPUTS, MotorTest, ServoOutputs, find_channel

Action = Literal["none", "warn", "disarm", "hold depth", "surface"]

_GCS: dict[int, Action] = {0: "none", 1: "warn", 2: "disarm", 3: "hold depth", 4: "surface"}
_PILOT: dict[int, Action] = {0: "none", 1: "warn", 2: "disarm"}


def ground_station(parameters: ParameterTable, heard_s: float | None, now_s: float) -> Action:
    """What FS_GCS_ENABLE asks for: nothing while a heartbeat is fresh, or if there was never one."""
    if heard_s is None or now_s - heard_s <= parameters.value("FS_GCS_TIMEOUT", otherwise=3.0):
        return "none"
    return _GCS.get(round(parameters.value("FS_GCS_ENABLE", otherwise=2.0)), "disarm")


def pilot_input(parameters: ParameterTable, heard_s: float | None, now_s: float) -> Action:
    """What FS_PILOT_INPUT asks for: nothing while sticks are fresh. Sticks that never came are silent ones."""
    if heard_s is not None and now_s - heard_s <= parameters.value("FS_PILOT_TIMEOUT", otherwise=3.0):
        return "none"
    return _PILOT.get(round(parameters.value("FS_PILOT_INPUT", otherwise=2.0)), "disarm")


FIRMWARE = (4, 5, 3)
"""Release that it says it is: the one that BlueOS 1.4 brings."""
HOME_DEG = (33.810313, -118.393867)
"""Latitude and longitude of the origin: where ArduPilot's simulated submarine starts."""
MOUNT_STOPS_DEG = 45.0
"""Of a BlueROV2's camera."""
PLACE_LASTS_S = 7.0
"""How long the filter's position outlasts the Doppler log."""
LOOPS_HZ = (50.0, 1000.0)
_LISTED_PER_LOOP = 10
_MOST_WAITING = 4000
TEXT_LETTERS = 50
_MOST_TEXT_ID = 65535
_CRITICAL, _ERROR, _WARNING, _INFO = 2, 3, 4, 6
_AT_REST = PhysicsState(
    time_s=0.0,
    omega_B_rad_s=np.zeros(3),
    force_B_m_s2=np.array([0.0, 0.0, -GRAVITY_M_S2]),
    p_WB_m=np.zeros(3),
    q_WB=np.array([1.0, 0.0, 0.0, 0.0]),
    v_W_m_s=np.zeros(3),
)

log = logging.getLogger(__name__)


class SimulatedAutopilot:
    """An autopilot of an eight- or six-motor submarine.

    Parameters
    ----------
    values : mapping, optional
        Parameters in place of the stand-in's own, and more of them.
    loop_hz : float
        Loops a second; as often as `step` is called, by the time of the motions.
    firmware : tuple of three int
        Release that it says it is.
    scripts : mapping, optional
        Lua scripts on its card, text by name.
    home_deg : tuple of two floats
        Latitude and longitude of physics' origin.
    zero_depth_m : float or None
        Where the depth sensor was calibrated; None does that at each start, wherever it is, as ArduSub does. Either
        way whatever is shallower later on is its new zero.
    sensors : SeaSensors, optional
        Rangefinder above a bed and the errors of position and velocity; none, and the truth, if not given.

    Raises
    ------
    InputError
        If it is to have more or fewer loops than `LOOPS_HZ`.
    MissingExtra
        If there is a script and no Lua.
    """

    armed: bool
    mode: int
    timetable: MessageSchedule
    joystick: ButtonHandler
    motor_test: MotorTest
    _loops: ModeControllers
    _demands: PilotDemands
    _servos: ServoOutputs
    _scripts: list[LuaScript]
    _to_list: deque[str]
    _station_s: float | None
    _sticks_s: float | None
    _told: dict[str, Action]
    _zeroed: bool
    _log_s: float

    def __init__(
        self,
        values: Mapping[str, float] | None = None,
        *,
        loop_hz: float = 400.0,
        firmware: tuple[int, int, int] = FIRMWARE,
        scripts: Mapping[str, str] | None = None,
        home_deg: tuple[float, float] = HOME_DEG,
        zero_depth_m: float | None = 0.0,
        sensors: SeaSensors | None = None,
    ) -> None:
        if not LOOPS_HZ[0] <= loop_hz <= LOOPS_HZ[1]:
            raise InputError(f"stand-in: {loop_hz:g} loops a second, {LOOPS_HZ[0]:g} to {LOOPS_HZ[1]:g} are allowed")
        self.loop_hz, self.firmware, self.home_deg = loop_hz, firmware, home_deg
        self._calibrated_m, self.zero_depth_m = zero_depth_m, 0.0
        self.parameters = ParameterTable(own_parameters() | dict(values or {}))
        self.files = MavftpServer()
        for name, text in (scripts or {}).items():
            self.files.put(f"/APM/scripts/{name}", text.encode("latin-1", "replace"))
        self._mav = mavlink.MAVLink(None, srcSystem=self.system, srcComponent=self.component)
        self._parsers: dict[str, Any] = {}
        self._out: list[bytes] = []
        self.bad_data = self.photographs = 0
        """Stretches of bytes that were no packet; photographs that were asked for."""
        self.mount_target_deg: float | None = None
        """What was asked of the camera's mount, up positive; None: it is the pilot's."""
        self.pulses_us: tuple[int, ...] = (0,) * OUTPUTS
        """What the outputs carry now."""
        self.motion = _AT_REST
        """What physics said last."""
        self.sensors = sensors
        self.estimated = _AT_REST
        """What position, velocity and attitude are by its own sensors."""
        self.texts: deque[str] = deque(maxlen=200)
        """What was last said in words."""
        self._began_s = 0.0
        self._text_id = 0
        self.reboot()

    # What it is.

    @property
    def system(self) -> int:
        """Its system id."""
        return int(self.parameters.value("MAV_SYSID", "SYSID_THISMAV", otherwise=DEFAULT_SYSTEM)) & 0xFF

    @property
    def component(self) -> int:
        """Its component id."""
        return AUTOPILOT_COMPONENT

    @property
    def ground_station(self) -> int:
        """System id of the ground station that may steer and whose silence counts."""
        return int(self.parameters.value("MAV_GCS_SYSID", "SYSID_MYGCS", otherwise=255.0))

    @property
    def now_s(self) -> float:
        """Time since its start."""
        return self.motion.time_s - self._began_s

    @property
    def boot_ms(self) -> int:
        """The same in whole milliseconds."""
        return round(1e3 * self.now_s) & 0xFFFFFFFF

    @property
    def mount_deg(self) -> float:
        """Angle of the camera's servo: the hull's pitch is taken off, as by ArduSub's servo mount; the pilot's is 0."""
        if self.mount_target_deg is None:
            return 0.0
        pitch_deg = math.degrees(float(euler_from_quat(self.motion.q_WB)[1]))
        steady = self.parameters.value("MNT1_TYPE", otherwise=0.0) == 1.0
        angle = self.mount_target_deg - (pitch_deg if steady else 0.0)
        return min(max(angle, -MOUNT_STOPS_DEG), MOUNT_STOPS_DEG)

    @property
    def depth_m(self) -> float:
        """What its depth sensor makes of where it is."""
        return float(self.motion.p_WB_m[2]) - self.zero_depth_m

    @property
    def place_lost(self) -> bool:
        """Whether its filter has no horizontal position."""
        return self.now_s - self._log_s > PLACE_LASTS_S

    @property
    def overridden(self) -> bool:
        """Whether a script drives an output now."""
        return any(self._servos.overridden)

    # In and out.

    def hear(self, data: bytes, link: str = "") -> None:
        """Take bytes that came on a link, whatever they are; each link has its own place in a packet."""
        ears = self._parsers.get(link)
        if ears is None:
            ears = self._parsers[link] = mavlink.MAVLink(None)
            ears.robust_parsing = True
        try:
            found = ears.parse_buffer(data) or []
        except mavlink.MAVError:  # a packet that its own length does not fit
            self.bad_data += 1
            return
        for message in found:
            if message.get_type() == "BAD_DATA":
                self.bad_data += 1
            elif message.get_msgId() >= 0:
                handle_message(self, message)

    def send(self, message: Any) -> None:
        """Put a message among what goes out."""
        if len(self._out) < _MOST_WAITING:
            self._out.append(bytes(message.pack(self._mav)))
            self._mav.seq = (self._mav.seq + 1) & 0xFF

    def take_out(self) -> list[bytes]:
        """What it has said since this was last asked: a packet each."""
        out, self._out = self._out, []
        return out

    def step(self, motion: PhysicsState) -> tuple[int, ...]:
        """One loop: the pulses of its outputs, 16 of them, after physics told how the vehicle moves."""
        dt_s = max(motion.time_s - self.motion.time_s, 0.0)
        self.motion = self.estimated = motion
        if self.sensors is not None:
            self.estimated = self.sensors.estimate(motion)
        if self.sensors is None or not self.sensors.lost(motion.time_s):
            self._log_s = self.now_s
        self._calibrate(float(motion.p_WB_m[2]))
        self._watch()
        for script in self._scripts:
            script.step()
        self._loops, demands = apply_mode(
            self.mode, self._loops, self._demands, self.estimated, self.parameters, dt_s or 1e-3
        )
        motors: list[int] | None = None
        if self.motor_test.over(self.now_s):
            self.send_text(_INFO, "Motor test timed out!")
            self.disarm("motor test")
        if self.armed and self.motor_test.pulses_us is not None:
            motors = self.motor_test.pulses_us
        elif self.armed:
            factors = factors_of(self.parameters)
            motors = motor_pulses_us(demands, factors, directions_of(self.parameters, len(factors)))
        else:
            self._loops = ModeControllers()
        self.pulses_us = self._servos.step(motors, self.parameters)
        for message in self.timetable.due(self.now_s):
            told = BUILDERS[message](self)
            if told is not None:
                self.send(told)
        for _ in range(min(_LISTED_PER_LOOP, len(self._to_list))):
            self.send(parameter(self, self._to_list.popleft()))
        return self.pulses_us

    def _calibrate(self, depth_m: float) -> None:
        """Take the depth at the start for 0, and any less for it later on: less than no depth cannot be."""
        if self._zeroed and depth_m >= self.zero_depth_m:
            return
        fixed = not self._zeroed and self._calibrated_m is not None
        self.zero_depth_m = self._calibrated_m if fixed and self._calibrated_m is not None else depth_m
        self._zeroed = True

    # What messages and failsafes do.

    def reboot(self) -> None:
        """Start anew: disarmed, in MANUAL, nobody heard; parameters and files stay."""
        self._began_s = self.motion.time_s
        self.armed, self.mode = False, int(MANUAL)
        self._loops, self._demands = ModeControllers(), PilotDemands()
        self._servos = ServoOutputs(self.loop_hz)
        self.motor_test = MotorTest(len(factors_of(self.parameters)))
        self.timetable, self.joystick = MessageSchedule(), ButtonHandler()
        self._zeroed = False
        self._log_s = 0.0
        self._station_s = None
        self._sticks_s = None
        self._to_list = deque()
        self._told = {}
        self._mav.srcSystem = self.system
        self.start_scripts()

    def start_scripts(self) -> None:
        """Stop all scripts and start those on the card, if scripting is on."""
        self.parameters.forget_tables()
        self._scripts = []
        if self.parameters.value("SCR_ENABLE", otherwise=0.0) == 1.0:
            self._scripts = [LuaScript(text, name, self) for name, text in self.files.scripts().items()]

    @property
    def script_faults(self) -> list[str]:
        """Why scripts were stopped."""
        return [script.fault for script in self._scripts if script.fault is not None]

    def to_scripts(self, raw: str, message: int) -> None:
        """Give scripts a message that they may have asked for."""
        for script in self._scripts:
            script.hear(raw, message, self.boot_ms)

    def arm(self) -> bool:
        """Arm the motors; False in a mode that is not flown, or where no button of the sticks disarms."""
        if self.mode not in MODES:
            return False
        if not can_disarm(self.parameters):
            self.send_text(_CRITICAL, "Arm: Must assign a disarm or arm_toggle button")
            return False
        if not self.armed:
            self.armed, self._loops = True, ModeControllers()
            # Sticks and heartbeats from before count from now: a pilot has as long as ever to begin.
            self._sticks_s = self.now_s
            self.send_text(_INFO, "Arming motors")
        return True

    def disarm(self, why: str) -> bool:
        """Disarm them."""
        if self.armed:
            self.armed, self._demands = False, PilotDemands()
            self.send_text(_INFO, f"Disarming motors ({why})")
        return True

    def set_mode(self, mode: int) -> bool:
        """Change the mode; False for one that the stand-in does not fly."""
        if mode not in MODES:
            self.send_text(_WARNING, f"Mode change failed: no mode {mode} here")
            return False
        if mode in NEEDS_PLACE and self.place_lost:
            self.send_text(_WARNING, f"Mode change failed: {MODES[mode]} requires position")
            return False
        if mode != self.mode:
            self.mode, self._loops = mode, self._loops.entered(mode)
        return True

    def take_target(self, message: Any) -> None:
        """SET_POSITION_TARGET_LOCAL_NED: followed in GUIDED, without effect in any other mode."""
        if self.mode != GUIDED:
            return
        target = read_target(message, self.estimated, self.zero_depth_m, self.motion.time_s, self.firmware)
        if target is not None:
            self._loops = replace(self._loops, target=target)

    @property
    def target(self) -> GuidedTarget | None:
        """What GUIDED and POSHOLD follow now."""
        return self._loops.target

    def set_parameter(self, name: str, value: float) -> bool:
        """Set a parameter as PARAM_SET does."""
        return self.parameters.set(name, value)

    def list_parameters(self) -> None:
        """Begin to tell all parameters, some in each loop."""
        self._to_list = deque(self.parameters)

    def note_ground_station(self) -> None:
        """A heartbeat of the ground station."""
        self._station_s = self.now_s

    def take_sticks(self, demands: PilotDemands) -> None:
        """Sticks of the pilot; they steer once armed."""
        self._sticks_s = self.now_s
        self._demands = demands

    def _watch(self) -> None:
        """Look after ground station and pilot while armed; a fault is told once, until it is another or over."""
        station = ground_station(self.parameters, self._station_s, self.now_s) if self.armed else "none"
        pilot = pilot_input(self.parameters, self._sticks_s, self.now_s) if self.armed else "none"
        if pilot != "none":
            self._demands = PilotDemands()
        faults = {"Lost ground station": station, "Lost manual control": pilot}
        for who, action in faults.items():
            if action not in ("none", self._told.get(who)):
                self.send_text(_ERROR, f"{who}: {action}")
            if action == "disarm":
                self.disarm(who)
            elif action in ("hold depth", "surface") and self.mode != ALT_HOLD:
                self.set_mode(ALT_HOLD)
        self._told = faults

    # What scripts see; see `scripting.Board`.

    def find_channel(self, function: int) -> int | None:
        """First output, numbered from 0, with a function."""
        return find_channel(self.parameters, function)

    def output_us(self, function: int) -> int | None:
        """Pulse on that output now."""
        channel = self.find_channel(function)
        return None if channel is None else self.pulses_us[channel]

    def override(self, channel: int, pulse_us: int, timeout_ms: int) -> None:
        """Put a pulse on an output for so long."""
        self._servos.override(channel, pulse_us, timeout_ms)

    def send_text(self, severity: int, words: str) -> None:
        """STATUSTEXT; longer words go in several, of 50 letters each and numbered."""
        self.texts.append(words)
        log.info("%s", words)
        self._text_id = self._text_id % _MOST_TEXT_ID + 1
        data = words.encode("ascii", "replace")
        parts = [data[i : i + TEXT_LETTERS] for i in range(0, len(data), TEXT_LETTERS)] or [b""]
        number = self._text_id if len(parts) > 1 else 0
        for k, part in enumerate(parts[:255]):
            self.send(mavlink.MAVLink_statustext_message(severity, part, number, k))

    def send_named_float(self, name: str, value: float) -> None:
        """NAMED_VALUE_FLOAT."""
        self.send(mavlink.MAVLink_named_value_float_message(self.boot_ms, name[:10].encode("ascii", "replace"), value))


def any_output_active(pulses_us: tuple[int, ...], channels: tuple[int, ...], within_us: int = 0) -> bool:
    """Whether an output of these channels, numbered from 1, is off the middle by more than so much; 0 is no signal."""
    return any(p != 0 and abs(p - MIDDLE_US) > within_us for p in (pulses_us[c - 1] for c in channels))
