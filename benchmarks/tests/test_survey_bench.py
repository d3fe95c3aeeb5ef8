"""The bench of slow surveys: its flights, intervals, losses and what is printed."""

from __future__ import annotations

from typing import Any

import pytest

from wakewise.experiments.trials.timing import BenchOptions
from wakewise_benchmarks import survey
from wakewise_benchmarks.registry import BENCHES, run_bench


def flight(relief: str, seed: int) -> dict[str, Any]:
    figures = {"speed_rms_cm_s": 0.3 + 0.1 * seed, "altitude_rms_cm": 1.0, "altitude_p95_cm": 3.0 + seed}
    figures |= {"cross_track_p95_cm": 2.0, "cross_track_max_cm": 6.0}
    return {"relief": relief, "seed": seed, "finished": True, **figures}


def test_a_short_flight_is_flown_and_judged_by_the_truth() -> None:
    """12 s of line over sawteeth: finished, with figures near what longer flights have."""
    told = survey.flight_figures("sawtooth", 1, 0.2)
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(1.2, abs=0.05)
    assert told["speed_rms_cm_s"] < 3.0
    assert told["altitude_p95_cm"] < 8.0


def test_figures_have_intervals_and_are_met_by_their_ends(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three seeds of two reliefs are six flights; altitudes of 3, 4 and 5 cm are not met for certain."""
    monkeypatch.setattr(survey, "flight_figures", lambda relief, seed, _minutes: flight(relief, seed))
    monkeypatch.setattr(survey, "SURVEYED", ("a stick is moved", "the program dies"))
    assert "survey" in BENCHES
    told = run_bench("survey", BenchOptions(seeds=3))
    assert told["all"]["flights"] == 6
    assert told["all"]["speed_rms_cm_s"]["met"] is True
    assert told["trapezoid"]["altitude_p95_cm"]["mean"] == pytest.approx(4.0)
    assert told["trapezoid"]["altitude_p95_cm"]["met"] is False
    assert {name: row["met"] for name, row in told["losses"].items()} == dict.fromkeys(survey.SURVEYED, True)
    survey.show_survey(told)
    printed = capsys.readouterr().out
    assert "sawtooth: 3 of 3 flights finished" in printed
    assert "the program dies" in printed
