"""Tables made from trials, within a budget or not; the campaign itself is stood in for."""

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.store import open_store, write_figures
from wakewise.experiments.campaigns.task import TrialOutcome
from wakewise_paper.reproduction import run as module
from wakewise_paper.reproduction.run import ReproduceOptions, reproduce
from wakewise_paper.reproduction.table_trials import TableRequest, blocks_of


@pytest.fixture
def campaign(monkeypatch):
    """Trials that take ten seconds each of a clock of their own, and what was asked for in each call."""
    clock, calls, known = {"now": 0.0}, [], {}

    def run(tasks, folder, engine, progress, **options):
        calls.append([task.name for task in tasks])
        progress(0, len(tasks), "a while left")
        outcomes = []
        for task in tasks:
            if task.key not in known:
                clock["now"] += 10.0 / engine.workers
                known[task.key] = {"target_speed_mean_m_s": 0.01, "position_rmse_mm": 2.0, "energy_kJ": 1.0}
            outcomes.append(TrialOutcome(task=task, figures=known[task.key], attempts=1, took_s=10.0))
        return outcomes

    monkeypatch.setattr(module, "run_campaign", run)
    monkeypatch.setattr(module, "compile_kernels", lambda **_: None)
    monkeypatch.setattr(module.time, "monotonic", lambda: clock["now"])
    return calls


FIVE = ("manual", "dp", "mpc", "mpc-smooth", "wake-aware")
"""Methods of the station's table, those of tests."""


def test_without_a_budget_all_trials_are_made_at_once(tmp_path, campaign):
    """So that workers are busy to the end."""
    options = ReproduceOptions(trials=2, worlds=("pump-tank",), methods=FIVE)
    told = reproduce(["station"], tmp_path, options)["station"]
    assert [len(call) for call in campaign] == [10]
    assert (told["trials"], told["seeds"], told["made"], told["failed"]) == (2, [3001, 3002], 10, 0)
    assert {row["method"] for row in told["rows"]} == set(FIVE)


def test_a_budget_buys_whole_blocks_by_what_they_were_found_to_cost(tmp_path, campaign):
    """A hundred seconds with two workers hold 20 trials of ten, of which a tenth is kept back: three blocks of five."""
    said = []
    options = ReproduceOptions(
        budget_s=100.0, worlds=("pump-tank",), methods=FIVE, progress=lambda *words: said.append(words[2])
    )
    told = reproduce(["station"], tmp_path, options)["station"]
    assert [len(call) for call in campaign] == [5, 15]
    assert (told["made"], told["seeds"]) == (15, [3001, 3002, 3003])
    assert said[-2:] == ["the first block of each table: a while left", "a while left"]


def test_a_budget_is_shared_by_time_spent(tmp_path, campaign):
    """Two tables whose blocks cost alike get as many; one with no room says so."""
    told = reproduce(["field", "flow", "dynamic"], tmp_path, ReproduceOptions(budget_s=160.0, worlds=("pump-tank",)))
    assert told["dynamic"]["rows"] == [] and "no room" in told["dynamic"]["why"]["rows"]
    spent = [10.0 * told[name]["made"] for name in ("field", "flow")]
    assert abs(spent[0] - spent[1]) <= 40.0 and sum(spent) >= 200.0


def test_a_budget_that_is_spent_shows_all_that_is_known(tmp_path, campaign, monkeypatch):
    """What an earlier run made costs nothing, however late it is: as when pages are written without a flight."""
    for block in blocks_of("station", TableRequest(trials=3, worlds=("pump-tank",))):
        for plan in block:
            place = open_store(tmp_path).place(plan.task.key)
            place.mkdir()
            write_figures(place, {"energy_kJ": 1.0}, 9.0)
    clock = iter(range(0, 10000, 10))
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(clock)))
    options = ReproduceOptions(budget_s=1.0, worlds=("pump-tank",))
    told = reproduce(["station", "flow"], tmp_path, options)
    assert told["station"]["seeds"] == [3001, 3002, 3003] and "no room" in told["flow"]["why"]["rows"]


