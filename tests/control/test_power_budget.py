"""How much power gentle shares may cost: next to nothing in calm water, what it is worth where there is wash."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.allocation import PowerBoundedAllocator, Weights, min_norm_allocation
from wakewise.allocation.power_budget import (
    CALM,
    CALM_M_S,
    MODEL_BIAS,
    MOST,
    MOST_M_S,
    TROUBLE,
    TROUBLE_M_S,
    power_limit,
)
from wakewise.control import vehicle_layout
from wakewise.control.null_space_allocation import STANDING_W, power_law
from wakewise.core.geometry import Pose
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import InfluenceModel, RoundJet

VEHICLE = load_vehicle("paper")
LAYOUT, LAW = vehicle_layout(VEHICLE), power_law(VEHICLE)
POINTS = np.array([[0.465, -0.195, 0.05], [0.465, 0.195, 0.05], [0.45, -0.18, 0.05]])
"""On the ways of the two bow thrusters' jets when they push astern."""
VIEW = InfluenceModel(
    wake=RoundJet(),
    points_W_m=POINTS,
    weights=np.ones(3),
    positions_B_m=VEHICLE.thruster_positions_B_m,
    axes_B=VEHICLE.thruster_axes_B,
    areas_m2=VEHICLE.disk_areas_m2,
)


def test_the_bound_rises_from_calm_to_trouble_and_on():
    """Calm and trouble are those set beforehand, beyond it goes with the speed, and it never falls."""
    assert power_limit(0.0) == power_limit(CALM_M_S) == CALM and power_limit(TROUBLE_M_S) == TROUBLE
    assert TROUBLE < power_limit(0.5 * (TROUBLE_M_S + MOST_M_S)) == pytest.approx(0.5 * (TROUBLE + MOST))
    assert power_limit(MOST_M_S) == power_limit(1.0) == MOST
    assert np.all(np.diff([power_limit(v) for v in np.linspace(0.0, 0.04, 50)]) >= 0.0)


def test_the_power_law_is_the_tank_s_own_above_the_least_thrust():
    """What is believed of power is the fit of the maker's table; below the least thrust, pulses of it."""
    T = np.array([1.0, -2.0, 3.0, -1.0, 0.5, 0.6, -0.7, 5.0])
    assert float(LAW.power_W(T)) == pytest.approx(float(electrical_power_W(T, VEHICLE.disk_areas_m2).sum()))
    small = np.full(8, 0.1)
    assert float(LAW.power_W(small)) > 1.5 * float(electrical_power_W(small, VEHICLE.disk_areas_m2).sum())


WRENCH = np.array([-4.0, 0.0, 1.0, 0.0, 0.05, 0.0])
"""Astern push ahead of a target."""
WEIGHTS = Weights(disturbance=50.0, effort=1e-3)


def shared(scale, law=LAW):
    """Thrusts by a share of the wake's own matrix, and what is drawn for them over that for the least thrusts."""
    G = scale * VIEW.gram(Pose(np.zeros(3)))
    found = PowerBoundedAllocator(layout=LAYOUT, law=law).allocate(WRENCH, G, G, WEIGHTS, 3.0)
    least = min_norm_allocation(LAYOUT, WRENCH, G)
    return found, least, drawn_W(found.thrusts_N) / drawn_W(least.thrusts_N)


def drawn_W(thrusts_N):
    """Power of thrusters and of what stands beside them."""
    return float(LAW.power_W(thrusts_N)) + STANDING_W


def speed_m_s(scale):
    """What the least thrusts leave at the target, by the wake model and what it is known to be wrong by."""
    G = scale * VIEW.gram(Pose(np.zeros(3)))
    return float(np.sqrt(min_norm_allocation(LAYOUT, WRENCH, G).disturbance / 3.0)) / MODEL_BIAS


def test_trouble_is_worth_half_as_much_power_again():
    """Jets straight at the target are taken away whole, and little is paid for where they are faint."""
    found, least, ratio = shared(1.0)
    assert speed_m_s(1.0) > MOST_M_S and TROUBLE < ratio < MOST
    assert found.disturbance < 0.05 * least.disturbance
    faint, _, little = shared(0.1 * (CALM_M_S / speed_m_s(1.0)) ** 2)
    assert little <= CALM + 1e-9 and faint.disturbance <= least.disturbance


