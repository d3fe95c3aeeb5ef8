"""Vehicle files: what they must hold, and what reading them refuses."""

import math
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters import library_curve
from wakewise.robot.vehicles import VehicleDraft, draft_names, draft_yaml, load_draft, load_vehicle, vehicle_names
from wakewise.robot.vehicles.library import parse_vehicle


def shipped(name: str) -> str:
    return (resources.files("wakewise.robot.vehicles") / "library_data" / f"{name}.yaml").read_text("utf-8")


def test_the_library_holds_the_cited_sets_and_knows_which_can_fly() -> None:
    assert draft_names() == (
        *("bluerov2", "bluerov2-abir", "bluerov2-gazebo", "bluerov2-heavy", "bluerov2-heavy-gazebo"),
        *("bluerov2-heavy-wu", "orca", "paper", "paper-six-thrusters", "paper-tilting", "rexrov", "soft-thrusters"),
    )
    assert vehicle_names() == [name for name in draft_names() if name != "orca"]
    assert vehicle_names(flyable_only=False) == list(draft_names())


@pytest.mark.parametrize("name", draft_names())
def test_every_group_names_its_source_and_every_file_what_it_does_not_claim(name: str) -> None:
    draft = load_draft(name)
    assert draft.name == name
    assert len(draft.does_not_claim) > 40
    assert {p.group for p in draft.provenance} >= {"body", "inertia", "thruster_layout", "thruster_limits"}
    assert all(p.source for p in draft.provenance)


def test_orca_says_what_it_lacks_when_asked_to_fly() -> None:
    """Its file holds thrusters, limits, mass and centre of gravity, and nothing is made up for the rest."""
    orca = load_draft("orca")
    assert (orca.mass_kg, len(orca.thrusters)) == (30.0, 8)
    assert orca.displaced_volume_m3 is None
    assert orca.added_mass is None
    with pytest.raises(InputError, match="orca: cannot fly, its file does not hold size, displaced volume, centre of"):
        load_vehicle("orca")


def test_published_sets_of_one_vehicle_stand_side_by_side() -> None:
    """Surge drag of the BlueROV2 Heavy spans a factor of 7.8 between the sets."""
    drag = [
        float(load_vehicle(name).hydrodynamics.quadratic_damping[0, 0])
        for name in ("bluerov2-heavy", "bluerov2-heavy-gazebo", "bluerov2-heavy-wu")
    ]
    assert drag == [141.0, 58.42, 18.18]


@pytest.mark.parametrize("name", draft_names())
def test_a_named_thrust_table_exists_and_gives_the_stated_limits(name: str) -> None:
    draft = load_draft(name)
    if draft.curve is None:
        limits = next(p.source for p in draft.provenance if p.group in ("thruster_limits", "thruster_layout"))
        assert "T200 public performance" not in limits
        return
    assert draft.thrust_limits_N is not None
    lowest, highest = library_curve(draft.curve.table).limits_N(draft.curve.supply_V)
    stands_in = next(p.estimate for p in draft.provenance if p.group == "thruster_curve")
    rounding_N = 0.5 if stands_in else 1e-9  # a table that stands for another maker's thruster fits to the newton
    assert np.allclose(draft.thrust_limits_N[0], lowest, atol=rounding_N)
    assert np.allclose(draft.thrust_limits_N[1], highest, atol=rounding_N)


@pytest.mark.parametrize("name", [n for n in draft_names() if n.startswith(("bluerov2", "paper"))])
def test_a_t200_gives_nothing_below_its_least_thrust(name: str) -> None:
    """Whether by the table or as stated, it is the first running row at 16 V."""
    assert load_vehicle(name).least_thrusts_N == pytest.approx((0.40, 0.36), abs=1e-12)
    assert load_vehicle(name).with_ideal_thrusters().least_thrusts_N == (0.0, 0.0)


def test_a_table_or_voltage_that_is_not_there_is_refused() -> None:
    """One line names what there is."""
    text = draft_yaml(load_draft("bluerov2-heavy"))
    for wrong, words in (("table: t999", "'t999': not in the library"), ("supply_V: 99.0", "holds 10 to 20 V")):
        old = "table: t200" if "table" in wrong else "supply_V: 16.0"
        with pytest.raises(InputError, match=words):
            parse_vehicle(text.replace(old, wrong), "x.yaml", "x")


