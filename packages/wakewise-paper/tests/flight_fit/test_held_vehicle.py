"""A held vehicle whose bow thrusters push in turn: which jets its camera can see, and what of the water it finds."""

import numpy as np

from wakewise.robot.vehicles import load_vehicle
from wakewise.vision.imaging import PinholeCamera
from wakewise_paper.flight_fit.flake_likelihood import fit_flight
from wakewise_paper.flight_fit.flake_tracks import ARRIVED_S, LEVELS_N, bow_jets, held_sightings
from wakewise_paper.learned_wake.truth import SampledWater

CAMERA = PinholeCamera(960, 720, float(np.radians(90.0)))
VEHICLE = load_vehicle("paper")


def test_the_bow_thrusters_alone_blow_into_the_view():
    """Forward thrust of the first two, whose force axes point aft."""
    assert bow_jets(VEHICLE) == [(0, 1.0), (1, 1.0)]
    assert (VEHICLE.thruster_axes_B[:2, 0] < 0.0).all()


def test_the_camera_finds_the_current():
    """Within 1 cm/s in half a minute, one jet pushing at a time and only once it has gone on for a while."""
    current = np.array([0.05, -0.03, 0.0])
    drawn = SampledWater(half_width_growth=0.12, wake_life=1.2)
    seen = held_sightings(VEHICLE, CAMERA, drawn, current, np.random.default_rng(0), minutes=0.5, per_m3=1500.0)
    pushing = seen.pushes_N > 0.0
    assert (pushing.sum(axis=1) == 1).all()
    assert np.isin(seen.pushes_N[pushing].round(9), LEVELS_N).all()
    assert (seen.times_s % 15.0 >= ARRIVED_S - 1e-6).all()
    np.testing.assert_allclose(fit_flight(seen, CAMERA, VEHICLE).current_m_s, current, atol=0.01)
