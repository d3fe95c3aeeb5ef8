"""Silt: mass is conserved, well-mixed stays mixed, still water clears at the settling speed, jets lift."""

import numpy as np
import pytest

from wakewise.simulation.tank.grains import mean_excess
from wakewise.simulation.tank.sediment import Silt, SiltProperties

SIZE_M = (1.0, 1.0, 0.5)
EVERYWHERE = np.array([[0.0, 0.0, 2.0]])
NOWHERE = np.zeros((0, 3))


class Uniform:
    """Water that moves everywhere alike along the bed."""

    def __init__(self, velocity_m_s):
        self.u = np.array(velocity_m_s, dtype=float)

    def velocity(self, points_W_m):
        return np.tile(self.u, (len(points_W_m), 1))


class Whirl:
    """Water that turns about a vertical axis and welled up in the middle; still at the bed's plane in z."""

    def velocity(self, points_W_m):
        x, y, z = points_W_m.T
        h = SIZE_M[2] - z
        return np.stack([-2.0 * y, 2.0 * x, -np.minimum(h, 0.1) * np.exp(-20 * (x**2 + y**2))], axis=1)


def _silt(load=0.1, particles=500, seed=0, grain=20e-6):
    laws = SiltProperties.of(grain, 2710.0, 1000.0, 5e-4)
    return Silt(laws, load, SIZE_M, particles, np.random.default_rng(seed))


def test_no_gram_is_lost():
    """Bed and water hold the same mass after erosion, mixing, pairing and settling, to 1e-6 (1e-12 in fact)."""
    silt = _silt()
    start = silt.total_kg
    for k in range(200):
        silt.step(Whirl() if k < 120 else Uniform([0, 0, 0]), EVERYWHERE, 0.05)
        assert np.all(silt.bed_kg_m2 >= 0.0)
        assert len(silt.mass_kg) <= 500
    assert silt.pairings > 0
    assert silt.suspended_kg > 0.0
    assert silt.total_kg == pytest.approx(start, rel=1e-12)


def test_erosion_lifts_what_partheniades_says():
    """Under a uniform stream the bed loses E times time, within 5 % and what has settled."""
    silt = _silt(load=1.0, particles=20000)
    silt.step(Uniform([0.4, 0, 0]), EVERYWHERE, 1e-9)
    stress = 1000.0 * silt._star_m_s**2
    rate = 5e-4 * (stress / silt.laws.threshold_Pa - 1)
    for _ in range(20):
        silt.step(Uniform([0.4, 0, 0]), EVERYWHERE, 0.05)
    settled_share = silt.laws.settling_m_s * 1.0 / 0.005
    expected = float(rate.mean()) * 1.0 * 1.0
    assert silt.suspended_kg == pytest.approx(expected, rel=0.05 + settled_share)


def test_a_clean_bed_or_gentle_water_lifts_nothing():
    """No load, or no stress above the threshold, leaves the water clear."""
    for silt, speed in ((_silt(load=0.0), 1.0), (_silt(), 0.05)):
        for _ in range(10):
            silt.step(Uniform([speed, 0, 0]), NOWHERE, 0.05)
        assert silt.suspended_kg == 0.0


def test_well_mixed_silt_stays_mixed():
    """With no settling, an even cloud stays even although diffusivity varies tenfold with height."""
    silt = _silt(load=0.0)
    silt.laws = SiltProperties.of(1e-6, 2710.0, 1000.0, 0.0)
    n = 20000
    rng = np.random.default_rng(1)
    silt.position_m = rng.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 0.5], (n, 3))
    silt.mass_kg = np.full(n, 1e-6)
    silt._max = n
    for _ in range(200):
        silt._star_m_s[:] = 0.02
        silt._mix(0.05)
    layers = np.histogram(silt.position_m[:, 2], bins=20, range=(0, 0.5))[0] / (n / 20)
    # Twenty bins of a thousand particles scatter by 3 %; ignoring the drift gives errors of 100 % next to the bed.
    assert np.abs(layers - 1).max() < 0.15


