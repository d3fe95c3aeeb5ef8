"""Wall jets on the bed: Rajaratnam's law, no divergence, the readable twin."""

import math

import numpy as np
import pytest
from scipy.special import erf, i0, i1
from wall_jet_reference import (
    grown,
    merged_rings,
    packed_rings,
    planes_velocity,
    ring_strength,
    ring_velocity,
    rings_from_strikes,
)

from wakewise.simulation.water import induction
from wakewise.simulation.water.bedjets import LOG_WIDTH, WALL_JET_SPEED, WALL_JET_SPREAD, WallJetRings, layer_speed
from wakewise.simulation.water.bedjets_sums import HIGHEST, REACH, leaning, log_i0, log_overlap

BED_Z_M = 1.5


def _rings(leaning=True):
    impulse = np.array([[0.0, 0.0, 1e-3], [4e-4, -3e-4, 8e-4], [0.0, 1e-4, 5e-4]])
    if not leaning:
        impulse[:, :2] = 0.0
    position = np.array([[0.0, 0.0, 1.45], [0.1, 0.05, 1.4], [-0.2, 0.1, 1.42]])
    return rings_from_strikes(position, impulse, np.array([0.05, 0.08, 0.06]))


def _steady(M=1e-3, seconds=40.0, dt_s=0.05):
    """Rings of an upright jet of steady momentum flux M, struck at every step."""
    rings = WallJetRings.none()
    for _ in range(round(seconds / dt_s)):
        rings, _ = grown(rings, np.zeros(3), dt_s)
        new = rings_from_strikes(np.array([[0.0, 0.0, 1.4]]), np.array([[0.0, 0.0, M * dt_s]]), np.array([0.03]))
        rings = merged_rings(rings.joined(new))
    return rings


def _twin(points, rings, bed_z_m):
    u = np.zeros_like(points)
    strength = ring_strength(rings)
    heading, kappa = rings.heading_kappa
    for k in range(rings.count):
        d = points[:, :2] - rings.centre_m[k]
        r, h = np.linalg.norm(d, axis=1), bed_z_m - points[:, 2]
        w = np.exp(kappa[k] * (d @ heading[k]) / r) / i0(kappa[k])
        R, A = rings.radius_m[k] * w**0.25, strength[k] * np.sqrt(w)
        t, delta = np.log(r / R), WALL_JET_SPREAD * rings.radius_m[k] * w**0.25
        g = np.where(np.abs(t) < REACH, np.exp(-(t**2) / (2 * LOG_WIDTH**2)), 0.0)
        g = np.where(h < HIGHEST * R, g, 0.0)
        layer = delta * np.sqrt(np.pi / 2) * erf(h / (np.sqrt(2) * delta))
        dF = (np.exp(-(h**2) / (2 * delta**2)) - layer / R) * np.exp(-h / R)
        u[:, :2] += d * (A * g * dF / r**2)[:, None]
        u[:, 2] -= A * g * t / (LOG_WIDTH**2 * r**2) * layer * np.exp(-h / R)
    return u


def test_the_fast_sum_is_the_formula_as_written():
    """Kernel and twin agree to the tails that the kernel leaves out: of Gaussian, erf and far rings."""
    points = np.random.default_rng(0).uniform([-0.6, -0.6, 1.2], [0.6, 0.6, 1.5], (300, 3))
    assert ring_velocity(points, _rings(), BED_Z_M) == pytest.approx(_twin(points, _rings(), BED_Z_M), abs=8e-5)


def test_a_steady_upright_jet_spreads_as_measured():
    """Speed at the bed within 10 % of 1.16 sqrt(M)/r, and half of it at 0.09 r within 10 %."""
    M, rings = 1e-3, _steady()
    for r in (0.15, 0.2, 0.3, 0.5):
        u = ring_velocity(np.array([[r, 0.0, BED_Z_M]]), rings, BED_Z_M)[0, 0]
        assert u * r / math.sqrt(M) == pytest.approx(WALL_JET_SPEED, rel=0.10)
        heights = np.linspace(0, 0.25 * r, 100)
        profile = ring_velocity(np.column_stack([np.full(100, r), 0 * heights, BED_Z_M - heights]), rings, BED_Z_M)
        half = np.interp(-0.5 * u, -profile[:, 0], heights)
        assert half / r == pytest.approx(0.09, rel=0.10)


