"""Geometry of the records: allocation matrix, null space, and what they refuse."""

from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters import Thruster
from wakewise.robot.vehicles import Hydrodynamics, Vehicle, load_vehicle, vehicle_names
from wakewise.robot.vehicles.vehicle import readable_null_space


@pytest.fixture(scope="module", params=vehicle_names())
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(request.param)


def thruster(**changes: Any) -> Thruster:
    values: dict[str, Any] = {
        "name": "T",
        "p_BT_m": np.array([0.1, 0.2, 0.3]),
        "axis_B": np.array([0.0, 0.0, 2.0]),
        "max_forward_N": 50.0,
        "max_reverse_N": 40.0,
        "disk_area_m2": 0.003,
        "time_constant_s": 0.1,
    }
    return Thruster(**(values | changes))


def test_a_columns_moment_is_the_lever_crossed_with_the_axis(vehicle: Vehicle) -> None:
    """Force parts have unit length and moments are perpendicular to both lever and force."""
    for j, t in enumerate(vehicle.thrusters):
        force, moment = vehicle.allocation_matrix[:3, j], vehicle.allocation_matrix[3:, j]
        assert np.isclose(np.linalg.norm(force), 1.0, atol=1e-15)
        assert abs(moment @ force) < 1e-15
        assert abs(moment @ t.p_BT_m) < 1e-15


def test_the_null_space_makes_no_wrench_and_is_orthonormal(vehicle: Vehicle) -> None:
    N = vehicle.null_space
    assert np.abs(vehicle.allocation_matrix @ N).max() < 1e-14
    assert np.allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-14)


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy", "bluerov2-heavy-gazebo", "bluerov2-heavy-wu"])
def test_four_and_four_fight_in_one_horizontal_squeeze_and_one_vertical_twist(name: str) -> None:
    expected = 0.5 * np.array([[1, 1, 1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 1, -1, -1, 1]]).T
    assert np.allclose(load_vehicle(name).null_space, expected, atol=1e-14)


def test_the_sparsest_null_vector_comes_first_and_stays_sparse() -> None:
    """RexROV's horizontals cancel alone; its slanted thrusters need the horizontals' help."""
    first, second = load_vehicle("rexrov").null_space.T
    assert np.allclose(first, 0.5 * np.array([0, 0, 0, 0, 1, 1, 1, 1]), atol=1e-9)
    assert np.all(np.abs(second) > 0.05)


@settings(max_examples=50, deadline=None)
@given(n=st.integers(1, 12), rank=st.integers(1, 6), seed=st.integers(0, 10_000))
def test_the_null_space_of_any_matrix_has_the_missing_dimensions(n: int, rank: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, n))
    N = readable_null_space(matrix)
    assert N.shape == (n, n - min(rank, n))
    assert np.abs(matrix @ N).max(initial=0.0) < 1e-9
    assert np.allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-9)


def test_records_cannot_be_changed(vehicle: Vehicle) -> None:
    record: Any = vehicle
    with pytest.raises(FrozenInstanceError):
        record.mass_kg = 1.0
    for array in (vehicle.allocation_matrix, vehicle.null_space, vehicle.thrust_upper_N, vehicle.thrusters[0].axis_B):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_an_axis_is_normalised() -> None:
    assert np.array_equal(thruster().axis_B, [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axis_B": np.zeros(3)}, "axis"),
        ({"axis_B": np.array([np.nan, 0, 1])}, "axis_B: holds NaN"),
        ({"p_BT_m": np.array([100.0, 0, 0])}, "at most 10 m"),
        ({"max_forward_N": -1.0}, "max_forward_N"),
        ({"max_reverse_N": float("nan")}, "max_reverse_N"),
        ({"disk_area_m2": 0.0}, "disk_area_m2"),
        ({"time_constant_s": float("inf")}, "time_constant_s"),
        ({"p_BT_m": np.zeros(2)}, "shape"),
    ],
)
def test_an_impossible_thruster_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        thruster(**changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"mass_kg": float("nan")}, "mass_kg"),
        ({"displaced_volume_m3": -1.0}, "displaced_volume_m3"),
        ({"size_m": np.array([1.0, 0.0, 1.0])}, "size_m"),
        ({"inertia_kg_m2": np.diag([1.0, 1.0, 0.0])}, "inertia"),
        ({"inertia_kg_m2": np.eye(3) + np.eye(3, k=1)}, "symmetric"),
        ({"p_BG_m": np.array([np.inf, 0, 0])}, "p_BG_m"),
        ({"thrusters": ()}, "at least one"),
        ({"thrusters": (thruster(), thruster())}, "more than once"),
        ({"camera_fov_rad": 4.0}, "camera_fov_rad"),
    ],
)
def test_an_impossible_vehicle_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(load_vehicle("paper"), **changes)


@pytest.mark.parametrize("field", ["added_mass", "linear_damping", "quadratic_damping"])
def test_water_that_would_do_work_on_the_vehicle_is_refused(field: str) -> None:
    matrices = {"added_mass": np.eye(6), "linear_damping": np.eye(6), "quadratic_damping": np.eye(6)}
    with pytest.raises(InputError, match=field):
        Hydrodynamics(**(matrices | {field: -np.eye(6)}))
    lopsided = np.eye(6)
    lopsided[0, 1] = 3.0
    with pytest.raises(InputError, match=field):
        Hydrodynamics(**(matrices | {field: lopsided}))
