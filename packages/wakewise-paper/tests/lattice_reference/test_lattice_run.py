"""Runs on small lattices: the disk, the bookkeeping, and laws that hold on any grid.

Slow laws (four to five cells per diameter, far from resolved, so only what does not need resolution):
    momentum through planes T, 5 %;   T -> 4 T doubles speeds, 2 %;   two jets join by momentum;   head-on jets go
    radial.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import DiskJet, LatticeCase, case_hash
from wakewise_paper.lattice_reference.crossing_jets import crossing_figures
from wakewise_paper.lattice_reference.mean_field import compute_mean_field, compute_run, momentum_flux
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import Disk, LatticeRun

pytestmark = pytest.mark.usefixtures("one_thread")

SMALL = LatticeCase(
    name="small",
    jets=(DiskJet(torque=0.1),),
    low_D=(-2, -2, -2),
    high_D=(3, 2, 2),
    sponge_D=1.0,
    cells_per_D=4,
    develop=1.0,
    average=2.0,
)


def test_disk_pushes_with_its_thrust_and_torque_on_every_grid():
    """Shares sum to one; force is the thrust, moment about the axis the torque, unsteady or not."""
    for n in (4, 7, 10):
        case = replace(SMALL, cells_per_D=n)
        rng = np.random.default_rng(0)
        disk = Disk(case, case.jets[0], rng)
        for unsteadiness in (0.0, 0.3):
            F = disk.forces(5.0, unsteadiness, rng, 0.05)
            across = ((disk.cells - 0.5) / n + np.array(case.low_D))[:, 1:]
            assert F.sum(0) == pytest.approx([5.0, 0, 0], abs=1e-12)
            if not unsteadiness:
                moment = np.sum(across[:, 0] * F[:, 2] - across[:, 1] * F[:, 1])
                assert moment == pytest.approx(0.1 * 5.0)
        reach = np.linalg.norm(across, axis=1).max()
        assert math.sqrt(0.5) - 1 / n < reach < math.sqrt(0.5) + 1 / n


@pytest.mark.parametrize("axis", ["y", "z"])
def test_a_disk_may_blow_along_any_axis(axis):
    """Turned with its box it has the same cells and forces, turned; and a case along x keeps the hash that it had."""
    turn = {"y": [2, 0, 1], "z": [1, 2, 0]}[axis]  # where x, y and z of the jet along x go
    jet = DiskJet(torque=0.1, position_D=(0.1, 0.2, -0.1))
    low, high, place = (np.array(v) for v in (SMALL.low_D, SMALL.high_D, jet.position_D))
    case = replace(SMALL, jets=(jet,))
    turned = replace(
        SMALL,
        jets=(DiskJet(), replace(jet, axis=axis, position_D=tuple(place[turn]))),
        low_D=tuple(low[turn]),
        high_D=tuple(high[turn]),
    )
    first, second = (Disk(c, c.jets[-1], np.random.default_rng(0)) for c in (case, turned))
    forces = [disk.forces(5.0, 0.3, np.random.default_rng(1), 0.05) for disk in (first, second)]
    assert np.array_equal(second.cells, first.cells[:, turn])
    assert forces[1] == pytest.approx(forces[0][:, turn], abs=1e-12)
    assert case_hash(find_case("twin")) == "b08291e8f41caa6b"


def test_unsteady_load_has_the_asked_size():
    """The rms over cells and time of what the patches add is the unsteadiness, per component."""
    rng = np.random.default_rng(1)
    disk = Disk(SMALL, replace(SMALL.jets[0], torque=0.0), rng)
    draws = np.array([disk.forces(1.0, 0.2, rng, 0.5) / disk.share[:, None] for _ in range(800)])
    draws[..., 0] -= 1
    rms = np.sqrt(np.mean(np.sum(disk.share[:, None] * draws**2, axis=1), axis=0))
    assert rms == pytest.approx(0.2, rel=0.1)


def test_bad_cases_are_refused():
    """Too few cells, no jets, a side that is no whole number of cells, a disk outside its box."""
    with pytest.raises(InputError, match="cells per diameter"):
        replace(SMALL, cells_per_D=2)
    with pytest.raises(InputError, match="no jets"):
        replace(SMALL, jets=())
    with pytest.raises(InputError, match="whole numbers"):
        replace(SMALL, high_D=(3.1, 2, 2))
    for axes, said in (("w", "axis 'w'"), ("y", "first jet, allowed x")):
        with pytest.raises(InputError, match=said):
            replace(SMALL, jets=(DiskJet(axis=axes),))
    with pytest.raises(InputError, match="box's edge"):
        LatticeRun(replace(SMALL, jets=(DiskJet(position_D=(0, 1.9, 0)),)))
    with pytest.raises(InputError, match="no such case"):
        find_case("whirl")


@pytest.mark.slow
def test_run_goes_on_from_a_checkpoint_as_if_never_stopped(tmp_path):
    """Stopped half-way and restored, the flow and its averages are the same bytes."""
    whole = compute_run(SMALL)
    half = LatticeRun(SMALL)
    stride = half.steps_at(0.3)
    for _ in range(5):
        half.advance(stride)
        half.watch()
    half.save(tmp_path / "half.npz")
    other = LatticeRun.restored(SMALL, tmp_path / "half.npz")
    while other.steps_done < other.steps_total:
        other.advance(min(stride, other.steps_total - other.steps_done))
        other.watch()
    assert np.array_equal(other.field(), whole.field())
    assert np.array_equal(other.means(), whole.means())


def test_samples_agree_with_cells_and_snapshots_move_on():
    """At a cell's centre the sample is the cell's; snapshots come at growing times."""
    run = LatticeRun(SMALL)
    run.advance(40)
    field = run.field().copy()
    x, y, z = run.cell_centres_D()
    points = np.array([[x[9], y[8], z[7]], [x[3], y[2], z[12]]])
    assert run.sample_velocity(points) == pytest.approx(field[1:, [9, 3], [8, 2], [7, 12]].T, abs=1e-6)
    times = [t for t, u in run.snapshots(points, 0.2, 3) if u.shape == (2, 3)]
    assert len(times) == 3
    assert np.all(np.diff(times) >= 0.19)


def test_stopped_disk_lets_the_water_calm_down():
    """Some diameters of time after the stop the water at the disk is slow."""
    case = replace(SMALL, jets=(DiskJet(stop=4.0),))
    run = LatticeRun(case)
    run.advance(run.steps_at(4.0))
    before = run.sample_velocity(np.zeros((1, 3)))[0, 0]
    run.advance(run.steps_at(8.0))
    assert before > 0.5
    assert abs(run.sample_velocity(np.zeros((1, 3)))[0, 0]) < 0.25 * before


def test_crossing_jets_are_told_apart_from_others():
    """Figures of a crossing are those of its own case; any other pair is refused."""
    with pytest.raises(InputError, match="not two jets that cross in a plane"):
        crossing_figures(LatticeRun(SMALL))


BOX = replace(SMALL, jets=(DiskJet(),), low_D=(-3, -4, -4), high_D=(8, 4, 4), sponge_D=1.5, develop=20.0, average=40.0)


@pytest.mark.slow
def test_momentum_through_every_plane_is_the_thrust_and_four_times_it_doubles_the_speed():
    """Momentum theory; and sqrt(T), with four times the thrust run at its own Reynolds number."""
    one = compute_mean_field(BOX)
    four = compute_mean_field(replace(BOX, jets=(DiskJet(strength=4.0),), develop=10.0, average=20.0))
    flux = np.interp([1.0, 2.0, 3.0, 4.0, 5.0], one.x_D, momentum_flux(one))
    assert flux == pytest.approx(1.0, abs=0.05)
    near = (one.x_D > 0.5) & (one.x_D < 2.5)
    assert np.mean(four.axial[near, 0]) == pytest.approx(2 * np.mean(one.axial[near, 0]), rel=0.02)


@pytest.mark.slow
def test_two_jets_side_by_side_join_by_momentum():
    """Two disks send twice the momentum of one, and the water midway is faster than the sum of speeds says.

    Their jets draw each other in. On the way to sqrt 2 times the speed of one jet, reached beyond this box, the
    fastest water stays below that: momentum adds, not speed.
    """
    pair = tuple(DiskJet(position_D=(0.0, side, 0.0)) for side in (-0.8, 0.8))
    one, two = compute_run(BOX), compute_run(replace(BOX, jets=pair))
    x, y, z = one.cell_centres_D()
    # Momentum before the slow stream back along the sides of so small a box tells.
    momentum = [run.means()[[0, 4]][:, (x > 2) & (x < 4)].sum() for run in (one, two)]
    at = (x > 4.5) & (x < 6.5)
    axial = [run.means()[1, at][:, :, np.abs(z) < 0.3].mean((0, 2)) for run in (one, two)]
    alone = axial[0][np.abs(np.abs(y) - 0.8) < 0.3].mean()
    together = axial[1][np.abs(y) < 0.3].mean()
    assert momentum[1] / momentum[0] == pytest.approx(2.0, rel=0.1)
    assert together > 2 * alone
    assert axial[1].max() < 1.1 * math.sqrt(2) * axial[0].max()


@pytest.mark.slow
def test_head_on_jets_go_sideways():
    """Midway between two disks 6 D apart the mean is still on the axis and flows outwards off it."""
    case = replace(BOX, jets=(DiskJet(), DiskJet(position_D=(6.0, 0.0, 0.0), along=-1)), high_D=(9, 4, 4), sponge_D=1.0)
    run = compute_run(case)
    x, y, z = run.cell_centres_D()
    means = run.means()
    plane = np.abs(x - 3.0) < 0.3
    Y, Z = np.meshgrid(y, z, indexing="ij")
    R = np.hypot(Y, Z)
    ring = (R > 0.8) & (R < 1.6)
    outward = ((means[2] * Y + means[3] * Z) / R)[plane].mean(0)[ring].mean()
    assert abs(means[1][plane].mean(0)[R < 0.4].mean()) < 0.25
    assert outward > 0.2


@pytest.mark.slow
def test_jets_that_cross_at_right_angles_go_on_along_the_bisector_and_spread_out_of_their_plane():
    """Both directions are alike, as nothing tells them apart; out of the plane the jet is more than twice as wide."""
    pair = (DiskJet(), DiskJet(axis="y", position_D=(3.0, -3.0, 0.0)))
    low, high = (-3.0, -6.0, -4.0), (9.0, 6.0, 4.0)
    case = replace(BOX, jets=pair, low_D=low, high_D=high, sponge_D=1.0, develop=15.0, average=25.0)
    run = compute_run(case)
    found = crossing_figures(run)
    u, v, w = run.means()[1:4, 28:30, 28:30, 15:17].mean((1, 2, 3))  # 1.5 D behind the crossing
    assert u == pytest.approx(v, rel=0.15)
    assert abs(w) < 0.05
    assert found["speed"][0] > found["speed"][2] > 0.3
    assert found["half_height_D"][1] > 2 * found["half_width_D"][1]
    assert found["rise"] > 0.2
