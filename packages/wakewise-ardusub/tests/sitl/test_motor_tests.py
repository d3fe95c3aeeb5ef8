"""The stand-in's motor test: ArduSub's rules about who may turn a motor alone, how long, and how soon again."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.servos import COOL_S, SILENT_S

HEAVY = load_vehicle("bluerov2-heavy")


def ask(flight: InProcessSession, motor: float, pulse: float, by: float = 1.0, order: float = 2.0) -> None:
    command = mavlink.MAV_CMD_DO_MOTOR_TEST
    flight.station.send(
        mavlink.MAVLink_command_long_message(flight.autopilot.system, 1, command, 0, motor, by, pulse, 0, 0, order, 0)
    )


def results(flight: InProcessSession) -> list[int]:
    """How commands of this kind were answered."""
    return [
        m.result for m in flight.said if m.get_type() == "COMMAND_ACK" and m.command == mavlink.MAV_CMD_DO_MOTOR_TEST
    ]


def armed() -> InProcessSession:
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.5)
    flight.arm(True)
    return flight.run(0.2)


def test_one_motor_turns_past_mixer_and_direction_until_nobody_asks() -> None:
    """Counted from 0, its pulse as it is, the others in the middle though the sticks ask for more; silence disarms."""
    flight = armed()
    flight.autopilot.set_parameter("MOT_2_DIRECTION", -1.0)
    for _ in range(10):
        ask(flight, 1, 1560)
        flight.run(0.1)
    assert flight.moments[-1].pulses_us[:8] == (1500, 1560, *(1500,) * 6)
    flight.run(SILENT_S - 0.2)
    assert flight.moments[-1].pulses_us[1] == 1560
    flight.run(0.3)
    assert not flight.autopilot.armed
    assert set(flight.moments[-1].pulses_us[:8]) == {1500}
    assert "Motor test timed out!" in flight.texts()
    assert set(results(flight)) == {mavlink.MAV_RESULT_ACCEPTED}


def test_none_begins_disarmed_nor_soon_after_the_last() -> None:
    """Refused in words each time; after ten seconds it turns again."""
    flight = InProcessSession(HEAVY).run(0.5)
    ask(flight, 0, 1560)
    flight.run(0.1)
    assert "Arm motors before testing motors." in flight.texts()
    flight = armed()
    ask(flight, 0, 1560)
    flight.run(SILENT_S + 0.2)
    flight.arm(True)
    flight.run(2.0)
    ask(flight, 0, 1560)
    flight.run(0.1)
    assert "10 second cooldown required after motor test" in flight.texts()
    flight.run(COOL_S)
    ask(flight, 0, 1560)
    flight.run(0.1)
    assert results(flight) == [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_ACCEPTED]


@pytest.mark.parametrize(
    "numbers", [(8, 1560), (-1, 1560), (0, 1560, 2.0), (0, 1560, 1.0, 0.0), (float("nan"), 1560), (0, float("nan"))]
)
def test_what_is_no_test_turns_nothing(numbers: tuple[float, ...]) -> None:
    """A motor that is not there, the pilot's throttle, another order of motors, no number."""
    flight = armed()
    ask(flight, *numbers)
    flight.run(0.1)
    assert set(flight.moments[-1].pulses_us[:8]) == {1500}
    assert results(flight) == [mavlink.MAV_RESULT_FAILED]


def test_a_share_of_the_throttle_is_a_pulse_between_its_ends() -> None:
    """75 per cent of 1100 to 1900 us."""
    flight = armed()
    ask(flight, 3, 75.0, by=0.0)
    flight.run(0.1)
    assert flight.moments[-1].pulses_us[3] == 1700
