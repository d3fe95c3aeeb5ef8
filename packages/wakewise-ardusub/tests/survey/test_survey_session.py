"""A survey on the stand-in: MAVLink bytes both ways, from consent to the firmware's hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, WakewiseError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, POSHOLD
from wakewise_ardusub.link.session_log import SessionLog, read_journal
from wakewise_ardusub.sitl.modes import GUIDED
from wakewise_ardusub.sitl.sea_sensors import Relief, SensorErrors, drawn_current
from wakewise_ardusub.sitl.survey_harness import (
    BY_TIME_OUT,
    SURVEY_FAULTS,
    SurveyHarness,
    seconds_to_hold,
    straight_line,
)
from wakewise_ardusub.survey.survey_plan import SurveyPace, parallel_lines
from wakewise_ardusub.survey.survey_safety import SurveyLimits
from wakewise_ardusub.survey.transect_session import TransectOptions

HEAVY = load_vehicle("bluerov2-heavy")


def harness(**more: Any) -> SurveyHarness:
    return SurveyHarness(HEAVY, **{"current": lambda _: np.array([0.05, 0.08, 0.0]), **more})


@pytest.mark.parametrize("fault", SURVEY_FAULTS)
def test_every_loss_ends_in_the_firmwares_hold(fault: str) -> None:
    """Within a second by the program, within 3 s by the firmware's time-out; afterwards no target moves it."""
    survey = harness()
    survey.flying(2.0)
    assert seconds_to_hold(survey, SURVEY_FAULTS[fault]) <= (3.1 if fault in BY_TIME_OUT else 1.0)
    before = survey.session.rows[-1][0]
    survey.flight.run(2.0)
    assert survey.session.state != "flying" or fault in BY_TIME_OUT
    if fault not in BY_TIME_OUT:
        assert survey.session.rows[-1][0] - before <= 1.0
        assert survey.flight.autopilot.mode != GUIDED or not survey.flight.autopilot.armed


def test_the_pilots_own_mode_is_left_alone() -> None:
    """Who sets ALT_HOLD during a survey has ALT_HOLD, and no POSHOLD a moment later."""
    survey = harness().flying(2.0)
    survey.flight.set_mode(ALT_HOLD)
    assert survey.flight.run(4.0).autopilot.mode == ALT_HOLD


def test_nothing_moves_without_consent() -> None:
    """A session that is ready sends no target and sets no mode for as long as nobody consents."""
    survey = harness().ready()
    survey.flight.run(5.0)
    assert survey.session.state == "ready"
    assert survey.flight.autopilot.mode == ALT_HOLD
    assert survey.flight.autopilot.target is None


def test_the_pilot_consents_by_setting_guided() -> None:
    """GUIDED set by the ground station while the session is ready begins the survey."""
    survey = harness().ready()
    survey.flight.run(1.5)
    survey.flight.set_mode(GUIDED)
    survey.flight.run(1.0)
    assert survey.session.state == "settling"


def test_guided_that_was_set_before_is_no_consent() -> None:
    """A vehicle that is in GUIDED when the session becomes ready is not moved; a key press then is consent."""
    survey = harness()
    survey.flight.run(0.2)
    survey.flight.arm(True)
    survey.flight.set_mode(GUIDED)
    survey.flight.run(3.0)
    assert survey.session.state == "ready"
    assert survey.session.consent() == "begun"


def test_a_line_over_relief_is_flown_as_asked(tmp_path: Path) -> None:
    """5 m at 10 cm/s and 80 cm over trapezoids in a current: figures within what is asked, a photograph a metre."""
    journal = SessionLog(tmp_path / "journal.jsonl")
    rng = np.random.default_rng(4)
    relief = Relief.drawn("trapezoid", rng)
    current = drawn_current(rng, 0.08)
    survey = harness(
        relief=relief,
        current=current,
        lines=straight_line(5.0),
        options=TransectOptions(every_m=1.0),
        journal=journal,
    )
    survey.ready().session.consent()
    survey.to_the_end()
    figures, told = survey.figures(), survey.session.figures()
    assert told["finished"]
    assert survey.flight.autopilot.mode == POSHOLD
    assert figures["speed_rms_cm_s"] < 1.0
    assert figures["altitude_p95_cm"] < 5.0
    assert figures["cross_track_p95_cm"] < 10.0
    assert told["photographs"] == survey.flight.autopilot.photographs == 5
    assert told["current_m_s"] == pytest.approx(current(20.0)[:2], abs=0.02)
    events = [line["event"] for line in read_journal(tmp_path / "journal.jsonl")[0]]
    assert {"state", "plan", "line", "photograph"} <= set(events)


def test_a_pause_holds_and_consent_goes_on() -> None:
    """Paused, the vehicle is at rest within 12 s and stays in GUIDED; then it goes on along the same line."""
    survey = harness().flying(5.0)
    assert survey.session.pause() == "pauses"
    survey.flight.run(14.0)
    assert abs(float(survey.flight.autopilot.motion.v_W_m_s[0])) < 0.02
    assert (survey.session.state, survey.flight.autopilot.mode) == ("paused", GUIDED)
    flown = survey.session.at.flown_m
    assert survey.session.consent() == "goes on"
    survey.flight.run(10.0)
    assert survey.session.at.flown_m > flown + 0.2


