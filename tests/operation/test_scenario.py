"""Scenarios: presets, files, overrides, and one-line errors that name the field."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from wakewise.core.errors import InputError
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
        ({"mission": 3}, ["mission", "group with the fields", "standoff_m"]),
        ({"target": "coral"}, ["target", "'coral'", "kind"]),
        ({"tank.current.velocity_m_s": 0.1}, ["velocity_m_s", "0.1", "such as [0."]),
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
    with pytest.raises(InputError, match=r"preset .huge.: allowed are"):
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
        "tank.silt.load_kg_m2": 0,
        "mission.views": [8, 8, 8],
        "vehicle": "paper",
        "tank.mismatch.trim_N": None,
    }
    for bad in ("silt", "=3", "a=[1"):
        with pytest.raises(InputError, match="--set"):
            parse_overrides([bad])


@pytest.mark.parametrize(
    "name", ["../x", "/abs/evil", "a/b", "a\\b", ".hidden", "..", " a", "a ", "a\nb", "a\x00b", "a\u202eb"]
)
def test_a_name_cannot_leave_its_folder(name: str) -> None:
    """A name becomes a folder's: separators, leading dots and what cannot be seen are refused in one line."""
    with pytest.raises(InputError, match=r"name: found .* names a folder") as caught:
        load_scenario("quick", None, {"name": name})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["scan", "Größe 2", "a..b", "reef-7_x", "珊瑚"])
def test_an_honest_name_is_kept(name: str) -> None:
    """Letters of any script, digits, inner dots and spaces are all a name."""
    assert load_scenario("quick", None, {"name": name}).name == name


def test_a_key_given_twice_is_refused_with_its_line(tmp_path: Path) -> None:
    """The second `seed` is not silently the one that counts, at the top or in a group."""
    path = tmp_path / "twice.yaml"
    path.write_text("seed: 1\nname: a\nseed: 2\n")
    with pytest.raises(InputError, match=r"twice\.yaml line 3: not YAML \(key seed given more than once\)"):
        load_scenario("quick", path, {})
    path.write_text("[" * 1200)
    with pytest.raises(InputError, match="too deep"):
        load_scenario("quick", path, {})
    with pytest.raises(InputError, match=r"--set a: .*too deep"):
        parse_overrides(["a=" + "[" * 1200])


@pytest.mark.parametrize(
    "text", ["seed: true", "seed: 12:30", "mission: {speed_m_s: true}", "tank: {silt: {load_kg_m2: yes}}"]
)
def test_neither_yes_nor_a_time_is_a_number(text: str, tmp_path: Path) -> None:
    """`true` is not 1 and `12:30` is not 750; a switch may be `true`, as before."""
    path = tmp_path / "odd.yaml"
    path.write_text(text + "\n")
    with pytest.raises(InputError, match=r"odd\.yaml: .*(number|integer)"):
        load_scenario("quick", path, {})
    path.write_text("tank: {jets: {inflow_loss: true}}\n")
    assert load_scenario("quick", path, {}).tank.jets.inflow_loss is True


@pytest.mark.parametrize("field", ["mission.speed_m_s", "mission.acceleration_m_s2"])
@pytest.mark.parametrize("value", [1e-300, 1e-9, 1e-6])
def test_a_speed_that_takes_months_is_refused(field: str, value: float) -> None:
    """Speeds and accelerations below a millimetre per second (squared) are refused before anything is computed."""
    with pytest.raises(InputError, match=rf"{field}: found .*0\.001"):
        load_scenario("quick", None, {field: value})


def leaves(model: type[BaseModel], prefix: str = "") -> list[str]:
    """Dotted names of the fields that hold values."""
    names: list[str] = []
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            names += leaves(kind, f"{prefix}{name}.")
        else:
            names.append(f"{prefix}{name}")
    return names


def test_a_scenario_has_at_most_220_fields() -> None:
    """What nobody would set, and no world, test, bench, study or document varies, is a constant with its argument."""
    assert len(leaves(Scenario)) <= 220


def test_a_scenario_without_a_preset_is_gentle() -> None:
    """The mechanisms that the tank bore out are defaults, and no preset speaks of control."""
    control = Scenario().control
    assert (
        control.allocation.null_space
        and control.allocation.merging_jets
        and control.allocation.advection
        and control.wake.floor
    )
    assert control.allocation.current_m_s is None
    assert all(load_scenario(preset, None, {}).control == control for preset in PRESETS)


def test_a_vehicle_that_nothing_names_is_refused_where_it_is_set() -> None:
    """With the nearest name; a path may be of another computer, and a given part is named as it is."""
    with pytest.raises(InputError, match=r"vehicle: found 'rov', did you mean rexrov\? allowed are bluerov2"):
        Scenario.preset(vehicle="rov")
    assert Scenario.preset(vehicle="elsewhere/rov.yaml").vehicle == "elsewhere/rov.yaml"
    assert Scenario.preset(vehicle="mine", overrides={"vehicle": "mine (lab.Rov)"}).vehicle == "mine"


def test_a_word_in_place_of_a_group_is_told_how_one_field_is_set() -> None:
    """A target by its kind is `target.kind`."""
    with pytest.raises(InputError, match=r"fields kind, size_m, .*; one of them alone is set as target\.kind$"):
        Scenario.preset(target="brain")
