"""Drafts: what a file does not say stays unsaid, what it says is refused where a vehicle would refuse it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import ThrusterDraft, VehicleDraft, draft_names, load_draft, load_vehicle, vehicle_names

EMPTY = VehicleDraft(name="x", title="X", source="nowhere", does_not_claim="anything")
SPUN = np.eye(3) + np.eye(3, k=1)


def thruster(**changes: Any) -> ThrusterDraft:
    values: dict[str, Any] = {"name": "T", "p_BT_m": np.zeros(3), "axis_B": np.array([0.0, 0.0, 1.0])}
    return ThrusterDraft(**(values | changes))


def test_an_empty_draft_lacks_everything_and_cannot_fly() -> None:
    assert EMPTY.missing == (
        *("size", "mass", "inertia", "displaced volume", "centre of gravity", "centre of buoyancy", "added mass"),
        *("linear damping", "quadratic damping", "camera mount", "camera field of view", "thruster places and axes"),
        *("thruster forward limit", "thruster reverse limit", "thruster disk", "thruster lag"),
    )
    with pytest.raises(InputError, match="vehicle x: cannot fly, its file does not hold size, mass, inertia"):
        EMPTY.vehicle()
    with pytest.raises(InputError, match="neither thrusters nor an allocation matrix"):
        _ = EMPTY.allocation_matrix


@pytest.mark.parametrize("name", vehicle_names())
def test_a_whole_vehicle_survives_being_a_draft(name: str) -> None:
    vehicle = load_vehicle(name)
    draft = VehicleDraft.of(vehicle)
    assert draft.missing == ()
    again = draft.vehicle()
    assert np.array_equal(again.allocation_matrix, vehicle.allocation_matrix)
    assert np.array_equal(again.hydrodynamics.added_mass, vehicle.hydrodynamics.added_mass)
    assert np.array_equal(again.X_BC.q, vehicle.X_BC.q)
    assert again.provenance == vehicle.provenance


@pytest.mark.parametrize("field", ["mass_kg", "inertia_kg_m2", "added_mass", "X_BC", "camera_fov_rad", "p_BB_m"])
def test_one_thing_missing_is_the_one_thing_listed(field: str) -> None:
    draft = replace(load_draft("paper"), **{field: None})
    assert len(draft.missing) == 1
    with pytest.raises(InputError, match=draft.missing[0]):
        draft.vehicle()


def test_a_limit_that_some_thrusters_lack_is_listed_with_their_numbers() -> None:
    paper = load_draft("paper")
    some = tuple(replace(t, max_reverse_N=None if i in (1, 4) else 40.0) for i, t in enumerate(paper.thrusters))
    assert replace(paper, thrusters=some).missing == ("thruster reverse limit (of thruster 2, 5)",)
    assert replace(paper, thrusters=some).thrust_limits_N is None


def test_a_matrix_stands_in_for_places() -> None:
    """A draft without places takes the shipped matrix and numbers its thrusters."""
    rexrov = load_draft("rexrov")
    bare = replace(rexrov, thrusters=())
    assert np.array_equal(bare.allocation_matrix, rexrov.shipped_matrix)
    assert bare.thruster_names == ("1", "2", "3", "4", "5", "6", "7", "8")
    assert "thruster places and axes" in bare.missing


def test_an_added_mass_off_by_rounding_is_made_symmetric_and_that_is_said() -> None:
    lopsided = np.diag([700.0, 1200.0, 3500.0, 500.0, 800.0, 200.0])
    lopsided[2, 5], lopsided[5, 2] = 10.774, 10.775
    draft = replace(EMPTY, added_mass=lopsided)
    assert draft.added_mass is not None
    assert draft.added_mass[2, 5] == draft.added_mass[5, 2] == pytest.approx(10.7745)
    assert "up to 0.001, the mean is taken" in draft.notes[0]
    lopsided[2, 5] = 40.0
    with pytest.raises(InputError, match="added_mass: not symmetric"):
        replace(EMPTY, added_mass=lopsided)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"mass_kg": float("nan")}, "mass_kg"),
        ({"displaced_volume_m3": -1.0}, "displaced_volume_m3"),
        ({"size_m": np.array([1.0, 0.0, 1.0])}, "size_m"),
        ({"inertia_kg_m2": np.diag([1.0, 1.0, -0.1])}, "inertia_kg_m2: smallest eigenvalue -0.1"),
        ({"inertia_kg_m2": SPUN}, "symmetric"),
        ({"inertia_kg_m2": np.eye(2)}, r"inertia_kg_m2: shape \(2, 2\), allowed \(3, 3\)"),
        ({"p_BG_m": np.array([np.inf, 0, 0])}, "p_BG_m: holds NaN or infinity"),
        ({"quadratic_damping": -np.eye(6)}, "quadratic_damping"),
        ({"linear_damping": -np.eye(6)}, "linear_damping"),
        ({"shipped_matrix": np.zeros((5, 8))}, r"shipped_matrix: shape \(5, 8\), allowed \(6, n\)"),
        ({"camera_fov_rad": 4.0}, "camera_fov_rad"),
        ({"thrusters": (thruster(), thruster())}, "more than once"),
        ({"thrusters": (thruster(),), "shipped_matrix": np.zeros((6, 2))}, r"allowed \(6, 1\)"),
    ],
)
def test_an_impossible_value_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(EMPTY, **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axis_B": np.zeros(3)}, "thruster T: axis.*must not be zero"),
        ({"axis_B": np.array([np.nan, 0, 1])}, "thruster T: axis_B: holds NaN"),
        ({"p_BT_m": np.array([11.0, 0, 0])}, "thruster T: 11 m from the body origin"),
        ({"max_forward_N": -1.0}, "max_forward_N"),
        ({"disk_area_m2": 0.0}, "disk_area_m2"),
        ({"time_constant_s": float("nan")}, "time_constant_s"),
    ],
)
def test_an_impossible_thruster_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        thruster(**changes)


@pytest.mark.parametrize("name", draft_names())
def test_arrays_of_a_draft_cannot_be_changed(name: str) -> None:
    draft = load_draft(name)
    for array in (draft.allocation_matrix, draft.null_space, draft.thrusters[0].axis_B, draft.p_BG_m):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
