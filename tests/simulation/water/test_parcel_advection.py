"""The compiled step of the parcels against the closure's own functions, one quantity after the other."""

import math

import numpy as np
import pytest
from round_jet_reference import across_row_m_s, bent_spread, carried_share, share_left, travel

from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.parcel_advection import (
    EMISSION_SPACING,
    HELD_S,
    advect_parcels,
    count_sent,
    emit_parcels,
    fade_gusts,
    parcels_to_sample,
    slugs,
)
from wakewise.simulation.water.parcels import Parcels
from wakewise.simulation.water.round_jet_closure import PLAIN, PUFF_SPREAD, SWIRLING, disk_share


def _parcels(rng, n=200):
    D = np.full(n, 0.06)
    sigma = rng.uniform(0.36, 4.0, n) * D
    sigma[:20] = rng.uniform(0.36, 0.49, 20) * D[:20]
    return Parcels.sent(
        rng.uniform([-1, -1, 0.2], [1, 1, 1.4], (n, 3)),
        rng.normal(0, 1e-4, (n, 3)),
        sigma,
        D,
        np.zeros(n, dtype=np.int64),
        np.zeros((n, 3)),
        rng.normal(0, 0.05, (n, 3)),
    )


def _laws(spreading, dt_s):
    return np.array([spreading.core_spread, spreading.spread, max(PUFF_SPREAD, spreading.spread), dt_s, 1.0])


def _drifted(parcels, u, ambient, dt_s, spreading, room):
    """Position, size, share of the disk's water after a step, and the jets' speed before it."""
    p = parcels.with_room(parcels.count)
    speed = np.empty(parcels.count)
    laws = _laws(spreading, dt_s)
    wake = np.zeros(parcels.count, bool)
    advect_parcels(p.position, p.sigma, p.share, speed, p.diameter, p.disk, u, ambient, p.start, wake, laws, room.walls)
    return p.position, p.sigma, p.share, speed


@pytest.mark.parametrize("spreading", [PLAIN, SWIRLING])
def test_the_compiled_step_is_the_closure_as_written(spreading):
    """Position, size and speed agree with the closure's functions to rounding, in the core, through its end, beyond."""
    rng = np.random.default_rng(0)
    parcels, dt_s = _parcels(rng), 0.05
    u, ambient = rng.normal(0, 0.3, (200, 3)), rng.normal(0, 0.05, (200, 3))
    position, sigma, kept, speed = _drifted(parcels, u, ambient, dt_s, spreading, TankFaces(()))
    own = carried_share(parcels.sigma_m, parcels.diameter_m)[:, None] * u
    spread = bent_spread(spreading.spread, own, ambient - parcels.disk_m_s)
    length = np.linalg.norm(u, axis=1)
    path, size = travel(parcels.sigma_m, parcels.diameter_m, length, dt_s, spreading, spread)
    across = across_row_m_s(own, ambient - parcels.disk_m_s)
    left = share_left(parcels.sigma_m, size, parcels.diameter_m, across, dt_s)
    share = (0.5 * (1 + left) * parcels.share)[:, None]
    carried = ambient + share * (parcels.disk_m_s - ambient)
    assert kept == pytest.approx(left * parcels.share, rel=1e-12)
    assert speed == pytest.approx(length, rel=1e-12)
    assert sigma == pytest.approx(size, rel=1e-12)
    assert position == pytest.approx(parcels.position_m + (path / length)[:, None] * u + carried * dt_s, abs=1e-12)


def test_nothing_ends_up_behind_a_face():
    """Parcels pushed through walls, bed or surface come back mirrored."""
    rng = np.random.default_rng(1)
    parcels, room = _parcels(rng), TankFaces.of(1.5, (1.0, 1.0), surface=True)
    position, *_ = _drifted(parcels, rng.normal(0, 4.0, (200, 3)), np.zeros((200, 3)), 0.1, PLAIN, room)
    assert np.all(np.abs(position[:, :2]) <= 1.0) and np.all((position[:, 2] >= 0.0) & (position[:, 2] <= 1.5))


