"""The clock of a flight by hand, on a clock that the test turns."""

import pytest

from wakewise.operation.teleop.live import MOST_CATCHING_UP_S, RealTimePacer


class Clock:
    """A clock that goes on when somebody waits, or when it is told."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def test_steps_wait_for_their_time_and_a_little_lost_is_caught_up() -> None:
    """On time where work is short; after a step that took long the next ones follow at once until it is made good."""
    clock = Clock()
    pace = RealTimePacer(clock.wait, clock=clock)
    begun = []
    for k in range(10):
        pace.pace(0.02 * k)
        begun.append(clock.now_s - 100.0)
        clock.now_s += 0.09 if k == 2 else 0.005
        pace.sent(0.02 * k)
    expected = [0.0, 0.02, 0.04, 0.13, 0.135, 0.14, 0.145, 0.15, 0.16, 0.18]
    assert begun == pytest.approx(expected)
    assert pace.lost_s == 0.0 and pace.behind_s == pytest.approx(0.0)
    assert pace.late_s(1.0) == pytest.approx(0.07) and pace.reaction_s == pytest.approx(0.005)


def test_a_long_stop_is_let_go() -> None:
    """A world that stood still for a second does not run fast afterwards; what was lost is known."""
    clock = Clock()
    pace = RealTimePacer(clock.wait, clock=clock)
    pace.pace(0.0)
    clock.now_s += 1.0
    pace.pace(0.02)
    assert pace.behind_s > MOST_CATCHING_UP_S and pace.lost_s == pytest.approx(0.98)
    before_s = clock.now_s
    pace.pace(0.04)
    assert clock.now_s - before_s == pytest.approx(0.02) and pace.behind_s == pytest.approx(0.0)


def test_without_pace_nothing_waits() -> None:
    """As fast as it goes; how long an answer takes is measured all the same."""
    clock = Clock()
    pace = RealTimePacer(clock.wait, paced=False, clock=clock)
    pace.pace(50.0)
    clock.now_s += 0.25
    pace.sent(50.0)
    pace.pace(51.0)
    assert clock.now_s == 100.25 and pace.behind_s == 0.0 and pace.reaction_s == pytest.approx(0.25)
