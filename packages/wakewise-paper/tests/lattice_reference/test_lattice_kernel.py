"""The lattice's step against its twin in NumPy, and the fluid it makes against exact solutions."""

import math

import numba
import numpy as np
import pytest

from wakewise.simulation.lattice.cases import DiskJet, LatticeCase
from wakewise.simulation.lattice.kernel import push, step, velocity, wrap
from wakewise.simulation.lattice.stencil import (
    OPEN,
    OPPOSITE,
    PERIODIC,
    VELOCITIES,
    WALL,
    WEIGHTS,
    box,
    plane_row,
    smagorinsky_factor,
    still_water,
)
from wakewise_paper.lattice_reference.numpy_step import equilibrium, twin_step
from wakewise_paper.lattice_reference.run import LatticeRun

pytestmark = pytest.mark.usefixtures("one_thread")

EDDIES = smagorinsky_factor(0.12)


def _random(cells, rng, size=1e-2):
    """A lattice and its populations as the twin takes them, (19, nx + 2, ny + 2, nz + 2), halo filled."""
    f = still_water(cells)
    start = (size * rng.standard_normal((19, *(n + 2 for n in cells)))).astype(np.float32)
    box(f, *cells[1:])[:] = start
    return f, start


def _run(rho, u, steps, tau, faces, eddies=0.0, force=None):
    """Start from equilibrium at `rho`, `u` (3, nx, ny, nz) and return density excess and velocity, float64."""
    nx, ny, nz = rho.shape
    now, later = still_water(rho.shape), still_water(rho.shape)
    box(now, ny, nz)[:, 1:-1, 1:-1, 1:-1] = equilibrium(rho, u) - WEIGHTS[:, None, None, None]
    tau_x, tau_yz = np.full(nx + 2, tau, np.float32), plane_row(np.zeros((ny + 2, nz + 2)))
    faces = np.array(faces)
    for _ in range(steps):
        wrap(now, ny, nz, faces)
        step(now, later, ny, nz, tau_x, tau_yz, eddies, faces)
        if force is not None:
            push(now, later, nz, tau_x, tau_yz, eddies, *force)
        now, later = later, now
    out = np.zeros((4, nx, ny, nz), np.float32)
    velocity(now, ny, nz, out)
    return out.astype(float)


def test_velocities_and_weights_are_isotropic_to_fourth_order():
    """Moments of the weights are those of a Maxwellian with cs^2 = 1/3 (Qian, d'Humieres and Lallemand 1992)."""
    c, w = VELOCITIES.astype(float), WEIGHTS
    eye = np.eye(3)
    assert w.sum() == pytest.approx(1)
    assert np.einsum("i,ia->a", w, c) == pytest.approx(np.zeros(3))
    assert np.einsum("i,ia,ib->ab", w, c, c) == pytest.approx(eye / 3)
    fourth = sum(np.einsum(s, eye, eye) for s in ("ab,cd->abcd", "ac,bd->abcd", "ad,bc->abcd")) / 9
    assert np.einsum("i,ia,ib,ic,id->abcd", w, c, c, c, c) == pytest.approx(fourth)
    assert np.array_equal(VELOCITIES[OPPOSITE], -VELOCITIES)


def test_equilibrium_has_the_fourth_moments_of_maxwell():
    """<cx cx cy cy> is rho/9 + (ux^2 + uy^2)/3 and knows nothing of uz, unlike the usual nineteen populations'."""
    f = equilibrium(np.array(1.0), np.array([0.1, -0.05, 0.2]))
    c = VELOCITIES.astype(float)
    assert np.einsum("i,i,i->", f, c[:, 0] ** 2, c[:, 1] ** 2) == pytest.approx(1 / 9 + (0.1**2 + 0.05**2) / 3)
    u = np.array([0.1, -0.05, 0.2])
    assert np.einsum("i,ia,ib->ab", f, c, c) == pytest.approx(np.eye(3) / 3 + np.outer(u, u))


