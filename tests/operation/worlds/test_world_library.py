"""Worlds by name."""

import json

import pytest

from wakewise.core.errors import InputError
from wakewise.operation import Scenario, load_scenario, read_scenario
from wakewise.operation.scenario import dump_scenario
from wakewise.operation.worlds import library
from wakewise.operation.worlds.library import load_world, parse_world, world_names
from wakewise.ui.cli.main import run


@pytest.mark.slow
@pytest.mark.parametrize("name", world_names())
def test_every_world_is_a_scenario_that_can_begin(name):
    """It passes what is checked before a flight, with the presets' vehicle and mission; what seeds draw is allowed."""
    scenario = Scenario.preset("quick", world=name, **{"target.points": 60})  # drawing 300 takes seconds
    parts = scenario.parts()
    assert parts.preflight.clearance_m >= parts.scenario.mission.clearance_m
    assert parts.world.begin()[1] is not None
    drawn = [scenario.replace(seed=seed).drawn() for seed in range(20)]
    assert len({one.tank.jets.half_width_growth for one in drawn}) == 20


@pytest.mark.parametrize("name", world_names())
def test_every_number_of_a_world_has_a_source(name):
    """A work that can be looked up, the paper, arithmetic on stated figures, or the word estimate with its reason."""
    for field in load_world(name).file.fields.values():
        assert len(field.source.split()) >= 3


def test_worlds_differ_by_seed_and_not_by_method():
    """Seeds draw their own worlds; on one seed two methods meet the same."""

    def tanks(seed, method):
        return Scenario.preset("quick", world="payload", seed=seed, method=method).parts().scenario.tank

    assert tanks(1, "dp") == tanks(1, "wake-aware") != tanks(2, "dp")


def test_a_world_lies_over_the_preset_and_under_what_the_user_says(tmp_path):
    """A file's value ends the world's draw of that field and leaves the others."""
    path = tmp_path / "mine.yaml"
    path.write_text("world: payload\ntank: {mismatch: {trim_N: 0.5}}\n")
    scenario = load_scenario("quick", path, {})
    drawn = set(load_world("payload").randomize)
    assert scenario.tank.mismatch.trim_N == 0.5 and set(scenario.randomize) == drawn - {"tank.mismatch.trim_N"}
    assert load_scenario("quick", path, {"world": "still-tank"}).tank.current.velocity_m_s == (0.0, 0.0, 0.0)


def test_leaving_a_world_leaves_nothing_of_it_behind():
    """Another world's values and draws take the place of the first's; what the user said stays."""
    there = Scenario.preset("quick", world="close", seed=9)
    assert there.replace(world="payload") == Scenario.preset("quick", world="payload", seed=9)
    assert there.replace(world="tank") == Scenario.preset("quick", world="tank", seed=9)


def test_a_trial_holds_the_world_that_was_flown_in_numbers(tmp_path):
    """What was drawn is read back as it was, with the world's name and without a draw; so it is through the loader."""
    flown = Scenario.preset("quick", world="payload", seed=4).parts().scenario
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(flown))
    assert read_scenario(path) == flown and flown.world == "payload"
    assert load_scenario(None, path, {}).drawn() == flown


def test_the_water_of_a_world_can_be_another():
    """`flow` takes the place of the world's own water and leaves the rest."""
    scenario = Scenario.preset("quick", world="payload", **{"target.elasticity": "none"})
    assert scenario.flow_name == "tank" and scenario.replace(flow="paper").flow_name == "paper"
    assert scenario.replace(flow="paper").parts().world.name == "paper"
    with pytest.raises(InputError, match="flow: 'paper' holds its target still"):
        _ = Scenario.preset("quick", world="payload", flow="paper").parts().world
    with pytest.raises(InputError, match=r"flow: found 'papr'.*did you mean paper"):
        scenario.replace(flow="papr")


def test_a_world_that_is_none_is_refused():
    """In one line with what is near, from Python and from the command."""
    with pytest.raises(InputError, match="world: found 'paylod', did you mean payload"):
        Scenario.preset("quick", world="paylod")
    with pytest.raises(InputError, match="world 'paylod': not in the library, did you mean payload"):
        load_world("paylod")
    with pytest.raises(InputError, match=r"world w: fields\.a\.source"):
        parse_world("w", "title: abc\nwhy: nobody knows why it is\nfields: {a: {value: 1}}")
    with pytest.raises(InputError, match=r"world w: fields\.a: gives value and randomize or neither"):
        parse_world("w", "title: abc\nwhy: nobody knows why it is\nfields: {a: {source: a book}}")


def test_the_command_shows_a_world_and_what_a_seed_draws(capsys):
    """Names, reasons, sources; the drawn numbers are those that are flown."""
    assert run(["world", "list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert {row["name"] for row in listed["worlds"]} == set(world_names()) and listed["default_world"]
    assert run(["world", "show", "payload", "--seed", "3", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    flown = Scenario.preset("quick", world="payload", seed=3).parts().scenario
    assert shown["fields"]["tank.mismatch.trim_N"]["drawn"] == flown.tank.mismatch.trim_N
    assert run(["world", "show", "payload"]) == 0
    assert "-5 to -2" in capsys.readouterr().out
    assert run(["world", "show", "nowhere"]) == 2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("title: abc\nseed: 1\nseed: 2\n", "world lagoon line 3: not YAML .*more than once"),
        ("title: [abc\n", "world lagoon.*: not YAML"),
    ],
)
def test_a_file_that_is_no_yaml_is_refused_in_one_line(text: str, reason: str) -> None:
    """With the world's name and the line, as that of a scenario is."""
    with pytest.raises(InputError, match=reason):
        parse_world("lagoon", text)


def test_a_field_that_no_scenario_has_is_refused_when_the_world_is_shown(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """`wakewise world show` is the check of a new world: exit code 2 and the field, as a flight would say it."""
    text = library._text("reef").replace("tank.waves.amplitude_m:", "tank.waves.amplitude:")
    whole = library._text
    monkeypatch.setattr(library, "_text", lambda name: text if name == "reef" else whole(name))
    load_world.cache_clear()
    try:
        assert run(["world", "show", "reef"]) == 2
    finally:
        load_world.cache_clear()
    told = capfd.readouterr()
    assert told.out == "" and told.err.startswith("wakewise: world reef: ") and "amplitude" in told.err
