"""The cable: drag of a cylinder, the lever rule, its end."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.simulation.tank import Tether
from wakewise.simulation.water import AmbientSum, SteadyCurrent

AT = Pose(np.array([0.0, 0.0, 1.0]))
STILL = AmbientSum()


def _tether(**changes):
    values = {"winch_W_m": np.zeros(3), "p_BT_m": np.zeros(3), "diameter_m": 0.008, "length_m": 1.0} | changes
    return Tether(density_kg_m3=1000.0, **values)


def _stream(*velocity):
    return AmbientSum(parts=(SteadyCurrent(velocity_W_m_s=np.array(velocity)),))


def test_half_of_the_drag_across_goes_to_the_vehicle():
    """A stream across a straight cable pushes 1/2 rho C_D d L u^2 in all, of which its end takes half."""
    force = _tether().force_W_N(AT, np.zeros(6), _stream(0.3, 0.0, 0.0), 0.0)
    assert force == pytest.approx([0.5 * 0.5 * 1000 * 1.1 * 0.008 * 1.0 * 0.3**2, 0.0, 0.0], rel=1e-6)


def test_a_stream_along_the_cable_does_nothing():
    """Cross-flow principle."""
    assert _tether().force_W_N(AT, np.zeros(6), _stream(0.0, 0.0, 0.5), 0.0) == pytest.approx(np.zeros(3), abs=1e-15)


def test_a_moving_vehicle_drags_its_cable():
    """Its share of the velocity grows towards it: the end takes the integral of s^3, a quarter, against the motion."""
    force = _tether().force_W_N(AT, np.array([0.4, 0, 0, 0, 0, 0]), STILL, 0.0)
    assert force[0] == pytest.approx(-0.25 * 0.5 * 1000 * 1.1 * 0.008 * 0.4**2, rel=0.01)


def test_it_pulls_at_its_end_and_no_farther_than_its_length():
    """Ten centimetres too far it pulls back with 20 N, at the place where it is fixed; a start out there is refused."""
    tether = _tether(length_m=0.9, p_BT_m=np.array([0.2, 0.0, 0.0]), winch_W_m=np.array([0.2, 0.0, 0.0]))
    wrench = tether.wrench_B(AT, np.zeros(6), STILL, 0.0)
    assert wrench == pytest.approx([0, 0, -20.0, 0, 4.0, 0], abs=1e-9)
    with pytest.raises(InputError, match=r"tether\.length_m"):
        tether.check_reach(AT)
