"""What a vehicle file lacks is told at once, has blanks to fill in, and can be estimated after another vehicle."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import (
    ThrusterDraft,
    VehicleDraft,
    blank_fields,
    completed,
    draft_yaml,
    load_draft,
    load_vehicle,
    plausible,
    vehicle_names,
)
from wakewise.robot.vehicles.draft import NEEDED_FIELDS
from wakewise.robot.vehicles.library import parse_vehicle
from wakewise.robot.vehicles.vehicle_file import VehicleFile

BARE = VehicleDraft(name="x", title="X", source="nowhere", does_not_claim="Anything.")
PLACES = tuple(
    ThrusterDraft(name=t.name, p_BT_m=t.p_BT_m, axis_B=t.axis_B) for t in load_draft("bluerov2-heavy").thrusters
)
OWN = replace(BARE, mass_kg=11.0, p_BG_m=np.array([0.0, 0.0, 0.02]), thrusters=PLACES)


def filled_in(text: str) -> str:
    """The file with every blank uncommented and filled in as a person would."""
    return "\n".join(_filled_in(line) if re.match(r"#(\w|  \w)", line) else line for line in text.splitlines())


def _filled_in(line: str) -> str:
    if line.startswith("#  mounts:"):
        return "  mounts: [{name: a, position_m: [0, 0, 0], axis: [1, 0, 0]}]"
    return re.sub(r"\b_\b", "2.0", line[1:].replace("source:", "source: measured"))


@pytest.mark.parametrize("draft", [BARE, OWN, load_draft("orca"), replace(load_draft("paper"), mass_kg=None)])
def test_blanks_that_are_filled_in_make_a_whole_vehicle(draft: VehicleDraft) -> None:
    """Whatever is missing has a line; unfilled it is a comment, so the file reads as the draft."""
    text = draft_yaml(draft, blank_fields(draft))
    again = parse_vehicle(text, "x.yaml", "x")
    assert again.missing == draft.missing != ()
    whole = parse_vehicle(filled_in(text), "x.yaml", "x")
    assert whole.missing == ()
    for dotted in draft.missing_fields:
        assert re.search(rf"^#  {dotted.partition('.')[2]}: ", text, re.MULTILINE), dotted


def test_a_blank_has_unit_meaning_and_a_range_of_vehicles_of_its_mass() -> None:
    lines = blank_fields(OWN)["damping"]
    quadratic = next(line for line in lines if "quadratic_N_s2_m2" in line)
    assert quadratic.startswith(
        "#  quadratic_N_s2_m2: [_, _, _]  # N s2/m2; surge, sway, heave; the library's vehicles"
    )
    low, high = (float(v) for v in re.findall(r"mass: ([\d.e-]+) to ([\d.e-]+)", quadratic)[0])
    assert 10.0 < low < 141.0 < high < 250.0  # the BlueROV2 Heavy, which has this mass, has 141


def test_blanks_that_were_left_blank_are_all_named_at_once() -> None:
    text = re.sub(r"^#(\w|  \w)", r"\1", draft_yaml(OWN, blank_fields(OWN)), flags=re.MULTILINE)
    with pytest.raises(InputError) as caught:
        parse_vehicle(text, "x.yaml", "x")
    said = str(caught.value)
    assert "\n" not in said
    for dotted in OWN.missing_fields:
        assert dotted in said, dotted
    assert said.count("not filled in") == len(OWN.missing_fields)


def test_all_that_is_wrong_or_missing_is_told_in_one_line() -> None:
    text = """
