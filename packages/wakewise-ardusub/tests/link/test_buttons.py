"""A button that means something here must mean nothing to the autopilot, which hears the same sticks."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bottle import Bottle

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.cli.link_ardusub import _buttons
from wakewise_ardusub.link.checks import CheckInputs, check, verdict
from wakewise_ardusub.link.parameters import BUTTONS, button_faults, conflict, free_buttons
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.own_parameters import own_parameters

ROOT = Path(__file__).parents[4]
HEAVY = load_vehicle("bluerov2-heavy")
FRESH = own_parameters()
GIVEN = re.compile(r"--buttons\s+([a-z_]+=\d+(?:,[a-z_]+=\d+)*)")


def test_of_a_fresh_autopilots_buttons_two_are_free() -> None:
    """0 and 15; a function with shift held takes a button, too."""
    assert free_buttons(FRESH) == [0, 15]
    assert free_buttons({**FRESH, "BTN0_SFUNCTION": 4.0}) == [15]
    assert free_buttons({**FRESH, "BTN7_FUNCTION": 91.0}) == [0, 7, 15]
    assert free_buttons({}) == []


@pytest.mark.parametrize("button", range(BUTTONS))
def test_a_button_at_which_the_autopilot_acts_is_refused(button: int) -> None:
    """Pressed on an armed and on a disarmed vehicle of ArduSub's default table, alone and with shift.

    Where the autopilot arms, disarms or changes its mode, it is refused by name; where it is not refused, nothing of
    that happens.
    """
    changed = False
    for armed in (False, True):
        for shift in (0, 1 << 5):
            flight = InProcessSession(HEAVY, loop_hz=50.0, values={"BTN5_FUNCTION": 1.0}).run(0.2)
            flight.arm(armed)
            flight.run(0.2)
            before = (flight.autopilot.armed, flight.autopilot.mode)
            assert before[0] is armed
            flight.buttons = 1 << button | shift
            flight.run(0.3)
            changed |= (flight.autopilot.armed, flight.autopilot.mode) != before
    words = button_faults({"engage": button}, FRESH)
    assert not changed or words
    assert bool(words) == (button not in {0, 15})
    if words:
        assert words.startswith(f"--buttons engage={button}: BTN{button}_FUNCTION is ")
        assert words.endswith("on this autopilot; free are 0 and 15")


def test_without_a_button_that_disarms_arduSub_does_not_arm() -> None:
    """So nobody is told to take the function from that one."""
    flight = InProcessSession(HEAVY, values={"BTN4_FUNCTION": 0.0}).run(0.2)
    flight.arm(True)
    flight.run(0.2)
    assert not flight.autopilot.armed
    assert "Must assign a disarm or arm_toggle button" in " ".join(flight.texts())
    full = {name: 32.0 if name.startswith("BTN") else value for name, value in FRESH.items()}
    assert "not those of disarm" in button_faults({"engage": 4}, full)


def test_a_photograph_may_trigger_the_autopilots_camera() -> None:
    """And nothing else may."""
    known = {**FRESH, "BTN7_FUNCTION": 24.0}
    assert not conflict(7, "capture", known)
    assert conflict(7, "engage", known) == "BTN7_FUNCTION is 24 (camera trigger)"


def test_the_check_says_which_button_is_whose() -> None:
    """No-go with the function's name and what is free; without --buttons the free ones are listed."""
    rows = check(CheckInputs(vehicle=HEAVY, parameters=FRESH, system=1, buttons={"engage": 4, "scan": 15}))
    engage, scan = (row for row in rows if row.what.startswith("button "))
    assert (engage.what, engage.verdict) == ("button 4 (engage)", "no-go")
    assert (engage.found, engage.do) == ("BTN4_FUNCTION is 4 (disarm)", "free is 0")
    assert scan.verdict == "go"
    assert verdict(rows) == "no-go"
    (free,) = (row for row in check(CheckInputs(vehicle=HEAVY, parameters=FRESH, system=1)) if "buttons" in row.what)
    assert (free.found, free.verdict) == ("0, 15", "go")
    unknown = {name: value for name, value in FRESH.items() if name != "BTN0_SFUNCTION"}
    (row,) = (row for row in check(CheckInputs(vehicle=HEAVY, parameters=unknown, system=1, buttons={"engage": 0}))
              if row.what == "button 0 (engage)")  # fmt: skip
    assert (row.verdict, row.needed, row.found) == ("unknown", True, "BTN0_SFUNCTION is not known")


def test_a_session_never_engages_with_a_button_of_the_autopilots() -> None:
    """Before they are known it says what it waits for; then which of them it is."""
    bottle = Bottle()
    bottle.parameter("BTN3_FUNCTION", 4.0)
    assert bottle.gate.button_fault == (
        "--buttons engage=3: BTN3_FUNCTION is 4 (disarm) on this autopilot; "
        "free are 0, 1, 2, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14 and 15"
    )
    assert bottle.engage() == f"not engaged: {bottle.gate.button_fault}"
    bottle.gate.known = bottle.gate.known.__class__(system=1, session=1)
    assert bottle.gate.button_fault is None


def test_every_button_that_a_page_names_is_free_on_a_fresh_autopilot() -> None:
    """README, docs and the help of the commands: what can be pasted neither arms, disarms nor changes a mode."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.py")]
    found = [(path, given) for path in pages for given in GIVEN.findall(path.read_text(encoding="utf-8"))]
    assert any(path.name == "ardusub-flight.md" for path, _ in found)
    for path, given in found:
        assert not button_faults(_buttons(given), FRESH), f"{path.name}: {given}"
