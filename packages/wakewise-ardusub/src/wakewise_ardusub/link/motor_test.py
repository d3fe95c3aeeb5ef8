"""Motor test: each motor turns alone for a moment, and the operator's answer is recorded.

ArduSub's MAV_CMD_DO_MOTOR_TEST (ArduSub, motors.cpp): the vehicle must be armed; param1 is the motor from 0; the pulse
bypasses MOT_n_DIRECTION, as the script's overrides do; a motor keeps its pulse until it gets another; half a second
without a command ends the test and disarms. So commands are renewed at 10 Hz, each motor is brought to rest before the
operator is asked, and nothing is sent at the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.checks import Answer, MotorObservation, MotorResults, force_words
from wakewise_ardusub.link.connection import MavlinkSession, send_command
from wakewise_ardusub.link.motor_interface import motor_output
from wakewise_ardusub.link.protocol import MIDDLE_US
from wakewise_ardusub.link.vehicle_survey import send_heartbeat
from wakewise_ardusub.motors import pulses_of_thrusts, supply_in_table

RENEW_S = 0.1
TURN_S = 1.5
REST_S = 0.4
"""How long a motor is told to rest after its turn."""
COOL_S = 11.0
"""ArduSub begins no test within 10 s of one that ended by half a second of silence."""
SHARE = 0.06
"""Thrust of a test as a share of the largest: seen and felt, and harmless in a basin."""
MOST_US = 150
_COMMAND, _BY_PULSE, _ORDER_BOARD = 209, 1, 2
_ARMED = 128
_REFUSALS = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed"}


@dataclass(frozen=True, kw_only=True)
class MotorTestStep:
    """One motor's turn, from 1: the pulse above 1500 us that it gets, and which way the vehicle should be pushed."""

    motor: int
    name: str
    pulse_us: int
    direction: float
    expected: str


class Operator(Protocol):
    """Who looks: consents to each motor before it turns, and says afterwards what was seen."""

    def consents(self, turn: MotorTestStep) -> bool:
        """Whether this motor may turn now."""
        ...

    def saw(self, turn: MotorTestStep) -> Answer:
        """What this motor did."""
        ...

    def arms(self, why: str) -> None:
        """Waits until the vehicle has been armed by its pilot; called before each motor that needs it."""
        ...


def chosen_motors(vehicle: Vehicle, motors: Sequence[int] | None) -> list[int]:
    """Numbers of the motors to turn, from 1; all if none are given.

    Raises
    ------
    InputError
        If a motor is asked for that there is not.
    """
    count = len(vehicle.thrusters)
    for motor in motors or ():
        if not 1 <= motor <= count:
            raise InputError(f"--motors: there is no motor {motor}, vehicle {vehicle.name} has motors 1 to {count}")
    return list(range(1, count + 1)) if motors is None else list(motors)


def planned_turns(
    vehicle: Vehicle, parameters: Mapping[str, float], motors: Sequence[int] | None = None
) -> list[MotorTestStep]:
    """What each motor will be told, and which way it should push the vehicle.

    Raises
    ------
    InputError
        If the autopilot's motors are not the vehicle's, or a motor is asked for that there is not.
    """
    output = motor_output(vehicle, parameters)
    count, chosen = len(vehicle.thrusters), chosen_motors(vehicle, motors)
    supply_V = supply_in_table(vehicle, float("nan"))
    # A pulse above the middle for every motor, so the demand is along the axis as the motor itself turns.
    own = pulses_of_thrusts(vehicle, SHARE * vehicle.thrust_upper_N, np.ones(count), supply_V)
    turns = []
    for motor in chosen:
        thruster, direction = vehicle.thrusters[motor - 1], float(output.directions[motor - 1])
        turns.append(
            MotorTestStep(
                motor=motor,
                name=thruster.name,
                pulse_us=min(int(own[motor - 1]), MIDDLE_US + MOST_US),
                direction=direction,
                expected=force_words(direction * thruster.axis_B),
            )
        )
    return turns


def run_motor_test(
    link: MavlinkSession,
    vehicle: Vehicle,
    turns: Sequence[MotorTestStep],
    operator: Operator,
    *,
    keep: Callable[[MotorResults], None] = lambda _: None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> MotorResults:
    """Turn motors one by one, each after consent; `keep` is handed what was seen so far after each.

    Raises
    ------
    EnvironmentFailure
        If the autopilot refuses a test, with its own words.
    """
    seen: dict[int, MotorObservation] = {}
    results = MotorResults(vehicle=vehicle.name, time="", seen=seen)
    ended_s = -COOL_S
    for turn in turns:
        answer: Answer = "not asked"
        if operator.consents(turn):
            wait_s = COOL_S - (clock() - ended_s)
            if ended_s >= 0.0 and wait_s > 0.0:
                sleep(wait_s)
            _until_armed(link, operator)
            _turn(link, turn, clock, sleep)
            ended_s = clock()
            answer = operator.saw(turn)
        seen[turn.motor] = MotorObservation(
            motor=turn.motor,
            pulse_us=turn.pulse_us,
            direction=turn.direction,
            expected=turn.expected,
            answer=answer,
        )
        stamp = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        results = MotorResults(vehicle=vehicle.name, time=stamp, seen=dict(seen))
        keep(results)
    return results


def _until_armed(link: MavlinkSession, operator: Operator) -> None:
    send_heartbeat(link)
    while not _armed(link):
        operator.arms("ArduSub turns motors only while it is armed, and disarms by itself after each")


def _armed(link: MavlinkSession) -> bool:
    """What the next heartbeat says; one that was waiting may be old, so the last of them counts."""
    armed = False
    beat: Any = link.hear({"HEARTBEAT"}, 2.5)
    if beat is None:
        raise EnvironmentFailure("the autopilot is not heard any more: nothing is turned")
    while beat is not None:
        armed = bool(beat.base_mode & _ARMED)
        beat = link.hear({"HEARTBEAT"}, 0.0)
    return armed


def _turn(
    link: MavlinkSession, turn: MotorTestStep, clock: Callable[[], float], sleep: Callable[[float], None]
) -> None:
    """One motor's pulse, renewed, then rest; whatever happens, rest is sent."""
    try:
        _renew(link, turn.motor, turn.pulse_us, TURN_S, clock, sleep)
    finally:
        _renew(link, turn.motor, MIDDLE_US, REST_S, clock, sleep, refusal=False)


def _renew(
    link: MavlinkSession,
    motor: int,
    pulse_us: int,
    seconds: float,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
    *,
    refusal: bool = True,
) -> None:
    until = clock() + seconds
    words = ""
    while clock() < until:
        send_command(link, _COMMAND, motor - 1, _BY_PULSE, pulse_us, 0.0, 0.0, _ORDER_BOARD)
        due_s = clock() + RENEW_S
        while (answer := link.hear({"COMMAND_ACK", "STATUSTEXT"}, max(due_s - clock(), 0.0))) is not None:
            if answer.get_type() == "STATUSTEXT":
                words = str(answer.text)
            elif refusal and answer.command == _COMMAND and answer.result in _REFUSALS:
                said = f": {words}" if words else ""
                raise EnvironmentFailure(f"motor {motor}: the test is {_REFUSALS[answer.result]}{said}")
        sleep(max(due_s - clock(), 0.0))
