"""The shipped mean fields against published laws of jets, and the measuring functions against a jet that is known.

What is met (measured on 10 cells per exit diameter):
    momentum and pressure through any plane = T, 5 %                       momentum theory
    turbulence on the axis 0.20 to 0.32 of U_c (law 0.24 to 0.28)          Hussein, Capp and George 1994
    speed on the axis 0.3 m from the disk on 7 and 10 cells per diameter, 5 %: with swirl, 0.6 %, though 8 % elsewhere
What is not met, and where the flow lies instead:
    the same without swirl: 6.6 %; the finer grid's jet is the wider one
    core at U0, 3 %: up to 9 % faster on the axis, since edges mix and the momentum is kept
    entrainment d(Q / Q0) / d(x / D) = 0.32, 15 % (Ricou and Spalding 1961): 0.364 with swirl, 0.374 without
    U_c (x - x0) / sqrt(M) = 6.5 to 7.0 and half width 0.094 to 0.102 x: within ten diameters the jet of an unsteady
    disk spreads faster, between the round jet and the propeller laws (3 and 0.177: Fuehrer and Roemisch 1977)
    starting front 2.57 M^(1/4) t^(1/2): 18 to 35 % slower in the first nine diameters; it goes as sqrt(K), and K is
    smaller here
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from wakewise.simulation.lattice import MeanField, load_mean_field
from wakewise_paper.lattice_reference.mean_field import (
    angular_flux,
    axis_speed,
    convergence,
    decay,
    decay_constant,
    entrainment,
    front_constant,
    half_width,
    momentum_flux,
    smooth_axis_speed,
    spreading,
    volume_flux,
    wall_jet_constant,
)


def _gaussian(K=6.5, width=0.094):
    """A round jet with U_c = K sqrt(M) / x and half width `width` x, from x = 5 on."""
    x, r = np.arange(4.0, 12.01, 0.1), np.arange(0, 5.01, 0.05)
    X, R = np.meshgrid(x, r, indexing="ij")
    u = K * math.sqrt(math.pi) / 2 / X * np.exp(-math.log(2) * (R / (width * X)) ** 2)
    zero = np.zeros_like(u)
    t = np.array([6.0, 10.0, 14.0, 18.0, 22.0, 40.0])
    front = 2.57 * (math.pi / 4) ** 0.25 * np.sqrt(t)
    names = ("pressure", "radial", "axial_rms", "radial_rms", "swirl_rms")
    return MeanField(
        case="free",
        hash="",
        cells_per_D=10,
        x_D=x,
        r_D=r,
        axial=u,
        swirl=0.1 * u,
        axis_times=t,
        axis_speeds=np.where(x < front[:, None], u[:, 0], 0),
        **dict.fromkeys(names, zero),
    )


def test_measures_give_back_a_jet_that_is_known():
    """Decay, width, momentum, volume, angular momentum and front of a Gaussian jet in closed form."""
    table, x = _gaussian(), np.array([6.0, 8.0, 10.0])
    assert decay_constant(table, x) == pytest.approx(6.5, rel=1e-3)
    assert half_width(table, x) / x == pytest.approx(0.094, rel=5e-3)
    flux = 6.5**2 * math.pi * 0.094**2 / (2 * math.log(2))
    assert momentum_flux(table) == pytest.approx(flux, rel=5e-3)
    area = math.pi * (0.094 * table.x_D) ** 2 / math.log(2)
    kept = 1 - 0.02  # volume is summed to 2 % of the axis' speed
    assert volume_flux(table) == pytest.approx(kept * table.axial[:, 0] * area / (math.pi / 4), rel=0.02)
    # Integral of 0.1 u^2 r over the plane.
    b = 0.094 * table.x_D / math.sqrt(2 * math.log(2))
    expected = 0.1 * table.axial[:, 0] ** 2 * 2 * math.pi * math.sqrt(math.pi) / 4 * b**3 / (math.pi / 4)
    assert angular_flux(table) == pytest.approx(expected, rel=0.01)
    assert decay(table, 6, 9) == pytest.approx((6.5, 0.0), abs=5e-3)
    assert spreading(table, 6, 9) == pytest.approx(0.094, rel=0.02)
    assert entrainment(table, 6, 9) == pytest.approx(volume_flux(table)[40] / table.x_D[40], rel=0.02)
    assert smooth_axis_speed(table, 8.0) == pytest.approx(float(axis_speed(table, 8.0)), rel=1e-3)
    seen = front_constant(table)
    assert seen[:5] == pytest.approx(2.57, rel=0.03)
    assert np.isnan(seen[5])


def test_convergence_is_the_change_on_the_axis():
    """A coarse run three per cent faster is three per cent away."""
    fine = _gaussian()
    coarse = replace(fine, axial=1.03 * fine.axial)
    assert convergence(fine, coarse)["grid_convergence_pct"] == pytest.approx(3.0, abs=1e-6)


@pytest.fixture(scope="module", params=["free", "swirl"])
def jet(request):
    return load_mean_field(request.param)


def test_momentum_through_every_plane_is_the_thrust(jet):
    """The integral of u^2 + u'^2 + p / rho is T / rho within 5 % from one diameter on."""
    planes = (jet.x_D >= 1.0) & (jet.x_D <= 9.0)
    assert momentum_flux(jet)[planes] == pytest.approx(1.0, abs=0.05)