def test_slugs_send_all_of_the_impulse():
    """Over many steps what is sent and what waits is what was given; parcels are one spacing apart on average."""
    areas, spacing = np.full(2, 2.8e-3), np.full(2, EMISSION_SPACING * 0.06 / math.sqrt(8))
    waiting, waiting_m = np.zeros((2, 2)), np.zeros((2, 2))
    given, dt_s = np.array([[5e-5, 0.0], [0.0, 2e-5]]), 0.05
    sent, births = np.zeros(2), []
    for k in range(40):
        expected = count_sent(given, dt_s, areas, spacing, waiting_m)
        thruster, reverse, age, _, impulse = slugs(given, dt_s, areas, spacing, waiting, waiting_m)
        assert np.array_equal(reverse, thruster) and len(age) == expected
        sent += np.bincount(thruster, impulse, minlength=2)
        births += list((k + 1) * dt_s - age[thruster == 0])
    assert sent + waiting.sum(axis=1) == pytest.approx(40 * given.sum(axis=1), rel=1e-12)
    exit_speed = math.sqrt(given[0, 0] / (dt_s * areas[0]))
    assert np.mean(np.diff(births)) * exit_speed == pytest.approx(spacing[0], rel=0.01)


def test_young_parcels_are_looked_at_in_every_step_and_slow_ones_now_and_then():
    """What moves by a twentieth of its size is due, so is what was never looked at; nobody waits longer than 0.2 s."""
    flow = np.array([[0.5, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    held, sigma = np.array([0.0, 0.0, np.inf, 0.0]), np.array([0.03, 0.3, 0.3, 0.005])
    seen = [parcels_to_sample(flow, held, sigma, 0.05).tolist() for _ in range(8)]
    assert seen[0] == [0, 2, 3]
    assert sum(1 in step for step in seen) == 2 and 1 in seen[round(HELD_S / 0.05) - 1]
    assert all(0 in step for step in seen)


def test_what_is_sent_lies_where_the_closure_puts_it():
    """Parcels of a moving disk in a current: place, size, share of the disk's water and impulse as the closure says."""
    areas, dt_s = np.array([2.8e-3, 2.8e-3]), 0.05
    disks = np.array(
        [[[0.0, 0.0, 1.0], [0.4, 0.0, 1.0]], [[0.1, 0.0, 0.0], [0.0, 0.2, 0.0]], [[-1.0, 0, 0], [0, 0, -1.0]]]
    )
    ambient = np.array([[0.03, 0.02, 0.0], [0.0, 0.0, 0.01]])
    slug = (np.array([0, 1]), np.array([0, 1]), np.array([0.03, 0.01]), np.array([0.4, 0.3]), np.array([1e-5, 2e-5]))
    jets = Parcels.none().with_room(3)
    noise = np.arange(6.0).reshape(2, 3)
    assert emit_parcels(jets, 1, slug, areas, disks, ambient, _laws(PLAIN, dt_s), TankFaces(()).walls, noise) == 3
    D = np.sqrt(4 * areas / math.pi)
    path, sigma = travel(D / math.sqrt(8), D, slug[3], slug[2], PLAIN)
    jet = np.array([[1.0, 0, 0], [0, 0, -1.0]])
    share = disk_share(sigma, D)[:, None]
    carried = ambient + share * (disks[1] - ambient)
    sent = Parcels.of(jets, 3).take(np.array([1, 2]))
    assert sent.sigma_m == pytest.approx(sigma, rel=1e-12)
    assert sent.share == pytest.approx(share[:, 0], rel=1e-12)
    assert sent.impulse_m4_s == pytest.approx(slug[4][:, None] * jet, rel=1e-12)
    expected = disks[0] + (carried - disks[1]) * slug[2][:, None] + path[:, None] * jet
    assert sent.position_m == pytest.approx(expected, abs=1e-12)
    assert sent.stream.tolist() == [0, 3] and np.all(np.isinf(sent.held_s)) and np.array_equal(sent.gust, noise)


def test_turbulence_keeps_its_strength_while_it_forgets():
    """Over many steps the gusts stay standard normal, and swift small parcels forget theirs sooner."""
    rng = np.random.default_rng(2)
    gust = rng.standard_normal((4000, 3))
    first, sigma, speed = gust.copy(), np.full(4000, 0.1), np.repeat([0.5, 0.05], 2000)
    for _ in range(4):
        fade_gusts(gust, sigma, speed, rng.standard_normal((4000, 3)), 0.05)
    assert gust.std() == pytest.approx(1.0, abs=0.03)
    kept = [float(np.mean(gust[part] * first[part])) for part in (slice(0, 2000), slice(2000, None))]
    assert kept == pytest.approx([math.exp(-1.0), math.exp(-0.1)], abs=0.05)
