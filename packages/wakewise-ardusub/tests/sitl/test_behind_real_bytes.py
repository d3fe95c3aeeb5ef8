"""The shipped script and the physics link in real time over sockets: with the stand-in always, with ArduSub if there.

WAKEWISE_ARDUSUB names a binary of ArduSub's simulator (ArduPilot, `./waf configure --board sitl && ./waf sub`); nothing
else is needed, it is started here with its own folder, parameters and script, and ended by its process. Port 9002 must
be free.
"""

from __future__ import annotations

import os
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.protocol import (
    ALT_HOLD,
    COMPANION_COMPONENT,
    ENABLE_PARAMETER,
    SCRIPT_VERSION,
    THRUST_GROUP,
)
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.physics import FreeWater, PhysicsServer, PulseTable, SimulatedBody
from wakewise_ardusub.physics.datagrams import PORT, PhysicsState
from wakewise_ardusub.physics.physics import LOOPBACK, open_socket, serve
from wakewise_ardusub.physics.surface import LoweringBody
from wakewise_ardusub.sitl.companion_harness import CompanionHarness
from wakewise_ardusub.sitl.inprocess_session import STATION, STATION_COMPONENT, THRUSTS, shipped_script
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.simulated_autopilot import HOME_DEG, SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import UdpEndpoint, UdpPhysics, run

HEAVY = load_vehicle("bluerov2-heavy")
BINARY = os.environ.get("WAKEWISE_ARDUSUB", "")
MIDDLE = (1500,) * 8
ACTING = tuple(int(1500 + 400 * value + 0.5) for value in THRUSTS)
START = BodyState(X_WB=Pose(np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0, 0.0])))
HELD_S = 10.0
FIRST_S = 90.0
"""How long a firmware may take to its first message and to be ready to arm."""