@pytest.mark.slow
def test_wall_jets_have_no_divergence_even_when_they_lean():
    """Central differences of the velocity sum to zero, relative to the velocity gradient."""
    rng = np.random.default_rng(5)
    points, h = rng.uniform([-0.5, -0.5, 1.3], [0.5, 0.5, 1.49], (200, 3)), 1e-5
    gradient = np.stack(
        [
            np.subtract(*(ring_velocity(points + s * e, _rings(), BED_Z_M, exact=True) for s in (h, -h))) / (2 * h)
            for e in np.eye(3)
        ]
    )
    # Each ring is cut off where g is 4e-4; points there see a step.
    divergence = np.abs(np.einsum("ini->n", gradient))
    assert np.quantile(divergence, 0.98) < 1e-4 * np.abs(gradient).max()


def test_nothing_flows_through_the_bed():
    """The vertical velocity vanishes on the bed."""
    xy = np.random.default_rng(2).uniform(-0.5, 0.5, (100, 2))
    u = ring_velocity(np.column_stack([xy, np.full(100, BED_Z_M)]), _rings(), BED_Z_M)
    assert np.abs(u[:, 2]).max() == 0.0
    assert np.abs(u[:, :2]).max() > 0.01


def test_a_leaning_jet_keeps_its_horizontal_momentum():
    """The mean direction I1/I0 of the azimuthal distribution is the horizontal share, within 2 %."""
    share = np.linspace(0.05, 0.95, 19)
    kappa = leaning(np.column_stack([share, 0 * share]))[1]
    assert i1(kappa) / i0(kappa) == pytest.approx(share, rel=0.02)


def test_merging_conserves_impulse_and_bounds_the_count():
    """Rings of a jet that ran 800 steps number a few dozen and carry all of its impulse."""
    rings = _steady()
    assert rings.impulse_m4_s.sum() == pytest.approx(1e-3 * 40.0, rel=1e-12)
    assert rings.count < 60


def test_without_supply_a_wall_jet_fades():
    """Ten seconds after the last strike the layer is slower everywhere."""
    rings = _steady(seconds=10.0)
    before = layer_speed(rings).max()
    for _ in range(200):
        rings, _ = grown(rings, np.zeros(3), 0.05)
    assert layer_speed(rings).max() < 0.3 * before


def test_merging_keeps_impulse_its_direction_and_the_flow():
    """Sums of impulse, of impulse along the plane, of its place, and of impulse over radius, the flow, are kept."""
    rng = np.random.default_rng(0)
    n = 80
    rings = WallJetRings(
        rng.uniform(-0.2, 0.2, (n, 2)),
        rng.uniform(0.3, 0.6, n),
        rng.uniform(1, 9, n) * 1e-4,
        rng.uniform(0, 0.5, (n, 2)),
    )
    fewer = merged_rings(rings)
    assert fewer.count < 0.7 * n
    for kept in (lambda r: r.impulse_m4_s, lambda r: r.impulse_m4_s / r.radius_m):
        assert kept(fewer).sum() == pytest.approx(kept(rings).sum(), rel=1e-12)
    for kept in (lambda r: r.lean, lambda r: r.centre_m):
        assert fewer.impulse_m4_s @ kept(fewer) == pytest.approx(rings.impulse_m4_s @ kept(rings), rel=1e-12)


def test_merging_hardly_changes_the_flow():
    """A crowd of weak rings made fewer moves water by a tenth of its rms differently, and nowhere by 5 mm/s."""
    rng = np.random.default_rng(1)
    n = 60
    rings = WallJetRings(
        rng.uniform(-0.3, 0.3, (n, 2)),
        rng.uniform(0.3, 0.6, n),
        rng.uniform(1, 9, n) * 3e-5,
        rng.uniform(0, 0.3, (n, 2)),
    )
    points = rng.uniform([-0.8, -0.8, 1.2], [0.8, 0.8, 1.5], (2000, 3))
    before, after = (ring_velocity(points, r, BED_Z_M) for r in (rings, merged_rings(rings)))
    error = np.linalg.norm(after - before, axis=1)
    assert np.sqrt((error**2).mean()) < 0.1 * np.sqrt((before**2).sum(axis=1).mean())
    assert error.max() < 5e-3


def test_overlap_is_the_integral_it_stands_for():
    """log_i0 and log_overlap agree with scipy and with the integral of sqrt(w_a w_b) to 1e-6."""
    x = np.array([0.0, 0.3, 3.7, 3.8, 20.0])
    assert [log_i0(v) for v in x] == pytest.approx(np.log(i0(x)), abs=1e-6)
    phi = np.linspace(-np.pi, np.pi, 4001)
    heading, kappa = leaning(np.array([[0.7, 0.1], [-0.2, 0.5]]))
    w = [np.exp(k * (np.cos(phi) * h[0] + np.sin(phi) * h[1])) / i0(k) for h, k in zip(heading, kappa, strict=True)]
    shared = np.trapezoid(np.sqrt(w[0] * w[1]), phi) / (2 * np.pi)
    args = heading[0], kappa[0], log_i0(kappa[0]), heading[1], kappa[1], log_i0(kappa[1])
    assert log_overlap(*args) == pytest.approx(math.log(shared), abs=1e-6)