def test_a_trial_that_two_tables_share_is_paid_once(tmp_path, campaign):
    """650 s of two workers hold 500 of dynamic and half of ablation's 200: the other half is dynamic's already."""
    options = ReproduceOptions(budget_s=360.0, worlds=("pump-tank",), targets=("brain",))
    told = reproduce(["dynamic", "ablation"], tmp_path, options)
    assert told["ablation"]["why"] == {} and told["ablation"]["made"] >= 4
    assert len(campaign[0]) == 9
    with_success = reproduce(["dynamic", "success"], tmp_path / "other", options)
    assert "no room" in with_success["success"]["why"]["rows"]


def test_the_same_trials_have_the_same_configuration(tmp_path, campaign):
    """And others another."""
    hashes = [
        reproduce(["station"], tmp_path, ReproduceOptions(trials=n, worlds=("pump-tank",)))["station"]["config_hash"]
        for n in (1, 1, 2)
    ]
    assert hashes[0] == hashes[1] != hashes[2]


def test_methods_of_one_table_do_not_hinder_another(tmp_path, campaign):
    """What a table does not have it ignores, unless it has none of them."""
    options = ReproduceOptions(trials=1, worlds=("pump-tank",), methods=("dp", "mpc", "linear"))
    told = reproduce(["station", "ablation"], tmp_path, options)
    assert told["station"]["methods"] == ["dp", "mpc"] and told["ablation"]["methods"] == ["mpc", "linear"]
    with pytest.raises(InputError, match="--methods"):
        reproduce(["station"], tmp_path, ReproduceOptions(methods=("magic",)))


@pytest.mark.parametrize(
    ("names", "methods", "words"),
    [
        (["station"], ("dp", "linear"), "--methods: 'linear' is not in table station, allowed: manual, manual-careful"),
        (["flow", "field"], ("dp", "linear"), "'linear' is not in any of the tables flow, field, allowed: dp, mpc"),
        (["station", "ablation"], ("linear",), "--methods: 'linear' is not in table station, allowed: manual"),
        (["solver"], ("dp",), "--methods: 'dp' is not in table solver, it has no methods"),
    ],
)
def test_a_method_that_does_not_fit_the_tables_is_refused_beside_one_that_does(
    tmp_path, campaign, names, methods, words
):
    """What is wrong, where, and what would be right; nothing is made."""
    with pytest.raises(InputError, match=words):
        reproduce(names, tmp_path / "new", ReproduceOptions(methods=methods))
    assert not (tmp_path / "new").exists() and campaign == []


@pytest.mark.parametrize("options", [{"trials": 0}, {"budget_s": 0.0}])
def test_what_cannot_be_is_refused(options):
    """No trials, no time."""
    with pytest.raises(InputError):
        ReproduceOptions(**options)


def test_an_unknown_table_is_refused_with_what_there_is(tmp_path):
    """Before anything is made."""
    with pytest.raises(InputError, match="allowed: dynamic"):
        reproduce(["quantum"], tmp_path, ReproduceOptions())
    assert list(tmp_path.iterdir()) == []


def test_a_part_of_a_block_that_an_earlier_run_made_is_shown(tmp_path, campaign):
    """Though there is no room for the rest of it; a table of which nothing was made says why."""
    block = next(blocks_of("dynamic", TableRequest(trials=1, worlds=("pump-tank",))))
    place = open_store(tmp_path).place(block[-1].task.key)
    place.mkdir()
    write_figures(place, {"rmse_mm": 1.0}, 9.0)
    told = reproduce(["dynamic", "success"], tmp_path, ReproduceOptions(budget_s=20.0, worlds=("pump-tank",)))
    assert told["dynamic"]["why"] == {} and told["dynamic"]["rows"]
    assert "no room" in told["success"]["why"]["rows"] and not told["success"]["rows"]