@pytest.mark.parametrize("eddies", [0.0, EDDIES])
@pytest.mark.parametrize("cells", [(5, 12, 13), (3, 20, 33)])
def test_kernel_equals_its_twin(cells, eddies):
    """One step of random populations agrees with the plain NumPy one to float32's rounding."""
    nx, ny, nz = cells
    f, start = _random(cells, np.random.default_rng(1))
    tau_x = np.linspace(0.51, 0.9, nx + 2).astype(np.float32)
    tau_yz = np.linspace(0.0, 0.2, (ny + 2) * (nz + 2)).reshape(ny + 2, nz + 2)
    out = still_water(cells)
    # Beyond periodic faces lies what the halo holds.
    step(f, out, ny, nz, tau_x, plane_row(tau_yz), eddies, np.full(6, PERIODIC))
    slow = twin_step(start.astype(float), tau_x.astype(float), tau_yz, eddies)
    fast = box(out, ny, nz)[:, 1:-1, 1:-1, 1:-1]
    assert np.abs(fast - slow).max() < 3e-7 * (1 + np.abs(slow).max())


@pytest.mark.parametrize("faces", [[OPEN] * 6, [WALL] * 6, [OPEN, WALL, WALL, OPEN, PERIODIC, PERIODIC]])
def test_push_without_force_is_the_collision_of_step(faces):
    """The plainly written collision and pull of single cells and the fast ones are the same function, at faces too."""
    cells = (4, 12, 21)
    nx, ny, nz = cells
    f, _ = _random(cells, np.random.default_rng(2))
    tau_x, tau_yz = np.full(nx + 2, 0.6, np.float32), plane_row(np.zeros((ny + 2, nz + 2)))
    fast, plain = still_water(cells), still_water(cells)
    step(f, fast, ny, nz, tau_x, tau_yz, EDDIES, np.array(faces))
    where = np.argwhere(np.ones(cells)) + 1
    push(f, plain, nz, tau_x, tau_yz, EDDIES, where, np.zeros((len(where), 3)))
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    assert np.abs(box(plain, ny, nz)[inside]).max() > 1e-3
    assert box(plain, ny, nz)[inside] == pytest.approx(box(fast, ny, nz)[inside], abs=3e-8)


def test_bytes_do_not_depend_on_where_a_lattice_lies_in_memory():
    """Lines that pass the caches by and ordinary stores write the same."""
    cells = (4, 60, 200)  # too many for the caches
    nx, ny, nz = cells
    f, _ = _random(cells, np.random.default_rng(4))
    tau_x, tau_yz = np.full(nx + 2, 0.6, np.float32), plane_row(np.zeros((ny + 2, nz + 2)))
    lined = still_water(cells)
    shifted = np.zeros(lined.size + 1, np.float32)[1:].reshape(lined.shape)
    if shifted.ctypes.data % 64 == 0:
        shifted = np.zeros(lined.size + 2, np.float32)[2:].reshape(lined.shape)
    assert lined.size > 2**20
    for out in (lined, shifted):
        step(f, out, ny, nz, tau_x, tau_yz, EDDIES, np.full(6, OPEN))
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    assert np.array_equal(box(lined, ny, nz)[inside], box(shifted, ny, nz)[inside])


def test_nearly_still_water_is_put_to_rest():
    """Where nothing is left that float32 could tell from rest, populations are exactly zero and not denormal."""
    cells = (3, 12, 13)
    f, _ = _random(cells, np.random.default_rng(5), 1e-18)
    tau_x, tau_yz = np.full(5, 0.6, np.float32), plane_row(np.zeros((14, 15)))
    out = still_water(cells)
    step(f, out, 12, 13, tau_x, tau_yz, EDDIES, np.full(6, PERIODIC))
    assert not box(out, 12, 13)[:, 1:-1, 1:-1, 1:-1].any()


