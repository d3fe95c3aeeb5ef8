"""Jets of uncertain direction: the mean over directions drawn one by one, and what its least shares do."""

import numpy as np
import pytest

from wakewise.allocation import Weights, compile_layout, min_wash_allocation
from wakewise.control.forward_jet_exclusion import bow_layout
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel, RoundJet, wake_model
from wakewise.wake.disturbance import SCATTER_RAD, scattered_jet_gram

AREA = np.array([0.0045])
AHEAD = np.array([[1.0, 0.0, 0.0]])
HERE = np.zeros((1, 3))
LAW = RoundJet().law


def drawn(rng, n):
    """Unit vectors about north, shape (n, 3): von Mises and Fisher's law by its inverse."""
    kappa = 2.0 / SCATTER_RAD**2
    cosine = 1.0 + np.log(rng.uniform(np.exp(-2.0 * kappa), 1.0, n)) / kappa
    turn, sine = rng.uniform(0.0, 2.0 * np.pi, n), np.sqrt(1.0 - cosine**2)
    return np.stack([cosine, sine * np.cos(turn), sine * np.sin(turn)], axis=1)


@pytest.mark.parametrize("name", ["jet", "jet-fitted"])
@pytest.mark.parametrize("angle_deg", [0.0, 50.0, 120.0])
def test_it_is_the_mean_over_drawn_directions(name, angle_deg):
    """To a seventh, at points ahead, abeam and behind: a jet is narrower than the scatter, not infinitely so."""
    model, rng = wake_model(name), np.random.default_rng(5)
    angle = np.radians(angle_deg)
    point = 0.7 * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    ways = drawn(rng, 200_000)
    alike = len(ways)
    velocity = model.unit_velocity(point, np.zeros((alike, 3)), ways, np.full(alike, AREA[0]))
    mean = float(np.mean(np.sum(velocity[:, 0] ** 2, axis=1)))
    # Force against the jet: slot 0 blows ahead.
    found = scattered_jet_gram(point, np.ones(1), HERE, -AHEAD, AREA, *model.law)
    assert found[0] == pytest.approx(mean, rel=1.0 / 7.0)


def test_signs_are_opposite_ways_and_weights_count():
    """A thruster turned about has its two slots exchanged; twice the weight is twice the harm."""
    points, weights = np.array([[0.5, 0.1, 0.0], [0.6, -0.2, 0.1]]), np.array([0.4, 0.6])
    one = scattered_jet_gram(points, weights, HERE, AHEAD, AREA, *LAW)
    np.testing.assert_allclose(scattered_jet_gram(points, weights, HERE, -AHEAD, AREA, *LAW), one[::-1])
    np.testing.assert_allclose(scattered_jet_gram(points, 2.0 * weights, HERE, AHEAD, AREA, *LAW), 2.0 * one)
    # T > 0 blows south, away from the points.
    assert one[0] < 0.2 * one[1]


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_its_least_shares_keep_the_bow_rule_without_a_word_of_bows(name):
    """For pushes astern, level: no thruster that the rule bounds blows ahead by more than .05 N."""
    vehicle = load_vehicle(name)
    region = Region(points_W_m=np.array([[0.7, 0.0, 0.1]]), weights=np.ones(1), distance_m=np.zeros(1))
    view = InfluenceModel.of(vehicle, region, RoundJet())
    layout = compile_layout(vehicle.allocation_matrix, vehicle.thrust_lower_N, vehicle.thrust_upper_N)
    ruled = bow_layout(vehicle)
    d = view.scattered_gram(Pose(np.zeros(3)))
    for wrench in ([-2.0, 0.0, 0.0], [-1.0, 0.5, 0.0], [-2.0, -0.6, 1.0]):
        found = min_wash_allocation(
            layout, np.array([*wrench, 0.0, 0.0, 0.0]), np.diag(d), Weights(disturbance=1e4, effort=1e-3)
        ).thrusts_N
        assert np.all(found <= ruled.upper_N + 0.05)
        assert np.all(found >= ruled.lower_N - 0.05)
