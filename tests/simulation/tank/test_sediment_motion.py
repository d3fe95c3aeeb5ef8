"""Each compiled loop of the silt against a slow readable twin, and the silt's approximations one at a time."""

import math

import numpy as np
import pytest

from wakewise.simulation.tank.grains import friction_table_m_s, friction_velocity_m_s, settling_speed_m_s
from wakewise.simulation.tank.sediment_motion import (
    advect_particles,
    cells_to_look_at,
    deposit,
    entrain,
    mix,
    moved_cells,
    particles_to_sample,
    shared_among_nodes,
    stirred_cells,
    update_friction,
)

LOW, CELL, SHAPE, DEPTH_M = np.array([-0.5, -0.4]), np.array([0.05, 0.05]), (20, 16), 0.6
KARMAN, HIGHEST_M, BACKGROUND = LAWS = (0.4, 0.065, 1e-5)


def cloud(n=200, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform([-0.5, -0.4, 0.0], [0.5, 0.4, DEPTH_M], (n, 3)), rng


def folded(value, low, high):
    """Mirrored once at an end that it is beyond."""
    if value > high:
        value = 2 * high - value
    elif value < low:
        value = 2 * low - value
    return min(max(value, low), high)


def cell_of(x, y):
    i, j = math.floor((x - LOW[0]) / CELL[0]), math.floor((y - LOW[1]) / CELL[1])
    return min(max(i, 0), SHAPE[0] - 1), min(max(j, 0), SHAPE[1] - 1)


def test_carrying_is_its_twin():
    """Along with the water, down at the settling speed, in sinking water by the share of the height that is left."""
    start, rng = cloud()
    u, dt, sinks = 0.2 * rng.normal(size=start.shape), 0.1, 0.004
    found = start.copy()
    landed = advect_particles(found, u, sinks, dt, LOW, DEPTH_M)
    for k, (x, y, z) in enumerate(start):
        height = DEPTH_M - z
        down = u[k, 2]  # z points down
        height_then = height * math.exp(-down * dt / height) if down > 0.0 else height - down * dt
        height_then -= sinks * dt
        assert landed[k] == (height_then <= 0.0)
        expected = [folded(x + u[k, 0] * dt, -0.5, 0.5), folded(y + u[k, 1] * dt, -0.4, 0.4)]
        np.testing.assert_allclose(found[k, :2], expected, atol=1e-12)
        np.testing.assert_allclose(found[k, 2], folded(abs(DEPTH_M - height_then), 0.0, DEPTH_M), atol=1e-12)


def test_mixing_is_its_twin():
    """Visser's walk: the gradient of K as drift, and a step with the K found half a drift on."""
    start, rng = cloud(seed=1)
    kicks, star, dt = rng.normal(size=start.shape), rng.uniform(0.0, 0.03, SHAPE), 0.05
    found = start.copy()
    mix(found, kicks, star, LOW, CELL, DEPTH_M, dt, np.array(LAWS))
    for k, (x, y, z) in enumerate(start):
        i, j = cell_of(x, y)
        height = DEPTH_M - z
        length = KARMAN * min(height, HIGHEST_M)
        before, after = max(i - 1, 0), min(i + 1, SHAPE[0] - 1)
        left, right = max(j - 1, 0), min(j + 1, SHAPE[1] - 1)
        drift = np.array(
            [
                length * (star[after, j] - star[before, j]) / ((after - before) * CELL[0]),
                length * (star[i, right] - star[i, left]) / ((right - left) * CELL[1]),
                -KARMAN * star[i, j] if height < HIGHEST_M else 0.0,
            ]
        )
        half_way = abs(height - 0.5 * drift[2] * dt)
        diffusivity = BACKGROUND + KARMAN * star[i, j] * min(half_way, HIGHEST_M)
        there = start[k] + drift * dt + math.sqrt(2 * diffusivity * dt) * kicks[k]
        expected = [folded(there[0], -0.5, 0.5), folded(there[1], -0.4, 0.4), folded(abs(there[2]), 0.0, DEPTH_M)]
        np.testing.assert_allclose(found[k], expected, atol=1e-12)


def test_sharing_among_nodes_is_its_twin():
    """Each of the eight nodes round a particle gets mass by how near it is in each direction; outside gets none."""
    place, rng = cloud(seed=2)
    mass, origin, spacing = rng.uniform(1.0, 2.0, len(place)), np.array([-0.2, -0.2, 0.1]), 0.1
    found, expected = np.zeros((5, 5, 6)), np.zeros((5, 5, 6))
    shared_among_nodes(place, mass, origin, spacing, found)
    for node in np.ndindex(expected.shape):
        away = np.abs((place - origin) / spacing - np.array(node))
        expected[node] = np.sum(mass * np.prod(np.maximum(1.0 - away, 0.0), axis=1))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_stirred_cells_are_those_whose_middle_a_circle_covers():
    """By looking at every cell and every circle."""
    rng = np.random.default_rng(3)
    circles = np.column_stack([rng.uniform(-0.7, 0.7, (12, 2)), rng.uniform(0.0, 0.2, 12)])
    found = np.zeros(SHAPE, dtype=np.bool_)
    stirred_cells(circles, LOW, CELL, 0.03, found)
    for i, j in np.ndindex(SHAPE):
        middle = LOW + (np.array([i, j]) + 0.5) * CELL
        covered = np.linalg.norm(circles[:, :2] - middle, axis=1) < circles[:, 2] + 0.03
        assert found[i, j] == covered.any()


def test_cells_are_looked_at_in_turn():
    """New ones at once, those of one colour that stay stirred keep what they felt; the first place is far away."""
    rng = np.random.default_rng(4)
    near, looked = rng.uniform(size=SHAPE) < 0.5, rng.uniform(size=SHAPE) < 0.5
    for odd in (0, 1):
        kept, cells, places = cells_to_look_at(near, looked, odd, LOW, CELL, DEPTH_M)
        expected = np.array([[near[c] and looked[c] and sum(c) % 2 == odd for c in row] for row in _all_cells()])
        assert np.array_equal(kept, expected)
        assert np.array_equal(cells, np.argwhere(near & ~kept))
        assert places[0] == pytest.approx([*LOW, DEPTH_M])
        assert places[1:] == pytest.approx(np.column_stack([LOW + (cells + 0.5) * CELL, np.full(len(cells), DEPTH_M)]))


def _all_cells():
    return [[(i, j) for j in range(SHAPE[1])] for i in range(SHAPE[0])]


def test_a_bed_feels_the_water_that_was_looked_at():
    """Kept cells keep, looked at ones take the law's friction velocity, and all others that of the first place."""
    rng = np.random.default_rng(5)
    star, kept = rng.uniform(0.0, 0.03, SHAPE), rng.uniform(size=SHAPE) < 0.2
    before = star.copy()
    cells = np.argwhere(~kept)[::3]
    u = rng.normal(0.0, 0.2, (len(cells) + 1, 3))
    update_friction(star, kept, cells, u, friction_table_m_s(0.01, 20e-6))
    law = friction_velocity_m_s(np.hypot(u[:, 0], u[:, 1]), 0.01, 20e-6)
    expected = np.where(kept, before, law[0])
    expected[tuple(cells.T)] = law[1:]
    assert star == pytest.approx(expected, rel=1e-4)
    bed = (rng.uniform(size=SHAPE) < 0.5).astype(float)
    moved = (star > 0.01) & (bed > 0.0)
    for found, expected in zip(
        moved_cells(star, bed, 0.01), (np.argwhere(moved), star[moved], bed[moved]), strict=True
    ):
        assert np.array_equal(found, expected)


@pytest.mark.parametrize("firm_kg_m2", [0.0, 0.3])
def test_lifting_is_its_twin(firm_kg_m2):
    """Whole particles leave, the loose layer first and never more than there is; what leaves is what the bed lacks."""
    rng = np.random.default_rng(5)
    bed = rng.choice([0.01, 0.3, 0.3005, 0.5], SHAPE)
    cells, birth_kg, area_m2 = np.argwhere(bed > 0.0)[::3], 1e-5, 0.0025
    drawn, before = rng.uniform(0.0, 4.0, len(cells)), bed.copy()
    expected = []
    for (i, j), particles in zip(cells, drawn, strict=True):
        loose = before[i, j] - firm_kg_m2
        most = (loose if loose > 1e-9 else before[i, j]) * area_m2
        if particles >= 1.0:
            expected.append((i, j, min(math.floor(particles) * birth_kg, most)))
    lifted = entrain(cells, drawn, birth_kg, area_m2, firm_kg_m2, bed)
    assert np.allclose(lifted, expected, rtol=1e-13)
    assert (before - bed).sum() * area_m2 == pytest.approx(lifted[:, 2].sum(), rel=1e-9)
    assert bed.min() >= 0.0


def test_particles_are_looked_at_when_they_have_gone_far_or_long():
    """The ages of the others go on, and those found start anew."""
    u, age = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.02, 0.0]]), np.array([0.1, 0.25, 0.1])
    assert particles_to_sample(u, age, 0.06, 0.015, 0.3).tolist() == [0, 1]
    assert age == pytest.approx([0.0, 0.0, 0.16])


