"""What the crew knows: drawn by the seed, told to mission, controller and reconstruction; the truth stays put."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.operation import Scenario
from wakewise.operation.scenario.calibration_error import (
    CURRENT_DEG,
    CalibrationErrorSettings,
    calibration_with_error,
    current_with_error,
    target_with_error,
)
from wakewise.simulation.water import AiryWave, AmbientSum, SteadyCurrent
from wakewise.vision.imaging import calibrate

ORDERS = ("plain", "current")
EXACT = {
    "calibration_error.target_position_m": 0.0,
    "calibration_error.focal_length_pct": 0.0,
    "calibration_error.principal_point_pct": 0.0,
    "calibration_error.distortion": 0.0,
}


def test_the_target_is_taken_to_be_where_it_is_not():
    """Millimetres off, another place for each seed, the same for one; its shape stays, and the bed."""
    parts = [Scenario(seed=seed).parts() for seed in (1, 1, 2)]
    places = [p.surveyed_target.centre_W_m - p.target.centre_W_m for p in parts]
    assert np.array_equal(places[0], places[1]) and not np.array_equal(places[0], places[2])
    assert 1e-4 < np.abs(places[0]).max() < 0.025
    true, found = parts[0].target, parts[0].surveyed_target
    np.testing.assert_allclose(
        found.mesh.vertices_m - true.mesh.vertices_m, np.tile(places[0], (len(true.mesh.vertices_m), 1)), atol=1e-12
    )
    assert (found.bed_z_m, found.radius_m) == (true.bed_z_m, true.radius_m)


def test_its_error_has_the_stated_spread():
    """Over 400 draws 5 mm per axis within 8 %."""
    target, rng = Scenario().parts().target, np.random.default_rng(0)
    moves = np.array(
        [target_with_error(target, CalibrationErrorSettings(), rng).centre_W_m - target.centre_W_m for _ in range(400)]
    )
    assert moves.std(axis=0) == pytest.approx(np.full(3, 0.005), rel=0.1)


def test_mission_and_controller_go_by_what_is_known_and_the_world_by_what_is():
    """Route, region and surroundings shift with the belief; the world's target does not."""
    known, exact = (Scenario(seed=3).replace(**{"target.points": 60}, **changes).parts() for changes in ({}, EXACT))
    shift = known.surveyed_target.centre_W_m - known.target.centre_W_m
    assert exact.surveyed_target is exact.target
    for a, b in (
        (known.route.centre_W_m, exact.route.centre_W_m),
        (known.surroundings.spheres[:, :3].mean(axis=0), exact.surroundings.spheres[:, :3].mean(axis=0)),
        (
            known.region.points_W_m[known.region.distance_m <= 0].mean(axis=0),
            exact.region.points_W_m[exact.region.distance_m <= 0].mean(axis=0),
        ),
    ):
        assert np.asarray(a) - np.asarray(b) == pytest.approx(shift, abs=3e-3)
    assert known.world.target is known.target
    assert np.array_equal(known.target.centre_W_m, exact.target.centre_W_m)


def test_a_calibration_is_as_far_off_as_stated():
    """Focal length, principal point, k1 to p2: over 400 draws their spreads within 10 %; both focal lengths alike."""
    true, rng, survey = calibrate(Scenario().imaging.camera()), np.random.default_rng(1), CalibrationErrorSettings()
    off = np.array([calibration_with_error(true, survey, rng).params - true.params for _ in range(400)])
    stated = [0.002 * true.params[0]] * 2 + [0.0015 * true.width] * 2 + [0.003, 0.006, 0.00075, 0.00075]
    assert off.std(axis=0) == pytest.approx(stated, rel=0.1)
    assert off[:, 0] == pytest.approx(off[:, 1])


@pytest.mark.parametrize(
    "bad", [{"place_m": -0.1}, {"place_m": 1.0}, {"focal_length_pct": 50.0}, {"distortion": float("nan")}]
)
def test_bad_values_do_not_become_settings(bad):
    """Out of range or no number."""
    with pytest.raises(ValidationError):
        CalibrationErrorSettings(**bad)


def test_the_current_is_known_but_for_its_direction():
    """Speed and sink are the water's own; over 400 draws the direction is off by the stated spread within 10 %."""
    water, rng = SteadyCurrent(velocity_W_m_s=np.array([0.06, -0.08, 0.01])), np.random.default_rng(0)
    known = np.array([current_with_error(water, np.zeros(3), rng) for _ in range(400)])
    np.testing.assert_allclose(np.hypot(known[:, 0], known[:, 1]), 0.1)
    np.testing.assert_allclose(known[:, 2], 0.01)
    off = np.degrees(np.arctan2(known[:, 1], known[:, 0]) - np.arctan2(-0.08, 0.06))
    assert off.std() == pytest.approx(CURRENT_DEG, rel=0.1)


def test_a_swell_is_no_current():
    """A minute's mean leaves less than a twentieth of the orbital speed of a wave that runs over a steady current."""
    steady = SteadyCurrent(velocity_W_m_s=np.array([0.05, 0.0, 0.0]))
    wave = AiryWave(amplitude_m=0.02, period_s=7.0, heading_rad=0.0, depth_m=1.5)
    place = np.array([0.0, 0.0, 1.4])
    swing = max(float(np.linalg.norm(wave.velocity(place[None], t))) for t in np.arange(0.0, 7.0, 0.1))
    rng = np.random.default_rng(1)
    known = current_with_error(AmbientSum(parts=(steady, wave)), place, rng)
    assert np.hypot(known[0], known[1]) == pytest.approx(0.05, abs=0.05 * swing)


def test_the_survey_is_of_the_water_that_is_flown_in():
    """Asked for an order, the mission begins downstream by the tank's own current; plain, in the north."""
    told = {"tank.current.velocity_m_s": (0.0, 0.08, 0.0), "tank.current.turbulence_m_s": 0.0, "world": "tank"}
    legs = {order: Scenario().replace(**told, **{"mission.order": order}).parts().route.legs[0] for order in ORDERS}
    assert float(legs["plain"].start[0]) == 0.0
    off = np.degrees(float(legs["current"].start[0]) - 0.5 * np.pi)
    assert abs(off) < 3.0 * CURRENT_DEG + 360.0 / 20
