"""The seat: several threads touch it, one flies from it."""

from __future__ import annotations

import numpy as np

from wakewise.operation.teleop.input.controls import CENTRED, Controls
from wakewise.ui.cockpit.control_mailbox import DEVICE, ControlMailbox

FULL = np.array([1.0, 0.0, 0.0, 0.0, 0.0])


class Clock:
    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        return self.now_s


class Pad:
    """A gamepad as a test moves it."""

    def __init__(self) -> None:
        self.held: Controls | None = CENTRED

    def read(self, time_s: float) -> Controls | None:
        return self.held


def test_nobody_is_none_and_a_holder_is_what_the_sticks_say() -> None:
    """None before anybody has the helm and after a second of quiet; zero after 300 ms of it."""
    clock = Clock()
    seat = ControlMailbox(clock)
    assert seat.read(0.0) is None
    seat.ask("a")
    lease = seat.holding.lease or ""
    assert seat.moved("a", lease, 1, 0.0, FULL)
    read = seat.read(0.0)
    assert read is not None
    np.testing.assert_array_equal(read.axes, FULL)
    clock.now_s += 0.31
    late = seat.read(0.0)
    assert late is not None
    assert late.centred
    clock.now_s += 1.0
    assert seat.read(0.0) is None


def test_a_button_is_flown_once() -> None:
    """However late the flight reads it; another's button is none."""
    seat = ControlMailbox(Clock())
    seat.ask("a")
    lease = seat.holding.lease or ""
    assert seat.press("a", lease, "capture")
    assert not seat.press("b", lease, "stop")
    first, second = seat.read(0.0), seat.read(0.02)
    assert first is not None
    assert first.pressed == ("capture",)
    assert second is not None
    assert second.pressed == ()


def test_the_wait_of_a_stick_counts_from_its_arrival_to_its_thrusts() -> None:
    """Once for each message that was flown; those that a newer one overtook do not count."""
    clock = Clock()
    seat = ControlMailbox(clock)
    assert seat.stick_to_thrust_ms_p99 is None
    seat.ask("a")
    lease = seat.holding.lease or ""
    seat.read(0.0)
    seat.flown()
    assert seat.waits_s == ()
    seat.moved("a", lease, 1, 0.0, FULL)
    clock.now_s += 0.01
    seat.moved("a", lease, 2, 10.0, FULL)
    clock.now_s += 0.02
    seat.read(0.02)
    clock.now_s += 0.005
    seat.flown()
    seat.flown()
    np.testing.assert_allclose(seat.waits_s, [0.025])
    assert seat.stick_to_thrust_ms_p99 is not None


def test_a_gamepad_here_takes_a_free_helm_by_moving_and_leaves_it_when_pulled_out() -> None:
    """At rest it takes nothing; against a page that flies it must ask; gone, nobody is there."""
    clock, pad = Clock(), Pad()
    seat = ControlMailbox(clock, pad)
    assert seat.read(0.0) is None
    assert seat.holding.holder is None
    pad.held = Controls(axes=FULL, pressed=("capture",))
    read = seat.read(0.02)
    assert seat.holding.holder == DEVICE
    assert read is not None
    assert (read.axes[0], read.pressed) == (1.0, ("capture",))
    pad.held = None
    assert seat.read(0.04) is None
    assert seat.holding.holder is None
    seat.ask("a")
    seat.moved("a", seat.holding.lease or "", 1, 0.0, -FULL)
    pad.held = Controls(axes=FULL)
    flown = seat.read(0.06)
    assert flown is not None
    assert flown.axes[0] == -1.0
    assert seat.holding.asked_by == DEVICE
