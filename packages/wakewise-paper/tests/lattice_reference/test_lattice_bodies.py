"""Solid boxes and turned disks on the lattice: what comes back from a wall, and where a disk pushes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import DiskJet, LatticeCase, case_hash
from wakewise.simulation.lattice.stencil import OPPOSITE, VELOCITIES, WALL, WEIGHTS, box, still_water
from wakewise_paper.lattice_reference.engines import BounceBackLinks, make_engine, solid_cells
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import Disk, LatticeRun

BESIDE = LatticeCase(
    name="beside",
    jets=(DiskJet(),),
    low_D=(-2, -2, -2),
    high_D=(4, 2, 3),
    sponge_D=1.0,
    cells_per_D=4,
    develop=1.0,
    average=1.0,
    boxes_D=(((1.0, -0.5, 0.5), (2.0, 0.5, 1.5)),),
)


def test_what_meets_a_body_comes_back_turned_round():
    """As a loop over the cells says: of each cell of water the population towards a solid neighbour, and no other."""
    rng, cells = np.random.default_rng(0), (9, 8, 7)
    solid = np.zeros(cells, bool)
    solid[3:6, 3:5, 2:5] = True
    solid[5, 4, 4] = False  # a corner that is missing: the body is not convex
    now = still_water(cells)
    water = box(now, *cells[1:])
    water[:, 1:-1, 1:-1, 1:-1] = rng.normal(0.0, 1e-3, (19, *cells))
    water[:, 1:-1, 1:-1, 1:-1][:, solid] = 0.0
    expected = water.copy()
    for x, y, z in np.argwhere(~solid):
        for i in range(1, 19):
            there = np.array([x, y, z]) + VELOCITIES[i]
            if np.all(there >= 0) and np.all(there < cells) and solid[tuple(there)]:
                expected[OPPOSITE[i], *(there + 1)] = water[i, x + 1, y + 1, z + 1]
    BounceBackLinks(solid).turn_back(now)
    assert np.array_equal(box(now, *cells[1:]), expected)
    assert np.abs(expected[:, 1:-1, 1:-1, 1:-1][:, solid]).max() > 0.0


def test_a_body_lets_no_water_in_and_loses_none():
    """In a closed box a blast keeps its mass to rounding of single precision, and in the body nothing moves."""
    cells = (20, 16, 18)
    solid = np.zeros(cells, bool)
    solid[8:13, 5:10, 6:12] = True
    water = make_engine("cpu", np.full(22, 0.51), np.zeros((18, 20)), 0.3, np.full(6, WALL), solid)
    rng = np.random.default_rng(1)
    start = 0.02 * WEIGHTS[:, None, None, None] * rng.normal(1.0, 0.3, cells) * ~solid
    water.restore(start.astype(np.float32), water.sums)
    mass = start.sum()
    for _ in range(60):
        water.advance([])
    field = water.field()
    assert np.abs(field[:, solid]).max() == 0.0
    assert np.abs(field[1:, ~solid]).max() > 1e-4
    assert water.populations[:, ~solid].sum(dtype=float) == pytest.approx(mass, rel=1e-4)


def test_solid_cells_are_those_whose_middles_are_in_the_box():
    """A cube of one diameter has the cells of one cubic diameter, on every grid that it fits."""
    for n in (4, 6, 8):
        assert solid_cells(BESIDE.resolved(n)).sum() == n**3
    assert not solid_cells(replace(BESIDE, boxes_D=())).any()


def test_boxes_that_cannot_be_are_refused():
    """Near an open face, inside out, round a disk; and on a graphics card."""
    for corners in (((1.0, -0.5, 0.5), (3.5, 0.5, 1.5)), ((2.0, -0.5, 0.5), (1.0, 0.5, 1.5))):
        with pytest.raises(InputError, match="a solid box from"):
            replace(BESIDE, boxes_D=(corners,))
    with pytest.raises(InputError, match="a disk inside a solid box"):
        LatticeRun(replace(BESIDE, boxes_D=(((-0.5, 0.0, 0.0), (1.0, 1.0, 1.0)),)))
    with pytest.raises(InputError, match="processors only"):
        LatticeRun(BESIDE, "cuda")
    with pytest.raises(InputError, match="a turned jet along y"):
        replace(BESIDE, jets=(DiskJet(), DiskJet(axis="y", turn_deg=10.0)))


@pytest.mark.parametrize("turn_deg", [20.0, -55.0, 130.0])
def test_a_turned_disk_pushes_along_its_own_way(turn_deg):
    """All of its force, at its middle to a hundredth of a diameter, with its own size and thickness."""
    jet = DiskJet(turn_deg=turn_deg, torque=0.1, position_D=(0.3, 0.1, 0.2))
    case = replace(BESIDE, jets=(jet,), boxes_D=(), cells_per_D=8)
    disk = Disk(case, jet, np.random.default_rng(0))
    F = disk.forces(5.0, 0.0, np.random.default_rng(1), 0.05)
    assert F.sum(0) == pytest.approx(5.0 * np.array(jet.direction), abs=1e-9)
    places = (disk.cells - 0.5) / 8 + np.array(case.low_D) - jet.position_D
    assert disk.share @ places == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert np.linalg.norm(places, axis=1).max() < math.sqrt(0.5) + 0.25
    assert np.abs(places @ jet.direction).max() < 0.1 + 0.125
    # Its moment about its own axis is the torque, and there is none other.
    assert np.cross(places, F).sum(0) == pytest.approx(0.5 * np.array(jet.direction), abs=0.06)


def test_a_disk_turned_by_a_quarter_is_the_one_along_y():
    """The same cells and the same shares, but for the points on edges; the hashes of what was before do not change."""
    upright = DiskJet(axis="y", position_D=(0.3, 0.1, 0.2))
    turned = DiskJet(turn_deg=90.0, position_D=(0.3, 0.1, 0.2))
    case = replace(BESIDE, jets=(DiskJet(), upright), boxes_D=(), cells_per_D=8)
    found = [Disk(case, jet, np.random.default_rng(0)) for jet in (upright, turned)]
    grids = [np.zeros([n + 2 for n in case.cells]) for _ in found]
    for grid, disk in zip(grids, found, strict=True):
        grid[tuple(disk.cells.T)] = disk.share
    assert np.abs(grids[0] - grids[1]).max() < 1e-3 * grids[0].max() + 1e-6
    assert turned.direction == pytest.approx(upright.direction)
    assert case_hash(find_case("crossing")) == "0d65b8c1e726327f"
    assert case_hash(find_case("free")) == "adba44cb7a40a161"
