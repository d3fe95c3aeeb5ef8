"""A survey that allocates thrusts, on the stand-in with the shipped script: from consent to the firmware's hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import POSHOLD
from wakewise_ardusub.sitl.sea_sensors import Relief, drawn_current
from wakewise_ardusub.sitl.survey_harness import SurveyHarness, straight_line
from wakewise_ardusub.survey.transect_session import TransectOptions

HEAVY = load_vehicle("bluerov2-heavy")


def harness(**more: Any) -> SurveyHarness:
    return SurveyHarness(HEAVY, **{"current": lambda _: np.array([0.05, 0.08, 0.0]), "allocates": True, **more})


def test_an_allocated_line_over_relief_is_flown_as_asked() -> None:
    """5 m at 10 cm/s and 80 cm over trapezoids in a current: figures within what is asked, a photograph a metre."""
    rng = np.random.default_rng(4)
    survey = harness(
        relief=Relief.drawn("trapezoid", rng),
        current=drawn_current(rng, 0.08),
        lines=straight_line(5.0),
        options=TransectOptions(every_m=1.0),
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
