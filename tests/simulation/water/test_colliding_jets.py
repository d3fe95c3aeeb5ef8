"""Jets that meet head-on: what turns aside, what goes on, and which plane it runs out in."""

import math

import numpy as np
import pytest

from wakewise.simulation.water.bedjets import JetPlanes, WallJetRings
from wakewise.simulation.water.colliding_jets import deflect_colliding
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.parcels import Parcels

ROOM = TankFaces.of(1.5, (math.inf, math.inf), surface=False)


def _met(impulses, gap=0.1, sigma=0.05, planes=None, layers=None, rings=0):
    """Two parcels on the x axis after their meeting: those left, the rings and the planes."""
    jets = Parcels.sent(
        np.array([[-gap / 2, 0.0, 1.0], [gap / 2, 0.0, 1.0]]),
        np.array(impulses, dtype=float),
        np.full(2, sigma),
        np.full(2, 0.06),
        np.array([0, 2]),
        np.zeros((2, 3)),
        np.zeros((2, 3)),
    ).with_room(4)
    planes = planes or JetPlanes.of(ROOM)
    layers = layers or WallJetRings(np.zeros((8, 2)), np.ones(8), np.zeros(8), np.zeros((8, 2))).layers()
    count, rings, taken = deflect_colliding(jets, 2, 4, planes, len(ROOM.faces), layers, rings)
    return Parcels.of(jets, count), layers, rings, taken, planes


def test_equal_jets_turn_aside_wholly():
    """Nothing is left of them but one ring with the impulse of one, in the plane midway across their axis."""
    left, layers, rings, taken, planes = _met([[1e-3, 0, 0], [-1e-3, 0, 0]])
    assert left.count == 0 and rings == 1
    assert taken == pytest.approx(2e-3)
    assert layers.impulse[0] == pytest.approx(1e-3)
    assert layers.lean[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    frame = planes.frames[layers.plane[0]]
    assert frame[:3] == pytest.approx([0.0, 0.0, 1.0])
    assert frame[3:12].reshape(3, 3) @ frame[3:12].reshape(3, 3).T == pytest.approx(np.eye(3), abs=1e-12)
    assert frame[9:12] == pytest.approx([1.0, 0.0, 0.0])


def test_of_unequal_jets_the_stronger_goes_on():
    """With what it has more than the weaker one."""
    left, _, rings, taken, _ = _met([[3e-3, 0, 0], [-1e-3, 0, 0]])
    assert left.impulse_m4_s == pytest.approx(np.array([[2e-3, 0.0, 0.0]]))
    assert rings == 1
    assert taken == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("impulses", "gap"),
    [([[1e-3, 0, 0], [0, 1e-3, 0]], 0.1), ([[-1e-3, 0, 0], [1e-3, 0, 0]], 0.1), ([[1e-3, 0, 0], [-1e-3, 0, 0]], 0.3)],
    ids=["across", "apart", "far"],
)
def test_others_do_not_meet(impulses, gap):
    """Jets that cross, that blow away from each other, or that are still far off go on as they were."""
    left, _, rings, taken, _ = _met(impulses, gap)
    assert left.count == 2 and rings == 0 and taken == 0.0


def test_the_same_jets_run_out_in_the_same_plane():
    """A second meeting in one place adds a ring to the plane of the first; another direction gets its own plane."""
    _, layers, rings, _, planes = _met([[1e-3, 0, 0], [-1e-3, 0, 0]])
    _met([[1e-3, 0, 0], [-1e-3, 0, 0]], planes=planes, layers=layers, rings=rings)
    assert layers.plane[0] == layers.plane[1]
    _met([[1e-3, 1e-3, 0], [-1e-3, -1e-3, 0]], planes=planes, layers=layers, rings=2, gap=0.02)
    assert layers.plane[2] != layers.plane[0]


def test_without_a_plane_left_a_meeting_waits():
    """Where rings run in all planes there are, the jets are left as they are."""
    planes = JetPlanes.of(ROOM)
    many = len(planes.used)
    layers = WallJetRings(np.zeros((many, 2)), np.ones(many), np.ones(many), np.zeros((many, 2))).layers()
    layers.plane[:] = np.arange(many)
    left, _, rings, taken, _ = _met([[1e-3, 0, 0], [-1e-3, 0, 0]], planes=planes, layers=layers, rings=many)
    assert left.count == 2 and rings == many and taken == 0.0
