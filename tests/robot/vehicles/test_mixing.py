"""Stated matrices and mixers: ArduSub's 48 factors, and faults that were planted on purpose."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import (
    ARDUSUB_VECTORED,
    ARDUSUB_VECTORED_6DOF,
    Vehicle,
    compare_matrix,
    compare_with_ardusub,
    load_draft,
    load_vehicle,
    mixing_disagreements,
)
from wakewise.robot.vehicles.mixing import FLU, compare_either_frame, moments_about

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
LEVEL = {"bluerov2-heavy": 0.085, "bluerov2-heavy-gazebo": 0.0, "bluerov2-heavy-wu": 0.0, "paper": 0.050}


@pytest.fixture(scope="module", params=sorted(LEVEL))
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(request.param)


def test_all_48_factors_of_ardusub_agree_about_the_height_of_the_horizontal_thrusters(vehicle: Vehicle) -> None:
    """ArduSub gives horizontal thrusters no roll or pitch, which is so about a point level with them."""
    found = compare_with_ardusub(vehicle)
    assert (found.compared, found.agree, found.disagreements) == (48, 48, ())
    assert mixing_disagreements(vehicle, ARDUSUB_VECTORED_6DOF, LEVEL[vehicle.name]) == []


def test_about_the_origin_ardusub_leaves_out_eight_couplings_and_reverses_none(vehicle: Vehicle) -> None:
    found = mixing_disagreements(vehicle, ARDUSUB_VECTORED_6DOF)
    assert not any(d.reversed for d in found)
    couplings = [(j, axis) for j in (1, 2, 3, 4) for axis in ("roll", "pitch")]
    assert [(d.thruster, d.row) for d in found] == (couplings if LEVEL[vehicle.name] else [])
    assert all(d.fault == "left out" for d in found)
    assert bool(compare_with_ardusub(vehicle).notes) == bool(LEVEL[vehicle.name])


@pytest.mark.parametrize("name", ["bluerov2", "bluerov2-abir", "bluerov2-gazebo"])
def test_all_36_factors_of_the_six_thruster_frame_agree(name: str) -> None:
    found = compare_with_ardusub(load_vehicle(name))
    assert (found.compared, found.agree) == (36, 36)


def test_our_table_of_motor_factors_is_ardusubs() -> None:
    path = DATA / "ardusub" / "ardusub_vectored_6dof_mixing.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    with path.open() as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    assert rows[0] == ["motor", "roll", "pitch", "yaw", "throttle", "forward", "lateral"]
    assert np.array_equal(np.array(rows[1:], dtype=float)[:, 1:], ARDUSUB_VECTORED_6DOF)
    assert np.array_equal(ARDUSUB_VECTORED[:4], ARDUSUB_VECTORED_6DOF[:4])


def test_a_reversed_factor_is_found(vehicle: Vehicle) -> None:
    factors = ARDUSUB_VECTORED_6DOF.copy()
    factors[6, 1] *= -1.0
    found = mixing_disagreements(vehicle, factors, LEVEL[vehicle.name])
    assert [(d.name, d.row, d.fault) for d in found] == [("rear right vertical", "pitch", "sign wrong")]
    with pytest.raises(InputError, match="a row per thruster"):
        mixing_disagreements(vehicle, factors[:6])


def test_ardusub_has_no_frame_of_seven() -> None:
    paper = load_vehicle("paper")
    with pytest.raises(InputError, match="6 or 8 motors"):
        compare_with_ardusub(replace(paper, thrusters=paper.thrusters[:7]))


def test_rexrovs_matrix_from_its_geometry_is_the_shipped_one() -> None:
    rexrov = load_draft("rexrov")
    assert rexrov.shipped_matrix is not None
    assert np.abs(rexrov.allocation_matrix - rexrov.shipped_matrix).max() < 1e-6
    assert compare_matrix(rexrov, rexrov.shipped_matrix, "TAM.yaml").agree == 48


def test_the_faults_of_a_public_matrix_are_found() -> None:
    """The controller file of one project has another yaw arm than its own places, and rolls the wrong way."""
    heavy = load_draft("bluerov2-heavy-wu")
    assert heavy.shipped_matrix is not None
    found = compare_matrix(heavy, heavy.shipped_matrix, "tam").disagreements
    assert [d.thruster for d in found if d.row == "yaw"] == [1, 2, 3, 4]
    assert [d.thruster for d in found if d.row == "roll" and d.reversed] == [5, 6, 7, 8]
    assert found[0].text == (
        "row yaw, thruster 1 (front right horizontal): file says +0.1888, geometry says +0.164, off by +15.1 %"
    )


def test_every_single_fault_is_named(vehicle: Vehicle) -> None:
    """One entry changed in a copy of the true matrix is the one entry found, and the kind of fault is right."""
    rng = np.random.default_rng(7)
    true = vehicle.allocation_matrix
    for _ in range(20):
        i, j = int(rng.integers(6)), int(rng.integers(8))
        stated = true.copy()
        stated[i, j] = -true[i, j] if abs(true[i, j]) > 1e-3 else 0.3
        found = compare_matrix(vehicle, stated, "mine").disagreements
        fault = "sign wrong" if abs(true[i, j]) > 1e-3 else "not in the geometry"
        assert [(d.row, d.thruster, d.fault) for d in found] == [
            (("surge", "sway", "heave", "roll", "pitch", "yaw")[i], j + 1, fault)
        ]


def test_rounding_to_three_digits_is_no_disagreement(vehicle: Vehicle) -> None:
    assert compare_matrix(vehicle, vehicle.allocation_matrix.round(4), "rounded").disagreements == ()


def test_a_reversed_thruster_another_order_and_another_point_are_explained() -> None:
    heavy = load_vehicle("bluerov2-heavy")
    true = heavy.allocation_matrix
    reversed_ = true.copy()
    reversed_[:, 2] *= -1.0
    assert "thruster 3: the whole column has the opposite sign" in compare_matrix(heavy, reversed_, "a").notes[0]
    order = np.array([3, 1, 2, 0, 4, 5, 7, 6])
    said = " ".join(compare_matrix(heavy, true[:, order], "b").notes)
    assert "in the order 4, 2, 3, 1, 5, 6, 8, 7 only 0 entries disagree" in said
    point = np.array([0.01, -0.02, 0.03])
    said = " ".join(compare_matrix(heavy, moments_about(true, point), "c").notes)
    assert "moments taken about (0.010, -0.020, 0.030) m only 0 entries disagree" in said


def test_a_matrix_of_another_frame_is_turned_and_that_is_said() -> None:
    heavy = load_vehicle("bluerov2-heavy")
    found = compare_either_frame(heavy, heavy.allocation_matrix * FLU[:, None], "flu.csv")
    assert found.agree == 48
    assert "turned between y left, z up" in found.notes[0]
    assert compare_either_frame(heavy, heavy.allocation_matrix, "frd.csv").notes == ()


def test_moments_about_another_point_follow_the_lever() -> None:
    """Moving the reference point by r takes r x F from every moment."""
    heavy = load_vehicle("bluerov2-heavy")
    point = np.array([0.1, 0.2, -0.3])
    moved = moments_about(heavy.allocation_matrix, point)
    for j, t in enumerate(heavy.thrusters):
        assert np.allclose(moved[3:, j], np.cross(t.p_BT_m - point, t.axis_B), atol=1e-15)


def test_a_matrix_of_the_wrong_shape_is_refused() -> None:
    with pytest.raises(InputError, match=r"shape \(6, 7\), allowed \(6, 8\)"):
        compare_matrix(load_vehicle("paper"), np.zeros((6, 7)), "mine.csv")