def test_what_lands_lies_on_the_bed_and_the_rest_closes_ranks():
    """Mass is kept, cell by cell, also of grains beyond the edge, where the nearest cell counts."""
    rng = np.random.default_rng(6)
    place = np.column_stack([rng.uniform(-0.7, 0.7, (50, 2)), rng.uniform(0, DEPTH_M, 50)])
    mass, u, age, landed = (
        rng.uniform(size=50),
        rng.normal(size=(50, 3)),
        rng.uniform(size=50),
        rng.uniform(size=50) < 0.4,
    )
    bed, expected = np.zeros(SHAPE), np.zeros(SHAPE)
    for (x, y, _), kg in zip(place[landed], mass[landed], strict=True):
        expected[cell_of(x, y)] += kg / CELL.prod()
    then = [array[~landed] for array in (place, mass, u, age)]
    left = deposit(landed, place, mass, u, age, bed, LOW, CELL)
    assert bed == pytest.approx(expected, rel=1e-12)
    for now, kept in zip((place, mass, u, age), then, strict=True):
        assert np.array_equal(now[:left], kept)


@pytest.mark.parametrize("grain_m", [20e-6, 60e-6, 3e-4])
def test_still_water_lets_grains_sink_at_their_speed(grain_m):
    """Ten seconds without mixing take a grain down by ten times the law's speed, in steps of any length."""
    sinks = settling_speed_m_s(grain_m, 2710.0, 1000.0)
    for dt in (0.05, 0.2):
        place = np.array([[0.0, 0.0, 0.05]])
        for _ in range(round(10.0 / dt)):
            advect_particles(place, np.zeros((1, 3)), sinks, dt, LOW, DEPTH_M)
        assert place[0, 2] - 0.05 == pytest.approx(10.0 * sinks, rel=1e-9)


