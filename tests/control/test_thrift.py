"""How much power gentle shares may cost: next to nothing in calm water, a fair share where there is wash to save."""

import numpy as np
import pytest

from wakewise.allocation import Weights, least_thrusts
from wakewise.control import vehicle_layout
from wakewise.control.thrift import CALM, CALM_M_S, TROUBLE, TROUBLE_M_S, Sharer, allowed, power_law
from wakewise.geometry import Pose
from wakewise.thrusters import electrical_power_W
from wakewise.vehicles import load_vehicle
from wakewise.wake import RoundJet, WakeView
from wakewise.wake.view import Seen

VEHICLE = load_vehicle("paper")
LAYOUT, LAW = vehicle_layout(VEHICLE), power_law(VEHICLE)
POINTS = np.array([[0.465, -0.195, 0.05], [0.465, 0.195, 0.05], [0.45, -0.18, 0.05]])
"""On the ways of the two bow thrusters' jets when they push astern."""
VIEW = WakeView(
    wake=RoundJet(),
    points_W_m=POINTS,
    weights=np.ones(3),
    positions_B_m=VEHICLE.thruster_positions_B_m,
    axes_B=VEHICLE.thruster_axes_B,
    areas_m2=VEHICLE.disk_areas_m2,
)


def test_the_bound_rises_from_calm_to_trouble():
    """The two ends are those set beforehand, between them it never falls."""
    assert allowed(0.0) == allowed(CALM_M_S) == CALM and allowed(TROUBLE_M_S) == allowed(1.0) == TROUBLE
    assert np.all(np.diff([allowed(v) for v in np.linspace(0.0, 0.02, 50)]) >= 0.0)


def test_the_power_law_is_the_tank_s_own_above_the_least_thrust():
    """What is believed of power is the fit of the maker's table; below the least thrust, pulses of it."""
    T = np.array([1.0, -2.0, 3.0, -1.0, 0.5, 0.6, -0.7, 5.0])
    assert float(LAW.power_W(T)) == pytest.approx(float(electrical_power_W(T, VEHICLE.disk_areas_m2).sum()))
    small = np.full(8, 0.1)
    assert float(LAW.power_W(small)) > 1.5 * float(electrical_power_W(small, VEHICLE.disk_areas_m2).sum())


@pytest.mark.parametrize(("scale", "most"), [(1e-5, CALM), (1.0, TROUBLE)])
def test_shares_keep_the_bound_that_the_water_asks_for(scale, most):
    """Astern push ahead of a target: three tenths more than the least power where jets stir it, little if faint."""
    wrench = np.array([-4.0, 0.0, 1.0, 0.0, 0.05, 0.0])
    G = scale * VIEW.gram(Pose(np.zeros(3)))
    sharer = Sharer(layout=LAYOUT, law=LAW)
    weights = Weights(disturbance=150.0 / 3.0 / scale, effort=1e-3)
    seen = Seen(gram=G, sent=G)
    found, least = sharer.shares(wrench, seen, weights, 3.0), least_thrusts(LAYOUT, wrench, G)
    free = Sharer(layout=LAYOUT).shares(wrench, seen, weights, 3.0)
    ratio = float(LAW.power_W(found.thrusts_N) / LAW.power_W(least.thrusts_N))
    assert float(LAW.power_W(free.thrusts_N) / LAW.power_W(least.thrusts_N)) > TROUBLE
    assert ratio <= most + 1e-9 and ratio > 0.95 * most
    assert free.disturbance < found.disturbance < least.disturbance


def test_what_may_join_a_jet_opens_no_bound():
    """Shares are chosen by the one matrix; what they may cost goes with what the least thrusts do by the other."""
    wrench = np.array([-4.0, 0.0, 1.0, 0.0, 0.05, 0.0])
    G = VIEW.gram(Pose(np.zeros(3)))
    found = Sharer(layout=LAYOUT, law=LAW).shares(
        wrench, Seen(gram=G, sent=1e-5 * G), Weights(disturbance=50.0, effort=1e-3), 3.0
    )
    least = LAW.power_W(least_thrusts(LAYOUT, wrench).thrusts_N)
    assert 1.0 < float(LAW.power_W(found.thrusts_N) / least) <= CALM + 1e-9
