"""The operator's bench: what it plans, what it keeps, and what it says of flights that are made up."""

import json

import pytest

from pools import MadeUp
from wakewise.core.errors import InputError, StageError
from wakewise.experiments.trials import BenchOptions
from wakewise_paper.cli.bench_operator import show_operator
from wakewise_paper.operator_study import bench
from wakewise_paper.operator_study.bench import planned_trials, selected_w_tracks, selected_worlds
from wakewise_paper.operator_study.flight import FIGURES

SPEED, DEVIATION = "target_speed_mean_m_s", "velocity_deviation_pct"


def flight(name, settings):
    """A tenth of direct's wash at w_track 5, more with more; the control is calm; `close` seed 2 of ours is lost."""
    method = settings["scenario"]["method"]
    if name.startswith("paper, "):
        return paper_flight(method)
    told = settings["setup"]["wakewise_paper.operator_study.flight:operated"]
    if (told["world"], method, told["seed"]) == ("close", "wake-aware", 2):
        raise StageError("the vehicle was lost")
    share = {"dp": 1.0, "wake-aware": 0.02 * told["w_track"], "no-forward-jets": 0.5}.get(method, 0.9)
    base = 0.004 if told["world"] == "still-tank" else 0.04
    row = dict.fromkeys(FIGURES, 1.0)
    return row | {SPEED: share * base, "disturbance": share * 1e-3, DEVIATION: 10.0, "sway_rms_mm": None, "cpu_s": 1.0}


def paper_flight(method):
    """Water a tenth of the careless one's."""
    share = 0.1 if method == "wake-aware" else 1.0
    keys = (DEVIATION, "velocity_deviation_planned_pct", "velocity_deviation_behind_plan_pct")
    return dict.fromkeys(keys, 6.0) | {"disturbance": share, SPEED: share, "cpu_s": 1.0}


@pytest.fixture
def here(monkeypatch):
    return MadeUp(monkeypatch, bench, flight)


@pytest.fixture
def made_up(here, tmp_path):
    return tmp_path


def test_direct_flights_are_shared_by_all_w_tracks_and_the_claim_is_flown_first():
    """`dp` and the bow rule once a seed and pilot; other w_tracks for the first seeds alone, by the script."""
    trials = planned_trials(("payload", "mud"), (1.0, 5.0), seeds=2, grid_seeds=1)
    flown = list(trials)
    for method in ("dp", "no-forward-jets"):
        assert sum(name == method for _, _, name, _ in flown) == 2 * 2 * 2
    grid = [key for key in flown if key[2].endswith(" 1")]
    assert len(grid) == 2 * 2 and {(pilot, seed) for _, pilot, _, seed in grid} == {("script", 1)}
    assert {name for _, _, name, _ in flown[:8]} == {"dp", "wake-aware 5"} and {key[3] for key in flown[:8]} == {1}


def test_the_answer_has_the_keys_of_the_figures_and_names_what_it_lacks(made_up, capsys):
    """Worlds by w_track, the default world's sweep on top, the paper's world labelled circular, nulls with a why."""
    found = bench.run(BenchOptions(seeds=2, worlds=("payload", "still-tank"), store=made_up))
    assert found["w_track"] is found["worlds"]["payload"]["w_track"]
    assert list(found["w_track"]) == ["1", "2", "5", "10", "20"]
    at_5 = found["w_track"]["5"]
    assert at_5[DEVIATION] == pytest.approx(10.0) and at_5["target_speed_reduction_pct"] == pytest.approx(90.0)
    assert at_5["disturbance_reduction_pct"] == pytest.approx(90.0) and at_5["trouble_flights"] == 4
    assert set(at_5["pilots"]) == {"script", "human"} and at_5["mpc"]["target_speed_reduction_pct"] < 15.0
    assert at_5["sway_rms_mm"] is None and "rigid" in at_5["why"]["sway_rms_mm"]
    calm = found["worlds"]["still-tank"]["w_track"]["5"]
    assert calm["target_speed_reduction_pct"] is None and "10 mm/s" in calm["why"]["target_speed_reduction_pct"]
    assert calm["target_speed_reduction_all_pct"] is not None
    assert found["paper"]["circular"]
    assert found["paper"]["w_track"]["5"]["disturbance_reduction_pct"] == pytest.approx(90.0)
    for key in ("latency_ms_p99", "coverage_agreement_pct", "coverage_ms_per_photo"):
        assert found[key] is None and found["why"][key]
    assert found["claim"]["deviation_ok"] and found["claim"]["wash_ok"]
    json.dumps(found)
    show_operator(found)
    shown = capsys.readouterr().out
    assert "claim" in shown and "payload" in shown and "circular" in shown


def test_a_flight_of_ours_that_failed_is_no_gain_and_is_named(made_up):
    """It lowers the mean logarithm and is flown anew the next time; direct's own figure says that it was trouble."""
    found = bench.run(BenchOptions(seeds=2, worlds=("close",), w_tracks=(5.0,), store=made_up))
    at_5 = found["worlds"]["close"]["w_track"]["5"]
    assert found["failed"] == 2 and at_5["failed"] == 2 and at_5["flights"] == 2 and at_5["trouble_flights"] == 4
    assert at_5["target_speed_reduction_pct"] == pytest.approx(100.0 * (1.0 - 0.1**0.5))
    assert {f["reason"] for f in found["failures"]} == {"StageError: the vehicle was lost"}
    assert found["w_track"] is None and "left out" in found["why"]["w_track"]


def test_a_run_that_was_stopped_goes_on(here, made_up):
    """What was flown is kept; another w_track adds its own flights and no direct ones."""
    options = BenchOptions(seeds=1, worlds=("mud",), w_tracks=(5.0,), store=made_up)
    bench.run(options)
    here.flown.clear()
    assert bench.run(options)["flown"] == 0 and not here.flown
    bench.run(BenchOptions(seeds=1, worlds=("mud",), w_tracks=(5.0, 20.0), store=made_up))
    assert {name.split("/")[1] for name in here.flown if "paper" not in name} == {"wake-aware 20", "mpc 20"}


def test_worlds_and_w_tracks_that_cannot_be_are_refused():
    """In one line with what would be right."""
    with pytest.raises(InputError, match="worlds: 'mars' is not known, allowed: "):
        selected_worlds(("mars",))
    for value in (0.0, -1.0, float("nan"), 51.0):
        with pytest.raises(InputError, match=r"w_tracks: .*must be from 0.5 to 50"):
            selected_w_tracks((value,))
    assert selected_w_tracks((20.0, 5.0, 5.0)) == (5.0, 20.0)
