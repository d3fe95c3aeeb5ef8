"""What the parcels' water does where it misses a law or the lattice: pinned, so that no change passes unseen.

These are regressions, not laws: their bounds are what was measured. How far each is from what should be is told in
`wakewise.simulation.tank.validation_limits`. Lattice figures: case `head-on` (seed 0, averaged from 40 to 100 D/U0),
November 2026.
"""

import math

import numpy as np
import pytest

from wakewise.simulation.water.water import Water

D_M = 0.06
AREA_M2 = math.pi * D_M**2 / 4
DENSITY = 998.0


def _water(n=1, seed=0, **options):
    options.setdefault("bed_z_m", math.inf)
    return Water(np.full(n, AREA_M2), density_kg_m3=DENSITY, rng=np.random.default_rng(seed), **options)


def _push(water, seconds, thrusts_N, origins=((0.0, 0.0, 0.0),), jets=((1.0, 0.0, 0.0),), dt_s=0.05):
    origins, axes = np.array(origins, dtype=float), -np.array(jets, dtype=float)
    T = np.array(thrusts_N, dtype=float)
    impulses = np.column_stack([np.maximum(T, 0), np.maximum(-T, 0)]) * dt_s
    for _ in range(round(seconds / dt_s)):
        water.step(dt_s, origins, origins, axes, impulses)
    return water


def test_head_on_jets_run_out_too_fast():
    """Two 1 N jets 0.6 m apart run out between them; mean outflow is 0.8 to 1.6 times the lattice's near the axis.

    Lattice: 0.20, 0.17 and 0.13 m/s at 5.2, 9.8 and 12.8 cm from the axis, here 1.5, 1.2 and 1.3 times that, and 0.05
    m/s at 20 cm, where 2.1 times that is left: the lattice's outflow falls faster. Its plane of meeting swings wildly
    (0.29 m/s rms at the very middle); here it stands, and the middle is too quiet (0.04).
    """
    origins, jets = [[0, 0, 0], [0.6, 0, 0]], [[1, 0, 0], [-1, 0, 0]]
    water = _push(_water(2, turbulence=0.25), 6.0, [1.0, 1.0], origins, jets)
    r, turn = np.array([0.052, 0.098, 0.128, 0.2]), np.linspace(0, 2 * np.pi, 8, endpoint=False)
    out = np.stack([0 * turn, np.cos(turn), np.sin(turn)], axis=1)
    points = np.array([0.3, 0.0, 0.0]) + r[:, None, None] * out
    speeds = []
    for _ in range(20):
        _push(water, 0.1, [1.0, 1.0], origins, jets)
        u = water.velocity(points.reshape(-1, 3)).reshape(4, 8, 3)
        speeds.append(np.einsum("rti,ti->r", u, out) / 8)
    ratio = np.mean(speeds, axis=0) / [0.20, 0.17, 0.13, 0.05]
    assert np.all((ratio > 0.8) & (ratio < [1.6, 1.6, 1.6, 2.3]))
    given = 2 * (6.0 + 2.0)
    held = water.parcels.size_m4_s.sum() * DENSITY
    assert water.counts.met_N_s + held + water.counts.retired_N_s == pytest.approx(given, rel=0.03)
