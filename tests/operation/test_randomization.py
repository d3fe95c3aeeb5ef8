"""Fields that a seed draws."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.operation import Scenario, load_scenario
from wakewise.operation.scenario.randomization import FieldDistribution, sample_fields

TRIM = "tank.mismatch.trim_N"


def test_a_draw_lies_where_it_says():
    """Numbers between their ends, sizes of vectors too, choices among those listed; log_uniform halves at the
    middle.
    """
    rng = np.random.default_rng(0)
    values = [FieldDistribution(uniform=(2.0, 5.0)).value(rng) for _ in range(300)]
    assert 2.0 <= min(values) < 2.1 and 4.9 < max(values) <= 5.0
    logs = np.array([FieldDistribution(log_uniform=(0.01, 1.0)).value(rng) for _ in range(400)])
    assert np.mean(logs < 0.1) == pytest.approx(0.5, abs=0.1)
    vectors = np.array([FieldDistribution(horizontal=(0.1, 0.3)).value(rng) for _ in range(300)])
    sizes = np.linalg.norm(vectors, axis=1)
    assert sizes.min() > 0.0999 and sizes.max() < 0.3001 and not vectors[:, 2].any()
    assert np.abs(vectors.mean(axis=0)).max() < 0.03  # to any side
    assert {FieldDistribution(choice=("mud", "sand")).value(rng) for _ in range(50)} == {"mud", "sand"}


def test_a_seed_draws_a_field_alike_whatever_else_is_drawn():
    """One more draw leaves the others what they were; another seed does not."""
    alone = sample_fields({TRIM: FieldDistribution(uniform=(0.0, 1.0))}, 3)
    beside = sample_fields({"a": FieldDistribution(uniform=(0.0, 1.0)), TRIM: FieldDistribution(uniform=(0.0, 1.0))}, 3)
    assert beside[TRIM] == alone[TRIM] != beside["a"]
    assert sample_fields({TRIM: FieldDistribution(uniform=(0.0, 1.0))}, 4) != alone


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([5.0, 2.0], "the smaller number comes first"),
        ({"log_uniform": [0.0, 1.0]}, "must be more than 0"),
        ({"horizontal": [-1.0, 1.0]}, "a size is 0 or more"),
        ({}, "gives nothing"),
        ({"uniform": [0, 1], "choice": [1]}, "gives uniform, choice"),
    ],
)
def test_a_draw_that_says_nothing_or_nonsense_is_refused(given, words):
    """In one line that names the field."""
    with pytest.raises(InputError, match=rf"randomize\.tank\.mismatch\.trim_N.*{words}"):
        load_scenario("quick", None, {"world": "tank", "randomize": {TRIM: given}})


def test_a_draw_of_no_field_is_refused():
    """A misspelt field is told of when the scenario is read, not when it is flown."""
    with pytest.raises(InputError, match=r"randomize: tank\.mismatch\.trim_n: no such field, did you mean trim_N"):
        load_scenario("quick", None, {"world": "tank", "randomize": {"tank.mismatch.trim_n": [0.0, 1.0]}})


def test_parts_fly_what_the_seed_draws_and_another_seed_draws_anew():
    """The scenario that is flown holds numbers and no draws; parts of another seed draw from where the first did."""
    scenario = Scenario.preset("quick", world="tank", randomize={TRIM: [-5.0, -2.0]})
    one = scenario.parts()
    two = one.replace(seed=scenario.seed + 1)
    trims = [parts.scenario.tank.mismatch.trim_N for parts in (one, two)]
    assert all(-5.0 <= trim <= -2.0 for trim in trims) and trims[0] != trims[1]
    assert not one.scenario.randomize and one.requested.randomize
    assert scenario.drawn() == one.scenario and one.scenario.drawn() is one.scenario


def test_what_is_said_of_a_field_ends_its_draw():
    """A value laid over a draw wins; a draw laid over a value wins; whole groups count as their fields."""
    scenario = Scenario.preset("quick", world="tank", randomize={TRIM: [-5.0, -2.0], "mission.standoff_m": [0.4, 0.5]})
    assert set(scenario.replace(**{TRIM: 1.0}).randomize) == {"mission.standoff_m"}
    assert set(scenario.replace(tank=scenario.tank).randomize) == {"mission.standoff_m"}
    other = Scenario.preset("quick", world="payload").replace(randomize={TRIM: {"choice": [1.0]}})
    assert other.drawn().tank.mismatch.trim_N == 1.0 and len(other.randomize) > 3  # another draw takes the whole place
    again = scenario.replace(**{TRIM: 1.0}).replace(randomize={TRIM: [2.0, 3.0]})
    assert 2.0 <= again.drawn().tank.mismatch.trim_N <= 3.0
