"""The gentle bench: its trials, its keys, what it keeps, what it says of what failed."""

import json

import pytest

from pools import MadeUp
from wakewise.control import METHODS as MADE
from wakewise.control import ControlSettings
from wakewise.core.errors import InputError, StageError
from wakewise.experiments.trials import BenchOptions
from wakewise_paper.cli.bench_wash import show_gentle
from wakewise_paper.reports.wash_bench_plot import draw_gentle
from wakewise_paper.wash_reduction import bench as gentle
from wakewise_paper.wash_reduction.bench import (
    MECHANISMS,
    METHODS,
    NONE,
    flown_methods,
    mechanism_settings,
    only_name,
    planned_trials,
    selected_mechanisms,
    without_name,
)
from wakewise_paper.wash_reduction.flight import FIGURES, parts_of
from wakewise_paper.wash_reduction.headline import SPEED, WRONG
from wakewise_paper.wash_reduction.paper import FIGURES as PAPER_FIGURES

ROW = dict.fromkeys(FIGURES, 1.0)
SHARE = {"dp": 1.0, "no-forward-jets": 0.4, "wake-aware": 0.1}


def made_up(name, settings):
    """Figures that depend on the trial alone: less without a mechanism."""
    *_, method, seed = name.split("/")
    if name.startswith("paper/"):
        return dict.fromkeys(PAPER_FIGURES, float(seed))
    fields = settings["scenario"]
    worse = 1.0 + sum(key.startswith("control.") for key in fields) + (WRONG in method)
    share = SHARE.get(fields["method"] if method not in METHODS else method, 0.8)
    return ROW | {SPEED: 0.02 * int(seed) * share * worse}


@pytest.fixture
def here(monkeypatch):
    """No process and no flight; knows the trials that were flown."""
    return MadeUp(monkeypatch, gentle, made_up)


@pytest.mark.slow
def test_the_answer_has_the_keys_that_were_promised(here, tmp_path, capsys):
    """Scenarios with methods, reductions and mechanisms; headline; flows; a picture of them."""
    found = gentle.run(
        BenchOptions(seeds=3, scenarios=("orbit/paper", "world/mud", "paper"), mechanisms=("all",), store=tmp_path)
    )
    json.dumps(found, allow_nan=False)
    assert set(found) >= {"scenarios", "headline", "flows", "flights", "failed", "why"}
    scenario = found["scenarios"]["orbit/paper"]
    assert scenario["dp_target_speed_m_s"] == pytest.approx(0.04)
    assert scenario["reduction_vs_dp_pct"] == pytest.approx(90.0)
    assert scenario["reduction_vs_no_forward_jets_pct"] == pytest.approx(75.0)
    row = scenario["methods"]["wake-aware"]
    for key in ("exceedance_1cm_s_pct", "exceedance_ambient_pct", "attitude_rmse_deg", "camera_rmse_mm"):
        assert row[key] == 1.0
    assert row["rmse_mm"] is None and "bench worlds" in row["why"]["rmse_mm"]
    for name in MECHANISMS:
        assert scenario["mechanisms"][name]["left_out_pct"] == pytest.approx(50.0)
        assert scenario["mechanisms"][name]["alone_pct"] > 0.0
    trouble = found["headline"]["trouble"]
    assert trouble["flights"] == 6 and trouble["worst_world_pct"] == pytest.approx(90.0)
    assert trouble["wrong_current_keeps_pct"] == pytest.approx(100.0 * 80.0 / 90.0)
    assert found["flows"]["paper"]["circular"] is True
    show_gentle(found)
    said = capsys.readouterr().out
    assert "headline" in said and "orbit/paper" in said and "mechanisms" in said and "circular" in said
    draw_gentle(found, tmp_path / "gentle.png")
    assert (tmp_path / "gentle.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="ending"):
        draw_gentle(found, tmp_path / "gentle.doc")


def test_a_bench_that_was_stopped_goes_on_and_failures_count(here, tmp_path):
    """A second run flies what the first could not; a failed flight is named, is no gain, and is not kept."""
    lost = True

    def flight(name, settings):
        if lost and name == "orbit/paper/wake-aware/2":
            raise StageError("the vehicle was lost")
        return made_up(name, settings)

    here.figures = flight
    said = []
    options = BenchOptions(
        seeds=2,
        scenarios=("orbit/paper",),
        methods=("dp", "wake-aware"),
        store=tmp_path,
        progress=lambda done, total, note="": said.append((done, total, note)),
    )
    first = gentle.run(options)
    assert first["flights"] == 6 and first["failed"] == 1 and first["flown"] == 5
    assert first["failures"] == [
        {"flow": "orbit/paper", "name": "wake-aware", "seed": 2, "reason": "StageError: the vehicle was lost"}
    ]
    assert first["headline"]["trouble"]["position_ok"] is False
    assert first["headline"]["trouble"]["reduction_vs_dp_pct"] < 70.0
    assert first["scenarios"]["orbit/paper"]["methods"]["wake-aware"]["failed"] == 1
    assert "s left" in said[-1][2]
    lost = False
    again = gentle.run(options)
    assert again["flown"] == 1 and again["failed"] == 0 and len(here.flown) == 7
    assert again["why"]["mpc-smooth"] == "this method was left out" and "paper" in again["why"]


def test_a_method_that_is_not_made_is_left_out_with_a_reason():
    """Names of the bench that no controller has are not flown and are said; +trim is flown by the method it ends."""
    methods, reasons = flown_methods(None)
    assert set(methods) | set(reasons) == set(METHODS)
    assert ("ardusub" in methods) == ("ardusub" in MADE) and "wake-aware+trim" in methods
    assert flown_methods(("dp",))[1]["manual"] == "this method was left out"


def test_each_lever_is_left_out_once_and_flown_alone_once():
    """All mechanisms' settings are accepted, none is without effect, and left out and alone differ."""
    table = mechanism_settings(tuple(MECHANISMS))
    assert set(table) == {NONE, *(without_name(n) for n in MECHANISMS), *(only_name(n) for n in MECHANISMS)}
    usual = ControlSettings()
    for settings in table.values():
        assert parts_of("calm/paper", "wake-aware", 1, control=settings).scenario.control != usual
    assert (
        selected_mechanisms(None) == ()
        and selected_mechanisms(("all",)) == tuple(MECHANISMS)
        and mechanism_settings(()) == {}
    )


def test_wrong_currents_are_flown_where_water_runs():
    """Not in the still tank; there nothing can be believed wrong."""
    trials = planned_trials(("world/still-tank", "world/kelp", "orbit/paper"), ("dp", "wake-aware"), (), 1)
    assert {key[0] for key in trials if key[1] == WRONG} == {"world/kelp", "orbit/paper"}


def test_requests_are_checked():
    """Names that do not exist and numbers out of range are refused with what is allowed."""
    with pytest.raises(InputError, match="allowed: dp"):
        gentle.run(BenchOptions(methods=("magic",)))
    with pytest.raises(InputError, match="allowed: none"):
        gentle.run(BenchOptions(mechanisms=("magic",)))
    with pytest.raises(InputError, match="allowed: orbit"):
        gentle.run(BenchOptions(scenarios=("magic",)))
    with pytest.raises(InputError, match="seeds: 0"):
        BenchOptions(seeds=0)