def test_still_water_clears_at_the_settling_speed():
    """A cloud's mean height falls at w_s, and what reaches the bed is bed."""
    silt = _silt(load=0.0, grain=60e-6)
    n, w_s = 2000, silt.laws.settling_m_s
    silt.position_m = np.column_stack([np.zeros((n, 2)), np.full(n, 0.2)])
    silt.mass_kg = np.full(n, 1e-6)
    silt._max = n
    for _ in range(100):
        silt.step(Uniform([0, 0, 0]), NOWHERE, 0.2)
    fallen = silt.position_m[:, 2].mean() - 0.2
    assert fallen == pytest.approx(w_s * 20.0, rel=0.05)
    for _ in range(600):
        silt.step(Uniform([0, 0, 0]), NOWHERE, 0.5)
    assert silt.suspended_kg == 0.0
    assert silt.bed_kg_m2.sum() * 0.05**2 == pytest.approx(n * 1e-6, rel=1e-9)


def test_the_grid_holds_the_mass_of_its_particles():
    """Concentration times volume sums to the suspended mass; nodes on the bed have half a volume."""
    silt = _silt(load=0.0)
    rng = np.random.default_rng(0)
    silt.position_m = rng.uniform([-0.3, -0.3, 0.2], [0.3, 0.3, 0.5], (500, 3))
    silt.mass_kg = rng.uniform(1e-6, 2e-6, 500)
    grid = silt.concentration(np.array([-0.5, -0.5, 0.0]), 0.05, (21, 21, 11))
    volume = np.full(11, 0.05**3)
    volume[-1] /= 2
    assert (grid.values * volume).sum() == pytest.approx(silt.suspended_kg, rel=1e-12)
    assert grid.values.min() >= 0.0


def test_the_same_seed_gives_the_same_bytes():
    """Two clouds from one seed are identical."""
    clouds = []
    for seed in (1, 1, 2):
        silt = _silt(seed=seed)
        for _ in range(40):
            silt.step(Whirl(), EVERYWHERE, 0.05)
        clouds.append(silt.position_m.tobytes())
    assert clouds[0] == clouds[1] != clouds[2]


def _sand(load=0.0, particles=4000, seed=0):
    laws = SiltProperties.of(3e-4, 2710.0, 1000.0, 5e-4)
    return Silt(laws, load, SIZE_M, particles, np.random.default_rng(seed))


def test_suspended_sand_sinks_out_of_the_water():
    """50 mg/L of 0.3 mm calcite start even in the water, and lie on the bed after depth over settling speed."""
    silt = _sand()
    silt.suspend(0.05, np.zeros(3))
    assert silt.suspended_kg == pytest.approx(0.05 * 0.5, rel=1e-9)
    grid = silt.concentration(np.array([-0.5, -0.5, 0.0]), 0.25, (5, 5, 3))
    assert grid.values[1:4, 1:4, 1].mean() == pytest.approx(0.05, rel=0.1)
    clears_s = SIZE_M[2] / silt.laws.settling_m_s
    assert 10.0 < clears_s < 12.0
    for _ in range(round(0.5 * clears_s / 0.1)):
        silt.step(Uniform([0, 0, 0]), NOWHERE, 0.1)
    assert silt.suspended_kg == pytest.approx(0.5 * 0.05 * 0.5, rel=0.1)
    for _ in range(round(0.8 * clears_s / 0.1)):
        silt.step(Uniform([0, 0, 0]), NOWHERE, 0.1)
    assert silt.suspended_kg < 1e-4 * 0.05 * 0.5
    assert silt.mass_error_rel < 1e-12


def test_suspended_grains_are_even_wherever_the_particles_are_finer():
    """Near the target and far from it a large tank holds the same concentration."""
    silt = Silt(SiltProperties.of(2e-5, 2710.0, 1000.0, 0.0), 0.0, (6.0, 5.0, 1.5), 40000, np.random.default_rng(0))
    silt.suspend(0.05, np.zeros(3))
    x, y = silt.position_m[:, 0], silt.position_m[:, 1]
    near = (np.abs(x) < 0.8) & (np.abs(y) < 0.8)
    assert silt.mass_kg[near].sum() / (1.6 * 1.6 * 1.5) == pytest.approx(0.05, rel=1e-9)
    far = (x > 1.0) & (y > -2.0)
    assert silt.mass_kg[far].sum() / (2.0 * 4.5 * 1.5) == pytest.approx(0.05, rel=0.06)


