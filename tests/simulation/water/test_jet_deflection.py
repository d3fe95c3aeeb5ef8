"""Jets that come up to a body go round it at their own speed, and what strikes it turns aside."""

import math
from itertools import pairwise

import numpy as np
import pytest
from bodies_in_jets import box
from hypothesis import given
from hypothesis import strategies as st

from wakewise.simulation.water.blockage import Blockage, deflect_velocity, strike_body
from wakewise.simulation.water.water import Water

SIDE = 0.3


@pytest.fixture(scope="module")
def wall():
    """A face at x = 0, wide beside the jets here, in pieces of a square centimetre; the box has no other."""
    rows = Blockage.of(box([0.0, -SIDE, 10.0 - SIDE], [0.2, SIDE, 10.0 + SIDE])).rows
    at = np.arange(-SIDE + 0.005, SIDE, 0.01)
    y, z = (side.ravel() for side in np.meshgrid(at, 10.0 + at))
    face = rows._replace(
        points=np.column_stack([0 * y, y, z]), normals=np.tile([-1.0, 0.0, 0.0], (len(y), 1)), piece=1e-4
    )
    deflect_velocity(face, np.array([-0.03, 0.0, 10.0]), np.ones(3), np.ones(3))  # compiled here, not within an example
    return face


def _struck(body, y, sigma, steps=200, start=-0.5, end=0.0):
    """What is left along x of a unit impulse that is carried straight up to the wall, y from its middle."""
    m, flow = np.array([1.0, 0.0, 0.0]), np.array([0.2, 0.0, 0.0])
    for a, b in pairwise(np.linspace(start, end, steps + 1)):
        strike_body(body, np.array([a, y, 10.0]), np.array([b, y, 10.0]), flow, sigma, m)
    return m[0]


def _met(y, sigma):
    """Share of a round Gaussian that lies within the face."""
    edges = [math.erf((side * SIDE - y) / math.sqrt(2) / sigma) for side in (-1, 1)]
    return 0.5 * (edges[1] - edges[0]) * math.erf(SIDE / math.sqrt(2) / sigma)


@pytest.mark.parametrize(("y", "sigma"), [(SIDE, 0.06), (SIDE - 0.04, 0.06), (SIDE + 0.05, 0.08), (SIDE + 0.1, 0.08)])
def test_of_a_slipstream_that_passes_an_edge_the_face_takes_what_lies_within_it(wall, y, sigma):
    """By the Gaussian's own share of the face, to a hundredth of the impulse, once the parcel has passed it."""
    assert _struck(wall, y, sigma, end=0.1) == pytest.approx(1.0 - _met(y, sigma), abs=0.01)


def test_a_square_strike_takes_all_and_nothing_is_felt_far_before(wall):
    """Three sigma before the face a parcel has lost nothing, at it nearly all; in steps of any size."""
    assert _struck(wall, 0.0, 0.05, end=-0.16) > 0.98
    assert _struck(wall, 0.0, 0.05) < 0.1
    assert _struck(wall, 0.0, 0.05, steps=60, end=-0.05) == pytest.approx(_struck(wall, 0.0, 0.05, end=-0.05), abs=0.05)


def test_what_strikes_goes_off_the_way_that_the_parcel_goes(wall):
    """The loss along the jet is a gain along the face; what is told as lost is the length's."""
    m, flow = np.array([1.0, 0.0, 0.0]), np.array([0.1, 0.1, 0.0])
    lost = strike_body(wall, np.array([-0.06, 0.0, 10.0]), np.array([-0.04, 0.01, 10.0]), flow, 0.05, m)
    assert m[1] == pytest.approx(1.0 - m[0]) and m[1] > 0.01 and m[2] == 0.0
    assert lost == pytest.approx(1.0 - np.linalg.norm(m))
    away = np.array([-1.0, 0.0, 0.0])
    assert strike_body(wall, np.array([-0.04, 0, 10.0]), np.array([-0.06, 0, 10.0]), -flow, 0.05, away) == 0.0
    assert away[0] == -1.0  # what leaves a surface does not strike it


@given(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9))
def test_a_parcel_keeps_its_speed_and_turns_by_a_right_angle_at_most(wall, numbers):
    """Whatever the answer is, and nothing of it draws the parcel to the face that it is at."""
    x = np.array([-0.03, 0.1 * numbers[0], 10.0 + 0.1 * numbers[1]])
    u, answer = np.array(numbers[3:6]), np.array(numbers[6:9])
    before, free = np.linalg.norm(u), u.copy()
    deflect_velocity(wall, x, u, answer.copy())
    assert np.linalg.norm(u) == pytest.approx(before, abs=1e-12)
    assert u @ free > -1e-9
    if np.linalg.norm(answer) < 1e-3 * before:
        assert np.array_equal(u, free)
    tangent = np.array([0.0, 0.6, 0.8])
    led = tangent.copy()
    # The face looks to -x: an answer that points to +x would draw in.
    deflect_velocity(wall, x, led, np.array([abs(numbers[6]), 0.0, 0.0]))
    assert led[0] <= 0.02 * np.linalg.norm(tangent) and led @ tangent > 0.99


def test_a_parcel_to_which_the_body_answers_nothing_goes_straight_on(wall):
    """Not even its rounding changes."""
    u = np.array([0.3, -0.2, 0.1])
    deflect_velocity(wall, np.array([-0.2, 0.0, 10.0]), u, np.zeros(3))
    assert np.array_equal(u, [0.3, -0.2, 0.1])


def test_a_jet_that_strikes_for_long_does_not_pile_up():
    """After a minute there are no more parcels, nor faster water, than after the first; what is missing is told."""
    body = Blockage.of(box([0.18, -0.075, 9.925], [0.33, 0.075, 10.075]))
    area, density, thrust = math.pi * 0.03**2, 998.0, 1.0
    water = Water(np.array([area]), density_kg_m3=density, bed_z_m=50.0, rng=np.random.default_rng(0), body=body)
    at, axes = np.array([[0.0, 0.0, 10.0]]), np.array([[-1.0, 0.0, 0.0]])
    grid = np.stack(np.meshgrid(np.linspace(0.05, 0.6, 12), np.linspace(-0.3, 0.3, 13), [10.0], indexing="ij"), axis=-1)
    places = grid.reshape(-1, 3)
    fastest, parcels = [], []
    for k in range(600):
        water.step(0.1, at, at, axes, np.array([[0.1 * thrust, 0.0]]))
        if k >= 60 and k % 10 == 0:
            fastest.append(np.linalg.norm(water.velocity(places), axis=1).max())
            parcels.append(water.parcels.count)
    exit_m_s = math.sqrt(thrust / (density * area))
    assert max(fastest) < 1.5 * exit_m_s
    assert np.mean(parcels[-10:]) < 1.5 * max(np.mean(parcels[:10]), 20.0)
    left = density * float(water.parcels.size_m4_s.sum())
    # A jet that is carried on has more parcels' impulse in it than was sent: nothing of it can be told as lost twice.
    assert 0.2 * 60.0 * thrust < water.counts.struck_N_s < 60.0 * thrust
    assert left + water.counts.struck_N_s + water.counts.retired_N_s == pytest.approx(60.0 * thrust, rel=0.02)
