"""The lattice's wall model: the law of the wall, the stress that walls take, and the flow along them."""

import math

import numpy as np
import pytest

from wakewise.simulation.lattice.kernel import step, velocity, wrap
from wakewise.simulation.lattice.stencil import (
    OPEN,
    PERIODIC,
    VELOCITIES,
    WALL,
    WEIGHTS,
    box,
    plane_row,
    smagorinsky_factor,
    still_water,
)
from wakewise_paper.lattice_reference.engines import BounceBackLinks
from wakewise_paper.lattice_reference.numpy_step import equilibrium
from wakewise_paper.lattice_reference.wall_model import SUBLAYER, WallModel, law_of_the_wall, wall_stress

pytestmark = pytest.mark.usefixtures("one_thread")

ALONG = np.array([PERIODIC, PERIODIC, PERIODIC, PERIODIC, WALL, WALL])
NU = 1e-4


def _water(cells, u):
    """A lattice in equilibrium at velocity `u`, shape (3, nx, ny, nz)."""
    now = still_water(cells)
    start = equilibrium(np.ones(cells), np.broadcast_to(u, (3, *cells))) - WEIGHTS[:, None, None, None]
    box(now, *cells[1:])[:, 1:-1, 1:-1, 1:-1] = start
    return now


def _inside(f, cells):
    return box(f, *cells[1:])[:, 1:-1, 1:-1, 1:-1]


def _momentum(f, cells):
    return VELOCITIES.T @ _inside(f, cells).sum((1, 2, 3), dtype=float)


def _advance(now, cells, faces, steps, tau=0.5 + 3 * NU, model=None, links=None):
    """So many steps, with the wall model and bodies if there are some."""
    nx, ny, nz = cells
    later = still_water(cells)
    tau_x, tau_yz = np.full(nx + 2, tau, np.float32), plane_row(np.zeros((ny + 2, nz + 2)))
    for _ in range(steps):
        wrap(now, ny, nz, faces)
        if model:
            model.impose(now)
        if links:
            links.turn_back(now)
        step(now, later, ny, nz, tau_x, tau_yz, smagorinsky_factor(0.12), faces)
        if links:
            links.empty(later)
        now, later = later, now
    return now


def _column(now, cells):
    """Mean velocity along x of each layer over z, shape (nz,)."""
    out = np.zeros((4, *cells), np.float32)
    velocity(now, *cells[1:], out)
    return out[1].mean((0, 1), dtype=float)


def test_slow_water_feels_the_laminar_stress():
    """Within the sublayer the stress is 2 nu u / cell, the laminar one; there is none at rest."""
    assert wall_stress(0.0, NU, 1.0) == 0.0
    for cell in (0.5, 1.0, 2.0):
        edge = 0.5 * NU / cell * SUBLAYER**2
        for speed in (1e-3 * edge, 0.5 * edge, 0.999 * edge):
            assert wall_stress(speed, NU, cell) == pytest.approx(2 * NU * speed / cell)
        assert wall_stress(1.000001 * edge, NU, cell) == pytest.approx(wall_stress(edge, NU, cell), rel=1e-5)
    assert round(SUBLAYER, 2) == 11.81


def test_the_stress_is_that_whose_profile_has_the_mean_speed_of_the_cell():
    """The law's profile at the stress found, averaged over the cell in steps, gives the speed back."""
    for speed in (0.01, 0.05, 0.15):
        friction = math.sqrt(wall_stress(speed, NU, 1.0))
        heights = (np.arange(20_000) + 0.5) / 20_000
        assert friction * law_of_the_wall(heights * friction / NU).mean() == pytest.approx(speed, rel=1e-3)


def test_the_law_is_near_the_logarithmic_one():
    """Within 4 % of ln(y+) / 0.41 + 5.2 from 40 to 1,000 viscous lengths."""
    y = np.geomspace(40.0, 1000.0, 50)
    assert law_of_the_wall(y) == pytest.approx(np.log(y) / 0.41 + 5.2, rel=0.04)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("u", [0.02, 0.12])
