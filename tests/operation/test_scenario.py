"""Scenarios: presets, files, overrides, and one-line errors that name the field."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.errors import InputError
from wakewise.operation import PRESETS, Scenario, differences, load_scenario, parse_overrides, read_scenario
from wakewise.operation.scenario import dump_scenario


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_a_valid_scenario_that_survives_its_file(preset: str, tmp_path: Path) -> None:
    """A preset loads, and writing then reading it changes nothing."""
    scenario = load_scenario(preset, None, {})
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(scenario, {"wakewise": "0"}))
    assert differences(scenario, read_scenario(path)) == []


def test_overrides_lie_over_files_and_files_over_presets(tmp_path: Path) -> None:
    """The last word has the override, then the file, then the preset, then the defaults."""
    path = tmp_path / "mine.yaml"
    path.write_text("seed: 7\nmission: {standoff_m: 0.6, speed_m_s: 0.2}\n")
    scenario = load_scenario("quick", path, {"mission.speed_m_s": 0.05})
    assert scenario.seed == 7
    assert scenario.mission.standoff_m == 0.6
    assert scenario.mission.speed_m_s == 0.05
    assert scenario.mission.views == (20, 16, 12)


def test_a_kind_of_silt_replaces_what_lies_below_and_yields_to_what_lies_beside_and_above(tmp_path: Path) -> None:
    """Over a scenario that spells out load and grains, a kind of silt sets them anew, unless they are set, too."""
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(load_scenario("quick", None, {"tank.silt.kind": "caco3-50mg"})))
    assert load_scenario(None, path, {}).tank.silt.grain_m == 3e-4
    clear = load_scenario(None, path, {"tank.silt.kind": "clear"}).tank.silt
    assert (clear.load_kg_m2, clear.suspended_mg_l) == (0.0, 0.0)
    silty = load_scenario(None, path, {"tank.silt.kind": "silt"}).tank.silt
    assert (silty.load_kg_m2, silty.suspended_mg_l, silty.grain_m) == (0.1, 0.0, 20e-6)
    for changes in (
        {"tank.silt.load_kg_m2": 0.4, "tank.silt.kind": "silt"},
        {"tank.silt.kind": "silt", "tank.silt.load_kg_m2": 0.4},
    ):
        assert load_scenario(None, path, changes).tank.silt.load_kg_m2 == 0.4
    assert load_scenario(None, path, {"tank.silt.load_kg_m2": 0.3}).tank.silt.suspended_mg_l == 50.0
    path.write_text("tank: {silt: {kind: clear, load_kg_m2: 0.2}}\n")
    assert load_scenario(None, path, {}).tank.silt.load_kg_m2 == 0.2
    assert load_scenario(None, path, {"tank": {"silt": {"kind": "caco3-50mg"}}}).tank.silt.load_kg_m2 == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tank.silty": 0}, ["tank.silty", "no such field", "silt"]),
        ({"nonsense.deep.field": 1}, ["nonsense", "no such field"]),
        ({"mission.standoff_m": -0.5}, ["mission.standoff_m", "-0.5", "greater than 0"]),
        ({"mission.views": [20]}, ["mission", "one count per orbit"]),
        ({"tank.failures": [{"thruster": 1, "att_s": 3}]}, ["tank.failures.0.att_s", "at_s"]),
        ({"tank.silt.kind": "mud"}, ["tank.silt.kind", "caco3-50mg"]),
        ({"method": "magic"}, ["method", "magic", "dp", "wake-aware"]),
        ({"seed": float("nan")}, ["seed"]),
        ({"mission": 3}, ["mission"]),
    ],
)
def test_a_fault_is_one_line_with_field_finding_and_remedy(changes: dict[str, object], words: list[str]) -> None:
    """The message names the field, what was found and what is allowed, and has no line break."""
    with pytest.raises(InputError) as caught:
        load_scenario("quick", None, changes)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("text", ["- a\n- b\n", "just words", "a: [1, 2", "a: b: c", ""])
def test_a_file_that_is_no_scenario_is_refused_by_name(text: str, tmp_path: Path) -> None:
    """Lists, prose, broken YAML and empty files are refused with the file's name."""
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"odd\.yaml"):
        load_scenario(None, path, {})
    with pytest.raises(InputError, match=r"gone\.yaml: no such file"):
        load_scenario(None, tmp_path / "gone.yaml", {})
    with pytest.raises(InputError, match="--preset"):
        load_scenario("huge", None, {})


@given(st.binary(max_size=200))
def test_random_bytes_never_end_in_anything_but_an_input_error(data: bytes) -> None:
    """Whatever a file holds, the reader returns a scenario or raises InputError."""
    import tempfile

    with tempfile.NamedTemporaryFile(suffix=".yaml") as file:
        file.write(data)
        file.flush()
        try:
            scenario = load_scenario(None, Path(file.name), {})
        except InputError as fault:
            assert "\n" not in str(fault)
        else:
            assert isinstance(scenario, Scenario)


def test_overrides_are_yaml_values() -> None:
    """Numbers, lists, words and null keep their kind; what is no pair is refused."""
    assert parse_overrides(
        ["tank.silt.load_kg_m2=0", "mission.views=[8, 8, 8]", "vehicle=paper", "tank.mismatch.trim_N=null"]
    ) == {
        "tank.size_m": 0,
        "mission.views": [8, 8, 8],
        "vehicle": "paper",
        "tank.mismatch.trim_N": None,
    }
    for bad in ("silt", "=3", "a=[1"):
        with pytest.raises(InputError, match="--set"):
            parse_overrides([bad])
