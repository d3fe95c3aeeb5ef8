"""Impulse parcels: laws of the induced velocity, and the readable twin of the fast sum."""

import math

import numpy as np
import pytest
from scipy.special import erf

from wakewise.simulation.water import induction
from wakewise.simulation.water.parcels import Parcels, gusty_impulse_m4_s, parcel_velocity, row_widening
from wakewise.simulation.water.round_jet_closure import first_sigma_m

BED_Z_M = 1.5


def _some_parcels(count=40, seed=3):
    rng = np.random.default_rng(seed)
    position = rng.uniform([-1, -1, 0.2], [1, 1, 1.45], (count, 3))
    return position, rng.normal(0, 1e-3, (count, 3)), rng.uniform(0.02, 0.2, count)


def _twin(points, position, impulse, sigma, bed_z_m):
    """The formula as written, one parcel at a time, with images as parcels of their own."""
    flip = np.array([1.0, 1.0, -1.0])
    sets = [(position, impulse), (position * flip + [0, 0, 2 * bed_z_m], impulse * flip)]
    u = np.zeros_like(points)
    for X, m in sets[: 2 if math.isfinite(bed_z_m) else 1]:
        for X_j, m_j, sigma_j in zip(X, m, sigma, strict=True):
            r = points - X_j
            d = np.linalg.norm(r, axis=1)
            s = d / sigma_j
            G = np.exp(-(s**2) / 2) / ((2 * np.pi) ** 1.5 * sigma_j**3)
            A = (erf(s / np.sqrt(2)) - np.sqrt(2 / np.pi) * s * np.exp(-(s**2) / 2)) / (4 * np.pi * d**3)
            along = (r @ m_j) / d**2
            u += m_j * (G - A)[:, None] - r * (along * (G - 3 * A))[:, None]
    return u


@pytest.mark.parametrize("bed_z_m", [BED_Z_M, math.inf])
def test_the_fast_sum_is_the_formula_as_written(bed_z_m):
    """Kernel and twin, exact Gaussians, agree to the fit's 2e-4 of the largest speed."""
    parcels = _some_parcels()
    points = np.random.default_rng(0).uniform([-1, -1, 0.1], [1, 1, 1.5], (200, 3))
    fast = parcel_velocity(points, *parcels, bed_z_m)
    slow = _twin(points, *parcels, bed_z_m if math.isfinite(bed_z_m) else math.inf)
    assert np.abs(fast - slow).max() < 2e-4 * np.abs(slow).max()


def test_induced_flow_has_no_divergence():
    """Central differences of the velocity sum to zero, relative to the velocity gradient."""
    parcels = _some_parcels()
    points = np.random.default_rng(1).uniform([-1, -1, 0.4], [1, 1, 1.4], (100, 3))
    h = 2e-3
    gradient = np.stack(
        [
            (parcel_velocity(points + h * e, *parcels, BED_Z_M) - parcel_velocity(points - h * e, *parcels, BED_Z_M))
            / (2 * h)
            for e in np.eye(3)
        ]
    )
    divergence = np.einsum("ini->n", gradient)
    assert np.abs(divergence).max() < 0.01 * np.abs(gradient).max()


def test_nothing_flows_through_the_bed():
    """On the bed and a hair above it, the vertical velocity vanishes while the horizontal one does not."""
    parcels = _some_parcels()
    xy = np.random.default_rng(2).uniform(-1, 1, (100, 2))
    for z in (BED_Z_M, BED_Z_M - 1e-9):
        u = parcel_velocity(np.column_stack([xy, np.full(100, z)]), *parcels, BED_Z_M)
        assert np.abs(u[:, 2]).max() < 1e-6 * np.abs(u).max()
        assert np.abs(u[:, :2]).max() > 1e-4


def test_far_away_a_parcel_is_a_dipole():
    """Beyond seven sigma the field is the potential dipole (3 (m.r) r / r^2 - m) / (4 pi r^3)."""
    m, r = np.array([[2e-3, -1e-3, 0.5e-3]]), np.array([[0.9, 0.4, -0.7]])
    u = parcel_velocity(r, np.zeros((1, 3)), m, np.array([0.05]), math.inf)
    d = np.linalg.norm(r)
    dipole = (3 * (m @ r.T) * r / d**2 - m) / (4 * np.pi * d**3)
    assert u == pytest.approx(dipole, abs=3e-4 * np.abs(dipole).max())


def test_threads_do_not_change_a_byte(monkeypatch):
    """Whole on one thread and in pieces on four give identical bytes."""
    parcels = _some_parcels(200)
    points = np.random.default_rng(4).uniform([-1, -1, 0.1], [1, 1, 1.5], (1501, 3))
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 10**12)
    one = parcel_velocity(points, *parcels, BED_Z_M)
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 1)
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    assert parcel_velocity(points, *parcels, BED_Z_M).tobytes() == one.tobytes()


@pytest.mark.parametrize("scale", [0.0, 0.4])
def test_gusts_are_their_readable_twin(scale):
    """Of a share that grows along the core, and less by the root of how much coarser an old row is."""
    _, impulse, sigma = _some_parcels()
    rng, diameter, none = np.random.default_rng(4), np.full(len(sigma), 0.08), np.zeros_like(impulse)
    gust = rng.normal(size=impulse.shape)
    parcels = Parcels.sent(none, impulse, sigma, diameter, np.zeros(len(sigma), np.int64), gust, none)
    first = first_sigma_m(diameter)
    wide = np.array([row_widening(*one) for one in zip(sigma, diameter, strict=True)])
    share = np.clip((sigma - first) / (diameter / 2 - first), 0.0, 1.0) / np.sqrt(wide)
    expected = impulse + (scale * share * np.linalg.norm(impulse, axis=1))[:, None] * gust
    np.testing.assert_allclose(gusty_impulse_m4_s(parcels, scale), expected, rtol=1e-12)
