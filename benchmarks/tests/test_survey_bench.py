"""The bench of slow surveys: its flights, intervals, losses and what is printed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_benchmarks import repeat_scans, survey, survey_by_hand, survey_orbits
from wakewise_benchmarks.registry import BENCHES, bench_target, run_bench


def flight(relief: str, seed: int) -> dict[str, Any]:
    figures = {"speed_rms_cm_s": 0.3 + 0.1 * seed, "altitude_rms_cm": 1.0, "altitude_p95_cm": 3.0 + seed}
    figures |= {"cross_track_rms_cm": 1.0, "cross_track_p95_cm": 2.0, "cross_track_max_cm": 6.0}
    return {"relief": relief, "seed": seed, "finished": True, **figures}


def test_a_short_flight_is_flown_and_judged_by_the_truth() -> None:
    """12 s of line over sawteeth: finished, with figures near what longer flights have."""
    told = survey.flight_figures("sawtooth", 1, 0.2)
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(1.2, abs=0.05)
    assert told["speed_rms_cm_s"] < 3.0
    assert told["altitude_p95_cm"] < 8.0


@pytest.mark.slow
def test_a_part_of_an_orbit_is_flown_and_judged_by_the_truth() -> None:
    """0.3 turns of 1 m: finished, near the circle and with the bow near its centre."""
    told = survey_orbits.orbit_figures(1, 1.0, 0.1, 0.3)
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(0.6 * np.pi, abs=0.01)
    assert told["cross_track_p95_cm"] < 15.0
    assert told["heading_p95_deg"] < 6.0


def test_figures_have_intervals_and_are_met_by_their_ends(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three seeds of two reliefs are six flights; altitudes of 3, 4 and 5 cm are not met for certain."""
    monkeypatch.setattr(survey, "flight_figures", lambda relief, seed, _minutes: flight(relief, seed))
    monkeypatch.setattr(survey, "SURVEYED", ("a stick is moved", "the program dies"))
    monkeypatch.setattr(survey_by_hand, "pair_figures", lambda _vehicle, seed: pair(seed))
    heading = {"heading_p95_deg": 1.0, "heading_max_deg": 2.0}
    monkeypatch.setattr(survey_orbits, "orbit_figures", lambda seed, *_: flight("sawtooth", seed) | heading)
    terrain = {"altitude_rms_cm": 11.0, "firmware_rms_cm": 17.8}
    monkeypatch.setattr(survey, "surftrak_figures", lambda _name: terrain)
    monkeypatch.setattr(repeat_scans, "colony_figures", lambda kind, _scans: colony(kind))
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
    assert told["orbit"]["heading_p95_deg"]["met"] is True
    assert told["orbit_fastest"]["altitude_p95_cm"]["met"] is False
    assert "SURFTRAK's trapezoid    altitude  11.0 cm rms, the firmware's own mode  17.8" in printed
    assert told["speed_rms_cm_s"] == told["all"]["speed_rms_cm_s"]["mean"]
    assert 2.0 < told["hold_after_loss_s_max"] < 3.2
    assert told["volume_cv_pct"] == 2.0
    assert told["growth_3mm_told"] is True
    assert told["growth_1mm_claimed"] is True
    assert "branching: CV of 2 scans: length 1.00 % (asked 0.5)" in printed
    assert "orbit_small: 3 of 3 flights finished" in printed
    assert told["by_hand"]["pairs"] == 3
    assert told["wash_pct"]["mean"] == pytest.approx(70.0)
    assert told["wash_pct"]["met"] is True
    assert "by hand at 20 % pilot gain: 3 pairs" in printed


def colony(kind: str) -> dict[str, Any]:
    """A colony whose 3 mm are told, and of which the branching one's 1 mm is claimed."""
    size = 2.0 if kind == "branching" else 1.0
    grown = {"1": {"told": kind == "branching", "verdict": "?"}, "3": {"told": True, "verdict": "grown by 3 mm"}}
    cvs = {f"{name}_cv_pct": 0.5 * size for name in ("length", "planar_area", "area")} | {"volume_cv_pct": size}
    return {"scans": [{}, {}], "grown": grown, **cvs}


