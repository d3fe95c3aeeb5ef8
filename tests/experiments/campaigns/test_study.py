"""A study lists its own trials; a campaign's folder keeps them by what is flown and by what flies them."""

import cheap
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns import Task, study
from wakewise.experiments.campaigns.definition import FLIGHT_SOURCES, MODEL_SOURCES, read_plan
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.study import (
    flight_trial,
    missing,
    run_study,
    selected,
    store_folder,
    study_trial,
)
from wakewise.experiments.campaigns.table import group_table, results
from wakewise.experiments.trials import BenchOptions

ADD, REFUSE = f"{cheap.__name__}:add", f"{cheap.__name__}:refuse"


@pytest.fixture(autouse=True)
def no_kernels(monkeypatch):
    monkeypatch.setattr(study, "compile_kernels", lambda **_: None)


def trials(seeds, work=ADD):
    """A trial for each seed, known by world, method and seed."""
    return {
        ("a", "b", seed): study_trial(
            "a", "b", seed, Task(name=f"b/{seed}", work=work, settings={"seed": seed}, sources=())
        )
        for seed in seeds
    }


def test_trials_are_kept_by_what_was_made(tmp_path):
    """The same trial is found again as it was, another is not, and `fresh` makes it anew; nonsense counts as
    missing.
    """
    folder, options = tmp_path / "c", BenchOptions(workers=1)
    one = trials((1,))
    key = ("a", "b", 1)
    assert missing(one, folder, options) == [key]
    first = run_study("s", one, folder, options)
    assert first.rows == {key: {"twice": 2.0}} and not first.failures and not first.known
    assert missing(one, folder, options) == [] and missing(trials((2,)), folder, options) == [("a", "b", 2)]
    assert run_study("s", one, folder, options).known == {key}
    assert run_study("s", one, folder, BenchOptions(workers=1, fresh=True)).counts["flown"] == 1
    (open_store(folder).place(one[key].task.key) / "figures.json").write_text("[1, 2")
    assert missing(one, folder, options) == [key]


def test_failures_are_named_and_the_folder_is_a_campaigns(tmp_path):
    """Its status and its table are those of `wakewise campaign`."""
    made = run_study("s", trials((1,)) | trials((2,), REFUSE), tmp_path, BenchOptions(workers=1))
    assert made.counts["failures"] == [
        {"flow": "a", "name": "b", "seed": 2, "reason": "ZeroDivisionError: nothing to share"}
    ]
    assert made.part([("a", "b", 1)]).counts == {"flights": 1, "flown": 1, "failed": 0, "failures": []}
    assert read_plan(tmp_path).name == "s"
    (row,) = group_table(results(tmp_path), by=("world", "method"), figures=("twice",))
    assert (row["done"], row["failed"], row["figures"]["twice"]["mean"]) == (1, 1, 2.0)


def test_what_flies_is_part_of_a_flight():
    """Flights and models name the parts of the package that can change them; a study names its own."""
    assert set(FLIGHT_SOURCES) < set(MODEL_SOURCES)
    task = flight_trial("w", "dp", 1, {"method": "dp"}, sources=("wakewise:core",)).task
    assert task.sources == (*FLIGHT_SOURCES, "wakewise:core") and len(task.key) == 32
    with pytest.raises(InputError, match="no package 'nowhere'"):
        _ = flight_trial("w", "dp", 1, {"method": "dp"}, sources=("nowhere:a.py",)).task.key


def test_names_are_refused_with_those_that_there_are():
    """In the order of what is allowed."""
    assert selected("methods", ("b", "a"), ("a", "b", "c")) == ("a", "b") and selected("x", None, ("a",)) == ("a",)
    with pytest.raises(InputError, match="methods: 'd' is not known, allowed: a, b"):
        selected("methods", ("d",), ("a", "b"))


def test_the_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    """XDG_CACHE_HOME is where users say that caches go."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store_folder("gentle").is_relative_to(tmp_path)
