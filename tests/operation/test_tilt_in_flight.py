"""A flight with a camera that tilts: what is true, what is measured, and what the photographs get."""

import math

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.operation import Flight

TILTING = {
    "vehicle": "paper-tilting",
    "method": "dp",
    "mission.elevations_deg": [25.0, 35.0],
    "mission.views": [3, 3],
    "mission.settle_s": 0.0,
    "mission.approach_m": 0.0,
    "tank.silt.load_kg_m2": 0.0,
    "tank.sensors.tilt_bias_rad": 0.02,
}
SECONDS = 2.5


@pytest.fixture(scope="module")
def flight() -> Flight:
    """The first seconds, in which the shutter opens at once."""
    return ww.fly(ww.Scenario.preset("quick", **TILTING), duration_s=SECONDS)


def columns(flight: Flight, who: str) -> np.ndarray:
    return flight.steps[f"{who}_tilt_deg"].to_numpy()


def test_the_vehicle_stays_level_while_its_camera_looks_down(flight: Flight) -> None:
    """The joint takes all 25 deg from the first instant on."""
    assert columns(flight, "true") == pytest.approx(np.full(len(flight.steps), -25.0), abs=1e-9)
    assert columns(flight, "goal") == pytest.approx(np.full(len(flight.steps), -25.0), abs=1e-9)
    q = flight.steps.select("goal_qw", "goal_qx", "goal_qy", "goal_qz").to_numpy()
    assert np.abs(q[:, 1:3]).max() < 1e-9


def test_the_measured_tilt_has_the_trials_own_error(flight: Flight) -> None:
    """One offset for all readings, drawn with 0.02 rad, and a noise of 0.002 rad; the first is exact."""
    error = np.radians(columns(flight, "est") - columns(flight, "true"))
    assert error[0] == 0.0
    assert 1e-4 < abs(error[1:].mean()) < 0.08
    assert error[1:].std() == pytest.approx(0.002, rel=0.3)


def test_photographs_are_taken_with_the_true_tilt_and_believed_with_the_measured_one(flight: Flight) -> None:
    """X_WC is X_WB X_BC(tilt), each with its own tilt."""
    vehicle, exposure = flight.parts.vehicle, flight.recorder.exposures[0]
    row = flight.steps.row(int(np.flatnonzero(flight.steps["exposing"].to_numpy())[0]), named=True)
    for who, X_WC in (("true", exposure.X_WC_true[0]), ("est", exposure.X_WC_est)):
        X_WB = Pose(np.array([row[f"{who}_{k}_m"] for k in "xyz"]), np.array([row[f"{who}_q{k}"] for k in "wxyz"]))
        expected = X_WB @ vehicle.X_BC_at(math.radians(row[f"{who}_tilt_deg"]))
        # The shutter opens within a step of the row and is open for some ms.
        assert X_WC.p_m == pytest.approx(expected.p_m, abs=2e-3)
        assert pytest.approx(expected.R, abs=2e-3) == X_WC.R


def test_a_flight_sends_only_thrusts_that_can_be_held(flight: Flight) -> None:
    """Every command is a step of the thruster; those that are asked for less rest now and then."""
    vehicle = flight.parts.vehicle
    commands = flight.steps.select([f"command_{i + 1}_N" for i in range(8)]).to_numpy()
    assert np.array_equal(vehicle.thrust_steps.delivered_N(commands), commands)
    assert 0.05 < np.mean(commands[:, :4] == 0.0) < 0.95


def test_ideal_thrusters_are_for_controller_and_tank_alike() -> None:
    """The setting takes the least thrust out of both."""
    parts = ww.Scenario.preset("quick", **TILTING, **{"tank.ideal_thrusters": True}).parts()
    assert parts.vehicle.thrust_steps is None
    assert parts.world.vehicle.thrust_steps is None
    assert parts.pipeline.pwm is None and parts.pipeline.motion is parts.controller.motion


def test_the_true_drag_is_the_case_that_is_asked_for() -> None:
    """A named case, within the stated percentage; the controller goes on believing its own."""
    parts = ww.Scenario.preset("quick", **{"tank.mismatch.drag": "box", "tank.mismatch.damping_pct": 0.0}).parts()
    assert np.diag(parts.world.vehicle.hydrodynamics.linear_damping).tolist() == [0.0] * 6
    assert parts.vehicle.hydrodynamics.linear_damping[0, 0] == 4.0
    with pytest.raises(InputError, match=r"tank\.mismatch\.drag: 'bx'"):
        _ = ww.Scenario.preset("quick", **{"tank.mismatch.drag": "bx"}).parts().world


def test_aims_that_the_vehicle_cannot_do_are_said_before_the_flight() -> None:
    """One line each: no joint, and stops that an orbit of 60 deg lies beyond."""
    with pytest.raises(InputError, match="has no tilt joint"):
        _ = ww.Scenario.preset("quick", **{"mission.aim": "tilt"}).parts().preflight
    high = TILTING | {"mission.aim": "tilt", "mission.elevations_deg": [40.0, 60.0]}
    with pytest.raises(InputError, match=r"its stops are at -45 and 45 deg"):
        _ = ww.Scenario.preset("quick", **high).parts().preflight


def test_a_current_is_held_against_the_worst_drag_that_may_be_drawn() -> None:
    """The margin told beforehand is that of the set with the most drag at that speed."""
    preset = {"tank.current.velocity_m_s": [0.3, 0.0, 0.0], "tank.mismatch.trim_N": 0.0}
    margins = {
        case: ww.Scenario.preset("quick", **preset, **{"tank.mismatch.drag": case}).parts().preflight.holding.share
        for case in ("nominal", "von-benzon", "random")
    }
    assert margins["random"] == margins["von-benzon"] < margins["nominal"]