def test_a_colony_that_grew_has_its_surface_moved_out() -> None:
    """By 3 mm along its normals: every vertex moved by so much, and the top rose."""
    target = bench_target()
    grown = repeat_scans.grown_target(target, 0.003)
    moved = np.linalg.norm(grown.mesh.vertices_m - target.mesh.vertices_m, axis=1)
    assert moved == pytest.approx(0.003)
    assert grown.mesh.vertices_m[:, 2].min() < target.mesh.vertices_m[:, 2].min()


def pair(seed: int) -> dict[str, Any]:
    """Wash of the survey 30 % of the person's, in whatever water."""
    person = dict.fromkeys(survey_by_hand.FIGURES, 100.0 + seed)
    less = {name: 0.3 * value for name, value in person.items()}
    others = dict.fromkeys(("allocated", *survey_by_hand.REASONS), less)
    return {"seed": seed, "person": person, "survey": less, **others}


def test_a_reduction_is_met_by_its_interval_alone() -> None:
    """Pairs of 40 and 80 % have a mean above 60 % and an interval that reaches below it."""
    pairs = [pair(seed) for seed in range(4)]
    for k, one in enumerate(pairs):
        one["survey"] = {**one["survey"], "wash_mm_s": (0.2 if k % 2 else 0.6) * one["person"]["wash_mm_s"]}
    told = survey_by_hand.hand_summary(pairs)
    assert told["wash_pct"]["mean"] > 60.0 > told["wash_pct"]["low"]
    assert told["wash_pct"]["met"] is False
    assert told["allocated_against_person_wash_pct"]["mean"] == pytest.approx(70.0)


@pytest.mark.slow
def test_a_person_flies_a_short_line_at_a_fifth_of_the_stick() -> None:
    """3 m in 30 s within 0.4 m of it and 0.4 m of the altitude, by sticks in their range."""
    sea = survey_by_hand.SurveySea.drawn(load_vehicle(survey.VEHICLE), 2)
    flown = survey_by_hand.by_hand(sea, np.zeros(2), sea.heading_rad, 2, 3.0).figures()
    assert flown["speed_mean_cm_s"] == pytest.approx(10.0, abs=2.5)
    assert flown["altitude_p95_cm"] < 40.0
    assert flown["cross_track_p95_cm"] < 40.0
    assert flown["wash_mm_s"] > 0.0
    assert flown["level_mm_s"] < 1.0


def test_the_wash_on_the_bed_is_that_of_the_thrusters_that_blow_at_it() -> None:
    """Level thrusters alone give none 0.8 m below; vertical ones that hold a weight blow down, those that hold a float
    up.
    """
    vehicle = load_vehicle(survey.VEHICLE)
    sea = survey_by_hand.SurveySea.drawn(vehicle, 0)
    motion = FreeWater(vehicle, BodyState(X_WB=Pose(np.array([0.0, 0.0, 4.2]), np.array([1.0, 0.0, 0.0, 0.0])))).step(
        np.zeros(8), 0.02
    )
    level = np.abs(vehicle.thruster_axes_B[:, 2]) < 0.5
    found = {}
    for name, thrusts in {"level": 2.0 * level, "down": 0.5 * ~level, "up": -0.5 * ~level}.items():
        wash = survey_by_hand.BedWash(sea=sea, way=np.array([1.0, 0.0]), start_W_m=np.zeros(2))
        wash.take(motion, thrusts, 0.0)
        found[name] = wash.figures()["wash_mm_s"]
    assert found["level"] < 1.0
    assert found["down"] == pytest.approx(0.0, abs=1e-6)
    assert found["up"] > 50.0
