"""Wall jets in water that moves: those of still water without a current, a front against one."""

import numpy as np

from wakewise.wake import ImpingingJet, RoundJet, gram
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import advected_velocity
from wakewise.wake.wall_jet import wall_velocity

BED = 0.5
MODEL = ImpingingJet(jet=RoundJet(), bed_z_m=BED)
AREA = np.array([0.0045])
DOWN = np.array([[0.0, 0.0, 1.0]])


def flow(*current, unsure=0.0, thrusts=(1.0,)):
    return CrossFlow(current_W_m_s=np.array(current, float), current_std_m_s=unsure, thrusts_N=np.array(thrusts, float))


def near_bed(*x, y=0.0):
    return np.array([[far, y, BED - 0.01] for far in x])


def speeds(points, current, unsure=0.0, direction=DOWN):
    """Speed along the bed of a jet of 1 N from half a metre above it."""
    found = advected_velocity(
        MODEL, points, np.zeros((1, 3)), direction, AREA, np.ones(1), flow(*current, unsure=unsure)
    )
    return np.linalg.norm(found[0, :, :2], axis=1)


def test_without_a_current_wall_jets_are_those_of_still_water():
    """Velocity at random places near the bed, of a jet straight down and of a slanting one."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 1, (60, 2)), BED - rng.uniform(0, 0.1, 60)])
    slant = np.array([[0.6, 0.0, 0.8]])
    for direction in (DOWN, slant):
        found = advected_velocity(MODEL, points, np.zeros((1, 3)), direction, AREA, np.ones(1), flow(0.0, 0.0, 0.0))
        free = RoundJet().unit_velocity(points, np.zeros((1, 3)), direction, AREA)
        wall = wall_velocity(points, np.zeros((1, 3)), direction, AREA, MODEL.numbers)
        np.testing.assert_allclose(found, free + wall, rtol=1e-4, atol=1e-6)


def test_a_wall_jet_stops_where_its_own_speed_is_twice_the_current_and_less():
    """Upstream of the strike point nothing is beyond the front, and the front is nearer in a faster current."""
    still = speeds(near_bed(-1.0), (0.0, 0.0, 0.0))[0]
    assert still > 0.01
    assert speeds(near_bed(-1.0), (0.1, 0.0, 0.0))[0] < 0.05 * still
    places = np.linspace(-0.05, -1.5, 60)
    fronts = []
    for c in (0.015, 0.03, 0.06):
        found = speeds(near_bed(*places), (c, 0.0, 0.0))
        fronts.append(places[np.flatnonzero(found > 0.3 * found.max())[-1]])
    assert fronts[0] < fronts[1] < fronts[2] < 0.0


def test_the_strike_point_is_where_the_current_takes_the_jet():
    """The fast ring round the strike point lies downstream, about c times the time of the fall."""
    places = np.linspace(-0.6, 0.6, 121)
    still, carried = (speeds(near_bed(*places), (c, 0.0, 0.0)) for c in (0.0, 0.06))
    assert abs(places @ still / still.sum()) < 0.02
    assert 0.02 < places @ carried / carried.sum() < 0.3


def test_mirrored_currents_give_mirrored_walls():
    """A current to the north and one to the south."""
    one, other = speeds(near_bed(0.3, -0.4), (0.05, 0.0, 0.0)), speeds(near_bed(-0.3, 0.4), (-0.05, 0.0, 0.0))
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_an_unsure_current_softens_the_front():
    """Beyond the sharp front a little is expected where the current may be less, and less than in still water."""
    sharp, soft = (speeds(near_bed(-0.9), (0.1, 0.0, 0.0), unsure)[0] for unsure in (0.0, 0.03))
    assert sharp < soft < speeds(near_bed(-0.9), (0.0, 0.0, 0.0))[0]


def test_d_of_wall_jets_in_a_current_stays_a_sum_of_squares():
    """Finite, symmetric, no negative eigenvalue, in slow and fast currents, toward every side."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.3, 0.3, (80, 2)), BED - rng.uniform(0, 0.1, 80)])
    origins, axes = rng.uniform(-0.2, 0.2, (4, 3)), np.array([[0, 0, 1.0], [0, 0.6, 0.8], [0.6, 0, 0.8], [0, 0, -1.0]])
    place = (points, np.ones(80), origins, axes, np.full(4, 0.0045))
    for size in (1e-6, 0.05, 0.5):
        for angle in (0.0, 2.0, 4.0):
            c = size * np.array([np.cos(angle), np.sin(angle), 0.0])
            G = gram(MODEL, *place, flow=flow(*c, unsure=0.2 * size, thrusts=(1.0, -1.0, 0.0, 0.5)))
            assert np.isfinite(G).all()
            assert np.linalg.eigvalsh(G).min() >= -1e-12 * np.abs(G).max()