def test_water_alone_carries_no_grain_into_the_bed():
    """However fast it sinks onto the bed, grains without weight come near and never land."""
    place = np.column_stack([np.zeros((5, 2)), np.linspace(0.1, 0.5, 5)])
    for _ in range(4):
        assert not advect_particles(place, np.tile([0.0, 0.0, 0.3], (5, 1)), 0.0, 0.05, LOW, DEPTH_M).any()
    assert np.all(place[:, 2] <= DEPTH_M)


def test_deposition_is_the_settling_flux():
    """Of an even cloud the share w_s dt / depth lands in a step, within what chance leaves."""
    rng, sinks, dt = np.random.default_rng(5), 0.02, 0.5
    place = rng.uniform([-0.5, -0.4, 0.0], [0.5, 0.4, DEPTH_M], (100000, 3))
    landed = advect_particles(place, np.zeros_like(place), sinks, dt, LOW, DEPTH_M)
    assert landed.mean() == pytest.approx(sinks * dt / DEPTH_M, rel=0.03)


def test_the_drift_term_keeps_silt_from_leaving_strong_mixing():
    """Where friction grows along x an even cloud stays even; taken without drift it would thin out there."""
    rng = np.random.default_rng(6)
    star = np.repeat(np.linspace(0.0, 0.05, SHAPE[0])[:, None], SHAPE[1], axis=1)
    n, dt = 20000, 0.1
    place = np.column_stack([rng.uniform(-0.5, 0.5, n), rng.uniform(-0.4, 0.4, n), np.full(n, DEPTH_M - 0.2)])
    no_drift = place.copy()
    for _ in range(400):
        kicks = rng.normal(size=(n, 3))
        kicks[:, 2] = 0.0
        mix(place, kicks, star, LOW, CELL, DEPTH_M, dt, np.array(LAWS))
        i, j = np.clip(np.floor((no_drift[:, :2] - LOW) / CELL).astype(int), 0, np.array(SHAPE) - 1).T
        size = np.sqrt(2 * (BACKGROUND + KARMAN * star[i, j] * HIGHEST_M) * dt)
        no_drift[:, 0] = np.clip(no_drift[:, 0] + size * kicks[:, 0], -0.5, 0.5)
    right = (place[:, 0] > 0.0).mean(), (no_drift[:, 0] > 0.0).mean()
    assert right[0] == pytest.approx(0.5, abs=0.02)
    assert right[1] < 0.47
