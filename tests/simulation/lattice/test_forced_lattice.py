"""The live box of lattice water: momentum, a jet's decay, bodies, a current, and its small kernels."""

import math

import numpy as np
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.simulation.lattice.forced_lattice import ForcedLattice, disk_points, interpolated, share_out

RHO = 1000.0
NOTHING = np.zeros((0, 3))


def box(cells, cell_m=0.02, current=(0.0, 0.0, 0.0), solid=None, fastest_m_s=1.0):
    low = np.array([-0.2, -0.5 * cells[1] * cell_m, 0.0])
    body = np.zeros(cells, bool) if solid is None else solid
    return ForcedLattice(
        low,
        cells,
        cell_m,
        fastest_m_s=fastest_m_s,
        jet_m=0.076,
        current_W_m_s=np.array(current),
        solid=body,
        density_kg_m3=RHO,
    )


def test_forces_are_shared_out_whole_and_stand_at_their_place():
    """What the eight cells get adds up to the force, and its middle is where the force was; outside nothing is kept."""
    grid = np.zeros((6, 6, 6, 3))
    at = np.array([[2.25, 3.5, 1.75], [2.25, 3.5, 1.75], [4.0, 4.0, 4.0], [-3.0, 2.0, 2.0]])
    forces = np.array([[1.0, 2.0, -3.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0, 9.0, 9.0]])
    cells = share_out(at, forces, grid)
    assert len(cells) == len(np.unique(cells, axis=0)) == 9
    assert grid.sum((0, 1, 2)) == pytest.approx([1.5, 3.0, -3.0])
    middle = np.einsum("xyz,xyzk->k", grid[..., 2], np.stack(np.indices((6, 6, 6)), axis=-1)) / grid[..., 2].sum()
    assert middle == pytest.approx(at[0])


def test_velocity_between_cells_is_linear_and_bodies_have_no_say():
    """A linear field is found as it is; beside a solid cell the water's own value is told of."""
    x, y, z = np.indices((5, 5, 5))
    field = np.stack([x + 2.0 * y, 3.0 * z, x * 1.0]).astype(np.float32)
    open_water = np.zeros((5, 5, 5), bool)
    at = np.array([[1.25, 2.5, 3.75]])
    assert interpolated(field, open_water, at)[0] == pytest.approx([6.25, 11.25, 1.25])
    solid = open_water.copy()
    solid[2] = True
    assert interpolated(field, solid, np.array([[1.5, 2.0, 2.0]]))[0] == pytest.approx([5.0, 6.0, 1.0])


def test_the_water_keeps_the_momentum_it_is_given():
    """Thrust times time within a thousandth, before sound has reached the sides."""
    water = box((76, 72, 32))
    points = np.array([[0.5, 0.0, 0.32]]) + np.c_[np.zeros(12), disk_points(12, 0.1)]
    forces = np.tile([0.5 / 12, 0.0, 0.0], (12, 1))
    while water.time_s < 0.2:
        water.advance(points, forces)
    momentum_N_s = water.field_m_s().astype(np.float64).sum((1, 2, 3)) * RHO * water.cell_m**3
    assert momentum_N_s == pytest.approx([0.5 * water.time_s, 0.0, 0.0], abs=0.001 * 0.5 * water.time_s)


@pytest.mark.slow
def test_a_jet_decays_as_published():
    """U x / sqrt(T / rho) is 5.8 to 7.0 half a metre and more from a disk of four cells (5.8 and 6.1: Hussein et al.
    1994; 6.5 to 7.0: ducted propellers, see `wakewise.simulation.water.round_jet_closure`).
    """
    water, thrust = box((62, 46, 36), fastest_m_s=0.5), 0.8
    speed = math.sqrt(thrust / RHO / (math.pi / 4 * 0.076**2))
    points = np.array([[0.05, 0.0, 0.36]]) + np.c_[np.zeros(24), disk_points(24, math.sqrt(2) * 0.076)]
    rng = np.random.default_rng(0)
    load = rng.standard_normal((24, 3))
    keep = math.exp(-water.step_s * speed / (0.5 * 0.076))
    along = np.array([0.5, 0.6, 0.7])
    seen, count = np.zeros(3), 0
    while water.time_s < 8.0:
        load = keep * load + math.sqrt(1 - keep**2) * rng.standard_normal(load.shape)
        water.advance(points, thrust / 24 * (np.array([1.0, 0.0, 0.0]) + 0.15 * (load - load.mean(0))))
        if water.time_s > 3.5:
            seen += water.velocity(np.c_[0.05 + along, np.zeros(3), np.full(3, 0.36)])[:, 0]
            count += 1
    K = seen / count * along / math.sqrt(thrust / RHO)
    assert np.all((K > 5.0) & (K < 7.5)) and 5.6 < K.mean() < 7.0


