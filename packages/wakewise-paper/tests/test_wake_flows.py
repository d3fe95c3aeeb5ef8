"""Flows that models are held against: each keeps the law that it is known by.

- propeller laws: their own numbers, and the momentum that their notes state;
- the parcels: decay of a round jet, speed with the square root of thrust;
- tables: scaling by thrust and disk, turning into the plane, gusts of unit strength without divergence;
- the real jet: what is read of it.
"""

from __future__ import annotations

import math
import os
import pathlib

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise_paper.flows import (
    BLAAUW_VAN_DE_KAA,
    FUEHRER_ROEMISCH,
    Gusts,
    ParcelJet,
    TableJet,
    exit_speed_m_s,
    read_air_jet,
)

DATA = pathlib.Path(os.environ.get("WAKEWISE_DATA", pathlib.Path(__file__).parents[4] / "shared" / "data"))


def _on_axis(*distances):
    return np.array([[x, 0.0, 0.0] for x in distances])


@pytest.mark.parametrize(("law", "share"), [(FUEHRER_ROEMISCH, 0.61), (BLAAUW_VAN_DE_KAA, 1.02)])
def test_propeller_laws_carry_the_momentum_that_is_stated(law, share):
    """Momentum flux far down over thrust is what the flow's note says: c^2 / (2 k) of the slipstream's."""
    r = np.linspace(0.0, 1.0, 2001)
    points = np.column_stack([np.full_like(r, 1.0), r, np.zeros_like(r)])
    u = law.mean_velocity(points, 2.0)[:, 0]
    flux = 998.0 * 2.0 * math.pi * np.trapezoid(u**2 * r, r)
    assert flux / 2.0 == pytest.approx(share, abs=0.01)
    assert f"{share:.2f}" in law.note
    assert law.mean_velocity(_on_axis(1.0), 8.0)[0, 0] == pytest.approx(2.0 * u[0])


def test_parcels_decay_as_a_round_jet_and_grow_with_the_root_of_thrust():
    """U_c x / sqrt(T/rho) is about 7 beyond ten diameters, and a fourfold thrust doubles the speed within 3 %."""
    jet = ParcelJet(snapshots=30, turbulence=0.0)
    at = _on_axis(0.3, 0.62)
    weak, strong = (jet.mean_velocity(at, thrust)[:, 0] for thrust in (1.0, 4.0))
    assert weak[1] * 0.62 / math.sqrt(1.0 / 998.0) == pytest.approx(7.0, rel=0.08)
    np.testing.assert_allclose(strong / weak, 2.0, rtol=0.03)


def _table():
    x, r = np.linspace(0.5, 10.0, 96), np.linspace(0.0, 4.0, 41)
    axial = 1.0 / x[:, None] * np.exp(-(r**2))
    return TableJet(
        name="table",
        title="",
        note="",
        x_D=x,
        r_D=r,
        axial=axial,
        radial=0.1 * axial,
        swirl=0.3 * axial,
        rms=0.2 * axial,
    )


def test_tables_scale_with_the_exit_speed_and_turn_with_the_azimuth():
    """Values are table times sqrt(T/(rho A)); swirl turns y into z at every azimuth; outside there is no number."""
    jet = _table()
    D = jet.disk_diameter_m
    turn = np.radians([0.0, 90.0, 200.0])
    points = np.column_stack([np.full(3, 5 * D), D * np.cos(turn), D * np.sin(turn)])
    velocity = jet.mean_velocity(points, 3.0)
    axial = exit_speed_m_s(3.0, D) * 0.2 * math.exp(-1.0)
    np.testing.assert_allclose(velocity[:, 0], axial, rtol=0.01)
    outward = np.column_stack([np.zeros(3), np.cos(turn), np.sin(turn)])
    around = np.column_stack([np.zeros(3), -np.sin(turn), np.cos(turn)])
    np.testing.assert_allclose(np.sum(velocity * outward, axis=1), 0.1 * axial, rtol=0.01)
    np.testing.assert_allclose(np.sum(velocity * around, axis=1), 0.3 * axial, rtol=0.01)
    assert np.isnan(jet.mean_velocity(_on_axis(-0.1), 1.0)).all()
    assert jet.reach_m == pytest.approx(0.6)


def test_gusts_have_unit_strength_and_no_divergence():
    """Each component of a gust has a mean square of one; its divergence is nil by central differences."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, (4000, 3))
    square = np.mean([np.mean(Gusts.drawn(0.05, rng).at(points) ** 2, axis=0) for _ in range(40)], axis=0)
    np.testing.assert_allclose(square, 1.0, atol=0.12)
    gust, h = Gusts.drawn(0.05, rng), 1e-5
    steps = np.eye(3) * h
    slopes = [(gust.at(points + step)[:, k] - gust.at(points - step)[:, k]) / (2 * h) for k, step in enumerate(steps)]
    assert np.abs(sum(slopes)).max() < 1e-4 * np.abs(slopes[0]).max()


def test_instants_of_a_table_differ_and_average_to_the_mean():
    """An instant is the mean with gusts of the tabulated strength, another at every draw."""
    jet, at = _table(), _on_axis(0.3)
    flows = jet.instants(1.0, 300, np.random.default_rng(1))
    speeds = np.array([flow.velocity(at)[0, 0] for flow in flows])
    mean = jet.mean_velocity(at, 1.0)[0, 0]
    assert speeds.mean() == pytest.approx(mean, rel=0.05)
    assert speeds.std() == pytest.approx(0.2 * mean, rel=0.15)


@pytest.mark.skipif(not (DATA / "piv_jet" / "jet_decoded.npz").is_file(), reason="reference data are not there")
def test_the_air_jet_is_read_in_its_own_frame():
    """Three snapshots of a jet along +x about r = 0, near its stated speed; two to fit on and one to test on."""
    jet = read_air_jet(DATA / "piv_jet" / "jet_decoded.npz")
    assert exit_speed_m_s(jet.samples.thrusts_N[0], 0.15) == pytest.approx(12.0)
    axis = jet.samples.take(jet.samples.r_m < 0.01)
    assert 6.0 < np.median(axis.speed_m_s) < 13.0
    assert not np.any(jet.split.train & jet.split.test)
    assert jet.split.test.sum() / len(jet.samples) == pytest.approx(1 / 3, abs=0.03)
    assert 0.0 < jet.snapshots_r2_core < 1.0


def test_a_missing_air_jet_is_bad_input(tmp_path):
    """A file that is not there, or holds other arrays, is named."""
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("none.npz", "other.npz"):
        with pytest.raises(InputError, match="needs arrays u, v"):
            read_air_jet(tmp_path / name)
