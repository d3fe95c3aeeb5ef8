"""What the geometry allows, against ArduSub's mixer and closed forms."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.vehicles import (
    ARDUSUB_VECTORED_6DOF,
    Vehicle,
    achievable_wrench,
    allocation_rank,
    failure_rank,
    load_vehicle,
    mixing_disagreements,
    null_space_names,
    vehicle_names,
)

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))


@pytest.fixture(scope="module", params=vehicle_names())
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(request.param)


def test_no_sign_of_ardusubs_mixer_is_reversed(vehicle: Vehicle) -> None:
    """All 24 factors that ArduSub states have the geometry's sign; it leaves out 8 small couplings, no more."""
    found = mixing_disagreements(vehicle, ARDUSUB_VECTORED_6DOF)
    assert not any(d.reversed for d in found)
    assert [(d.thruster, d.axis) for d in found] == [
        (t.name, axis) for t in vehicle.thrusters[:4] for axis in ("roll", "pitch")
    ]


def test_all_48_factors_agree_once_the_horizontal_thrusters_have_no_height(vehicle: Vehicle) -> None:
    """The couplings that ArduSub leaves out are those of the horizontal thrusters' height and nothing else."""
    flat = replace(
        vehicle, thrusters=tuple(replace(t, p_BT_m=t.p_BT_m * np.array([1.0, 1.0, 0.0])) for t in vehicle.thrusters)
    )
    assert mixing_disagreements(flat, ARDUSUB_VECTORED_6DOF) == []


def test_our_table_of_motor_factors_is_ardusubs() -> None:
    path = DATA / "ardusub" / "ardusub_vectored_6dof_mixing.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    with path.open() as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    assert rows[0] == ["motor", "roll", "pitch", "yaw", "throttle", "forward", "lateral"]
    assert np.array_equal(np.array(rows[1:], dtype=float)[:, 1:], ARDUSUB_VECTORED_6DOF)


def test_a_reversed_factor_is_found(vehicle: Vehicle) -> None:
    factors = ARDUSUB_VECTORED_6DOF.copy()
    factors[6, 1] *= -1.0
    assert [(d.thruster, d.axis) for d in mixing_disagreements(vehicle, factors) if d.reversed] == [
        ("rear right vertical", "pitch")
    ]
    with pytest.raises(InputError, match="a row per thruster"):
        mixing_disagreements(vehicle, factors[:6])


def test_eight_thrusters_lose_none_of_six_axes_when_one_fails(vehicle: Vehicle) -> None:
    assert allocation_rank(vehicle) == 6
    assert failure_rank(vehicle) == [6] * 8


def test_six_thrusters_do_lose_an_axis() -> None:
    vehicle = load_vehicle("paper")
    six = replace(vehicle, thrusters=vehicle.thrusters[:6])
    assert allocation_rank(six) == 5
    assert min(failure_rank(six)) == 4


def test_the_null_space_has_names_in_words(vehicle: Vehicle) -> None:
    assert null_space_names(vehicle) == ["horizontal squeeze", "vertical twist"]


def test_the_achievable_wrench_has_its_closed_forms(vehicle: Vehicle) -> None:
    """Heave is limited by all four verticals; surge, sway and yaw by the weaker of each opposed pair."""
    wrench = achievable_wrench(vehicle)
    forward, reverse = float(vehicle.thrust_upper_N[0]), float(-vehicle.thrust_lower_N[0])
    assert np.allclose(wrench[2], [-4.0 * reverse, 4.0 * forward], rtol=1e-9)
    # A null-space squeeze shifts all four horizontals alike, so both signs share the whole range of thrust.
    surge = 4.0 * np.sqrt(0.5) * 0.5 * (forward + reverse)
    assert np.allclose(wrench[:2], [[-surge, surge]] * 2, rtol=1e-9)
    lever = float(vehicle.allocation_matrix[5, 0])
    assert np.allclose(wrench[5], [-2.0 * lever * (forward + reverse), 2.0 * lever * (forward + reverse)], rtol=1e-9)