def test_walls_take_the_stress_and_no_more(axis, u):
    """Of an even flow slanting along two walls, whichever way they face, one step takes twice area times stress."""
    cells = (6, 7, 8)
    faces = np.full(6, PERIODIC)
    faces[2 * axis : 2 * axis + 2] = WALL
    way = np.array([0.8, 0.6])
    flow = np.insert(u * way, axis, 0.0)
    now = _water(cells, flow[:, None, None, None])
    before, mass = _momentum(now, cells), _inside(now, cells).sum(dtype=float)
    now = _advance(now, cells, faces, 1, model=WallModel(np.zeros(cells, bool), faces, NU))
    area = math.prod(cells) / cells[axis]
    lost = 2 * area * wall_stress(u, NU, 1.0) * flow / u
    assert before - _momentum(now, cells) == pytest.approx(lost, abs=2e-6 * area)
    assert _inside(now, cells).sum(dtype=float) == pytest.approx(mass, abs=1e-5)


def test_the_model_is_what_a_loop_over_cells_says():
    """Pairs of slanting populations at flat walls are exchanged less the stress; edges, corners, open ends are not."""
    rng, cells = np.random.default_rng(0), (9, 8, 7)
    solid = np.zeros(cells, bool)
    solid[3:6, 2:5, :3] = True
    faces = np.array([PERIODIC, OPEN, PERIODIC, PERIODIC, WALL, WALL])
    now = still_water(cells)
    _inside(now, cells)[:] = rng.normal(0.0, 1e-2, (19, *cells)) * ~solid
    old = _inside(now, cells).astype(float)
    new = old.copy()

    def is_solid(at):
        x, y, z = at[0] % 9, at[1] % 8, at[2]
        return not 0 <= z < 7 or bool(solid[x, y, z])

    def index(c):
        return next(i for i in range(19) if np.array_equal(VELOCITIES[i], c))

    changed = 0
    for x, y, z in np.argwhere(~solid):
        at = np.array([x, y, z])
        if x == 8:
            continue
        f = old[:, x, y, z]
        u = VELOCITIES.T @ f / (1 + f.sum())
        for n in VELOCITIES[1:7]:
            if not is_solid(at + n):
                continue
            slip = u * (n == 0)
            stress = wall_stress(np.linalg.norm(slip), NU, 1.0) * slip / np.linalg.norm(slip)
            for t in np.eye(3, dtype=int)[n == 0]:
                flat = is_solid(at + n + t) and is_solid(at + n - t) and not is_solid(at + t) and not is_solid(at - t)
                if flat:
                    a, b = index(n + t), index(n - t)
                    new[a, x, y, z] = f[b] + 0.5 * stress @ t
                    new[b, x, y, z] = f[a] - 0.5 * stress @ t
                    changed += 1
    WallModel(solid, faces, NU).impose(now)
    assert _inside(now, cells) == pytest.approx(new, abs=1e-8)
    assert 200 < changed < 400


def test_a_channel_stays_symmetric():
    """A flow that is the same on both sides of the middle stays so, to rounding, past a bar that fills the width."""
    cells = (16, 4, 12)
    solid = np.zeros(cells, bool)
    solid[4:8, :, 4:8] = True
    rng = np.random.default_rng(1)
    half = 0.1 + 0.02 * rng.standard_normal(6)
    u = np.zeros((3, *cells))
    u[0] = np.r_[half, half[::-1]] * ~solid
    now = _water(cells, u)
    _inside(now, cells)[:, solid] = 0.0
    model, links = WallModel(solid, ALONG, NU), BounceBackLinks(solid)
    now = _advance(now, cells, ALONG, 40, tau=0.52, model=model, links=links)
    out = np.zeros((4, *cells), np.float32)
    velocity(now, *cells[1:], out)
    assert out[:3] == pytest.approx(out[:3, ..., ::-1], abs=2e-6)
    assert out[3] == pytest.approx(-out[3, ..., ::-1], abs=2e-6)
    assert np.abs(out[1]).max() > 0.05


