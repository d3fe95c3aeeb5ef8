"""Each motor turned alone: consent first, ArduSub's own rules kept, and rest at the end whatever happens."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from fake_autopilot import FakeAutopilot
from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.checks import Answer
from wakewise_ardusub.link.motor_test import COOL_S, MotorTestStep, planned_turns, run_motor_test
from wakewise_ardusub.motors import thrusts_of_pulses

HEAVY = load_vehicle("bluerov2-heavy")
DIRECTIONS = (1, 1, -1, -1, 1, -1, -1, 1)
PARAMETERS = {
    **{f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(DIRECTIONS, 1)},
    **{f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 9)},
}


@dataclass
class Bench:
    """ArduSub's side of a motor test (ArduSub, motors.cpp), in a time that only sleeping moves."""

    now_s: float = 100.0
    armed: bool = True
    pulses: dict[int, float] = field(default_factory=lambda: dict.fromkeys(range(8), 1500.0))
    turned: list[tuple[int, float, float]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    _last_s: float | None = None
    _ended_s: float = -1e9

    def __post_init__(self) -> None:
        self.link = FakeAutopilot(on={"COMMAND_LONG": self._command, "HEARTBEAT": self._hello})

    def clock(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        self._watch()

    def _watch(self) -> None:
        if self._last_s is not None and self.now_s > self._last_s + 0.5:
            self.armed, self._last_s, self._ended_s = False, None, self._last_s + 0.5

    def _hello(self, heard: object) -> None:
        self._watch()
        self.link.armed = self.armed
        self.link.heartbeat()

    def _command(self, heard: object) -> None:
        self._watch()
        assert (heard.command, heard.param2, heard.param6) == (209, 1.0, 2.0)
        result = 0
        if self._last_s is None and (not self.armed or self.now_s < self._ended_s + 10.0):
            words = b"Arm motors before testing motors." if not self.armed else b"10 second cooldown required"
            self.link.say("statustext", severity=4, text=words)
            result = 4
        else:
            self._last_s = self.now_s
            self.pulses[int(heard.param1)] = heard.param3
            self.turned.append((int(heard.param1), heard.param3, self.now_s))
            assert sum(pulse != 1500.0 for pulse in self.pulses.values()) <= 1
        self.link.say("command_ack", command=209, result=result)


@dataclass
class Looker:
    """Somebody who looks: arms where asked, and answers as the bench's motors really are mounted."""

    bench: Bench
    answers: dict[int, Answer] = field(default_factory=dict)
    refuses: frozenset[int] = frozenset()
    asked: list[int] = field(default_factory=list)
    armed: int = 0
    broken_at: int = 0

    def consents(self, turn: MotorTestStep) -> bool:
        assert all(pulse == 1500.0 for pulse in self.bench.pulses.values())
        self.asked.append(turn.motor)
        return turn.motor not in self.refuses

    def saw(self, turn: MotorTestStep) -> Answer:
        assert all(pulse == 1500.0 for pulse in self.bench.pulses.values())
        self.bench.sleep(3.0)
        if turn.motor == self.broken_at:
            raise KeyboardInterrupt
        return self.answers.get(turn.motor, "as expected")

    def arms(self, why: str) -> None:
        self.armed += 1
        self.bench.armed = True
        self.bench._hello(None)


def _run(bench: Bench, looker: Looker, motors: list[int] | None = None):
    turns = planned_turns(HEAVY, PARAMETERS, motors)
    return run_motor_test(bench.link, HEAVY, turns, looker, clock=bench.clock, sleep=bench.sleep)


def test_each_motor_turns_alone_gently_and_is_expected_where_its_axis_points() -> None:
    """A pulse above the middle that the motor holds; a motor with direction -1 is expected to push the other way."""
    for turn in planned_turns(HEAVY, PARAMETERS):
        assert 1528 < turn.pulse_us <= 1650
        pushed = thrusts_of_pulses(HEAVY, np.full(8, float(turn.pulse_us)), np.array(DIRECTIONS, float), 16.0)
        thrust = pushed[turn.motor - 1]
        assert np.sign(thrust) == DIRECTIONS[turn.motor - 1]
        assert 1.0 < abs(thrust) < 5.0
    words = {turn.motor: turn.expected for turn in planned_turns(HEAVY, PARAMETERS)}
    assert words[1] == "astern and right"
    assert words[3] == "astern and left"
    assert (words[5], words[6]) == ("down", "up")


def test_all_motors_one_by_one() -> None:
    """Every motor turns once for its time, only after consent, armed again each time, and what was seen is kept."""
    bench = Bench()
    looker = Looker(bench, answers={3: "the other way", 7: "nothing"})
    results = _run(bench, looker)
    assert looker.asked == list(range(1, 9))
    assert {motor: seen.answer for motor, seen in results.seen.items()} == {
        **dict.fromkeys(range(1, 9), "as expected"),
        3: "the other way",
        7: "nothing",
    }
    assert results.seen[3].right_direction == 1.0
    for motor in range(8):
        times = [at for who, pulse, at in bench.turned if who == motor and pulse > 1500.0]
        assert 1.2 <= times[-1] - times[0] <= 1.6
        assert max(np.diff(times)) < 0.2
    assert looker.armed == 7


def test_what_was_not_consented_to_does_not_turn() -> None:
    """Refused motors get no pulse at all, and nothing is known of them."""
    bench = Bench()
    results = _run(bench, Looker(bench, refuses=frozenset({1, 2})), [1, 2, 4])
    assert {who for who, _, _ in bench.turned} == {3}
    assert results.of(1) is None
    assert results.of(4) is not None


def test_the_rest_between_two_tests_is_kept() -> None:
    """ArduSub refuses a test within ten seconds of the last; nobody is asked to wait by hand."""
    bench = Bench()
    _run(bench, Looker(bench), [1, 2])
    first, second = (min(at for who, _, at in bench.turned if who == motor) for motor in (0, 1))
    assert second - first > COOL_S


def test_a_refusal_is_said_with_the_autopilots_words() -> None:
    """And rest is sent all the same."""
    bench = Bench()
    bench._ended_s = bench.now_s
    with pytest.raises(EnvironmentFailure, match="motor 1: the test is failed: 10 second cooldown required"):
        _run(bench, Looker(bench), [1])
    assert bench.link.sent[-1].param3 == 1500.0


def test_what_was_seen_is_kept_motor_by_motor() -> None:
    """A test that is broken off at the third motor has handed over what was seen of two."""
    bench, kept = Bench(), []
    looker = Looker(bench, broken_at=3)
    with pytest.raises(KeyboardInterrupt):
        run_motor_test(
            bench.link,
            HEAVY,
            planned_turns(HEAVY, PARAMETERS),
            looker,
            keep=kept.append,
            clock=bench.clock,
            sleep=bench.sleep,
        )
    assert [sorted(results.seen) for results in kept] == [[1], [1, 2]]


def test_ctrl_c_brings_the_motor_to_rest() -> None:
    """An interruption in the middle of a turn ends with rest."""
    bench = Bench()

    def interrupted(seconds: float) -> None:
        bench.sleep(seconds)
        if bench.turned and bench.turned[-1][1] > 1500.0 and len(bench.turned) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_motor_test(
            bench.link,
            HEAVY,
            planned_turns(HEAVY, PARAMETERS, [2]),
            Looker(bench),
            clock=bench.clock,
            sleep=interrupted,
        )
    assert bench.pulses[1] == 1500.0


def test_a_lost_autopilot_turns_nothing() -> None:
    """No heartbeat, no command."""
    bench = Bench()
    bench.link.on["HEARTBEAT"] = lambda heard: None
    with pytest.raises(EnvironmentFailure, match="not heard any more"):
        _run(bench, Looker(bench), [1])
    assert not bench.turned


def test_motors_that_there_are_not() -> None:
    """Named in one line; so is another vehicle's file."""
    with pytest.raises(InputError, match="no motor 9, vehicle bluerov2-heavy has motors 1 to 8"):
        planned_turns(HEAVY, PARAMETERS, [9])
    with pytest.raises(InputError, match="6 thrusters"):
        planned_turns(load_vehicle("bluerov2"), PARAMETERS)