class Ashore:
    """Pilot and companion at one socket: heartbeats and sticks go out by themselves, what comes is kept by kind.

    It has what `CompanionHarness` needs of a rehearsal, so the shipped output gate can be the companion, by the clock
    on the wall.
    """

    vehicle, autopilot = HEAVY, SimpleNamespace(system=1)

    def __init__(self, listening: socket.socket, physics: PhysicsServer) -> None:
        self._socket, self.physics = listening, physics
        self._station = mavlink.MAVLink(None, srcSystem=STATION, srcComponent=STATION_COMPONENT)
        self._companion = mavlink.MAVLink(None, srcSystem=1, srcComponent=COMPANION_COMPONENT)
        self._parsers = mavlink.MAVLink(None)
        self._parsers.robust_parsing = True
        self._peer: tuple[str, int] | None = None
        self._due = {"beat": 0.0, "sticks": 0.0, "stream": 0.0}
        self.sticks: tuple[int, int, int, int] | None = (0, 0, 500, 0)
        self.streams = False
        self.thrusts: tuple[float, ...] = THRUSTS
        self.listeners: dict[str, Callable[[bytes], None]] = {}
        self.turns: list[Callable[[], None]] = []
        self.last: dict[str, Any] = {}
        self.named: dict[str, float] = {}
        self.texts: list[str] = []
        listening.settimeout(0.005)

    @property
    def now_s(self) -> float:
        """The computer's clock."""
        return time.monotonic()

    @property
    def pulses(self) -> tuple[int, ...]:
        """What the motors get, as physics is told."""
        return self.physics.figures().pulses_us[:8]

    @property
    def armed(self) -> bool:
        """As its last heartbeat says."""
        return bool(self.last["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def turn(self) -> None:
        """Send what is due, take what came."""
        now_s = time.monotonic()
        if self._is_due("beat", now_s, 1.0):
            self.say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        if self.sticks is not None and self._is_due("sticks", now_s, 0.05):
            self.say(mavlink.MAVLink_manual_control_message(1, *self.sticks, 0))
        if self.streams and self._is_due("stream", now_s, 0.05):
            stamp_us = round(1e6 * now_s)
            self._send(
                self._companion,
                mavlink.MAVLink_set_actuator_control_target_message(stamp_us, THRUST_GROUP, 1, 1, list(self.thrusts)),
            )
        for turn in self.turns:
            turn()
        try:
            data, self._peer = self._socket.recvfrom(4096)
        except TimeoutError:
            return
        self._tell(data, "")
        for message in self._parsers.parse_buffer(data) or []:
            if message.get_srcComponent() != 1:
                continue
            self.last[message.get_type()] = message
            if message.get_type() == "NAMED_VALUE_FLOAT":
                self.named[message.name] = message.value
            elif message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)

    @property
    def time_s(self) -> float:
        """Of physics, which a busy computer slows down."""
        return 0.0 if self.physics.motion is None else self.physics.motion.time_s

    @property
    def motion(self) -> PhysicsState:
        """The vehicle's, as physics knows it."""
        assert self.physics.motion is not None
        return self.physics.motion

    @property
    def depth_m(self) -> float:
        """As physics knows it."""
        return float(self.motion.p_WB_m[2])

    @property
    def off_m(self) -> float:
        """What the autopilot says of its depth, less the truth."""
        return -float(self.last["VFR_HUD"].alt) - self.depth_m

    def ask(self, message: int, rate_hz: float) -> None:
        """Have a message told so often."""
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self.say(mavlink.MAVLink_command_long_message(1, 1, interval, 0, message, 1e6 / rate_hz, 0, 0, 0, 0, 0))

    def run(self, seconds: float) -> None:
        """Let so much of the vehicle's time pass."""
        began_s = self.time_s
        self.until(lambda: self.time_s >= began_s + seconds, 10.0 * seconds + 5.0, f"{seconds:g} s of flight")

    def until(self, holds: Callable[[], bool], seconds: float, what: str) -> float:
        """Wait until something holds; how long that took of the vehicle's time."""
        began_s, began_at_s = time.monotonic(), self.time_s
        while not holds():
            assert time.monotonic() - began_s < seconds, f"{what}: not within {seconds:g} s; {self.texts[-5:]}"
            self.turn()
        return self.time_s - began_at_s

    def say(self, message: Any) -> None:
        """As the ground station."""
        self._send(self._station, message)

    def arm(self, armed: bool) -> None:
        """Ask until it is so: a firmware refuses until its estimator is sure."""
        asked_s = -10.0

        def so() -> bool:
            nonlocal asked_s
            if time.monotonic() - asked_s > 1.0:
                asked_s = time.monotonic()
                arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
                self.say(mavlink.MAVLink_command_long_message(1, 1, arm, 0, float(armed), 0, 0, 0, 0, 0, 0))
            return self.armed == armed

        self.until(so, FIRST_S, f"armed {armed}")

    def set(self, name: str, value: float) -> None:
        """Ask for a parameter's value."""
        real = mavlink.MAV_PARAM_TYPE_REAL32
        self.say(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, real))

    def enable(self) -> None:
        """Switch the script on."""
        self.set(ENABLE_PARAMETER, 1.0)

    def carry(self, data: bytes, link: str) -> None:
        """What somebody beside the pilot sends."""
        if self._peer is not None:
            self._socket.sendto(data, self._peer)
        self._tell(data, link)

    def _tell(self, data: bytes, link: str) -> None:
        for name, hear in self.listeners.items():
            if name != link:
                hear(data)

    def _is_due(self, what: str, now_s: float, every_s: float) -> bool:
        if self._peer is None or now_s < self._due[what]:
            return False
        self._due[what] = now_s + every_s
        return True

    def _send(self, mav: Any, message: Any) -> None:
        assert self._peer is not None
        data = bytes(message.pack(mav))
        self._socket.sendto(data, self._peer)
        self._tell(data, "pilot")
        mav.seq = (mav.seq + 1) & 0xFF


def _start_stand_in(stack: ExitStack, physics_port: int, station_port: int) -> None:
    over = threading.Event()
    made = SimulatedAutopilot(loop_hz=100.0, scripts=shipped_script())
    link, behind = UdpEndpoint(LOOPBACK, station_port, out=True), UdpPhysics(LOOPBACK, physics_port)
    thread = threading.Thread(target=run, args=(made, behind, [link], lambda: not over.is_set()))
    thread.start()
    for last in (behind.close, link.close, thread.join, over.set):  # the last is called first
        stack.callback(last)


