"""A campaign file says what is made, and a fault in it is told in a line before the first trial."""

from __future__ import annotations

from importlib import invalidate_caches
from pathlib import Path
from typing import Any

import pytest
import yaml

from wakewise.core.errors import InputError
from wakewise.core.settings import Settings
from wakewise.experiments.campaigns.definition import Campaign, check_campaign, example, load_campaign, planned_trials
from wakewise.experiments.campaigns.flights import scenario_of

_MINE = """
from wakewise.control import MAKERS

def make(*arguments, **more):
    return MAKERS["dp"](*arguments, **more)
"""


def _planned(**fields: Any) -> list[Any]:
    return planned_trials(check_campaign({"stages": "fly", "targets": ["branching"]} | fields))


def test_every_combination_is_a_trial_seed_by_seed() -> None:
    """Methods x targets x worlds x variations x seeds; names tell them apart, keys do, too."""
    trials = _planned(
        methods=["dp", "mpc"],
        targets=["branching", "brain"],
        worlds=["payload", "mud"],
        variations={"as-is": {}, "closer": {"mission.standoff_m": 0.45}},
        seeds=[4, 7],
    )
    assert len(trials) == 2 * 2 * 2 * 2 * 2
    assert [trial.factors["seed"] for trial in trials] == [4] * 16 + [7] * 16
    assert len({trial.task.key for trial in trials}) == len({trial.task.name for trial in trials}) == 32
    assert trials[0].task.name == "dp/branching/payload/as-is/4"


def test_a_trial_is_the_scenario_that_it_says() -> None:
    """Fields of all trials, of the target by name, of the variation; the later one wins."""
    (trial,) = _planned(
        methods="dp",
        targets={"coral-2": {"kind": "brain", "seed": 2}},
        worlds="mud",
        scenario={"mission": {"standoff_m": 0.6}, "control.rate_hz": 25},
        variations={"near": {"mission.standoff_m": 0.55}},
        seeds=[9],
    )
    scenario = scenario_of(trial.task.settings)
    assert (scenario.method, scenario.world, scenario.seed) == ("dp", "mud", 9)
    assert (scenario.target.kind, scenario.target.seed) == ("brain", 2)
    assert (scenario.mission.standoff_m, scenario.control.rate_hz) == (0.55, 25)
    assert trial.factors == {
        "method": "dp",
        "target": "coral-2",
        "world": "mud",
        "vehicle": scenario.vehicle,
        "variation": "near",
        "seed": 9,
    }


def test_a_controller_from_outside_is_flown_anew_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its source is in the trial's key; so are the bytes of a vehicle's file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "my_campaign_method.py").write_text(_MINE)
    (first,) = _planned(methods=["my_campaign_method:make"], seeds=1)
    (again,) = _planned(methods=["my_campaign_method:make"], seeds=1)
    (tmp_path / "my_campaign_method.py").write_text(_MINE + "# changed\n")
    (changed,) = _planned(methods=["my_campaign_method:make"], seeds=1)
    assert first.task.key == again.task.key != changed.task.key


def test_a_trial_with_another_detector_has_another_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bytes of a model file are in it, and the source of a module; so is that there is one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    model, module = tmp_path / "find.onnx", tmp_path / "my_campaign_detector.py"
    for file, name in ((model, "find.onnx"), (module, "my_campaign_detector:make")):
        file.write_text("make = None\n")
        keys = [
            _planned(methods=["dp"], scenario={"perception.detector": said}, seeds=1)[0].task.key
            for said in (None, name, name)
        ]
        file.write_text("make = None  # changed\n")
        (changed,) = _planned(methods=["dp"], scenario={"perception.detector": name}, seeds=1)
        assert keys[1] == keys[2]
        assert len({*keys, changed.task.key}) == 3