@pytest.mark.slow
def test_a_jet_that_leaves_by_a_side_does_not_come_back():
    """Half a metre a second through an open side, for ten seconds: behind the disk the water stays as slow as it is
    drawn in, and no water is faster than the jet.
    """
    cells, exit_m_s = (28, 24, 24), math.sqrt(1.75 / (RHO * math.pi * 0.038**2))
    water = box(cells, 0.025, fastest_m_s=1.05)
    disk = water.low_W_m + 0.025 * np.array([14.0, 12.0, 12.0])
    places = disk + np.c_[np.zeros(32), disk_points(32, math.sqrt(2.0) * 0.076)]
    rng = np.random.default_rng(0)
    while water.time_s < 10.0:
        water.advance(places, np.tile([-1.75 / 32, 0.0, 0.0], (32, 1)) + rng.normal(0.0, 0.008, (32, 3)))
    speed = np.linalg.norm(water.field_m_s(), axis=0)
    assert 0.3 < speed.max() < 1.3 * exit_m_s
    assert speed[22:].max() < 0.1


@pytest.mark.slow
def test_a_current_goes_round_a_body_and_stays_what_it_was_beside():
    """From once to three times the box's length it has its speed upstream, none in the body, less behind it, in the
    mean: an instant of an eddying wake is another on every processor.
    """
    cells = (40, 46, 20)
    solid = np.zeros(cells, bool)
    solid[14:18, 20:26, 12:] = True
    water = box(cells, current=(0.1, 0.0, 0.0), solid=solid, fastest_m_s=0.5)
    places = {
        "upstream": [-0.1, 0.0, 0.2],
        "body": [0.12, 0.0, 0.32],
        "lee": [0.2, 0.0, 0.32],
        "beside": [0.12, 0.24, 0.1],
    }
    seen, passage_s = [], 0.8 / 0.1
    while water.time_s < 3 * passage_s:
        water.advance(NOTHING, NOTHING)
        if water.time_s > passage_s:
            seen.append(water.velocity(np.array(list(places.values())))[:, 0])
    speeds = dict(zip(places, np.mean(seen, axis=0), strict=True))
    assert speeds["upstream"] == pytest.approx(0.1, rel=0.05) and speeds["beside"] == pytest.approx(0.1, rel=0.15)
    assert speeds["body"] == pytest.approx(0.0, abs=1e-6) and speeds["lee"] < 0.03


def test_a_copy_goes_its_own_way_as_the_water_would_have():
    """Of three boxes with one past the one that is pushed parts from the others, which stay alike to the last bit."""
    water = box((12, 12, 10), current=(0.1, 0.0, 0.0), fastest_m_s=0.5)
    for _ in range(30):
        water.advance(NOTHING, NOTHING)
    alone, other = water.copy(), water.copy()
    middle = water.low_W_m + 0.5 * water.cell_m * np.array(water.cells)
    for _ in range(10):
        water.advance(middle[None], np.array([[0.0, 1.0, 0.0]]))
        alone.advance(NOTHING, NOTHING)
        other.advance(NOTHING, NOTHING)
    assert np.array_equal(alone.field_m_s(), other.field_m_s()) and alone.time_s == water.time_s
    assert np.abs(water.field_m_s()[1] - alone.field_m_s()[1]).max() > 0.01


def test_what_it_cannot_compute_is_refused_or_told():
    """A current that sinks, one faster than it is made for, a box of few cells; and forces far beyond its speed."""
    with pytest.raises(InputError, match="needs a level one"):
        box((10, 10, 10), current=(0.0, 0.0, 0.1))
    with pytest.raises(InputError, match="at most 1 m/s"):
        box((10, 10, 10), current=(2.0, 0.0, 0.0))
    with pytest.raises(InputError, match="needs 8 or more"):
        box((10, 4, 10))
    water = box((10, 10, 10))
    with pytest.raises(StageError, match="the flow blew up"):
        for _ in range(200):
            water.advance(np.array([[-0.1, 0.0, 0.1]]), np.array([[1e4, 0.0, 0.0]]))
            water.field_m_s()