@pytest.mark.parametrize("speed", [0.006, 0.012, 0.02])
def test_shares_keep_the_bound_that_the_water_asks_for(speed):
    """At whatever speed the least thrusts leave; without a law of power shares cost what they cost."""
    scale = (speed / speed_m_s(1.0)) ** 2
    assert speed_m_s(scale) == pytest.approx(speed)
    found, least, ratio = shared(scale)
    free, _, dear = shared(scale, law=None)
    assert 1.0 <= ratio <= power_limit(speed) + 1e-9
    assert dear > TROUBLE and free.disturbance <= found.disturbance <= least.disturbance


def test_extra_power_is_multiplied_by_the_setting():
    """Without extra power the least thrusts fly; more of it leaves less wash, and no more than that is taken."""
    G = VIEW.gram(Pose(np.zeros(3))) * (0.012 / speed_m_s(1.0)) ** 2
    least = min_norm_allocation(LAYOUT, WRENCH, G)
    limit = power_limit(0.012)
    found = {
        excess: PowerBoundedAllocator(layout=LAYOUT, law=LAW, excess=excess).allocate(WRENCH, G, G, WEIGHTS, 3.0)
        for excess in (0.0, 0.5, 1.0, 2.0)
    }
    assert found[0.0].disturbance == pytest.approx(least.disturbance, rel=0.05)
    wash = [one.disturbance for one in found.values()]
    assert wash[0] > wash[1] > wash[2] >= wash[3]
    for excess, one in found.items():
        extra = drawn_W(one.thrusts_N) / drawn_W(least.thrusts_N) - 1.0
        assert extra <= excess * (limit - 1.0) + 1e-9


def test_two_shares_are_compared_by_cost_and_power():
    """Two percent of power must save a percent of speed, over what counts as calm; without a law the cost decides."""
    bounded, calm = (
        PowerBoundedAllocator(layout=LAYOUT, law=LAW),
        WEIGHTS.disturbance * 3.0 * (MODEL_BIAS * CALM_M_S) ** 2,
    )
    T = np.ones(8)
    more = (2.0 + STANDING_W / float(LAW.power_W(T))) ** (2.0 / 3.0)
    worth = bounded.adjusted_cost(9.0 * calm, T, WEIGHTS, 3.0)
    assert bounded.adjusted_cost(9.0 * calm, more * T, WEIGHTS, 3.0) == pytest.approx(2.0 * worth)
    assert bounded.adjusted_cost(4.0 * calm, more * T, WEIGHTS, 3.0) == pytest.approx(worth)
    assert PowerBoundedAllocator(layout=LAYOUT).adjusted_cost(7.0, T, WEIGHTS, 3.0) == 7.0


def test_what_may_join_a_jet_opens_no_bound():
    """Shares are chosen by the one matrix; what they may cost goes with what the least thrusts do by the other."""
    wrench = np.array([-4.0, 0.0, 1.0, 0.0, 0.05, 0.0])
    G = VIEW.gram(Pose(np.zeros(3)))
    found = PowerBoundedAllocator(layout=LAYOUT, law=LAW).allocate(
        wrench, G, 1e-5 * G, Weights(disturbance=50.0, effort=1e-3), 3.0
    )
    assert 1.0 < drawn_W(found.thrusts_N) / drawn_W(min_norm_allocation(LAYOUT, wrench).thrusts_N) <= CALM + 1e-9


def test_a_vehicle_that_hovers_on_a_watt_may_spend_another():
    """Jets of a light load that stir the target are taken away whole, where a share of its own power would not do."""
    G, wrench = VIEW.gram(Pose(np.zeros(3))), 0.3 * WRENCH
    G = G * 3.0 * (MODEL_BIAS * TROUBLE_M_S) ** 2 / min_norm_allocation(LAYOUT, wrench, G).disturbance
    least = min_norm_allocation(LAYOUT, wrench, G)
    assert float(LAW.power_W(least.thrusts_N)) < 3.0
    with_it, without = (
        PowerBoundedAllocator(layout=LAYOUT, law=law).allocate(wrench, G, G, WEIGHTS, 3.0).disturbance
        for law in (LAW, replace(LAW, standing_W=0.0))
    )
    assert with_it < 0.05 * least.disturbance and 0.2 * least.disturbance < without < least.disturbance