def test_sand_is_lifted_by_van_rijns_law():
    """Sand takes van Rijn's pickup unless told otherwise, and a bed loses what it says."""
    silt = _sand(load=50.0, particles=20000)
    assert silt.laws.sand
    assert not SiltProperties.of(3e-4, 2710.0, 1000.0, 5e-4, pickup="partheniades").sand
    assert not SiltProperties.of(2e-5, 2710.0, 1000.0, 5e-4).sand
    before = silt.bed_kg_m2.sum()
    silt._shear(Uniform([0.6, 0, 0]), EVERYWHERE)
    silt._erode(0.05)
    stress = 1000.0 * silt._star_m_s**2
    expected = silt.laws.lifted_kg_m2_s(stress.ravel(), np.full(stress.size, 50.0)).sum() * 0.05
    assert before - silt.bed_kg_m2.sum() == pytest.approx(expected, rel=0.05)


def test_mass_is_kept_to_a_millionth_through_lifting_and_settling_of_sand():
    """Sand that jumps along the bed for minutes is neither made nor lost."""
    silt = _sand(load=1.0, particles=2000)
    silt.suspend(0.05, np.zeros(3))
    for k in range(150):
        silt.step(Uniform([0.5 if k < 100 else 0.0, 0, 0]), EVERYWHERE, 0.1)
    assert silt.mass_error_rel < 1e-9


def test_a_fluctuating_stress_lifts_what_its_mean_does_not():
    """Just below the threshold a steady stress moves nothing, a turbulent one what the mean excess says."""
    stress = 0.9 * 0.0625
    laws = [SiltProperties.of(20e-6, 2710.0, 1000.0, 5e-5, 0.0625, stress_intensity=i) for i in (0.0, 0.4)]
    load = np.array([1.0])
    assert laws[0].lifted_kg_m2_s(np.array([stress]), load)[0] == 0.0
    assert laws[1].lifted_kg_m2_s(np.array([stress]), load)[0] == pytest.approx(5e-5 * mean_excess(0.9, 0.4))
    assert laws[1].stirring_Pa < 0.5 * laws[0].stirring_Pa


def test_fluff_goes_first_and_the_firm_layer_stays():
    """Between the two thresholds all the fluff leaves, no firm grain; above both, the firm layer erodes too."""
    laws = SiltProperties.of(8e-6, 2650.0, 1000.0, 1e-3, 0.035, firm_kg_m2=0.5)
    silt = Silt(laws, 0.6, SIZE_M, 4000, np.random.default_rng(0))
    start = silt.total_kg
    star = np.sqrt(0.2 / 1000.0)
    for _ in range(400):
        silt._star_m_s = np.full(silt._shape, star)
        silt._erode(0.1)
    assert silt.bed_kg_m2 == pytest.approx(np.full(silt._shape, 0.5), abs=1e-6)
    assert silt.lifted_kg == pytest.approx(0.1, rel=1e-3)
    silt._star_m_s = np.full(silt._shape, np.sqrt(0.7 / 1000.0))
    silt._erode(1.0)
    assert silt.lifted_kg == pytest.approx(0.1 + 1e-3, rel=0.01)
    assert silt.total_kg == pytest.approx(start, rel=1e-12)


def test_what_settles_on_a_firm_bed_is_fluff():
    """A grain that has settled on a bare firm layer goes again at the fluff's threshold."""
    laws = SiltProperties.of(8e-6, 2650.0, 1000.0, 1e-3, 0.035, firm_kg_m2=0.5)
    stress = np.array([0.1, 0.1])
    rates = laws.lifted_kg_m2_s(stress, np.array([0.5, 0.501]))
    assert rates[0] == 0.0
    assert rates[1] == pytest.approx(1e-3 * (0.1 / 0.035 - 1))
    assert laws.firm_threshold_Pa == pytest.approx(0.35)


def test_what_was_lifted_is_what_left_the_bed():
    """Lifted less settled again is what is in the water, through a flight of erosion and rest, to rounding."""
    silt = _silt()
    settled, before = 0.0, silt.bed_kg_m2.sum() * silt._cell.prod()
    for k in range(120):
        silt.step(Whirl() if k < 60 else Uniform([0, 0, 0]), EVERYWHERE, 0.05)
    after = silt.bed_kg_m2.sum() * silt._cell.prod()
    settled = silt.lifted_kg - (before - after)
    assert silt.lifted_kg > 0.0
    assert settled > 0.0
    assert silt.suspended_kg == pytest.approx(silt.lifted_kg - settled, rel=1e-9)


