"""Laws of what a page says of its water: a flight in the tank has the table, misses first, others a sentence."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from markupsafe import escape

from wakewise.operation.worlds.makers import WORLDS
from wakewise.simulation.tank.validation_limits import ABSENT, LIMITS
from wakewise.ui.reports.compare import comparison_page
from wakewise.ui.reports.references import limits_section
from wakewise.ui.reports.trial import Trial, read_trial

pytestmark = pytest.mark.usefixtures("undrawn")


def flown(folder: Path, **fields: object) -> Trial:
    """A trial of which only figures and scenario are left."""
    folder.mkdir()
    (folder / "metrics.json").write_text('{"duration_s": 1.0}')
    (folder / "scenario.yaml").write_text(yaml.safe_dump({"seed": 1, "vehicle": "paper", **fields}))
    return read_trial(folder)


def test_the_report_tells_every_law_and_misses_first(report_text: str) -> None:
    """Each law with what is asked, reached and meant; each is marked by a word, and no kept one stands above a miss."""
    part = report_text[report_text.index('id="limits"') : report_text.index('id="figures"')]
    assert "What the tank gets wrong" in part
    assert '<a href="#limits">' in report_text
    rows = re.findall(r"<tr><td>.*?</tr>", part)
    assert len(rows) == len(LIMITS)
    marks = [re.findall(r">(missed|kept)<", row) for row in rows]
    missed = sum(not limit.met for limit in LIMITS)
    assert marks == [["missed"]] * missed + [["kept"]] * (len(LIMITS) - missed)
    assert f"{missed} of {len(LIMITS)} missed" in part
    for limit in LIMITS:
        (row,) = (row for row in rows if f"<b>{escape(limit.name)}</b>" in row)
        assert ("missed" in row) is not limit.met
        ends = (f"{limit.asked[0]:.3g} to {limit.asked[1]:.3g}", f"{limit.reached[0]:.3g} to {limit.reached[1]:.3g}")
        for words in (limit.law, limit.source, limit.means, *ends):
            assert escape(words) in row
    assert all(f"<li>{escape(line)}</li>" in part for line in ABSENT)


@pytest.mark.parametrize(
    ("flow", "word"), [("paper", "circular"), ("lattice", "large-eddy"), ("lattice-jets", "answers thrust at once")]
)
def test_another_water_has_one_sentence_and_not_the_tanks_table(tmp_path: Path, flow: str, word: str) -> None:
    """Laws of the tank say nothing of water that is not the tank's, be it named as the world or put in its place."""
    for i, fields in enumerate(({"world": flow}, {"world": "mud", "flow": flow})):
        text = limits_section({"one": flown(tmp_path / str(i), **fields)})
        assert word in text
        assert "What this water gets wrong" in text
        assert "<table" not in text


def test_every_water_of_ours_has_its_words(tmp_path: Path) -> None:
    """A new flow cannot be forgotten here."""
    texts = {limits_section({"one": flown(tmp_path / flow, world=flow)}) for flow in WORLDS}
    assert len(texts) == len(WORLDS)
    assert not any("outside" in text for text in texts)


def test_a_named_world_is_told_by_its_water(tmp_path: Path) -> None:
    """`payload` is flown in the tank's water and has the tank's table."""
    assert "<table" in limits_section({"one": flown(tmp_path / "a", world="payload")})


def test_a_world_from_outside_is_not_vouched_for(tmp_path: Path) -> None:
    """Given in Python or named, it is its maker's to judge, even if it calls itself as a world of ours does."""
    given = flown(tmp_path / "a", world="still-tank", overrides={"world": "still-tank (lab.<b>.Pool)"})
    named = flown(tmp_path / "b", world="lab.water:pool")
    for trial, name in ((given, "lab.&lt;b&gt;.Pool"), (named, "lab.water:pool")):
        text = limits_section({"one": trial})
        assert "came from outside" in text
        assert name in text
        assert "<table" not in text


def test_an_unknown_water_is_called_unknown(tmp_path: Path) -> None:
    """Without a scenario that can be read nothing is said of its laws."""
    text = limits_section({"one": flown(tmp_path / "a", world="no-such-water")})
    assert "cannot be shown: no scenario that can be read" in text
    assert "<table" not in text


def test_a_comparison_tells_each_water_once_and_whose_it_was(tmp_path: Path) -> None:
    """Two flights in the tank share one table without names; beside the paper's water each is named."""
    tank = flown(tmp_path / "a", world="tank")
    other = flown(tmp_path / "b", world="reef")
    paper = flown(tmp_path / "c", world="paper")
    same = limits_section({"dp": tank, "wake-aware": other})
    assert same.count("<table") == 1
    assert "sheet-leg" not in same
    mixed = comparison_page({"dp": tank, "wake-aware": other, "mpc-smooth": paper})
    part = mixed[mixed.index('id="limits"') : mixed.index('id="figures"')]
    assert re.findall(r'<p class="sheet-leg">([^<]+)</p>', part) == ["dp, wake-aware", "mpc-smooth"]
    assert part.count("<table") == 1
    assert "circular" in part