@pytest.mark.slow
def test_a_survey_that_a_stick_ended_is_resumed_where_it_ended() -> None:
    """The pilot flies away and lets go; consent flies back to the place and finishes the line, counted once."""
    survey = harness(lines=straight_line(2.0)).flying(5.0)
    survey.flight.sticks = (0, 400, 500, 0)
    survey.flight.run(4.0)
    survey.flight.sticks = (0, 0, 500, 0)
    survey.flight.run(6.0)
    assert survey.session.ended_by == "the pilot moved a stick"
    assert survey.session.consent() == "GUIDED requested"
    survey.to_the_end()
    assert survey.session.finished
    assert survey.session.at.flown_m == pytest.approx(2.0, abs=0.05)


def test_what_is_missing_is_told_and_keeps_it_from_beginning() -> None:
    """No rangefinder, no sticks, disarmed, a bed too near to the surface: each in words, and consent is not taken."""
    cases = {
        "no rangefinder": lambda s: setattr(s.sensors, "range_lost", True),
        "no sticks are heard": lambda s: setattr(s.flight, "sticks", None),
    }
    for words, fault in cases.items():
        survey = harness()
        fault(survey)
        survey.flight.run(0.2)
        survey.flight.arm(True)
        survey.flight.run(2.0)
        assert words in survey.session.why
        assert survey.session.consent().startswith("not begun: no ")
    survey = harness()
    survey.flight.run(2.0)
    assert survey.session.why == "the vehicle is disarmed; the pilot arms it"
    shallow = harness(relief=Relief(depth_m=1.0), depth_m=0.5)
    shallow.flight.run(0.2)
    shallow.flight.arm(True)
    shallow.flight.run(2.0)
    assert shallow.session.why.endswith("0.8 m above it is the surface")


@pytest.mark.slow
def test_a_bed_that_rises_too_fast_ends_it() -> None:
    """Over a wall of 76 degrees, from which no distance comes back, it stops while it is still above it."""
    wall = Relief(shape="trapezoid", height_m=0.9, slope=4.0, period_m=8.0, phase=0.3)
    survey = harness(relief=wall, current=None)
    survey.flying(1.0)
    survey.to_the_end()
    assert not survey.session.finished
    assert survey.session.ended_by == "no distance of the rangefinder"
    motion = survey.flight.run(5.0).autopilot.motion
    assert wall.bed_m(*motion.p_WB_m[:2]) - motion.p_WB_m[2] > 0.03


@pytest.mark.slow
def test_a_steep_face_is_climbed_before_it_is_passed() -> None:
    """Over faces to 74 degrees the way ahead stops until the altitude is there again, and the line is finished."""
    face = Relief(shape="trapezoid", height_m=0.9, slope=3.5, period_m=8.0, phase=0.3)
    survey = harness(relief=face, current=None, lines=straight_line(3.0))
    survey.flying(1.0)
    survey.to_the_end()
    assert survey.session.finished
    assert min(row[2] for row in survey.rows) > 0.25


def test_lines_out_of_the_fence_are_told_before_anybody_consents() -> None:
    """A line of 20 m with a fence of 5 m: the session waits with the reason, and no mode is asked for."""
    options = TransectOptions(limits=replace(SurveyLimits(), fence_m=5.0))
    survey = harness(options=options)
    with pytest.raises(WakewiseError, match="20 m from here, --fence is 5 m"):
        survey.ready()
    assert (survey.session.state, survey.session.why) == ("waiting", "survey: 20 m from here, --fence is 5 m")
    survey.session.consent()
    survey.flight.run(1.0)
    assert survey.flight.autopilot.mode == ALT_HOLD


def test_lines_that_the_current_makes_impossible_are_refused_in_the_hold() -> None:
    """It is known after the hold alone: the session ends with the reason, at its place."""

    def lines(place: Array, heading: float, current: Array, anchor: object) -> list[Array]:
        if current.any():
            raise InputError("survey: not in a current")
        return list(straight_line(20.0)(place, heading, current, None))

    survey = harness(lines=lines)
    survey.ready().session.consent()
    survey.to_the_end()
    assert survey.session.refused == "survey: not in a current"
    assert survey.session.state == "ended"
    assert float(np.hypot(*survey.flight.autopilot.motion.p_WB_m[:2])) < 1.0


@pytest.mark.slow
def test_an_acceleration_is_sent_from_4_8_on_alone() -> None:
    """ArduSub before it would take no target at all from such a message."""
    masks: dict[tuple[int, int, int], set[int]] = {}
    for firmware in ((4, 5, 3), (4, 8, 0)):
        survey = harness(firmware=firmware, errors=SensorErrors(gaps_per_min=0.0))
        heard = masks.setdefault(firmware, set())
        parser = mavlink.MAVLink(None)

        def hear(data: bytes, heard: set[int] = heard, parser: Any = parser) -> None:
            for message in parser.parse_buffer(data) or []:
                if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                    heard.add(message.type_mask)

        survey.flight.listeners["spy"] = hear
        survey.flying(1.0)
    assert masks == {(4, 5, 3): {0x9C0}, (4, 8, 0): {0x800}}


@pytest.mark.slow
def test_a_lawnmower_is_flown_with_its_turns() -> None:
    """Two lines of 1.5 m, 1 m apart, at 20 cm/s: 3 m of line, and the vehicle ends 1 m aside."""
    options = TransectOptions(pace=SurveyPace(speed_m_s=0.2, acceleration_m_s2=0.03))
    survey = harness(
        options=options,
        current=None,
        lines=lambda place, heading, _c, _a: parallel_lines(place, heading, 1.0, 1.5, 1.0, 1),
    )
    survey.ready().session.consent()
    survey.to_the_end()
    assert survey.session.finished
    assert survey.session.at.flown_m == pytest.approx(3.0, abs=0.01)
    assert float(survey.flight.autopilot.motion.p_WB_m[1]) == pytest.approx(1.0, abs=0.25)
