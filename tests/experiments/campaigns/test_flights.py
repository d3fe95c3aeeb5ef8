"""A flight of a campaign: setup functions change its parts, probes watch it and add figures."""

import re
import sys
from pathlib import Path

import polars as pl
import pytest
import yaml

from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.campaigns.definition import check_campaign, planned_trials
from wakewise.experiments.campaigns.flights import FlightProbe, flight_parts, fly_stage, settled

PAGE = (Path(__file__).parents[3] / "docs" / "campaigns.md").read_text(encoding="utf-8")
SECTION = PAGE[PAGE.index("## A study of your own") :]


@pytest.fixture
def study(tmp_path, monkeypatch):
    """The study of docs/campaigns.md, in the working folder, one trial and a second long."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "hover.py").write_text(re.search(r"```python\n(.*?)```", SECTION, re.S)[1])
    told = yaml.safe_load(re.search(r"```yaml\n(.*?)```", SECTION, re.S)[1])
    return told | {"methods": ["dp"], "worlds": ["payload"], "seeds": 1, "duration_s": 1.0}


def test_the_study_of_the_page_is_planned_and_flown(study, tmp_path):
    """Its setup moves the start, its probe's figure stands beside the flight's own, and its file is in the key."""
    (trial,) = planned_trials(check_campaign(study))
    parts, gathered = flight_parts(trial.task.settings)
    plain, _ = flight_parts(trial.task.settings | {"setup": {}})
    assert parts.start.X_WB.p_m - plain.start.X_WB.p_m == pytest.approx([0.1, 0.0, 0.0]) and gathered == {}
    figures = fly_stage(trial.task.settings, tmp_path, no_progress)
    assert figures["within_2cm_s"] is None and figures["energy_kJ"] > 0.0
    assert figures["hover_only"] == 1.0  # a second is less than the settling hover
    assert (tmp_path / "steps.parquet").is_file()
    (tmp_path / "hover.py").write_text((tmp_path / "hover.py").read_text() + "# changed\n")
    (again,) = planned_trials(check_campaign(study))
    assert again.task.key != trial.task.key


def test_what_cannot_be_loaded_is_refused_before_anything_is_flown(study):
    """In a line; setup and probes are of flights alone."""
    with pytest.raises(InputError, match=r"'hover:nothing'.*cannot be loaded"):
        planned_trials(check_campaign(study | {"probes": {"hover:nothing": {}}}))
    for given, words in (({"north": 0.1}, "'?north"), ({}, "'north_m'")):
        with pytest.raises(InputError, match=f"hover:shifted: .*{words}"):
            planned_trials(check_campaign(study | {"setup": {"hover:shifted": given}}))
    with pytest.raises(InputError, match=r"hover:Settling: .*'within_m'"):
        planned_trials(check_campaign(study | {"probes": {"hover:Settling": {"within_m": 0.02}}}))
    with pytest.raises(InputError, match=r"method dp.*duration_s: 0\.001, must be at least"):
        planned_trials(check_campaign(study | {"duration_s": 0.001}))
    with pytest.raises(InputError, match="of `stages: fly`"):
        check_campaign(study | {"stages": "model"})


def test_a_setup_that_gives_no_parts_is_refused(study):
    """What it gave is named."""
    (trial,) = planned_trials(check_campaign(study))
    with pytest.raises(InputError, match="gave str, must give the parts of a flight"):
        flight_parts(trial.task.settings | {"setup": {f"{__name__}:wrong": {}}})


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("setup hover:boom", "ValueError: a b"),
        ("setup hover:none", "gave far ndarray"),
        ("probe hover:Made", "KeyError: 'x'"),
        ("probe hover:Stepped", "ZeroDivisionError: division by zero"),
        ("probe hover:Ended", "gave NoneType; must give figures by name, each a number, a word or None"),
        ("probe hover:Array", "gave mean ndarray; must give figures by name, each a number, a word or None"),
        ("probe hover:Bare", "gave ndarray; must give figures by name"),
        ("probe hover:Energy", "gave energy_kJ, hover_only, which are there already; give other names"),
    ],
)
def test_a_setup_or_probe_that_fails_is_named(study, tmp_path, part, words):
    """In one line, with what is needed."""
    (tmp_path / "hover.py").write_text((tmp_path / "hover.py").read_text() + _FAILING)
    sys.modules.pop("hover", None)
    kind, name = part.split()
    (trial,) = planned_trials(check_campaign(study | {"setup": {}, "probes": {}}))
    settings = trial.task.settings | {"duration_s": 0.2, {"setup": "setup", "probe": "probes"}[kind]: {name: {}}}
    with pytest.raises(InputError) as fault:
        fly_stage(settings, tmp_path, no_progress)
    assert str(fault.value).startswith(f"{part}: {words}")
    assert "\n" not in str(fault.value)


_FAILING = """

def boom(parts):
    raise ValueError("a\\nb")


def none(parts):
    return parts, {"far": np.zeros(3)}


class Made(FlightProbe):
    def __init__(self, parts, folder):
        {}["x"]


class Stepped(FlightProbe):
    def step(self, step, truth_provider):
        1 / 0


class Ended(FlightProbe):
    def figures(self, steps):
        pass


class Array(FlightProbe):
    def figures(self, steps):
        return {"mean": np.zeros(2), "last": np.float32(1.0), "word": "a", "none": None}


class Bare(FlightProbe):
    def figures(self, steps):
        return np.zeros(2)


class Energy(FlightProbe):
    def figures(self, steps):
        return {"hover_only": 0.0, "energy_kJ": 0.0, "own": 1.0}
"""


def test_a_name_without_a_function_says_what_it_is_for(study):
    """A setup or a probe."""
    for kind, field in (("setup", "setup"), ("probe", "probes")):
        with pytest.raises(InputError, match=f"^campaign: {kind} 'hover': must be package.module:name"):
            planned_trials(check_campaign(study | {field: {"hover": {}}}))


def wrong(parts):
    """No parts."""
    return "nothing"


def test_a_plain_probe_adds_nothing(study):
    """Steps before the first leg are left out of what is judged."""
    (trial,) = planned_trials(check_campaign(study))
    parts, _ = flight_parts(trial.task.settings)
    probe = FlightProbe(parts, Path())
    steps = pl.DataFrame({"leg": ["settle", "orbit"]})
    assert probe.figures(steps) == {} and settled(steps)["leg"].to_list() == ["orbit"]
    assert settled(steps[:1]).height == 1