@pytest.mark.parametrize(
    ("file", "fields"),
    [
        ("my_campaign_pyramid.py", {"targets": ["my_campaign_pyramid:make"]}),
        ("cur.csv", {"scenario": {"tank.current.file": "cur.csv"}}),
        ("my_campaign_current.py", {"scenario": {"tank.current.file": "my_campaign_current:make"}}),
    ],
)
def test_a_target_or_current_of_ones_own_is_flown_anew_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, fields: dict[str, Any]
) -> None:
    """A module by its source, a series by its bytes; a name that leads nowhere is told before the first trial."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"^campaign: method dp, .*(no such file|cannot be loaded)"):
        _planned(methods=["dp"], seeds=1, **fields)
    texts = {
        "my_campaign_pyramid.py": "from wakewise.scene.targets import find_mesh\n\n"
        'make = lambda *_: find_mesh("branching")[1]\n',
        "cur.csv": "time_s,u,v\n0,0.01,0.0\n300,0.02,0.0\n",
        "my_campaign_current.py": "from wakewise.simulation.water import SteadyCurrent\nimport numpy as np\n\n"
        "make = lambda: SteadyCurrent(velocity_W_m_s=np.zeros(3))\n",
    }
    (tmp_path / file).write_text(texts[file])
    invalidate_caches()
    keys = [_planned(methods=["dp"], seeds=1, **fields)[0].task.key for _ in range(2)]
    (tmp_path / file).write_text(texts[file] + ("# changed\n" if file.endswith("py") else "600,0.02,0.0\n"))
    (changed,) = _planned(methods=["dp"], seeds=1, **fields)
    assert keys[0] == keys[1] != changed.task.key


def test_the_example_is_a_campaign(tmp_path: Path) -> None:
    """As it is printed."""
    path = tmp_path / "campaign.yaml"
    path.write_text(example())
    assert len(planned_trials(load_campaign(path))) == 3 * 2 * 1 * 2 * 3


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"method": ["dp"]}, "method: no such field, did you mean methods?"),
        ({"stages": "both"}, "stages: found 'both', should be 'fly' or 'model'"),
        ({"seeds": 0}, "allowed are 1 to 100000, or a list of seeds"),
        ({"seeds": [1, 1]}, "none twice"),
        ({"seeds": []}, "at least one"),
        ({"methods": ["dp", "dp"]}, "methods: 'dp' is named twice"),
        ({"timeout_s": 0}, "timeout_s: found 0, should be greater than 0"),
        ({"retries": -1}, "retries"),
        ({"name": "../../evil"}, "name: found '../../evil', names a folder, so no slash, no dot first"),
    ],
)
def test_a_fault_of_the_file_is_told_with_what_would_be_right(
    tmp_path: Path, fields: dict[str, Any], words: str
) -> None:
    """File, field, what was found."""
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(fields))
    with pytest.raises(InputError) as fault:
        load_campaign(path)
    assert str(fault.value).startswith(f"{path}: ")
    assert words in str(fault.value)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"methods": ["dp", "wake-awere"]}, "did you mean wake-aware?"),
        ({"methods": ["no_such_module:make"]}, "method 'no_such_module:make': cannot be loaded"),
        ({"worlds": ["payload", "mudd"]}, "did you mean mud?"),
        ({"targets": ["branchin"]}, "branchin"),
        ({"vehicles": ["no-such-vehicle"]}, "no-such-vehicle"),
        ({"scenario": {"mision.standoff_m": 1}}, "mision: no such field, did you mean mission?"),
        ({"variations": {"far": {"mission.standoff_m": 99}}}, "variation far"),
        ({"targets": {"a": {"kinds": "brain"}}}, "target.kinds: no such field, did you mean kind?"),
        ({"seeds": 90_000, "methods": ["dp", "mpc"]}, "180000 trials, at most 100000"),
    ],
)
def test_a_combination_that_cannot_be_flown_is_named(fields: dict[str, Any], words: str) -> None:
    """Before the first trial is made."""
    with pytest.raises(InputError) as fault:
        _planned(**fields)
    assert words in str(fault.value)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"variations": {"far": {"method": "mpc"}}}, "variation far: method must be given under methods"),
        ({"variations": {"far": {"seed": 4}}}, "variation far: seed must be given under seeds"),
        ({"variations": {"far": {"world": "mud"}}}, "variation far: world must be given under worlds"),
        ({"variations": {"far": {"vehicle": "paper"}}}, "variation far: vehicle must be given under vehicles"),
        ({"variations": {"far": {"target": {"kind": "brain"}}}}, "far: target.kind must be given under targets"),
        ({"targets": [], "variations": {"b": {"target.kind": "brain"}}}, "target.kind must be given under targets"),
        (
            {"targets": {"a": {"kind": "brain", "seed": 2}, "b": {}}, "variations": {"c": {"target.seed": 3}}},
            "variation c: target.seed must be given under targets",
        ),
        ({"scenario": {"seed": 7}}, "scenario: seed must be given under seeds"),
        ({"scenario": {"method": "mpc"}}, "scenario: method must be given under methods"),
        ({"scenario": {"world": "mud"}, "worlds": ["payload"]}, "scenario: world must be given under worlds"),
        ({"scenario": {"target": {"kind": "brain"}}}, "scenario: target.kind must be given under targets"),
    ],
)
def test_what_a_factor_sets_is_said_once(fields: dict[str, Any], words: str) -> None:
    """Else a trial would be named by what it is not."""
    with pytest.raises(InputError) as fault:
        _planned(**{"methods": ["dp"]} | fields)
    assert words in str(fault.value)
    assert "\n" not in str(fault.value)


def test_fields_that_no_factor_sets_are_the_scenarios() -> None:
    """What is not listed, and what only some of the targets say; groups of fields are merged."""
    scenario = {"world": "mud", "target": {"kind": "brain", "seed": 5}, "mission": {"standoff_m": 0.6}}
    targets = {"five": {}, "six": {"seed": 6}}
    variations = {"slow": {"mission": {"clearance_m": 0.07}}}
    trials = _planned(methods="dp", targets=targets, scenario=scenario, variations=variations, seeds=1)
    flown = [scenario_of(trial.task.settings) for trial in trials]
    assert [one.target.seed for one in flown] == [5, 6]
    assert {(one.world, one.target.kind) for one in flown} == {("mud", "brain")}
    assert {(one.mission.standoff_m, one.mission.clearance_m) for one in flown} == {(0.6, 0.07)}


def test_what_is_no_mapping_is_refused(tmp_path: Path) -> None:
    """A list is no campaign, nor is a file that is not there."""
    path = tmp_path / "c.yaml"
    path.write_text("- dp\n")
    with pytest.raises(InputError, match="holds list, must hold fields of a campaign"):
        load_campaign(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_campaign(tmp_path / "none.yaml")


def test_a_campaign_is_settings_like_others() -> None:
    """Frozen, and unknown fields are refused."""
    assert issubclass(Campaign, Settings)
    assert all(field.description for field in Campaign.model_fields.values())