title: x
source: s
does_not_claim: d
body: {source: s, size_m: [1, 2], mass_kg: -3, weight: 4}
camera: {}
camera_mount: {source: s, position_m: [0, 0, 0]}
"""
    with pytest.raises(InputError) as caught:
        parse_vehicle(text, "x.yaml", "x")
    said = str(caught.value)
    for words in ("body.size_m", "body.mass_kg: found -3", "body.weight: no such field", "camera: no such field"):
        assert words in said
    for dotted in (*set(NEEDED_FIELDS) - {"camera_mount.position_m"}, "camera_mount.roll_pitch_yaw_deg: missing"):
        assert dotted in said, dotted
    assert said.count("camera_mount.roll_pitch_yaw_deg") == 1


def test_faults_that_only_the_record_can_see_are_told_together_too() -> None:
    value = yaml.safe_load(draft_yaml(load_draft("paper")))
    value["inertia"]["products_kg_m2"] = [2.0, 2.0, 2.0]
    value["thruster_layout"]["mounts"][0]["position_m"] = [20.0, 0.0, 0.0]
    value["thruster_layout"]["mounts"][1]["axis"] = [0.0, 0.0, 0.0]
    value["damping"].pop("linear_N_m_s")
    with pytest.raises(InputError) as caught:
        parse_vehicle(yaml.safe_dump(value), "x.yaml", "x")
    for words in ("linear_N_m_s: missing", "20 m from", "must not be zero", "inertia_kg_m2: smallest"):
        assert words in str(caught.value)


@pytest.mark.parametrize("name", vehicle_names())
def test_after_another_vehicle_a_draft_is_whole_and_keeps_what_it_held(name: str) -> None:
    like = load_draft(name)
    whole = completed(OWN, like)
    assert whole.missing == ()
    assert whole.vehicle().mass_kg == 11.0
    assert np.array_equal(whole.p_BG_m, OWN.p_BG_m)
    assert [t.name for t in whole.thrusters] == [t.name for t in OWN.thrusters]
    marked = {p.group for p in whole.provenance if p.estimate}
    assert marked >= {"inertia", "added_mass", "damping", "camera_mount", "camera_lens", "thruster_limits"}
    assert f"an estimate after {name}" in next(p.source for p in whole.provenance if p.group == "damping")
    body = next(p for p in whole.provenance if p.group == "body")
    assert body.source.startswith("nowhere; size_m: an estimate after")
    assert parse_vehicle(draft_yaml(whole), "x.yaml", "x").missing == ()


def test_a_vehicle_scaled_to_its_own_mass_is_itself() -> None:
    like = load_draft("bluerov2-heavy")
    whole = completed(replace(BARE, mass_kg=like.mass_kg), like).vehicle()
    own = load_vehicle("bluerov2-heavy")
    assert np.allclose(whole.hydrodynamics.added_mass, own.hydrodynamics.added_mass)
    assert np.allclose(whole.p_BB_m, own.p_BB_m)
    assert whole.displaced_volume_m3 == pytest.approx(own.displaced_volume_m3)
    assert np.allclose(whole.allocation_matrix, own.allocation_matrix)
    assert whole.curve == own.curve


def test_twice_the_length_is_eight_times_the_mass() -> None:
    like = load_draft("paper")
    big = completed(replace(BARE, mass_kg=8.0 * 4.5), like).vehicle()
    small = like.vehicle()
    assert np.allclose(big.size_m, 2.0 * small.size_m)
    assert np.allclose(big.inertia_kg_m2, 32.0 * small.inertia_kg_m2)
    assert big.displaced_volume_m3 == pytest.approx(8.0 * small.displaced_volume_m3)
    ratio = np.diag(big.hydrodynamics.added_mass) / np.diag(small.hydrodynamics.added_mass)
    assert np.allclose(ratio, [8, 8, 8, 32, 32, 32])
    ratio = np.diag(big.hydrodynamics.quadratic_damping) / np.diag(small.hydrodynamics.quadratic_damping)
    assert np.allclose(ratio, [4, 4, 4, 32, 32, 32])
    assert np.array_equal(big.thrust_upper_N, small.thrust_upper_N)


def test_the_centre_of_buoyancy_goes_above_the_drafts_own_centre_of_gravity() -> None:
    whole = completed(OWN, load_draft("paper")).vehicle()
    assert whole.p_BB_m[2] < whole.p_BG_m[2]


def test_what_cannot_or_need_not_be_estimated_is_refused() -> None:
    with pytest.raises(InputError, match="paper: lacks nothing that bluerov2-heavy could give"):
        completed(load_draft("paper"), load_draft("bluerov2-heavy"))
    with pytest.raises(InputError, match="orca: cannot fly"):
        completed(OWN, load_draft("orca"))


def test_places_of_thrusters_are_not_made_up_beside_a_matrix() -> None:
    """They would contradict it."""
    draft = replace(BARE, mass_kg=11.0, shipped_matrix=load_draft("paper").allocation_matrix)
    whole = completed(draft, load_draft("paper"))
    assert "thruster places and axes" in whole.missing
    assert whole.size_m is not None


def test_every_needed_field_is_one_of_the_file() -> None:
    for dotted in NEEDED_FIELDS:
        group, _, field = dotted.partition(".")
        assert field in dict(VehicleFile.model_json_schema()["$defs"])[_kind(group)]["properties"]
    assert plausible("body.mass_kg").endswith("1860")


def _kind(group: str) -> str:
    schema = VehicleFile.model_json_schema()["properties"][group]
    return next(option["$ref"] for option in schema["anyOf"] if "$ref" in option).rpartition("/")[2]
