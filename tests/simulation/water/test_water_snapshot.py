"""The water at one instant: it stays, it may be shared, and its parts add up."""

import threading

import numpy as np
import pytest
from scipy.special import i0

from wakewise.simulation.water.bedjets import layer_speed
from wakewise.simulation.water.bedjets_sums import LOG_WIDTH, REACH
from wakewise.simulation.water.parcels import CENTRE_SPEED
from wakewise.simulation.water.water import Water

AREAS_M2 = np.full(2, 2.8e-3)
DISKS_M = np.array([[0.0, 0.0, 0.8], [0.3, 0.0, 0.9]])
AXES = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


def _water():
    water = Water(
        AREAS_M2,
        density_kg_m3=1000.0,
        bed_z_m=1.5,
        rng=np.random.default_rng(0),
        current_W_m_s=np.array([0.02, 0.01, 0.0]),
        half_size_m=(1.5, 1.5),
        turbulence=0.25,
    )
    _go_on(water, 60)
    return water


def _go_on(water, steps):
    for _ in range(steps):
        water.step(0.05, DISKS_M, DISKS_M, AXES, np.array([[0.2, 0.0], [0.1, 0.0]]))


def _points(n=600):
    return np.random.default_rng(1).uniform([-0.5, -0.5, 0.9], [0.5, 0.5, 1.5], (n, 3))


def test_an_instant_stays_what_it_was():
    """The water moves on, the flow of a moment ago does not, and the water's own answer is that of now."""
    water, points = _water(), _points()
    then = water.now
    before = water.velocity(points)
    _go_on(water, 5)
    assert then.velocity(points).tobytes() == before.tobytes()
    assert np.abs(water.velocity(points) - before).max() > 1e-3
    assert water.now.velocity(points).tobytes() == water.velocity(points).tobytes()
    assert water.now.time_s == pytest.approx(then.time_s + 0.25)


def test_excess_and_ambient_are_the_whole():
    """Jets and current add up to the velocity, each with the body's answer to it."""
    now, points = _water().now, _points()
    both = now.excess_velocity(points) + now.ambient_velocity(points)
    assert both == pytest.approx(now.velocity(points), abs=1e-9)
    assert now.ambient_velocity(points)[0] == pytest.approx([0.02, 0.01, 0.0])


def test_several_threads_may_look_at_once():
    """Four threads that ask a fresh instant together get the bytes that one gets."""
    alone = _water().now.velocity(_points())
    now, found = _water().now, []
    threads = [threading.Thread(target=lambda: found.append(now.velocity(_points()))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [u.tobytes() for u in found] == [alone.tobytes()] * 4


def test_the_bed_is_stirred_where_it_is_fast():
    """Beyond the circles no place on the bed is faster than the speed they were asked for."""
    now = _water().now
    circles = now.stirred_bed(0.02)
    grid = np.stack(np.meshgrid(np.linspace(-1.4, 1.4, 57), np.linspace(-1.4, 1.4, 57)), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(grid[:, None] - circles[None, :, :2], axis=2)
    outside = grid[np.all(apart > circles[:, 2], axis=1)]
    u = now.excess_velocity(np.column_stack([outside, np.full(len(outside), 1.5)]))
    assert 0 < len(outside) < len(grid)
    assert np.linalg.norm(u, axis=1).max() < 0.03
    inside = grid[np.any(apart < circles[:, 2], axis=1)]
    u = now.excess_velocity(np.column_stack([inside, np.full(len(inside), 1.5)]))
    assert np.linalg.norm(u, axis=1).max() > 0.05


def test_circles_are_their_readable_twin():
    """Of rings and of parcels, those that are fast enough, as the laws are written for all of them at once."""
    least = 0.02
    now = _water().now
    rings, parcels = now.rings, now.parcels
    speed, (heading, kappa) = layer_speed(rings), rings.heading_kappa
    fast = speed > least
    beyond = np.exp(np.minimum(LOG_WIDTH * np.sqrt(2 * np.log(np.maximum(speed / least, 1.0))), REACH))
    ahead, behind = (beyond * rings.radius_m * (np.exp(s * kappa) / i0(kappa)) ** 0.25 for s in (1.0, -1.0))
    middle = rings.centre_m + (0.5 * (ahead - behind))[:, None] * heading
    swift = 4 * CENTRE_SPEED * parcels.size_m4_s / parcels.sigma_m**3 > least
    low = swift & (1.5 - parcels.position_m[:, 2] < 4 * parcels.sigma_m)
    under_rings = np.column_stack([middle, 0.5 * (ahead + behind)])[fast]
    under_jets = np.column_stack([parcels.position_m[:, :2], 4 * parcels.sigma_m])[low]
    assert len(under_rings)
    assert len(under_jets)
    np.testing.assert_allclose(now.stirred_bed(least), np.concatenate([under_rings, under_jets]), rtol=1e-12)
