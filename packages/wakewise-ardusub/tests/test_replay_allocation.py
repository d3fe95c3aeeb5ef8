"""What other thrusts would have done, worked out from the pulses of a log."""

from __future__ import annotations

import dataclasses

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_table import library_curve
from wakewise.robot.vehicles import Vehicle, load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.logs.replay_allocation import bow_points, replay_log
from wakewise_ardusub.motors import motor_channels
from wakewise_ardusub.vehicle_summary import VehicleSummary

DIRECTIONS = (-1, -1, 1, 1, -1, 1, 1, -1)
PARAMETERS = {f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(DIRECTIONS, 1)} | {
    f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 9)
}


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("bluerov2-heavy")


def _rows(*pulses: list[float | None], volts: float | None = 15.0) -> pl.DataFrame:
    columns = {f"servo_{i + 1}_us": [row[i] if i < len(row) else None for row in pulses] for i in range(16)}
    return pl.DataFrame(columns, schema_overrides=dict.fromkeys(columns, pl.Float64)).with_columns(
        voltage_V=pl.lit(volts, dtype=pl.Float64)
    )


def _astern(size_us: float) -> list[float | None]:
    """Pulses that push back along the nose with all four level thrusters."""
    signs = (1, 1, -1, -1, 0, 0, 0, 0)
    return [1500.0 + d * s * size_us for d, s in zip(DIRECTIONS, signs, strict=True)]


def test_pulses_become_thrusts_by_curve_voltage_and_direction(vehicle: Vehicle) -> None:
    """A motor with direction -1 gives the curve's thrust the other way; less voltage, less thrust."""
    region, wake = bow_points(vehicle, 0.4), wake_model("jet")
    curve = library_curve("t200")
    for volts in (13.0, 16.0):
        found = replay_log(_rows(_astern(150.0), volts=volts), PARAMETERS, vehicle, region, wake)
        signs = np.array(DIRECTIONS) * np.array([1, 1, -1, -1, 0, 0, 0, 0])
        expected = np.array(DIRECTIONS) * curve.thrust_N(1500.0 + 150.0 * signs, volts)
        assert found.thrusts_N["flown"][0] == pytest.approx(expected)
        assert found.wrench_B[0] == pytest.approx(vehicle.allocation_matrix @ expected)
        assert found.wrench_B[0, 0] < -5.0


def test_all_shares_make_the_flown_wrench_and_gentle_is_never_worse(vehicle: Vehicle) -> None:
    """Going astern, the bow's jets blow at the points; the rear thrusters can do it alone."""
    rng = np.random.default_rng(0)
    pulses = [_astern(150.0)] + [list(1500.0 + rng.uniform(-150.0, 150.0, 8)) for _ in range(20)]
    found = replay_log(_rows(*pulses), PARAMETERS, vehicle, bow_points(vehicle, 0.4), wake_model("jet"))
    for share in ("least", "gentle"):
        made = found.thrusts_N[share] @ vehicle.allocation_matrix.T
        assert made == pytest.approx(found.wrench_B, abs=1e-6)
    cost = {
        share: found.disturbance[share] + 1e-6 * (found.thrusts_N[share] ** 2).sum(axis=1)
        for share in ("flown", "least", "gentle")
    }
    assert (cost["gentle"] <= np.minimum(cost["flown"], cost["least"]) + 1e-9).all()
    assert found.disturbance["gentle"][0] < 0.1 * found.disturbance["flown"][0]
    saved = found.saved_pct()
    assert saved is not None
    assert saved > 0.0


def test_what_is_not_known_is_null_and_rest_is_nothing(vehicle: Vehicle) -> None:
    """A row without pulses has no thrusts; pulses in the dead band give none."""
    found = replay_log(
        _rows([None] * 8, [1500.0] * 8, _astern(20.0), volts=None),
        PARAMETERS,
        vehicle,
        bow_points(vehicle, 0.4),
        wake_model("jet"),
    )
    assert np.isnan(found.thrusts_N["flown"][0]).all()
    assert not found.running.any()
    assert found.saved_pct() is None
    columns = found.columns()
    assert columns["disturbance_flown"].to_list() == [None, 0.0, 0.0]
    assert columns["saved_pct"].null_count() == 3


def test_motors_are_found_on_their_channels(vehicle: Vehicle) -> None:
    """SERVOn_FUNCTION says where a motor is; without it they are in order; another number of motors is refused."""
    craft = VehicleSummary.of(vehicle, wake_model("jet"))
    assert motor_channels(craft, {}) == tuple(range(1, 9))
    moved = {f"SERVO{i + 4}_FUNCTION": 32.0 + i for i in range(1, 9)}
    assert motor_channels(craft, moved) == tuple(range(5, 13))
    six = {name: value for name, value in PARAMETERS.items() if value not in {39.0, 40.0}}
    with pytest.raises(InputError, match="8 thrusters, SERVOn_FUNCTION drives motors 1, 2, 3, 4, 5, 6;"):
        motor_channels(craft, six)


def test_a_thruster_without_a_curve_goes_in_proportion(vehicle: Vehicle) -> None:
    """Half of full output is half of the limit, whatever the voltage."""
    plain = dataclasses.replace(vehicle, curve=None)
    found = replay_log(_rows([1700.0] * 8), {}, plain, bow_points(plain, 0.4), wake_model("jet"))
    assert found.thrusts_N["flown"][0] == pytest.approx(0.5 * plain.thrust_upper_N)


def test_points_ahead_of_the_bow_are_ahead_of_it(vehicle: Vehicle) -> None:
    """None lies in the hull, and a distance out of range is refused."""
    for ahead_m in (0.05, 0.4, 3.0):
        assert (bow_points(vehicle, ahead_m).points_W_m[:, 0] > 0.5 * vehicle.size_m[0]).all()
    with pytest.raises(InputError, match="--ahead"):
        bow_points(vehicle, float("nan"))