def test_jet_entrains_somewhat_more_than_a_round_jet(jet):
    """Q grows by 0.32 to 0.385 of the exit's per diameter: the law's 0.32 or, the jet being wider, a fifth more."""
    assert 0.32 < entrainment(jet) < 0.385


def test_core_has_about_the_exit_speed():
    """Without swirl the axis reaches U0 = sqrt(T / (rho A)) and no more than 1.1 of it."""
    assert 0.97 < load_mean_field("free").axial[:, 0].max() < 1.1


def test_turbulence_on_the_axis_is_that_of_a_jet(jet):
    """Axial rms over U_c at seven to nine diameters."""
    part = (jet.x_D >= 7.0) & (jet.x_D <= 9.0)
    assert 0.20 < np.mean(jet.axial_rms[part, 0] / jet.axial[part, 0]) < 0.32


def test_regression_of_decay_and_spread(jet):
    """K from 3 (propeller) to 7 (round jet), half width growing by 0.094 (round jet) to 0.177 (propeller)."""
    K, _ = decay(jet)
    assert 3.0 < K < 7.0
    assert 0.094 < spreading(jet) < 0.177


def test_swirl_widens_the_jet():
    """At five diameters the swirling jet is wider and slower than the plain one; swirl itself stays inside it."""
    plain, swirling = load_mean_field("free"), load_mean_field("swirl")
    assert half_width(swirling, 5.0)[0] > 1.05 * half_width(plain, 5.0)[0]
    assert axis_speed(swirling, 5.0) < axis_speed(plain, 5.0)
    assert np.abs(plain.swirl).max() < 0.05 < swirling.swirl.max()


def test_swirl_carries_the_torque():
    """Angular momentum of the means is 0.11 to 0.15 T D between two and six diameters, under the torque of 0.15 T D."""
    table = load_mean_field("swirl")
    part = (table.x_D >= 2.0) & (table.x_D <= 6.0)
    assert np.all((angular_flux(table)[part] > 0.11) & (angular_flux(table)[part] < 0.15))


def test_regression_of_the_front(jet):
    """Beyond five diameters x / (M^(1/4) t^(1/2)) lies 18 to 35 % below 2.57 and changes by less than a fifth."""
    front = front_constant(jet)
    x = front * np.sqrt(math.sqrt(math.pi) / 2 * jet.axis_times)
    late = front[(x > 5.5) & (x < 9.0)]
    assert len(late) > 5
    assert np.all((late > 0.65 * 2.57) & (late < 0.82 * 2.57))
    assert np.ptp(late) < 0.2 * np.mean(late)


@pytest.mark.parametrize(("name", "limit_pct"), [("swirl", 5.0), ("free", 8.0)])
def test_two_grids_agree_at_0_3_m(name, limit_pct):
    """The finer has ten cells per diameter; 5 % is met with swirl, without it 8 % is. The tables hold the figures."""
    table = load_mean_field(name)
    assert table.cells_per_D >= 10
    assert table.figures["grid_convergence_pct"] <= limit_pct


def test_regression_of_the_wall_jet():
    """Speeds over the floor fall about as 1 / r, at 0.5 to 1.2 sqrt(M) / r; the law of a resolved wall jet is 1.16."""
    table = load_mean_field("floor")
    constant = wall_jet_constant(table, np.array([2.0, 3.0, 4.0]))
    assert np.all((constant > 0.5) & (constant < 1.2))
    assert np.abs(table.axial[-1]).max() < 0.25
