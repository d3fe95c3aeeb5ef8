"""A vehicle in a bottle: an output gate, a clock that only we move, and the messages that an ArduSub would send."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import TICK_S, OutputGate
from wakewise_ardusub.link.parameters import BUTTON_PARAMETERS
from wakewise_ardusub.link.protocol import RELEASE_GROUP, SCRIPT_VERSION
from wakewise_ardusub.link.session_log import SessionLog

MOTORS = 8
SESSION = 4711
THRUSTS = np.full(MOTORS, 5.0)
SOURCES = ("heartbeat", "attitude", "pose", "depth", "sticks", "servos", "script")


class Tenths:
    """A `Drive`: a tenth of full for each newton, as a stand-in for a thruster's curve."""

    words = ""

    needs = ("MOT_1_DIRECTION",)

    def amiss(self, parameters: Mapping[str, float]) -> str:
        """It must be 1 or -1."""
        return "" if abs(parameters["MOT_1_DIRECTION"]) == 1.0 else "MOT_1_DIRECTION must be 1 or -1"

    def slots(self, parameters: Mapping[str, float], thrusts_N: np.ndarray, battery_V: float) -> np.ndarray:
        """All eight."""
        return np.clip(0.1 * thrusts_N, -1.0, 1.0)


@dataclass
class Bottle:
    """Everything about a session but sockets and threads; `sent` holds (time, message name, fields)."""

    limits: EngagementLimits = field(default_factory=EngagementLimits)
    journal: SessionLog | None = None
    listen_only: bool = False
    session: int = SESSION
    now_s: float = 1000.0
    boot_s: float = 50.0
    armed: bool = True
    mode: int = 19
    sent: list[tuple[float, str, Mapping[str, Any]]] = field(default_factory=list)
    silent: set[str] = field(default_factory=set)
    deciding: bool = True
    at: tuple[float, float, float] = (0.0, 0.0, 2.0)
    roll_rad: float = 0.0
    buttons: int = 0
    acts: float = 0.0

    def __post_init__(self) -> None:
        self.gate = OutputGate(
            send=lambda name, fields: self.sent.append((self.now_s, name, dict(fields))),
            drive=Tenths(),
            limits=self.limits,
            journal=self.journal,
            session=self.session,
            buttons={"engage": 3, "capture": 4},
            listen_only=self.listen_only,
            clock=lambda: self.now_s,
        )
        self.gate.target_W_m = np.array([1.0, 0.0, 2.0])
        self.gate.begin()
        self.parameters()
        self._step = 0

    def say(self, name: str, /, system: int = 1, component: int = 1, **fields: Any) -> None:
        """A message comes."""
        self.gate.take(MavlinkMessage(system, component, name, fields))

    def parameter(self, name: str, value: float) -> None:
        """The autopilot says what a parameter is."""
        self.say("PARAM_VALUE", param_id=name, param_value=value, param_type=9, param_count=900, param_index=1)

    def parameters(self) -> None:
        """All that the output gate asks for: the motor as it should be, and no button of the autopilot's."""
        self.parameter("MOT_1_DIRECTION", 1.0)
        for name in BUTTON_PARAMETERS:
            self.parameter(name, 0.0)

    def beat(self) -> None:
        """The autopilot's heartbeat."""
        base_mode = 128 * self.armed
        self.say("HEARTBEAT", type=12, autopilot=3, base_mode=base_mode, custom_mode=self.mode, system_status=4)

    def stick(self, system: int = 255, **axes: int) -> None:
        """The pilot's sticks."""
        fields = {"x": 0, "y": 0, "z": 500, "r": 0, "buttons": self.buttons, **axes}
        self.say("MANUAL_CONTROL", system=system, component=190, target=1, **fields)

    def run(self, duration_s: float) -> None:
        """Let time pass: the vehicle talks at its rates, the watch ticks, the controller decides ten times a second."""
        for _ in range(round(duration_s / TICK_S)):
            self.now_s += TICK_S
            k, boot_ms = self._step, round(1e3 * (self.now_s - 1000.0 + self.boot_s))
            if "heartbeat" not in self.silent and k % 50 == 0:
                self.beat()
            if "attitude" not in self.silent:
                turned = {"roll": self.roll_rad, "pitch": 0.0, "yaw": 0.0}
                self.say("ATTITUDE", time_boot_ms=boot_ms, rollspeed=0.0, pitchspeed=0.0, yawspeed=0.0, **turned)
            if "pose" not in self.silent and k % 2 == 0:
                x, y, z = self.at
                self.say("LOCAL_POSITION_NED", time_boot_ms=boot_ms, x=x, y=y, z=z, vx=0.0, vy=0.0, vz=0.0)
            if "depth" not in self.silent and k % 5 == 0:
                self.say("VFR_HUD", alt=-self.at[2])
            if "servos" not in self.silent and k % 5 == 0:
                pulses = {f"servo{i}_raw": 1500 for i in range(1, 9)}
                self.say("SERVO_OUTPUT_RAW", time_usec=1000 * boot_ms, port=0, **pulses)
            if "sticks" not in self.silent and k % 2 == 0:
                self.stick()
            if "script" not in self.silent and k % 25 == 0:
                self.say("NAMED_VALUE_FLOAT", name="WKW_ENG", value=self.acts, time_boot_ms=boot_ms)
                self.say("NAMED_VALUE_FLOAT", name="WKW_VER", value=float(SCRIPT_VERSION), time_boot_ms=boot_ms)
            self.gate.tick()
            if self.deciding and k % 5 == 0:
                self.gate.estimated(BodyState(X_WB=Pose(np.array(self.at), np.array([1.0, 0.0, 0.0, 0.0]))))
            if self.deciding and k % 5 == 0 and (entry := self.gate.entry) is not None:
                self.acts = 1.0
                self.gate.command(THRUSTS, entry)
            self._step += 1

    def engage(self) -> str:
        """All well, and the operator consents."""
        self.run(1.2)
        return self.gate.press()

    @property
    def thrusts(self) -> list[float]:
        """When thrusts went out."""
        return [t for t, name, fields in self.sent if name == THRUST and fields["group_mlx"] != RELEASE_GROUP]

    @property
    def releases(self) -> list[float]:
        """When the script was told to let go."""
        return [t for t, name, fields in self.sent if name == THRUST and fields["group_mlx"] == RELEASE_GROUP]


THRUST = "set_actuator_control_target"