def test_aggregates_sink_at_the_speed_given():
    """A settling speed that is given replaces the grain's own and nothing else."""
    own, given = (SiltProperties.of(8e-6, 2650.0, 1000.0, 1e-4, settling_m_s=w) for w in (None, 3e-4))
    assert given.settling_m_s == 3e-4
    assert own.settling_m_s == pytest.approx(5.2e-5, rel=0.05)
    assert given.threshold_Pa == own.threshold_Pa


def test_a_plume_is_that_of_advection_and_diffusion():
    """Downstream of a steady point source in a uniform stream: Q / U through each plane, Gaussian with variance 2 K t.

    Far from the bed K is even, K0 + 0.40 u* 0.065 m; along the stream diffusion is negligible there.
    """
    speed, rate, h = 0.05, 1e-6, 0.02
    laws = SiltProperties.of(1e-6, 2710.0, 1000.0, 0.0)
    silt = Silt(laws, 0.0, (1.2, 1.0, 0.6), 10**6, np.random.default_rng(0))
    source, rng, dt, each = np.array([-0.5, 0.0, 0.3]), np.random.default_rng(1), 0.1, 500
    water = Uniform([speed, 0, 0])
    for _ in range(200):
        silt.step(water, NOWHERE, dt)
        fresh = source + np.column_stack([rng.random(each) * speed * dt, np.zeros((each, 2))])
        silt.position_m = np.concatenate([silt.position_m, fresh])
        silt.mass_kg = np.concatenate([silt.mass_kg, np.full(each, rate * dt / each)])
    diffusivity = 1e-5 + 0.4 * 0.065 * float(silt._star_m_s[0, 0])
    assert diffusivity > 5e-5
    grid = silt.concentration(np.array([-0.6, -0.3, 0.0]), h, (61, 31, 31))
    for x in (-0.3, 0.0, 0.2):
        spread = 2 * diffusivity * (x - source[0]) / speed
        near = silt.position_m[np.abs(silt.position_m[:, 0] - x) < 0.05]
        assert (near[:, 1:] - source[1:]).var(axis=0) == pytest.approx(np.full(2, spread), rel=0.1)
        planes = grid.values[round((x + 0.6) / h) - 2 : round((x + 0.6) / h) + 3].mean(axis=0)
        assert planes.sum() * h**2 == pytest.approx(rate / speed, rel=0.03)
        # Sharing among nodes spreads each grain by h^2 / 6 per axis.
        wide = spread + h**2 / 6
        y, z = np.meshgrid(-0.3 + h * np.arange(31), h * np.arange(31), indexing="ij")
        law = rate / (2 * np.pi * wide * speed) * np.exp(-(y**2 + (z - 0.3) ** 2) / (2 * wide))
        assert np.abs(planes - law).max() < 0.15 * law.max()
        assert np.abs(planes - law).sum() < 0.12 * law.sum()


def test_a_settling_plume_sinks_as_it_goes():
    """Grains released into a stream lie lower by w x / U, and what reaches the bed is counted there."""
    laws = SiltProperties.of(20e-6, 2710.0, 1000.0, 0.0, settling_m_s=0.01)
    silt = Silt(laws, 0.0, (1.2, 1.0, 0.6), 10**6, np.random.default_rng(0))
    silt.position_m = np.tile([-0.5, 0.0, 0.2], (4000, 1))
    silt.mass_kg = np.full(4000, 1e-6)
    for _ in range(100):
        silt.step(Uniform([0.05, 0, 0]), NOWHERE, 0.1)
    assert silt.position_m.mean(axis=0) == pytest.approx([0.0, 0.0, 0.3], abs=0.005)
    for _ in range(700):
        silt.step(Uniform([0.0, 0, 0]), NOWHERE, 0.1)
    assert silt.suspended_kg < 1e-3 * 4000e-6
    assert silt.total_kg == pytest.approx(4000e-6, rel=1e-12)


def test_nodes_on_bed_and_walls_tell_what_is_before_them():
    """Even silt is even on a grid of all the water, on its faces too, where a node has less water round it."""
    silt = _silt(load=0.0)
    n = 400_000
    silt.position_m = np.random.default_rng(2).uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 0.5], (n, 3))
    silt.mass_kg = np.full(n, 0.02 * 0.5 / n)
    values = silt.concentration(np.array([-0.5, -0.5, 0.0]), 0.1, (11, 11, 6)).values[:, :, 1:]
    for part in (values[0], values[-1], values[:, 0], values[:, -1], values[:, :, -1], values[1:-1, 1:-1, :-1]):
        assert part.mean() == pytest.approx(0.02, rel=0.02)