def test_six_of_the_papers_eight_thrusters_are_the_papers_in_all_else() -> None:
    six, paper = load_vehicle("paper-six-thrusters"), load_vehicle("paper")
    kept = [paper.thrusters[i] for i in (0, 1, 2, 3, 4, 7)]
    assert [t.name for t in six.thrusters] == [t.name for t in kept]
    assert np.array_equal(six.allocation_matrix, paper.allocation_matrix[:, [0, 1, 2, 3, 4, 7]])
    assert six.mass_kg == paper.mass_kg
    assert np.array_equal(six.hydrodynamics.added_mass, paper.hydrodynamics.added_mass)


def test_the_soft_vehicle_has_slow_jets_and_flies() -> None:
    """At equal thrust its jets leave at three tenths of the speed; no disk meets another or sits outside the box."""
    soft, paper = load_vehicle("soft-thrusters"), load_vehicle("paper")
    speeds = np.sqrt(1.0 / np.array([v.disk_areas_m2[0] for v in (soft, paper)]))
    assert speeds[0] / speeds[1] == pytest.approx(0.3)
    assert soft.least_thrusts_N == (0.02, 0.02)
    places = soft.thruster_positions_B_m
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(8, 1)]
    assert apart.min() > 0.17  # disks that stand across each other
    assert np.linalg.norm(places[:4, None, :] - places[None, :4], axis=2)[np.triu_indices(4, 1)].min() > 0.2
    assert np.linalg.norm(places[4:, None, :] - places[None, 4:], axis=2)[np.triu_indices(4, 1)].min() > 0.2
    assert np.all(np.abs(places) + 0.0 <= 0.5 * soft.size_m)
    assert np.linalg.matrix_rank(soft.allocation_matrix) == 6


def test_a_file_may_stand_on_another_of_the_library() -> None:
    """What it states takes the place of a whole group; all else is its base's."""
    tilting, paper = load_vehicle("paper-tilting"), load_vehicle("paper")
    assert paper.tilt is None
    assert tilting.tilt is not None
    assert np.array_equal(tilting.allocation_matrix, paper.allocation_matrix)
    assert tilting.mass_kg == paper.mass_kg
    assert tilting.source == paper.source
    assert tilting.title != paper.title
    for base, words in (("papper", "allowed bluerov2, "), ("paper-tilting", "has a base itself, name 'paper'")):
        with pytest.raises(InputError, match=f"base: '{base}'.*{words}"):
            parse_vehicle(f"base: {base}", "x.yaml", "x")


def test_rexrov_keeps_the_couplings_of_its_added_mass() -> None:
    water = load_vehicle("rexrov").hydrodynamics
    assert water.added_mass[1, 3] == water.added_mass[3, 1] == 409.44
    assert np.linalg.eigvalsh(water.added_mass)[0] > 0.0


@pytest.mark.parametrize("name", draft_names())
def test_a_draft_written_and_read_is_the_same_draft(name: str) -> None:
    draft = load_draft(name)
    assert_same(parse_vehicle(draft_yaml(draft), "again.yaml", name), draft)


def test_thrusters_that_differ_keep_their_own_figures(tmp_path: Path) -> None:
    """Limits, disk and lag of single thrusters survive, and what they share is written once."""
    paper = load_draft("paper")
    mixed = replace(paper, thrusters=(replace(paper.thrusters[0], max_forward_N=10.0), *paper.thrusters[1:]))
    text = draft_yaml(mixed)
    assert text.count("time_constant_s") == 1
    path = tmp_path / "mixed.yaml"
    path.write_text(text)
    assert [t.max_forward_N for t in load_draft(str(path)).thrusters] == [10.0] + 7 * [51.0]
    assert load_vehicle(str(path)).thrust_upper_N[0] == 10.0


