"""Which trials a table is made of."""

import json

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.flights import scenario_of
from wakewise.experiments.campaigns.task import function_named
from wakewise_paper.reproduction.claim import TABLES
from wakewise_paper.reproduction.table_trials import (
    APPROACHES,
    COMPARED,
    CORALS,
    NOWHERE,
    OWN,
    TABLE,
    TableRequest,
    blocks_of,
)


@pytest.mark.parametrize("name", list(TABLES))
def test_a_block_has_all_methods_on_one_seed_at_one_target_in_one_world(name):
    """So that what is compared met the same water."""
    for block in blocks_of(name, TableRequest(trials=2)):
        assert len({(plan.world, plan.target, plan.seed) for plan in block}) == 1
        assert tuple(plan.method for plan in block) == TABLE[name].methods
        assert len({plan.task.key for plan in block}) == len(
            {json.dumps(plan.task.settings, sort_keys=True) for plan in block}
        )


@pytest.mark.parametrize("name", list(TABLES))
def test_the_work_of_a_trial_is_there_and_its_settings_are_a_scenario(name):
    """What would fail in a worker fails here: fields, methods, vehicles and targets by name."""
    for block in blocks_of(name, TableRequest(trials=1)):
        for plan in block:
            assert callable(function_named(plan.task.work))
            if "scenario" in plan.task.settings:
                scenario_of(plan.task.settings)


def test_more_trials_add_to_what_was_there():
    """The first seed's trials are the same whether two or three seeds are asked for."""
    few = [plan.task.key for block in blocks_of("station", TableRequest(trials=2)) for plan in block]
    more = [plan.task.key for block in blocks_of("station", TableRequest(trials=3)) for plan in block]
    assert more[: len(few)] == few and len(more) > len(few)
    assert len(set(more)) == len(more)


def test_worlds_and_targets_take_turns():
    """A budget that ends early has been to every world."""
    blocks = list(blocks_of("dynamic", TableRequest(trials=1)))
    assert [(block[0].world, block[0].target) for block in blocks] == [
        ("pump-tank", CORALS[0]),
        ("payload", OWN),
        ("sheltered", OWN),
        ("pump-tank", CORALS[1]),
        ("pump-tank", CORALS[2]),
    ]


@pytest.mark.slow
def test_other_worlds_are_flown_on_each_third_seed():
    """So that a budget buys pairs in the paper's own set-up; alone, another world is flown on every seed."""

    def seeds(world, **request):
        blocks = blocks_of("success", TableRequest(trials=7, **request))
        return [block[0].seed for block in blocks if block[0].world == world]

    assert seeds("pump-tank") == [3001, 3002, 3003, 3004, 3005, 3006, 3007]
    assert seeds("payload") == seeds("sheltered") == [3001, 3004, 3007]
    assert seeds("payload", worlds=("payload",), first_seed=5) == [5, 6, 7, 8, 9, 10, 11]


def test_tables_share_the_scans_that_they_have_in_common():
    """A scan of one method, world, coral and seed is made once, whatever tables show it."""

    def keys(table, method):
        blocks = blocks_of(table, TableRequest(trials=1, worlds=("pump-tank",)))
        return {plan.task.key for block in blocks for plan in block if plan.method == method}

    assert keys("ablation", "mpc") == keys("dynamic", "mpc")
    assert keys("sediment", "wake-aware") < keys("dynamic", "wake-aware")
    assert not keys("ablation", "linear") & keys("dynamic", "wake-aware")


def test_silt_has_the_same_coral_and_method_in_clear_water_beside_it():
    """What differs is the silt alone."""
    clear, silted, _ = blocks_of("sediment", TableRequest(trials=1))
    fields = [dict(block[0].task.settings["scenario"]) for block in (clear, silted)]
    assert fields[1].pop("tank.silt.kind") == "caco3-50mg"
    assert fields[0] == fields[1] and (clear[0].world, silted[0].world) == ("pump-tank", "caco3")


def test_requests_narrow_a_table():
    """Worlds, methods and targets by name; what cannot be flown in the world of nothing stays."""
    request = TableRequest(trials=1, worlds=("reef",), methods=("mpc-smooth",), targets=("plate",))
    (block,) = blocks_of("dynamic", request)
    assert [(plan.world, plan.method, plan.target) for plan in block] == [("reef", "mpc-smooth", "plate")]
    (solver,) = blocks_of("solver", TableRequest(trials=5, worlds=("reef",)))
    assert solver[0].world == NOWHERE


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (TableRequest(trials=1, worlds=("atlantis",)), "--world: 'atlantis'"),
        (TableRequest(trials=1, methods=("magic",)), "--methods: 'magic'"),
        (TableRequest(trials=1, targets=("unicorn",)), "--targets: 'unicorn'.*brain"),
    ],
)
def test_an_unknown_name_is_refused_with_what_would_do(asked, words):
    """Before anything is flown."""
    with pytest.raises(InputError, match=words):
        blocks_of("station", asked)


def test_the_varied_missions_of_success_are_drawn_by_the_seed_alone():
    """Both methods fly the same mission, and another seed another one."""
    first, second = blocks_of("success", TableRequest(trials=2, worlds=("pump-tank",)))
    missions = [
        [{k: v for k, v in plan.task.settings["scenario"].items() if k.startswith("mission.")} for plan in block]
        for block in (first, second)
    ]
    assert missions[0][0] == missions[0][1] != missions[1][0]


def test_no_approach_bears_the_name_of_a_method():
    """Both are rows of one table."""
    assert not set(APPROACHES) & set(COMPARED)