def test_rings_of_two_jets_on_the_same_ground_run_as_those_of_one():
    """Momentum adds: twice the impulse on one spot, as one jet or two, has the same layer speed."""
    one = _rings(leaning=False).take(np.array([0]))
    twice = WallJetRings(one.centre_m, one.radius_m, 2 * one.impulse_m4_s, one.lean)
    assert layer_speed(one.joined(one)) == pytest.approx(np.repeat(layer_speed(twice), 2), rel=1e-12)


def test_threads_and_blocks_do_not_change_a_byte(monkeypatch):
    """One thread or four give the same velocities."""
    points = np.random.default_rng(4).uniform([-0.6, -0.6, 1.2], [0.6, 0.6, 1.5], (3001, 3))
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 10**12)
    one = ring_velocity(points, _rings(), BED_Z_M)
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 1)
    monkeypatch.setattr(induction, "cores", lambda: 4)
    assert ring_velocity(points, _rings(), BED_Z_M).tobytes() == one.tobytes()


def test_pieces_of_a_list_give_the_same_bytes():
    """Many rings, of all sizes and leans: which points are summed together does not change what each gets."""
    rng = np.random.default_rng(7)
    n = 200
    rings = WallJetRings(
        rng.uniform(-1.0, 1.0, (n, 2)),
        np.exp(rng.uniform(np.log(0.05), np.log(1.5), n)),
        1e-3 * rng.uniform(0.01, 1.0, n),
        rng.uniform(-0.65, 0.65, (n, 2)),
    )
    walk = np.cumsum(rng.normal(0.0, 0.03, (2048, 3)), axis=0)
    points = np.clip(walk, [-1.2, -1.2, -0.3], [1.2, 1.2, 0.3])
    points[:, 2] += 1.2
    whole = ring_velocity(points, rings, BED_Z_M)
    for size in (64, 192, 320, 1024):
        pieces = [ring_velocity(points[s : s + size], rings, BED_Z_M) for s in range(0, len(points), size)]
        assert np.concatenate(pieces).tobytes() == whole.tobytes()


@pytest.mark.parametrize("least_m", [0.0, 0.03])
def test_on_the_bed_the_short_sum_is_the_long_one(least_m):
    """Blocks of points that all lie on the bed take a shorter way: the same as among points above it."""
    points = np.random.default_rng(8).uniform([-0.6, -0.6, BED_Z_M], [0.6, 0.6, BED_Z_M], (64, 3))
    above = points.copy()
    above[::2, 2] -= 0.1
    on_bed = ring_velocity(points, _rings(), BED_Z_M, least_m)
    mixed = ring_velocity(above, _rings(), BED_Z_M, least_m)
    assert np.abs(on_bed).max() > 0.05
    assert on_bed[1::2] == pytest.approx(mixed[1::2], rel=1e-5, abs=1e-7)
    assert np.all(on_bed[:, 2] == 0.0)


@pytest.mark.parametrize(("stretch", "least_m"), [(3.0, 0.0), (1.0, 0.1)])
def test_a_thicker_jet_carries_the_same_momentum(stretch, least_m):
    """A layer made thicker runs slower by the root of that: speed squared times thickness stays within 12 %."""
    M, dt_s, at = 1e-3, 0.05, []
    for widening, least in ((1.0, 0.0), (stretch, least_m)):
        rings = WallJetRings.none()
        for _ in range(1600):
            rings, _ = grown(rings, np.zeros(3), dt_s, least, widening)
            new = rings_from_strikes(np.array([[0.0, 0.0, 1.4]]), np.array([[0.0, 0.0, M * dt_s]]), np.array([0.03]))
            rings = merged_rings(rings.joined(new))
        packed = packed_rings(rings, least, stretch=widening)
        frame = np.concatenate([np.zeros(3), np.eye(3).ravel(), [BED_Z_M, widening]])
        points = np.column_stack([np.linspace(0.25, 0.45, 21), np.zeros(21), np.full(21, BED_Z_M)])
        u = planes_velocity(points, frame[None], np.array([0, len(packed)]), packed)[:, 0]
        at.append(np.mean(u * points[:, 0]) / math.sqrt(M))
    r = 0.35
    thicker = math.hypot(stretch * WALL_JET_SPREAD * r, least_m) / (WALL_JET_SPREAD * r)
    assert at[0] == pytest.approx(WALL_JET_SPEED, rel=0.12)
    assert at[1] * math.sqrt(thicker) == pytest.approx(at[0], rel=0.12)
