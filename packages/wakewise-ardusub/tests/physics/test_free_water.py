"""The body of quick tests."""

import numpy as np
import pytest

from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import fossen, load_vehicle
from wakewise_ardusub.physics import FreeWater

HEAVY = load_vehicle("bluerov2-heavy")


def test_it_moves_as_the_readable_equations_say() -> None:
    """A second of steps of 1 ms against a Runge-Kutta of them, motors at once: within a per cent of the way."""
    vehicle, thrusts = HEAVY, np.array([-3.0, -3.0, 3.0, 3.0, 1.0, 1.0, 1.0, 1.0])
    start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0, 0.0])))
    body = FreeWater(vehicle, start)
    for _ in range(2000):
        motion = body.step(thrusts, 0.001)
    before = body.thrusts_N
    p, q, nu = motion.p_WB_m, motion.q_WB, np.concatenate([motion.v_W_m_s, motion.omega_B_rad_s])
    nu[:3] = Pose(p, q).R.T @ nu[:3]
    for _ in range(100):
        p, q, nu = fossen.step_rk4(
            vehicle, TRIM_WATER_KG_M3, GRAVITY_M_S2, p, q, nu, vehicle.allocation_matrix @ before, np.zeros(3), 0.01
        )
    for _ in range(1000):
        motion = body.step(thrusts, 0.001)
    assert motion.p_WB_m == pytest.approx(p, rel=0.01, abs=2e-3)


def test_it_does_not_fly() -> None:
    """Pushed up for ten seconds it is at the surface, at rest there."""
    body = FreeWater(HEAVY)
    for _ in range(1000):
        motion = body.step(np.array([0.0, 0.0, 0.0, 0.0, -20.0, -20.0, -20.0, -20.0]), 0.01)
    assert motion.p_WB_m[2] == 0.0
    assert motion.v_W_m_s[2] == pytest.approx(0.0, abs=0.2)
