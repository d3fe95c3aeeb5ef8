"""Pages of the paper's tables beside ours, from tables made up for the purpose."""

import platform
import re
import runpy
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from wakewise.experiments.campaigns.pictures import MODEL
from wakewise.experiments.campaigns.task import Task, TrialOutcome
from wakewise.ui.reports.methods_compared import methods_compared, profiles
from wakewise_paper.flights import SERIES
from wakewise_paper.reports.reproduction import plots, write_pages, write_results
from wakewise_paper.reports.reproduction.results import standalone_svg
from wakewise_paper.reports.reproduction.sentences import computer_description, reproduced
from wakewise_paper.reproduction.claim import JUDGED
from wakewise_paper.reproduction.rows import CompletedTrial
from wakewise_paper.reproduction.run import _figures, _Growing
from wakewise_paper.reproduction.table_trials import TABLE, TableRequest, blocks_of


def table(name, figures, trials=4, worlds=None):
    """A table whose trials became what `figures(plan)` says; None: it failed."""
    growing = _Growing(name, iter(()))
    growing.taken = list(blocks_of(name, TableRequest(trials=trials, first_seed=1, worlds=worlds)))
    for block in growing.taken:
        for plan in block:
            found = figures(plan)
            reason = None if found is not None else "it <fell> over"
            growing.made.append(
                CompletedTrial(plan, TrialOutcome(task=plan.task, figures=found, reason=reason, attempts=1, took_s=9.0))
            )
    return _figures(growing)


def scans(plan):
    """RMSE in the paper's order; one scan failed."""
    if plan.method == "manual" and plan.seed == 2:
        return None
    step = ("manual", "mpc", "mpc-smooth", "wake-aware").index(plan.method.removesuffix("-careful"))
    noise = 0.05 * np.sin(7.0 * plan.seed + step)
    return {"rmse_mm": 4.0 - step + noise, "completeness_pct": 90.0 + step, "success": 1.0, "energy_kJ": 1.0,
            "target_speed_mean_m_s": 0.02, "area_cm2": 100.0 + plan.seed, "volume_cm3": 50.0, "collisions": 0.0,
            "position_rmse_mm": 2.0, "failure": None}  # fmt: skip


def flights(plan):
    """Wash by method, less with ours."""
    rivals = {"dp-paper": 0.025, "weighted-pseudo-inverse": 0.01}
    wash = (
        rivals
        | {"manual": 0.03, "manual-careful": 0.028, "dp": 0.02, "mpc": 0.022, "mpc-smooth": 0.02, "wake-aware": 0.004}
    )[plan.method]
    return {"target_speed_mean_m_s": wash + 1e-4 * plan.seed, "position_rmse_mm": 2.0, "energy_kJ": 1.0,
            "roll_pitch_rms_deg": 1.0, "roll_pitch_max_deg": 1.1, "estimate_rmse_mm": 5.0,
            "tracking_rmse_mm": 1.8}  # fmt: skip


def wakes(plan):
    """One measurement: two models against two flows."""
    return {f"{m}/{f}/{k}": v for m in ("paper", "fitted") for f in ("oracle", "parcels")
            for k, v in (("r2_core", -3.0 if m == "paper" else 0.995), ("r2_wake", 0.9), ("bias_far_pct", 5.0))
            }  # fmt: skip


@pytest.fixture(scope="module")
def tables():
    return {
        "dynamic": table("dynamic", scans, trials=7, worlds=("pump-tank",)),
        "station": table("station", flights, worlds=("pump-tank", "paper")),
        "wake": table("wake", wakes),
        "solver": table("solver", lambda _: None),
    }


def _store(tables, folder):
    """What trials leave: series of flights, models and photographs of scans."""
    rng = np.random.default_rng(0)
    for place in tables["station"]["places"]:
        own = folder / place["folder"]
        own.mkdir(parents=True)
        time_s = np.arange(0.0, 20.0, 0.2)
        np.savez(own / SERIES, time_s=time_s, thrusts_N=rng.normal(size=(100, 8)), speed_m_s=0.01 + 0.0 * time_s,
                 D_time_s=time_s, D=np.abs(rng.normal(size=100)), begins_s=np.array(8.0))  # fmt: skip
    for place in tables["dynamic"]["places"]:
        own = folder / place["folder"]
        own.mkdir(parents=True)
        if place["reason"] is None:
            np.savez(own / MODEL, points_m=rng.normal(size=(500, 3)) * 0.05, error_mm=np.abs(rng.normal(size=500)))
    return folder


@pytest.mark.slow
def test_the_page_answers_at_a_glance_and_shows_the_worst(tables, tmp_path):
    """First and next best, the difference, the cost, the failures; a failed trial in its own words, escaped."""
    page = write_pages(tables, _store(tables, tmp_path / "store"), tmp_path).read_text(encoding="utf-8")
    assert re.search(r"wake-aware: [^.]*\.\d+ mm RMSE, [\d.]+ % less than mpc-smooth \(21 pairs; interval", page)
    assert "too few pairs: " in page and "is best" not in page
    assert "Failed: manual" in page and "as much energy as" in page
    assert "it &lt;fell&gt; over" in page and "<fell>" not in page
    assert "Circular" in page and "thrusts and disturbance over time" in page
    assert page.count('class="views"') == 4  # four methods have a model, the worst of manual failed
    assert "performance profiles, dynamic" in page
    assert not re.search(r'(src|href)="https?:', page)


def test_a_table_without_rows_says_why(tables, tmp_path):
    """And the others are there."""
    page = write_pages({"solver": tables["solver"]}, tmp_path, tmp_path).read_text(encoding="utf-8")
    assert "cannot be shown: no trial of it gave a figure" in page


