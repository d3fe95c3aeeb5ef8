"""What a ground station meets in the stand-in."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, MANUAL, STABILIZE
from wakewise_ardusub.sitl.inprocess_session import InProcessSession, ScriptedGroundStation
from wakewise_ardusub.sitl.mavlink_messages import BUILDERS
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot

HEAVY = load_vehicle("bluerov2-heavy")


def _of(flight: InProcessSession, kind: str) -> list[object]:
    return [message for message in flight.said if message.get_type() == kind]


def _command(flight: InProcessSession, command: int, *numbers: float) -> int:
    """Result of a command, as its acknowledgement says."""
    flight.said.clear()
    flight.station.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *(*numbers, 0, 0, 0, 0, 0, 0, 0)[:7]))
    flight.run(0.05)
    (answer,) = (message for message in flight.said if message.get_type() == "COMMAND_ACK")
    assert answer.command == command
    return int(answer.result)


def test_it_says_that_it_is_a_submarine_of_ardupilot() -> None:
    """Heartbeats once a second: type, autopilot, mode, not armed."""
    flight = InProcessSession(HEAVY).run(3.05)
    beats = _of(flight, "HEARTBEAT")
    assert len(beats) == 4
    beat = beats[-1]
    assert (beat.type, beat.autopilot, beat.custom_mode) == (12, 3, MANUAL)
    assert not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)


def test_arming_is_acknowledged_seen_and_undone() -> None:
    """The heartbeat's flag follows, and disarmed outputs stand in the middle."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.1)
    assert set(flight.moments[-1].pulses_us[:8]) == {1500}
    assert _command(flight, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
    flight.run(1.2)
    assert _of(flight, "HEARTBEAT")[-1].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert flight.moments[-1].thrusting
    assert _command(flight, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mavlink.MAV_RESULT_ACCEPTED
    assert set(flight.moments[-1].pulses_us[:8]) == {1500}


def test_sticks_reach_the_motors_by_the_frames_factors() -> None:
    """Half forward at half gain is a quarter, over the level four; the throttle's upper half pushes up."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.1)
    flight.arm(True)
    flight.run(0.2)
    assert flight.moments[-1].pulses_us[:8] == (1400, 1400, 1600, 1600, 1500, 1500, 1500, 1500)
    flight.sticks = (0, 0, 1000, 0)
    flight.run(0.2)
    assert flight.moments[-1].pulses_us[:8] == (1500, 1500, 1500, 1500, 1300, 1300, 1300, 1300)


def test_sticks_of_others_steer_nothing() -> None:
    """Only those of the ground station that SYSID_MYGCS names."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0), values={"SYSID_MYGCS": 254}).run(0.1)
    flight.arm(True)
    flight.run(0.3)
    assert flight.autopilot.armed
    assert not flight.moments[-1].thrusting


def test_a_turned_motor_gets_its_pulse_turned() -> None:
    """MOT_n_DIRECTION of -1 about the middle, and the motor that is turned pushes as ever."""
    turned = InProcessSession(HEAVY, sticks=(500, 0, 500, 0), values={"MOT_1_DIRECTION": -1}).run(0.1)
    plain = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.1)
    for flight in (turned, plain):
        flight.arm(True)
        flight.run(2.0)
    assert (turned.moments[-1].pulses_us[0], plain.moments[-1].pulses_us[0]) == (1600, 1400)
    assert turned.autopilot.motion.p_WB_m[0] == pytest.approx(plain.autopilot.motion.p_WB_m[0], rel=0.15)


def test_all_parameters_are_listed_once() -> None:
    """With their count and places, the script's own among them."""
    flight = InProcessSession(HEAVY).run(0.1)
    flight.said.clear()
    flight.station.send(mavlink.MAVLink_param_request_list_message(1, 1))
    flight.run(3.0)
    told = _of(flight, "PARAM_VALUE")
    names = [message.param_id for message in told]
    assert len(names) == len(set(names)) == told[0].param_count
    assert sorted(message.param_index for message in told) == list(range(len(told)))
    assert {"SERVO1_FUNCTION", "MOT_8_DIRECTION", "FS_GCS_ENABLE", "WKW_ENABLE"} <= set(names)


def test_a_parameter_is_read_by_name_or_place_and_set() -> None:
    """Each is answered by its value; one that there is not, by nothing."""
    flight = InProcessSession(HEAVY).run(0.1)
    flight.said.clear()
    read = mavlink.MAVLink_param_request_read_message
    flight.station.send(read(1, 1, b"SERVO3_FUNCTION", -1))
    flight.station.send(read(1, 1, b"", 0))
    flight.station.send(read(1, 1, b"NO_SUCH", -1))
    flight.set("FS_GCS_TIMEOUT", 5.0)
    flight.set("NO_SUCH", 5.0)
    flight.run(0.05)
    told = [(message.param_id, message.param_value) for message in _of(flight, "PARAM_VALUE")]
    assert told == [("SERVO3_FUNCTION", 35.0), ("ACRO_YAW_P", 3.375), ("FS_GCS_TIMEOUT", 5.0)]


def test_it_names_its_release() -> None:
    """AUTOPILOT_VERSION on request, the release in its first three bytes."""
    flight = InProcessSession(HEAVY).run(0.1)
    assert _command(flight, mavlink.MAV_CMD_REQUEST_MESSAGE, 148) == mavlink.MAV_RESULT_ACCEPTED
    (version,) = _of(flight, "AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 8 == 0x040503
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_FTP


def test_it_tells_where_it_is_as_physics_says() -> None:
    """Position, attitude, depth and the water's pressure agree with the motion of that moment."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 10)).run(0.1)
    flight.arm(True)
    flight.run(3.0)
    motion = flight.autopilot.motion
    said = {}
    for identity in BUILDERS:
        message = BUILDERS[identity](flight.autopilot)
        if message is not None:  # no rangefinder, and no target in this mode
            said[message.get_type()] = message
    assert said["LOCAL_POSITION_NED"].x == motion.p_WB_m[0] > 0.1
    assert said["VFR_HUD"].alt == -motion.p_WB_m[2]
    water_hPa = said["SCALED_PRESSURE2"].press_abs - 1013.25
    assert water_hPa == pytest.approx(98.0665 * motion.p_WB_m[2])
    assert said["ATTITUDE"].yaw != 0.0
    assert said["SERVO_OUTPUT_RAW"].servo1_raw == flight.autopilot.pulses_us[0]
    for message in said.values():
        assert message.pack(mavlink.MAVLink(None))


def test_rates_are_those_asked_for() -> None:
    """Faster, never, and as at first again; what is no message is refused."""
    flight = InProcessSession(HEAVY).run(0.1)
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    counts = []
    for every_us in (20_000.0, -1.0, 0.0):
        assert _command(flight, interval, mavlink.MAVLINK_MSG_ID_ATTITUDE, every_us) == mavlink.MAV_RESULT_ACCEPTED
        flight.said.clear()
        flight.run(2.0)
        counts.append(len(_of(flight, "ATTITUDE")))
    assert counts[0] == pytest.approx(100, abs=2)
    assert counts[1] == 0
    assert counts[2] == pytest.approx(20, abs=1)
    assert _command(flight, interval, 9999, 1e6) == mavlink.MAV_RESULT_FAILED


def test_modes_that_it_does_not_fly_are_refused() -> None:
    """It says so, and stays in its own."""
    flight = InProcessSession(HEAVY).run(0.1)
    assert _command(flight, mavlink.MAV_CMD_DO_SET_MODE, 1, STABILIZE) == mavlink.MAV_RESULT_ACCEPTED
    assert _command(flight, mavlink.MAV_CMD_DO_SET_MODE, 1, 3) == mavlink.MAV_RESULT_FAILED
    assert flight.autopilot.mode == STABILIZE
    flight.set_mode(ALT_HOLD)
    assert flight.autopilot.mode == ALT_HOLD
    assert _command(flight, mavlink.MAV_CMD_DO_SET_SERVO, 1, 1900) == mavlink.MAV_RESULT_UNSUPPORTED


def test_a_start_anew_forgets_who_was_there_and_switches_off() -> None:
    """Not while armed; afterwards disarmed, in MANUAL, the script's switch off."""
    flight = InProcessSession(HEAVY).engaged()
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert _command(flight, reboot, 1) == mavlink.MAV_RESULT_DENIED
    assert flight.autopilot.parameters.get("WKW_ENABLE") == 1.0
    flight.arm(False)
    flight.run(0.05)
    assert _command(flight, reboot, 1) == mavlink.MAV_RESULT_ACCEPTED
    assert not flight.autopilot.armed
    assert flight.autopilot.now_s < 0.2
    flight.run(0.1)
    assert flight.autopilot.parameters.get("WKW_ENABLE") == 0.0


def test_bad_arguments_are_refused() -> None:
    """Loops that no time-out of a script could be counted in."""
    with pytest.raises(InputError, match="10 loops"):
        SimulatedAutopilot(loop_hz=10.0)


def test_the_pilot_ashore_leaves_alone_what_somebody_else_switched_off() -> None:
    """It arms and switches on once; what another station undoes stays undone until the stand-in starts anew."""
    flight = InProcessSession(HEAVY, sticks=None, beats=False)
    pilot = ScriptedGroundStation(flight.autopilot, flight.carry)
    flight.turns.append(pilot.turn)
    flight.run(3.0)
    assert flight.autopilot.armed
    assert flight.autopilot.parameters.get("WKW_ENABLE") == 1.0
    flight.arm(False)
    flight.set("WKW_ENABLE", 0.0)
    flight.run(6.0)
    assert not flight.autopilot.armed
    assert flight.autopilot.parameters.get("WKW_ENABLE") == 0.0
    flight.autopilot.reboot()
    flight.run(3.0)
    assert flight.autopilot.armed
    assert flight.autopilot.parameters.get("WKW_ENABLE") == 1.0
