"""The hazard table: every row names a test that exists; and the rows that have no other place."""

from __future__ import annotations

import re
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from bottle import Bottle
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.motor_interface import VehicleMotors
from wakewise_ardusub.link.protocol import ALLOWED_MODES, ALT_HOLD, POSHOLD
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.sitl.companion_harness import COMPANION_FAULTS
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.survey_harness import SURVEY_FAULTS

ROOT, TESTS = Path(__file__).parents[4], Path(__file__).parents[1]
ROW = re.compile(r"^\|.*\| `(test_\w+)(?:\[(.+)\])?` \|$", re.MULTILINE)


def test_every_row_names_a_test_that_exists():
    """Its function is in some test file, and what it is parametrized with stands in that file."""
    pages = ("hazards.md", "survey-hazards.md")
    text = "\n".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in pages)
    rows = [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| fault |")]
    found = ROW.findall(text)
    assert len(found) == len(rows) >= 25
    files = {path: path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py")}
    for name, case in found:
        homes = [body for body in files.values() if re.search(rf"^def {name}\(", body, re.MULTILINE)]
        assert homes, name
        known = case in COMPANION_FAULTS or case in SURVEY_FAULTS or any(f'"{case}"' in body for body in homes)
        assert not case or known, f"{name}[{case}]"


def test_a_vehicle_of_another_number_of_motors_is_refused():
    """A file of six thrusters on an autopilot that drives eight motors: said in one line, and it is never ready."""
    six = load_vehicle("bluerov2")
    words = VehicleMotors(six).amiss(own_parameters(8))
    assert words.startswith("vehicle bluerov2: 6 thrusters, the autopilot drives motors 1, 2, 3, 4, 5, 6, 7, 8;")
    assert "\n" not in words
    bottle = Bottle()
    bottle.parameter("MOT_1_DIRECTION", 0.0)
    assert bottle.engage() == "not engaged: MOT_1_DIRECTION must be 1 or -1"


def risen_m(mode: int, script: str, seconds: float = 10.0) -> float:
    """How far the vehicle rises after thrusts have pushed it down for 15 s in a mode, and it was handed back."""
    flight = InProcessSession(load_vehicle("bluerov2-heavy"), loop_hz=50.0, scripts={"wakewise.lua": script})
    flight.run(0.2)
    flight.set_mode(mode)
    flight.arm(True)
    flight.run(3.0)
    flight.set("WKW_ENABLE", 1.0)
    flight.thrusts, flight.streams = (0.0,) * 4 + (0.08,) * 4, True
    flight.run(15.0)
    assert flight.moments[-1].overridden
    flight.streams = False
    flight.station.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    flight.run(0.3)
    assert not flight.moments[-1].overridden
    deepest = float(flight.autopilot.motion.p_WB_m[2])
    least = deepest
    for _ in range(round(10.0 * seconds)):
        flight.run(0.1)
        least = min(least, float(flight.autopilot.motion.p_WB_m[2]))
    assert flight.autopilot.mode == mode
    assert not flight.autopilot.script_faults
    return deepest - least


def test_hand_back_does_not_jump_in_any_mode_that_is_allowed():
    """In ALT_HOLD because the script has the autopilot enter it anew, after a turn in STABILIZE.

    Without that it goes back to the depth that it held beneath the override; entered anew in the same turn it takes the
    depth of now and the throttle that it had summed up.
    """
    shipped = script_text()
    for mode in ALLOWED_MODES:
        assert risen_m(mode, shipped) < 0.05, mode
    left = "stepped_out = vehicle:set_mode(STABILIZE)"
    assert shipped.count(left) == 1
    assert risen_m(ALT_HOLD, shipped.replace(left, "stepped_out = false")) > 0.5
    at_once = shipped.replace(left, "vehicle:set_mode(STABILIZE) vehicle:set_mode(ALT_HOLD)")
    assert risen_m(ALT_HOLD, at_once) > 0.07


def test_modes_that_hold_a_place_are_not_allowed():
    """POSHOLD would go back to its place, so neither script nor output gate drives in it."""
    assert POSHOLD not in EngagementLimits().modes
    bottle = Bottle(mode=POSHOLD)
    assert bottle.engage() == "not engaged: mode POSHOLD, allowed are MANUAL, ALT_HOLD, STABILIZE"