def test_an_empty_draft_can_be_written_too() -> None:
    empty = VehicleDraft(name="x", title="X", source="nowhere", does_not_claim="anything", notes=("odd: it is empty",))
    again = parse_vehicle(draft_yaml(empty), "x.yaml", "x")
    assert again.missing == empty.missing
    assert again.notes == empty.notes


def assert_same(a: VehicleDraft, b: VehicleDraft) -> None:
    for field in fields(VehicleDraft):
        one, two = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            assert np.allclose(one, two, rtol=1e-14, atol=1e-14), field.name
        elif field.name == "X_BC":
            assert (one is None) == (two is None)
            assert one is None or np.allclose(one.R, two.R, atol=1e-13)
            assert one is None or np.array_equal(one.p_m, two.p_m)
        elif field.name == "thrusters":
            for s, t in zip(one, two, strict=True):
                assert s.name == t.name
                assert np.array_equal(s.p_BT_m, t.p_BT_m)
                assert np.allclose(s.axis_B, t.axis_B, atol=1e-15)
                for value in ("max_forward_N", "max_reverse_N", "disk_area_m2", "time_constant_s"):
                    stated = getattr(t, value)
                    assert getattr(s, value) == (None if stated is None else pytest.approx(stated, rel=1e-12))
        elif field.name == "drag_cases":
            for s, t in zip(one, two, strict=True):
                assert (s.name, s.source, s.estimate) == (t.name, t.source, t.estimate)
                assert np.array_equal(s.linear_damping, t.linear_damping)
                assert np.array_equal(s.quadratic_damping, t.quadratic_damping)
        elif field.name == "tilt":
            stated = None if two is None else pytest.approx((two.low_rad, two.high_rad, two.rate_rad_s), rel=1e-12)
            assert (None if one is None else (one.low_rad, one.high_rad, one.rate_rad_s)) == stated
        elif field.name == "camera_fov_rad":
            assert one == (None if two is None else pytest.approx(two, rel=1e-12))
        else:
            assert one == two, field.name


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
    """RexROV's looks down by 0.6 rad, the others' are level."""
    R_BC = load_vehicle(name).X_BC.R
    down = 0.6 if name == "rexrov" else 0.0
    assert np.allclose(R_BC @ [0, 0, 1], [math.cos(down), 0, math.sin(down)], atol=1e-12)
    assert np.allclose(R_BC @ [1, 0, 0], [0, 1, 0], atol=1e-15)


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
    with pytest.raises(InputError, match=r"'nope'.*bluerov2-heavy,.*, paper,"):
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
        ("  mass_kg: 4.5", "", r"does not hold mass; fill in body\.mass_kg \(docs/veh"),
        ("  linear_N_m_s: [0.07, 0.07, 0.07]", "", r"damping\.linear_N_m_s: missing, it goes with linear_N_s_m"),
        ("translation_kg: [3.8, 7.7, 9.0]", "translation_kg: [3.8, 7.7]", r"added_mass\.translation_kg"),
        (
            "translation_kg: [3.8, 7.7, 9.0]",
            "translation_kg: [[1, 9, 0], [9, 1, 0], [0, 0, 1]]",
            "added_mass: smallest",
        ),
        ("translation_kg: [3.8, 7.7, 9.0]", "translation_kg: [[1, 9, 0], [0, 1, 0], [0, 0, 1]]", "not symmetric"),
        ("rotation_kg_m2: [0.034", "coupling_kg_m: [[1, 0], [0, 1]]\n  rotation_kg_m2: [0.034", r"coupling_kg_m"),
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


def test_xml_is_sent_to_the_importer(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("<robot/>")
    with pytest.raises(InputError, match="is XML, not a vehicle file; see wakewise vehicle import"):
        load_vehicle(str(path))


def test_a_shipped_matrix_has_rows_alike(tmp_path: Path) -> None:
    block = "shipped_matrix:\n  source: s\n  force_N_per_N: [[1], [0], [0]]\n  moment_N_m_per_N: [[0], [0], [0, 0]]\n"
    path = tmp_path / "bad.yaml"
    path.write_text(shipped("paper") + "\n" + block)
    with pytest.raises(InputError, match=r"shipped_matrix: rows of \[1, 2\] numbers"):
        load_draft(str(path))


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