def _start_firmware(stack: ExitStack, folder: Path, station_port: int) -> None:
    values = {name: own_parameters()[name] for name in ("FRAME_CONFIG", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT")}
    # From 4.7 on ARMING_CHECK is ARMING_SKIPCHK; what a release does not know it leaves out.
    values |= {
        "SIM_BARO_RND": 0.01,
        "SIM_BAR2_RND": 0.01,
        "SCR_ENABLE": 1,
        "ARMING_CHECK": 0,
        "ARMING_SKIPCHK": -1,
        "JS_GAIN_DEFAULT": 0.5,
    }
    (folder / "start.parm").write_text("".join(f"{name},{value:g}\n" for name, value in values.items()))
    (folder / "scripts").mkdir()
    (folder / "scripts" / "wakewise.lua").write_text(script_text())
    home = ",".join(map(str, (*HOME_DEG, 0, 0)))
    arguments = ["--model", f"JSON:{LOOPBACK}", "--speedup", "1", "-I0", "--home", home, "--defaults", "start.parm"]
    arguments += ["--serial0", f"udpclient:{LOOPBACK}:{station_port}", "--serial1", "none:0", "--serial2", "none:0"]
    with (folder / "firmware.log").open("w") as log:
        firmware = subprocess.Popen(
            [str(Path(BINARY).resolve()), *arguments], cwd=folder, stdout=log, stderr=subprocess.STDOUT
        )
    stack.callback(
        lambda: print((folder / "firmware.log").read_text(errors="replace")[-3000:])
    )  # shown if a test fails
    stack.callback(firmware.wait)
    stack.callback(firmware.kill)


WHO = [
    "stand-in",
    pytest.param(
        "ArduSub",
        marks=[
            pytest.mark.sitl,
            pytest.mark.skipif(not BINARY, reason="WAKEWISE_ARDUSUB names no binary of ArduSub"),
        ],
    ),
]


@pytest.fixture(params=WHO)
def ashore(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Ashore]:
    """A vehicle in still water behind an autopilot that has said its first heartbeat and loaded the script."""
    real = request.param == "ArduSub"

    def begin() -> SimulatedBody:
        """The firmware calibrates its depth at the surface; the stand-in was calibrated there before."""
        body = FreeWater(HEAVY, START)
        return LoweringBody(body, START, HELD_S) if real else body

    physics = PhysicsServer(begin, PulseTable.of(HEAVY).thrusts)
    over = threading.Event()
    with ExitStack() as stack:
        assert not real or os.access(BINARY, os.X_OK), f"WAKEWISE_ARDUSUB={BINARY}: no program is there"
        listening = stack.enter_context(open_socket(LOOPBACK, PORT if real else 0))
        station = stack.enter_context(open_socket(LOOPBACK, 0))
        serving = threading.Thread(target=serve, args=(physics, listening, lambda: not over.is_set()))
        serving.start()
        stack.callback(serving.join)
        stack.callback(over.set)
        if real:
            _start_firmware(stack, tmp_path, station.getsockname()[1])
        else:
            _start_stand_in(stack, listening.getsockname()[1], station.getsockname()[1])
        ashore = Ashore(station, physics)
        ashore.until(lambda: not physics.figures().stage and physics.figures().frames > 0, FIRST_S, "under water")
        ashore.until(lambda: "HEARTBEAT" in ashore.last and "WKW_VER" in ashore.named, FIRST_S, "heartbeat and script")
        yield ashore


def test_the_script_drives_only_while_armed_and_lets_go(ashore: Ashore) -> None:
    """Nothing while disarmed, thrusts on the motors, the sticks back within 300 ms, none after disarming.

    Pulses are those that physics is told, so the whole way is in the times.
    """
    assert ashore.named["WKW_VER"] == SCRIPT_VERSION
    ashore.enable()
    ashore.streams = True
    ashore.run(1.0)
    assert ashore.pulses == MIDDLE

    ashore.arm(True)
    ashore.until(lambda: ashore.pulses == ACTING, 3.0, "thrusts on the motors")
    ashore.until(lambda: ashore.named.get("WKW_ENG") == 1.0, 2.0, "the script says that it acts")

    ashore.streams = False
    assert ashore.until(lambda: ashore.pulses == MIDDLE, 2.0, "neutral after the stream stops") < 0.35
    ashore.streams = True
    ashore.until(lambda: ashore.pulses == ACTING, 2.0, "thrusts again")

    ashore.arm(False)
    assert ashore.until(lambda: ashore.pulses == MIDDLE, 2.0, "neutral after disarming") < 0.35
    ashore.run(0.5)
    assert ashore.pulses == MIDDLE
    assert ashore.physics.figures().lost == 0
    assert ashore.physics.figures().refused == 0


def test_sticks_move_the_vehicle_as_the_frame_means(ashore: Ashore) -> None:
    """Ahead is ahead and up is up, by the autopilot's own mixer on the vehicle file's thrusters."""
    ashore.arm(True)
    ashore.run(0.5)
    before = ashore.physics.motion
    ashore.sticks = (250, 0, 500, 0)
    ashore.run(2.0)
    ashore.sticks = (0, 0, 800, 0)
    ashore.run(1.0)
    after = ashore.physics.motion
    assert before is not None
    assert after is not None
    moved = after.p_WB_m - before.p_WB_m
    assert moved[0] > 0.05
    assert moved[2] < -0.02
    assert abs(moved[1]) < abs(moved[0])
    ashore.arm(False)


def test_the_output_gate_drives_by_consent_and_lets_go_when_the_sticks_fall_silent(ashore: Ashore) -> None:
    """The whole companion but its controller: what it asks for, the position it needs, consent, loss, silence."""
    wide = EngagementLimits(depth_m=(-10.0, 100.0), distance_m=1000.0, tilt_rad=4.0, speed_m_s=10.0)
    session: Any = ashore  # has what the harness needs of an InProcessSession
    aboard = CompanionHarness(session, limits=wide)
    ashore.enable()
    ashore.arm(True)

    def drives() -> bool:
        """Consent is given whenever it may be: a computer that is busy elsewhere makes the output gate let go."""
        if aboard.gate.engagement.state == "ready":
            aboard.gate.press()
        return all(abs(pulse - 1500) > 28 for pulse in ashore.pulses)

    ashore.until(drives, FIRST_S, "the companion's thrusts on the motors")
    ashore.sticks = None
    assert ashore.until(lambda: ashore.pulses == MIDDLE, 2.0, "neutral after the sticks fall silent") < 0.4
    assert aboard.gate.entry is None
    ashore.sticks = (0, 0, 500, 0)
    ashore.run(1.5)
    assert ashore.pulses == MIDDLE
    ashore.arm(False)


@pytest.mark.slow
def test_the_autopilot_knows_its_depth_down_and_up_to_the_surface(ashore: Ashore) -> None:
    """Down by the sticks, then up until it is there and on: the vehicle stays in the water, its depth within 0.3 m."""
    ashore.ask(mavlink.MAVLINK_MSG_ID_VFR_HUD, 20.0)
    ashore.arm(True)
    ashore.run(1.0)
    off, depths = [abs(ashore.off_m)], [ashore.depth_m]
    for throttle, seconds in ((100, 2.0), (1000, 9.0), (300, 1.5)):
        ashore.sticks = (0, 0, throttle, 0)
        for _ in range(round(10.0 * seconds)):
            ashore.run(0.1)
            off.append(abs(ashore.off_m))
            depths.append(ashore.depth_m)
    print(f"depths {min(depths):.2f} to {max(depths):.2f} m, off by {max(off):.3f} m at most")
    assert max(depths) > 2.1
    assert -0.3 < min(depths) < 0.3
    assert max(off) < 0.3
    ashore.arm(False)


@pytest.mark.slow
def test_depth_hold_is_handed_back_where_the_vehicle_is(ashore: Ashore) -> None:
    """In ALT_HOLD thrusts push it down past the depth that it held; left alone it stays there, still in ALT_HOLD."""
    ashore.ask(mavlink.MAVLINK_MSG_ID_VFR_HUD, 20.0)
    ashore.enable()
    ashore.arm(True)
    ashore.say(mavlink.MAVLink_set_mode_message(1, 1, ALT_HOLD))
    ashore.until(lambda: ashore.last["HEARTBEAT"].custom_mode == ALT_HOLD, 5.0, "ALT_HOLD")
    ashore.run(2.0)
    held = ashore.depth_m
    ashore.thrusts, ashore.streams = (0.0,) * 4 + (0.09,) * 4, True
    ashore.run(5.0)
    ashore.streams = False
    ashore.run(0.4)
    handed_back, heading = ashore.depth_m, ashore.motion.q_WB[3]
    after = []
    for _ in range(80):
        ashore.run(0.1)
        after.append(ashore.depth_m - handed_back)
    turned = float(ashore.motion.q_WB[3] - heading)
    print(f"down by {handed_back - held:.2f} m, then {min(after):+.3f} to {max(after):+.3f} m, turned {turned:+.3f}")
    assert handed_back - held > 0.15
    assert min(after) > -0.05
    assert max(after) < 0.15
    assert ashore.last["HEARTBEAT"].custom_mode == ALT_HOLD
    ashore.arm(False)