def test_force_adds_its_momentum_and_periodic_water_keeps_it():
    """After k steps the momentum of a periodic box is k times the force, and its mass is unchanged."""
    shape = (12, 12, 12)
    cells = np.array([[5, 6, 7], [6, 6, 7]])
    forces = np.array([[1e-3, -2e-4, 5e-4], [5e-4, 0.0, 0.0]])
    field = _run(np.ones(shape), np.zeros((3, *shape)), 20, 0.55, [PERIODIC] * 6, EDDIES, (cells, forces))
    momentum = ((1 + field[0]) * field[1:]).sum((1, 2, 3))
    assert field[0].sum() == pytest.approx(0, abs=2e-5)
    assert momentum == pytest.approx(20 * forces.sum(0), rel=2e-4)


def _taylor_green(n, nu=0.04, speed_at_32=0.04):
    """Velocity error and measured viscosity after the vortices have decayed to 1/e; diffusive scaling of speeds."""
    U = speed_at_32 * 32 / n
    k = 2 * math.pi / n
    x, y, _ = np.meshgrid(*[np.arange(m) + 0.5 for m in (n, n, 8)], indexing="ij")
    u = np.stack([U * np.sin(k * x) * np.cos(k * y), -U * np.cos(k * x) * np.sin(k * y), 0 * x])
    rho = 1 + 3 * U**2 / 4 * (np.cos(2 * k * x) + np.cos(2 * k * y))
    steps = round(1 / (2 * nu * k**2))
    out = _run(rho, u, steps, 0.5 + 3 * nu, [PERIODIC] * 6)[1:]
    exact = u * math.exp(-2 * nu * k**2 * steps)
    measured = -math.log(np.linalg.norm(out) / np.linalg.norm(u)) / (2 * k**2 * steps)
    return np.linalg.norm(out - exact) / np.linalg.norm(exact), measured / nu


def test_taylor_green_vortices_decay_as_exact_to_second_order():
    """Doubling the cells divides the error by four, and the viscosity is the set one within 1 %."""
    coarse, _ = _taylor_green(16)
    fine, viscosity = _taylor_green(32)
    assert 3.2 < coarse / fine < 4.8
    assert viscosity == pytest.approx(1, abs=0.01)


def test_flow_between_walls_is_the_parabola():
    """Under a constant force between two walls, halfway bounce-back gives Poiseuille's profile, centre within 1 %."""
    ny, nu, F = 12, 1 / 6, 1e-5
    shape = (3, ny, 12)
    cells = np.argwhere(np.ones(shape)) + 1
    faces = [PERIODIC, PERIODIC, WALL, WALL, PERIODIC, PERIODIC]
    steps = round(0.7 * ny**2 / nu)
    force = (cells, np.tile([F, 0.0, 0.0], (len(cells), 1)))
    # With tau = 1 nothing of the stress is kept, and the wall lies exactly on the face to second order.
    u = _run(np.ones(shape), np.zeros((3, *shape)), steps, 0.5 + 3 * nu, faces, 0.0, force)[1]
    y = np.arange(ny) + 0.5
    assert u[1, :, 5] == pytest.approx(F / (2 * nu) * y * (ny - y), rel=0.03, abs=0.01 * F * ny**2 / (8 * nu))


def test_closed_box_keeps_its_mass():
    """Between six walls no water is lost, whatever moves inside."""
    rng = np.random.default_rng(3)
    shape = (12, 13, 14)
    u = 0.05 * rng.standard_normal((3, *shape))
    field = _run(np.ones(shape), u, 50, 0.52, [WALL] * 6, EDDIES)
    assert np.abs(field[1:]).max() > 1e-3
    assert field[0].sum() == pytest.approx(0, abs=1e-3)


def test_bytes_do_not_depend_on_threads():
    """One thread and two give the same flow, bit for bit."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("this machine has one core")
    case = LatticeCase(name="t", jets=(DiskJet(torque=0.1),), low_D=(-2, -2, -2), high_D=(3, 2, 2), cells_per_D=4)
    before, digests = numba.get_num_threads(), []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            run = LatticeRun(case)
            run.advance(40)
            digests.append(run.field().tobytes())
    finally:
        numba.set_num_threads(before)
    assert np.abs(run.field()[1]).max() > 0.1
    assert digests[0] == digests[1]
