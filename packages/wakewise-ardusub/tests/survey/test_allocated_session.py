"""A survey that allocates thrusts, on the stand-in with the shipped script: from consent to the firmware's hold."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, ENABLE_PARAMETER, MANUAL, POSHOLD
from wakewise_ardusub.sitl.modes import GUIDED
from wakewise_ardusub.sitl.sea_sensors import Relief, drawn_current
from wakewise_ardusub.sitl.survey_harness import (
    BY_TIME_OUT,
    SURVEY_FAULTS,
    SurveyHarness,
    seconds_to_hold,
    straight_line,
)
from wakewise_ardusub.survey.survey_safety import SurveyLimits
from wakewise_ardusub.survey.transect_session import TransectOptions

HEAVY = load_vehicle("bluerov2-heavy")


def harness(**more: Any) -> SurveyHarness:
    """A session 0.8 m above a bed in a current, where it need not descend."""
    still = {"current": lambda _: np.array([0.05, 0.08, 0.0]), "depth_m": 4.2, "allocates": True}
    return SurveyHarness(HEAVY, **still | more)


def test_an_allocated_line_over_relief_is_flown_as_asked() -> None:
    """5 m at 10 cm/s and 80 cm over trapezoids in a current: figures within what is asked, a photograph a metre."""
    rng = np.random.default_rng(4)
    current = drawn_current(rng, 0.08)
    survey = harness(
        relief=Relief.drawn("trapezoid", rng),
        current=current,
        lines=straight_line(5.0),
        options=TransectOptions(every_m=1.0),
        depth_m=3.6,
    )
    survey.ready().session.consent()
    survey.to_the_end()
    figures, told = survey.figures(), survey.session.figures()
    assert told["finished"]
    assert survey.flight.autopilot.mode == POSHOLD
    assert not survey.flight.autopilot.overridden
    assert figures["speed_rms_cm_s"] < 1.0
    assert figures["altitude_p95_cm"] < 5.0
    assert figures["cross_track_p95_cm"] < 10.0
    assert told["photographs"] == survey.flight.autopilot.photographs == 5
    assert told["current_m_s"] == pytest.approx(current(20.0)[:2], abs=0.02)
    assert told["weight_N"] == pytest.approx(1.0, abs=0.3)
    assert "N in water, and lifting it blows at the bed" in survey.session.warning


@pytest.mark.parametrize("fault", SURVEY_FAULTS)
def test_every_loss_ends_allocated_thrusts(fault: str) -> None:
    """Within a second by the program, within 0.3 s by the script; then the autopilot holds and nothing drives again."""
    survey = harness().flying(1.0)
    assert survey.flight.autopilot.overridden
    assert seconds_to_hold(survey, SURVEY_FAULTS[fault]) <= (0.3 if fault in BY_TIME_OUT else 1.0)
    for _ in range(30):
        survey.flight.run(0.1)
        assert not survey.flight.autopilot.overridden
    assert survey.flight.autopilot.mode in (ALT_HOLD, POSHOLD)
    lost = fault in ("the pilot changes the mode", "disarmed", "no Doppler log", "nobody hears the program")
    held = not lost and fault not in BY_TIME_OUT and fault != "nothing is heard from the autopilot"
    assert not held or survey.flight.autopilot.mode == POSHOLD


@pytest.mark.parametrize("mode", [MANUAL, GUIDED])
def test_a_mode_that_the_pilot_sets_under_thrusts_stays(mode: int) -> None:
    """The script lets go in its next loop, and no POSHOLD is asked for a moment later."""
    survey = harness().flying(1.0)
    survey.flight.set_mode(mode)
    survey.flight.run(0.1)
    assert not survey.flight.autopilot.overridden
    survey.flight.run(4.0)
    assert survey.flight.autopilot.mode == mode
    assert not survey.flight.autopilot.overridden


def test_a_script_that_is_switched_off_ends_it() -> None:
    """WKW_ENABLE = 0 releases in the next loop; the session ends with a reason and waits until it is set again."""
    survey = harness().flying(1.0)
    survey.flight.set(ENABLE_PARAMETER, 0.0)
    survey.flight.run(0.1)
    assert not survey.flight.autopilot.overridden
    survey.flight.run(5.0)
    assert survey.session.ended_by == "the script does not act on the thrusts"
    assert survey.session.why == "the script is not enabled; the pilot sets WKW_ENABLE to 1"
    assert survey.session.consent().startswith("not begun: the script is not enabled")


def test_no_thrust_acts_before_consent() -> None:
    """A session that is ready drives no output for as long as nobody consents, nor because the pilot sets a mode."""
    survey = harness().ready()
    for mode in (ALT_HOLD, GUIDED, ALT_HOLD):
        survey.flight.set_mode(mode)
        survey.flight.run(3.0)
        assert not survey.flight.autopilot.overridden
        assert survey.flight.autopilot.mode == mode
    assert survey.session.state == "ready"
    assert survey.session.gate.thrusts_sent == 0


def test_only_alt_hold_is_flown_in() -> None:
    """Modes that hold a place are refused with the reason; from MANUAL it asks for ALT_HOLD on consent."""
    survey = harness().ready()
    for mode, name in ((GUIDED, "GUIDED"), (POSHOLD, "POSHOLD")):
        survey.flight.set_mode(mode)
        survey.flight.run(2.0)
        assert survey.session.state == "waiting"
        assert survey.session.why == f"mode {name}, allowed are ALT_HOLD"
        assert survey.session.consent().startswith("not begun: ")
    survey.flight.set_mode(MANUAL)
    survey.flight.run(3.0)
    assert survey.session.state == "ready"
    assert survey.session.consent() == "ALT_HOLD requested"
    survey.flight.run(1.0)
    assert (survey.session.state, survey.flight.autopilot.mode) == ("settling", ALT_HOLD)
    assert survey.flight.autopilot.overridden


def test_an_allocated_survey_pauses_and_goes_on() -> None:
    """Paused, the vehicle is at rest and its thrusts go on; then it goes on along the same line."""
    survey = harness().flying(5.0)
    assert survey.session.pause() == "pauses"
    survey.flight.run(12.0)
    assert abs(float(survey.flight.autopilot.motion.v_W_m_s[0])) < 0.02
    assert survey.session.state == "paused"
    assert survey.flight.autopilot.overridden
    flown = survey.session.at.flown_m
    assert survey.session.consent() == "goes on"
    survey.flight.run(8.0)
    assert survey.session.at.flown_m > flown + 0.1


@pytest.mark.slow
def test_an_allocated_survey_that_a_stick_ended_is_resumed() -> None:
    """The pilot flies away in POSHOLD, sets ALT_HOLD and lets go; consent finishes the line, counted once."""
    survey = harness(lines=straight_line(2.0)).flying(5.0)
    survey.flight.sticks = (0, 400, 500, 0)
    survey.flight.run(3.0)
    assert survey.flight.autopilot.mode == POSHOLD
    survey.flight.sticks = (0, 0, 500, 0)
    survey.flight.set_mode(ALT_HOLD)
    survey.flight.run(6.0)
    assert survey.session.ended_by == "the pilot moved a stick"
    assert survey.session.consent() == "begun"
    survey.to_the_end()
    assert survey.session.finished
    assert survey.session.at.flown_m == pytest.approx(2.0, abs=0.05)


def test_hand_back_after_a_survey_does_not_jump() -> None:
    """From the last thrusts on the vehicle stays within 0.1 m of its depth for 8 s."""
    survey = harness().flying(3.0)
    survey.session.abort("q")
    depth = float(survey.flight.autopilot.motion.p_WB_m[2])
    for _ in range(80):
        survey.flight.run(0.1)
        assert float(survey.flight.autopilot.motion.p_WB_m[2]) == pytest.approx(depth, abs=0.1)
    assert survey.session.state == "ended"


def test_a_current_that_pushes_it_off_ends_allocated_thrusts() -> None:
    """Half the distance that ends it for GUIDED is enough to see it: the gate's fault, then the firmware's hold."""
    options = TransectOptions(limits=replace(SurveyLimits(), off_m=0.3))
    begins_s = math.inf

    def current(time_s: float) -> np.ndarray:
        return np.array([0.0, 0.9 if time_s > begins_s else 0.0, 0.0])

    survey = harness(options=options, current=current).flying(2.0)
    begins_s = survey.flight.now_s
    survey.flight.run(10.0)
    assert not survey.flight.autopilot.overridden
    assert "off the target place" in survey.session.ended_by or "from the target" in survey.session.ended_by