def test_what_is_met_is_told_of_one_set_up_at_a_time(tables):
    """The paper's own first, then named worlds; the circular one is marked, and no heading is of any world at all."""
    found = reproduced(tables)
    titles = [title for title in found if title.startswith(("Met", "Not met"))]
    assert titles[:2] == ["Met in the paper's own set-up, pump-tank", "Not met in the paper's own set-up, pump-tank"]
    assert "Met in paper (circular)" in titles and "Not met in flow oracle" in titles
    assert not any(words in title for title in titles for words in ("any", "some", "at least", "none"))
    own = found[titles[0]]
    assert any("wash at the target, less than dp-paper" in line and "too few pairs (n = 4)" in line for line in own)
    assert any("energy, less than dp-paper" in line and "(0.330 times" not in line for line in found[titles[1]])
    assert any("the estimated place from the desired one" in line and "1.80 mm" in line for line in own)
    assert any("order of the methods" in line and "manual > mpc" in line for line in own)
    assert any("largest roll or pitch" in line and "by every method here" in line for line in own)
    assert any("R2 near the axis" in line for line in found["Not met in flow oracle"])


@pytest.mark.slow
def test_markdown_has_a_page_for_each_table_and_plots_that_are_pictures(tables, tmp_path):
    """SVG that any reader takes, the same for the same figures."""
    store = _store(tables, tmp_path / "store")
    index = write_results(tables, store, tmp_path / "a").read_text(encoding="utf-8")
    write_results(tables, store, tmp_path / "b")
    for name in tables:
        assert f"[{name}]({name}.md)" in index
    pictures = sorted((tmp_path / "a").glob("*.svg"))
    assert {"dynamic-methods.svg", "dynamic-profiles.svg", "station-over-time-pump-tank.svg", "wake-agreement.svg"} <= {
        p.name for p in pictures
    }
    for picture in pictures:
        ET.parse(picture)
        assert picture.read_text().count("#010a") == 0
        assert re.sub(r'id="[^"]*"|#[\w-]+', "", picture.read_text()) == re.sub(
            r'id="[^"]*"|#[\w-]+', "", (tmp_path / "b" / picture.name).read_text()
        )
    station = (tmp_path / "a" / "station.md").read_text(encoding="utf-8")
    assert "| wake-aware | wash at the target, less than dp |" in station and "**met, " in station
    assert all(line.count("|") == 11 for line in station.splitlines() if line.startswith("| wake-aware"))
    assert "no trial gave a figure" in (tmp_path / "a" / "solver.md").read_text(encoding="utf-8")
    why = (tmp_path / "a" / "reproduced.md").read_text(encoding="utf-8")
    assert "where the paper has 180" in why and "the target is rigid" in why
    assert "## Met in the paper's own set-up, pump-tank" in why and "## Stated by the paper, not measured here" in why
    assert "| in the paper's own set-up, pump-tank |" in index and "any world" not in index + why


def test_results_are_written_whole_and_small_or_not_at_all(tables, tmp_path, monkeypatch):
    """Pages, all trials, the worst in pictures; what an earlier run left goes; what is too large changes nothing."""
    tool = runpy.run_path(str(Path(__file__).parents[5] / "tools" / "write_results.py"))["write_all"]
    store, out = _store(tables, tmp_path / "store"), tmp_path / "results"
    out.mkdir()
    (out / "earlier.md").write_text("of a table that is no more")
    with monkeypatch.context() as patched, pytest.raises(SystemExit, match="at most"):
        patched.setitem(tool.__globals__, "MOST_MB", 1e-3)
        tool({"solver": tables["solver"]}, store, out)
    assert [path.name for path in out.iterdir()] == ["earlier.md"]
    assert 0.0 < tool({name: tables[name] for name in ("dynamic", "solver")}, store, out, "Few trials.") < 3.0
    names = {path.name for path in out.iterdir()}
    assert {"README.md", "reproduced.md", "results.json", "dynamic.csv", "dynamic-worst-pump-tank.jpg"} <= names
    assert "earlier.md" not in names
    assert "Few trials." in (out / "README.md").read_text(encoding="utf-8")
    trials = pl.read_csv(out / "dynamic.csv")
    assert len(trials) == tables["dynamic"]["made"]
    assert trials["reason"].drop_nulls().to_list() == ["it <fell> over"] * 3


def test_plots_of_nothing_are_none():
    """No trial, no picture."""
    assert methods_compared(JUDGED["dynamic"], [], []) is None
    assert plots.over_time({}) is None
    assert profiles(JUDGED["dynamic"], []) is None
    assert plots.obedience([]) is None
    assert plots.agreement([]) is None


def test_the_machine_is_told_without_a_name():
    """Cores, system, versions; no host, no user, no folder."""
    told = computer_description()
    assert int(told["cores"]) >= 1 and "numpy" in told
    assert not any("/" in value or platform.node() in value for value in told.values())


def test_every_flown_table_has_a_plot_of_its_methods(tables):
    """Named as the paper's method comparison."""
    figure = methods_compared(JUDGED["station"], tables["station"]["places"], tables["station"]["rows"])
    assert "wake-aware" in standalone_svg(figure)
    assert set(TABLE) >= set(tables)


def test_a_task_of_a_table_is_plain(tables):
    """What a page is told of a trial can be written down."""
    assert all(isinstance(place["folder"], str) for place in tables["dynamic"]["places"])
    assert isinstance(next(blocks_of("wake", TableRequest(trials=1)))[0].task, Task)
