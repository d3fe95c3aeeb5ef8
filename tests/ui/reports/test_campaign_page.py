"""A campaign's page answers at a glance, whatever its trials differ in."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from wakewise.experiments.campaigns.definition import CampaignPlan, PlanEntry
from wakewise.experiments.campaigns.pictures import MODEL
from wakewise.experiments.campaigns.table import Results, TrialRecord
from wakewise.ui.reports import write_campaign
from wakewise.ui.reports.campaign import campaign_page

pytestmark = pytest.mark.usefixtures("undrawn")


def campaign(seeds=6, worlds=("mud",), waiting=0, factor="method", names=("dp", "<ours>"), lost=True):
    """Models of two methods, the second better; maybe one of its models did not come about."""
    made = []
    for world in worlds:
        for seed in range(1, seeds + 1):
            for place, name in enumerate(names):
                rmse = None if place and seed == seeds and lost else 3.0 - place + 0.02 * seed
                figures = {"rmse_mm": rmse, "target_speed_mean_m_s": 0.02 / (1 + place), "energy_kJ": 1.0 + place}
                key = f"{world}-{seed}-{place}"
                entry = PlanEntry(
                    key=key, name=key, factors={factor: name, "target": "brain", "world": world, "seed": seed}
                )
                made.append(
                    TrialRecord(entry=entry, state="done", figures=figures, reason=None, attempts=1, took_s=60.0)
                )
    made += [
        TrialRecord(entry=one.entry, state="waiting", figures={}, reason=None, attempts=0, took_s=0.0)
        for one in made[:waiting]
    ]
    plan = CampaignPlan(
        name="first <try>",
        campaign={"seeds": seeds},
        wakewise="0.1",
        sources="abc",
        trials=tuple(m.entry for m in made),
    )
    return Results(plan=plan, made=tuple(made), drivers=0, others=0)


def kept(found, folder):
    """What trials leave for a page."""
    rng = np.random.default_rng(0)
    for one in found.made:
        own = folder / "trials" / one.entry.key / "work"
        own.mkdir(parents=True, exist_ok=True)
        if one.figures["rmse_mm"] is not None:
            np.savez(own / MODEL, points_m=rng.normal(size=(300, 3)) * 0.05, error_mm=np.abs(rng.normal(size=300)))
        cv2.imwrite(str(own / "photograph-0s.jpg"), rng.integers(0, 255, (60, 80, 3), dtype=np.uint8))
        (own / "photographs.json").write_text(json.dumps([{"after_s": 0.0, "file": "photograph-0s.jpg"}]))
    return folder


def test_the_page_says_who_won_and_shows_the_worst(tmp_path):
    """In the headline both means and the pairs, below it the cost; pictures of each method's worst trial."""
    found = campaign()
    page = write_campaign(found, kept(found, tmp_path)).read_text(encoding="utf-8")
    assert (tmp_path / "campaign.html").is_file()
    # A model that did not come about costs the other 20 mm, and one of six decides nothing.
    assert "<h1>not told apart: dp 3.07, &lt;ours&gt; " in page
    assert "less than" not in page[page.index("<h1>") : page.index("</h1>")]
    assert "Failed: &lt;ours&gt; 1." in page and "dp takes 0.500 times the energy of &lt;ours&gt;." in page
    assert page.count('class="photo"') == 2 and page.count('class="views"') == 1 and "No model" in page
    assert "first &lt;try&gt;" in page and "<try>" not in page and "<ours>" not in page
    assert "http" not in page.replace("http://www.w3.org", "").replace("https://www.w3.org", "")


def test_several_worlds_are_counted_in_the_headline(tmp_path):
    """In how many of them the first is told apart from the next best."""
    page = campaign_page(campaign(seeds=6, worlds=("mud", "reef"), lost=False), tmp_path)
    assert (
        "&lt;ours&gt; is ahead of the next best in 2 of 2 settings (mm RMSE of the model), preliminary (n &lt; 20)."
        in page
    )


@pytest.mark.parametrize(("seeds", "words"), [(1, "One pair somewhere"), (3, "3 pairs somewhere")])
def test_few_trials_are_cautioned(tmp_path, seeds, words):
    """A page of one pair says that it decides nothing."""
    page = campaign_page(campaign(seeds=seeds), tmp_path)
    assert words in page


def test_what_is_not_finished_or_not_there_is_said(tmp_path):
    """Waiting trials, no pictures, nothing to compare."""
    assert "Not finished" in campaign_page(campaign(waiting=2), tmp_path)
    assert "they are kept of trials of" in campaign_page(campaign(), tmp_path)
    empty = campaign_page(campaign(seeds=0, names=("dp",)), tmp_path)
    assert "No trials that can be compared have ended yet." in empty


def test_a_campaign_of_hovers_says_so(tmp_path):
    """Flights that end before their first leg tell of the settling hover alone."""
    found = campaign()
    assert "Hover only" not in campaign_page(found, tmp_path)
    hovers = tuple(replace(one, figures=dict(one.figures) | {"hover_only": 1.0}) for one in found.made)
    page = campaign_page(replace(found, made=hovers), tmp_path)
    assert "Hover only: all flights ended before the first leg (duration_s)." in page
    some = campaign_page(replace(found, made=(*hovers[:1], *found.made[1:])), tmp_path)
    assert "Hover only: 1 of 12 flights" in some


def test_vehicles_are_compared_like_methods(tmp_path):
    """Whatever differs; each has a colour of its own."""
    page = campaign_page(campaign(factor="vehicle", names=("heavy", "vectored6"), lost=False), tmp_path)
    assert "vectored6: " in page and "than heavy (" in page
