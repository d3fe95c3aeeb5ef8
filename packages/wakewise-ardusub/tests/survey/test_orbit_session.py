"""An orbit on the stand-in: round the centre in a current over relief, its layers, losses and going on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import POSHOLD
from wakewise_ardusub.sitl.modes import GUIDED
from wakewise_ardusub.sitl.sea_sensors import Relief, SensorErrors, drawn_current
from wakewise_ardusub.sitl.survey_harness import BY_TIME_OUT, SURVEY_FAULTS, SurveyHarness, seconds_to_hold
from wakewise_ardusub.survey.orbit_plan import OrbitRequest
from wakewise_ardusub.survey.survey_plan import SurveyPace
from wakewise_ardusub.survey.survey_safety import SurveyLimits
from wakewise_ardusub.survey.transect_session import TransectOptions

HEAVY = load_vehicle("bluerov2-heavy")


def harness(request: OrbitRequest | None = None, *, pace: SurveyPace | None = None, **more: Any) -> SurveyHarness:
    asked = request or OrbitRequest()
    options = TransectOptions(pace=pace or SurveyPace(), every_m=0.5, layers_m=asked.altitudes_m)
    return SurveyHarness(
        HEAVY,
        lines=lambda place, heading, current, _anchor: asked.legs(place, heading, current),
        options=options,
        **{"current": lambda _: np.array([0.06, 0.08, 0.0]), **more},
    )


@pytest.mark.parametrize("direction", ["left", pytest.param("right", marks=pytest.mark.slow)])
def test_an_orbit_over_relief_in_a_current_is_flown_as_asked(direction: Any) -> None:
    """One turn of 1.5 m at 10 cm/s in 0.1 m/s: radius, altitude, speed and bearing of the centre within bounds, a
    photograph each half metre, and the vehicle is where it began, in POSHOLD.
    """
    rng = np.random.default_rng(5)
    survey = harness(
        OrbitRequest(direction=direction),
        relief=Relief.drawn("trapezoid", rng),
        current=drawn_current(rng, 0.1),
        heading_rad=1.0,
        seed=3,
    )
    survey.ready().session.consent()
    survey.to_the_end()
    figures, told = survey.figures(), survey.session.figures()
    assert told["finished"]
    assert survey.flight.autopilot.mode == POSHOLD
    assert figures["cross_track_p95_cm"] < 10.0
    assert figures["altitude_p95_cm"] < 5.0
    assert figures["speed_rms_cm_s"] < 1.5
    assert figures["heading_p95_deg"] < 4.0
    assert told["photographs"] == survey.flight.autopilot.photographs == 19
    assert told["flown_m"] == pytest.approx(2.0 * math.pi * 1.5, abs=0.01)
    assert told["centre_m"] == pytest.approx([1.5 * math.cos(1.0), 1.5 * math.sin(1.0)], abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("fault", SURVEY_FAULTS)
def test_every_loss_on_an_orbit_ends_in_the_firmwares_hold(fault: str) -> None:
    """Within a second by the program, within 3 s by the firmware's time-out."""
    survey = harness().flying(2.0)
    assert seconds_to_hold(survey, SURVEY_FAULTS[fault]) <= (3.1 if fault in BY_TIME_OUT else 1.0)


def test_an_orbit_that_is_pushed_towards_its_target_ends_before_it() -> None:
    """A current of 0.5 m/s towards the centre begins: the session ends before half the clearance is used up."""
    gust = [math.inf]
    survey = harness(current=lambda time_s: np.array([0.5 if time_s > gust[0] else 0.0, 0.0, 0.0]))
    survey.session.options = replace(survey.session.options, limits=SurveyLimits(off_m=0.3))
    survey.flying(2.0)
    gust[0] = survey.flight.now_s
    while survey.session.state == "flying" and survey.flight.now_s < gust[0] + 20.0:
        survey.flight.run(0.1)
    assert "off the target place" in survey.session.ended_by
    assert math.dist(survey.flight.autopilot.motion.p_WB_m[:2], survey.session.plan.centre_W_m) > 1.0


@pytest.mark.slow
def test_layers_are_flown_at_their_altitudes() -> None:
    """0.3 turns at 0.8 m, then back at 1.1 m: the altitude asked for is that of the layer, and it is kept."""
    pace = SurveyPace(speed_m_s=0.2, acceleration_m_s2=0.03)
    survey = harness(OrbitRequest(radius_m=2.0, turns=0.3, altitudes_m=(0.8, 1.1)), pace=pace)
    survey.ready().session.consent()
    survey.to_the_end()
    assert survey.session.finished
    assert {row.asked_m for row in survey.session.rows} == {0.8, 1.1}
    assert survey.figures()["altitude_p95_cm"] < 6.0
    motion = survey.flight.autopilot.motion
    assert 5.0 - motion.p_WB_m[2] == pytest.approx(1.1, abs=0.1)
    assert float(np.hypot(*motion.p_WB_m[:2])) < 0.3


@pytest.mark.slow
def test_an_orbit_pauses_and_goes_on_round_the_centre() -> None:
    """A pause holds the place; a stick ends it; from 1 m outside consent goes back to the circle and finishes it."""
    pace = SurveyPace(speed_m_s=0.2, acceleration_m_s2=0.03)
    survey = harness(OrbitRequest(radius_m=2.0, turns=0.35), pace=pace).flying(8.0)
    assert survey.session.pause() == "pauses"
    survey.flight.run(16.0)
    assert float(np.hypot(*survey.flight.autopilot.motion.v_W_m_s[:2])) < 0.03
    assert (survey.session.state, survey.flight.autopilot.mode) == ("paused", GUIDED)
    survey.flight.sticks = (-400, 0, 500, 0)
    survey.flight.run(4.0)
    survey.flight.sticks = (0, 0, 500, 0)
    survey.flight.run(6.0)
    assert survey.session.ended_by == "the pilot moved a stick"
    assert survey.session.consent() == "GUIDED requested"
    survey.to_the_end()
    assert survey.session.finished
    assert survey.session.at.flown_m == pytest.approx(0.35 * 2.0 * math.pi * 2.0, abs=0.05)


def test_the_turn_is_sent_on_the_circle_alone_and_is_never_negative() -> None:
    """A turn to the left: heading and turn rate together while it moves, without the rate while it holds."""
    survey = harness(OrbitRequest(direction="right"), errors=SensorErrors(gaps_per_min=0.0))
    heard: list[tuple[int, float]] = []
    parser = mavlink.MAVLink(None)

    def hear(data: bytes) -> None:
        said = parser.parse_buffer(data) or []
        heard.extend((m.type_mask, m.yaw_rate) for m in said if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED")

    survey.flight.listeners["spy"] = hear
    survey.flying(12.0)
    assert {mask for mask, _ in heard} == {0x9C0, 0x1C0}
    assert all(rate > 0.1 for mask, rate in heard if mask == 0x1C0)
