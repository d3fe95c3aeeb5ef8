"""Vehicle files: what they must hold, and what reading them refuses."""

import math
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.errors import InputError
from wakewise.vehicles import load_vehicle, vehicle_names


def shipped(name: str) -> str:
    return (resources.files("wakewise.vehicles") / "library_data" / f"{name}.yaml").read_text("utf-8")


def test_the_library_holds_the_papers_vehicle_and_the_heavy() -> None:
    assert vehicle_names() == ["bluerov2-heavy", "paper"]


@pytest.mark.parametrize("name", vehicle_names())
def test_every_group_names_its_source_and_every_file_what_it_does_not_claim(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert len(vehicle.does_not_claim) > 40
    assert {p.group for p in vehicle.provenance} >= {"body", "inertia", "added_mass", "damping", "thruster_layout"}
    assert all(p.source for p in vehicle.provenance)


def test_the_papers_vehicle_is_as_published_and_marks_the_rest_as_estimates() -> None:
    vehicle = load_vehicle("paper")
    assert vehicle.size_m.tolist() == [0.45, 0.35, 0.28]
    assert vehicle.mass_kg == 4.5
    assert set(vehicle.thrust_upper_N) == {51.0}
    assert set(vehicle.thrust_lower_N) == {-40.0}
    assert math.isclose(vehicle.camera_fov_rad, math.pi / 2)
    assert np.allclose(vehicle.disk_areas_m2, math.pi * 0.03**2)
    published = {p.group for p in vehicle.provenance if not p.estimate}
    assert published == {"body", "thruster_limits", "camera_lens"}


@pytest.mark.parametrize("name", vehicle_names())
def test_the_camera_looks_forward_with_its_image_upright(name: str) -> None:
    R_BC = load_vehicle(name).X_BC.R
    assert np.allclose(R_BC @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    assert np.allclose(R_BC @ [0, 1, 0], [0, 0, 1], atol=1e-15)


@pytest.mark.parametrize("name", vehicle_names())
def test_every_thruster_lies_within_the_vehicles_box(name: str) -> None:
    vehicle = load_vehicle(name)
    assert np.all(np.abs(vehicle.thruster_positions_B_m) <= 0.5 * vehicle.size_m)


def test_a_copy_of_a_shipped_file_reads_the_same(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(shipped("paper"))
    mine, ours = load_vehicle(str(path)), load_vehicle("paper")
    assert mine.name == "mine"
    assert np.array_equal(mine.allocation_matrix, ours.allocation_matrix)
    assert np.array_equal(mine.hydrodynamics.added_mass, ours.hydrodynamics.added_mass)


def test_an_unknown_name_lists_the_allowed_ones() -> None:
    with pytest.raises(InputError, match=r"'nope'.*bluerov2-heavy, paper"):
        load_vehicle("nope")


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(InputError, match="no such file"):
            load_vehicle(str(path))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg: 4.5", "mass_kg: -4.5", r"body\.mass_kg: found -4\.5.*greater than 0"),
        ("mass_kg: 4.5", "mass_kg: .nan", r"body\.mass_kg: found nan"),
        ("mass_kg: 4.5", "mass_kg: heavy", r"body\.mass_kg: found 'heavy'"),
        ("mass_kg: 4.5", "mass_kg: 4.5\n  colour: red", r"body\.colour: no such field"),
        ("mass_kg: 4.5", "mass_kg: 4.5\n  mass_kg: 5.5", "mass_kg given more than once"),
        ("  mass_kg: 4.5", "", r"body\.mass_kg: missing"),
        ("axis: [1, -1, 0]", "axis: [0, 0, 0]", "rear left horizontal: axis.*must not be zero"),
        ("position_m: [0.085, 0.140, 0.0]", "position_m: [85, 140, 0]", "front right vertical.*at most 10 m"),
        ("moments_kg_m2: [0.075, 0.105, 0.122]", "moments_kg_m2: [0.075, 0.105]", r"inertia\.moments_kg_m2"),
        (
            "moments_kg_m2: [0.075, 0.105, 0.122]",
            "moments_kg_m2: [0.075, 0.105, 0.122]\n  products_kg_m2: [0.5, 0, 0]",
            "inertia_kg_m2: smallest eigenvalue",
        ),
        ("name: front left vertical", "name: front right vertical", "named more than once"),
    ],
)
def test_a_bad_field_is_named_with_the_file(tmp_path: Path, old: str, new: str, words: str) -> None:
    text = shipped("paper")
    assert old in text
    path = tmp_path / "bad.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=words) as caught:
        load_vehicle(str(path))
    assert "bad.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"[1, 2]", b"a: [1", b"a: *b", b"\xff\xfe\x00", b"? [a]\n: 1", b"a: !!python/x 1"]
)
def test_a_file_that_is_no_vehicle_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.yaml") as caught:
        load_vehicle(str(path))
    assert "\n" not in str(caught.value)


SCALARS = st.none() | st.booleans() | st.integers(-3, 3) | st.floats() | st.text(max_size=5)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner))


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_value_in_any_field_gives_a_vehicle_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    value = yaml.safe_load(shipped("paper"))
    group = data.draw(st.sampled_from(sorted(value)))
    if isinstance(value[group], dict) and data.draw(st.booleans()):
        value[group][data.draw(st.sampled_from(sorted(value[group])))] = data.draw(VALUES)
    else:
        value[group] = data.draw(VALUES)
    path = tmp_path_factory.mktemp("any") / "any.yaml"
    path.write_text(yaml.safe_dump(value))
    try:
        vehicle = load_vehicle(str(path))
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert vehicle.mass_kg > 0.0