@pytest.mark.parametrize("nu", [1e-6, 1e-4, 1e-2, 0.1])
def test_a_wall_slows_the_flow_and_never_turns_it(nu):
    """Left to itself between walls, at any viscosity, no layer flows backwards and none gains over 2 %."""
    cells = (4, 4, 6)
    now = _water(cells, np.array([0.1, 0.0, 0.0])[:, None, None, None])
    model, flux = WallModel(np.zeros(cells, bool), ALONG, nu), 0.6
    for _ in range(20):
        now = _advance(now, cells, ALONG, 50, tau=0.5 + 3 * nu, model=model)
        u = _column(now, cells)
        assert u.min() > -1e-6
        assert u.max() < 0.102
        assert u.sum() < flux
        flux = u.sum()
    still = _advance(still_water(cells), cells, ALONG, 10, model=model)
    assert not _inside(still, cells).any()


def test_a_laminar_channel_has_the_parabola():
    """At a low Reynolds number, driven evenly, the flux is 2 h^3 F / (3 nu) to 2 %, as with walls without slip."""
    cells, nu, force = (4, 4, 16), 0.1, 1e-5
    model, now = WallModel(np.zeros(cells, bool), ALONG, nu), still_water(cells)
    drive = (3 * WEIGHTS * VELOCITIES[:, 0] * force).astype(np.float32)[:, None, None, None]
    for _ in range(4000):
        now = _advance(now, cells, ALONG, 1, tau=0.5 + 3 * nu, model=model)
        _inside(now, cells)[:] += drive
    h = 8.0
    flux = 2 * h**3 * force / (3 * nu)
    assert _column(now, cells).sum() == pytest.approx(flux, rel=0.02)


def test_the_shear_of_a_turbulent_channel_is_deans():
    """At Reynolds number 40,000 on 16 cells the friction velocity is within 20 % of Dean's correlation.

    Dean 1978, J. Fluids Eng. 100, 215: cf = 0.073 Re^(-1/4), of bulk velocity and full height. Walls without slip take
    more than five times that stress on these cells.
    """
    cells, bulk, reynolds = (48, 24, 16), 0.1, 40_000.0
    nu = bulk * cells[2] / reynolds
    dean = 0.5 * 0.073 * reynolds**-0.25 * bulk**2
    rng = np.random.default_rng(0)
    y = (np.arange(cells[2]) + 0.5) / cells[2]
    x, z = np.arange(cells[0]) / cells[0], np.arange(cells[1]) / cells[1]
    start = 0.03 * bulk * rng.standard_normal((3, *cells))
    start[0] += 7 / 6 * bulk * (1 - (2 * y - 1) ** 6)
    for a, b in np.ndindex(3, 3):
        for way in range(3):
            waves = np.sin(2 * np.pi * ((a + 1) * x[:, None] + (b + 1) * z) + rng.uniform(0, 2 * np.pi))
            start[way] += 0.03 * bulk * waves[..., None] * np.sin(np.pi * y * rng.integers(1, 4))
    stress = {}
    for model in (WallModel(np.zeros(cells, bool), ALONG, nu), None):
        now = _water(cells, start)
        lost = []
        for _ in range(2000):
            now = _advance(now, cells, ALONG, 1, tau=0.5 + 3 * nu, model=model)
            # What walls take in a step is given back evenly, so that the flux stays.
            f = _inside(now, cells)
            lost.append(bulk - float(VELOCITIES[:, 0] @ f.mean((1, 2, 3), dtype=float)))
            f += (3 * WEIGHTS * VELOCITIES[:, 0] * lost[-1]).astype(np.float32)[:, None, None, None]
        stress[model is None] = 0.5 * cells[2] * np.mean(lost[1000:])
    assert math.sqrt(stress[False] / dean) == pytest.approx(1.0, abs=0.2)
    assert stress[True] > 5 * dean
