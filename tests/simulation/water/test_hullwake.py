"""What a hull gives back to the water: its momentum, where it begins, and how its wake spreads."""

import math

import numpy as np
import pytest

from wakewise.simulation.water.hullwake import HullPush, HullWake, first_wake, frontal_area_m2, lee_m
from wakewise.simulation.water.round_jet_closure import FIRST_D
from wakewise.simulation.water.water import Water

DENSITY = 1000.0
SIZE_M = np.array([0.45, 0.35, 0.28])
SPEED_M_S = 0.2
DRAG_N = 0.5 * DENSITY * SPEED_M_S**2 * 0.35 * 0.28  # a drag coefficient of 1, ahead


def _water(**options):
    options = {"bed_z_m": math.inf, "rest_speed_m_s": 0.0} | options
    return Water(np.full(1, 2.8e-3), density_kg_m3=DENSITY, rng=np.random.default_rng(0), **options)


def _towed(seconds, drag_W_N=(DRAG_N, 0.0, 0.0), dt_s=0.05, **options):
    """Water in which a hull was towed ahead, and where the hull is then."""
    water, velocity = _water(**options), np.array([SPEED_M_S, 0.0, 0.0])
    none, zero = np.zeros((1, 2)), np.zeros((1, 3))
    for k in range(round(seconds / dt_s)):
        push = HullPush(
            p_WB_m=velocity * (k + 1) * dt_s,
            R_WB=np.eye(3),
            size_m=SIZE_M,
            velocity_W_m_s=velocity,
            through_W_m_s=velocity,
            impulse_W_N_s=np.array(drag_W_N) * dt_s,
        )
        water.step(dt_s, zero, zero, np.array([[1.0, 0, 0]]), none, push)
    return water, velocity * seconds


def _momentum_N_s(water):
    held = water.parcels.impulse_m4_s.sum(axis=0) + water._hull.waiting_m4_s
    return DENSITY * held


@pytest.mark.parametrize("drag_W_N", [(DRAG_N, 0.0, 0.0), (DRAG_N, 0.1 * DRAG_N, -0.3 * DRAG_N)], ids=["ahead", "lift"])
def test_a_towed_hull_leaves_its_drag_times_the_time(drag_W_N):
    """The water's momentum is that of the force on it, along the way and across it, to rounding."""
    water, _ = _towed(30.0, drag_W_N)
    assert _momentum_N_s(water) == pytest.approx(30.0 * np.array(drag_W_N), rel=1e-9)


def test_a_wake_spreads_and_fades_as_measured():
    """Behind a towed hull sigma is 1.14 theta (x/theta)^(1/3), the deficit 0.77 U (x/theta)^(-2/3), within 8 %.

    Johansson, George and Gourlay 2003. x is from where a wake of no width would have begun; from 30 theta on.
    """
    water, hull = _towed(60.0)
    theta = math.sqrt(DRAG_N / (2 * math.pi * DENSITY)) / SPEED_M_S
    first, _ = first_wake(DRAG_N / (DENSITY * SPEED_M_S), SPEED_M_S, 0.35 * 0.28)
    tip = theta * (first / (1.14 * theta)) ** 3
    for behind in (30 * theta, 60 * theta, 90 * theta):
        x = behind + tip
        at = hull - [0.5 * SIZE_M[0] + behind, 0.0, 0.0]
        sigma = 1.14 * theta * (x / theta) ** (1 / 3)
        near = water.parcels.take(np.abs(water.parcels.position_m[:, 0] - at[0]) < 0.3)
        assert np.mean(near.sigma_m) == pytest.approx(sigma, rel=0.08)
        along = water.velocity(at + np.array([[0.0, 0.0, 0.0], [0.0, sigma, 0.0]]))[:, 0]
        assert along[0] == pytest.approx(0.77 * SPEED_M_S * (x / theta) ** (-2 / 3), rel=0.08)
        assert along[1] / along[0] == pytest.approx(math.exp(-0.5), abs=0.06)


def test_a_wake_begins_at_the_lee():
    """The youngest parcel stands for a stretch of way that has just passed the stern, and ahead the water is still."""
    water, hull = _towed(10.0)
    stern = hull[0] - 0.5 * SIZE_M[0]
    youngest = water.parcels.position_m[:, 0].max()
    assert stern - 2 * 0.6 * 0.125 < youngest < stern
    ahead, behind = water.velocity(hull + np.array([[1.0, 0, 0], [-1.0, 0, 0]]))
    assert abs(ahead[0]) < 0.1 * behind[0]


def test_the_first_wake_is_as_wide_as_the_hull_and_no_faster():
    """Below a drag coefficient of 2 sigma is the hull's own; above it the deficit stays at the hull's speed."""
    area = 0.1
    for coefficient in (0.5, 1.0, 1.9):
        sigma, deficit = first_wake(0.5 * coefficient * area * SPEED_M_S, SPEED_M_S, area)
        assert sigma == pytest.approx(FIRST_D * math.sqrt(4 * area / math.pi))
        assert deficit == pytest.approx(0.5 * coefficient * SPEED_M_S)
    sigma, deficit = first_wake(0.5 * 4.0 * area * SPEED_M_S, SPEED_M_S, area)
    assert sigma == pytest.approx(math.sqrt(4.0 * area / (4 * math.pi))) and deficit == pytest.approx(SPEED_M_S)


def test_a_box_is_seen_from_its_sides():
    """Frontal areas and distances to the faces of a box along its axes and across a corner."""
    assert frontal_area_m2(SIZE_M, np.array([1.0, 0, 0])) == pytest.approx(0.35 * 0.28)
    assert lee_m(SIZE_M, np.array([0.0, 0, -1.0])) == pytest.approx(0.14)
    slant = np.array([0.6, 0.8, 0.0])
    assert frontal_area_m2(SIZE_M, slant) == pytest.approx(0.6 * 0.35 * 0.28 + 0.8 * 0.45 * 0.28)
    assert lee_m(SIZE_M, slant) == pytest.approx(0.175 / 0.8)


def test_a_hull_at_rest_in_the_water_sends_nothing():
    """Without motion through the water there is no lee; what little there was waits."""
    wake, still = HullWake(2, DENSITY), np.zeros(3)
    push = HullPush(
        p_WB_m=still,
        R_WB=np.eye(3),
        size_m=SIZE_M,
        velocity_W_m_s=still,
        through_W_m_s=still,
        impulse_W_N_s=np.array([1e-6, 0, 0]),
    )
    assert wake.sent(0.05, push, np.random.default_rng(0)).count == 0
    assert wake.waiting_m4_s == pytest.approx([1e-9, 0.0, 0.0])
