"""What a vehicle leaves in the water as a whole: jets and hull's wake together."""

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Mesh, place_on_bed
from wakewise.simulation.tank import Tank, TankSettings

VEHICLE = load_vehicle("paper").with_ideal_thrusters()  # as heavy as the water that it displaces
CURRENT_M_S = (0.08, 0.05, 0.0)
CORNERS = np.array([[0.07, 0.07, 0], [-0.07, 0.07, 0], [0.0, -0.07, 0], [0, 0, 0.15]])
TARGET = place_on_bed("wedge", Mesh(CORNERS, np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]])), 1.5)


def _tank(**settings):
    settings = {"silt": {"load_kg_m2": 0.0}, "current": {"velocity_m_s": CURRENT_M_S}} | settings
    start = BodyState(X_WB=Pose(np.array([-1.0, 0.3, 0.8])))
    return Tank(VEHICLE, TARGET, TankSettings(**settings), start, np.random.default_rng(0))


def _hover(tank, seconds, weight_N=0.0):
    """Hold the place by proportional and derivative forces; N s given to the water by jets and by hull, and drag."""
    jets, hull, water = np.zeros(3), np.zeros(3), tank._water
    step = water.step

    def told(dt_s, before, origins, axes, impulses_N_s, push=None):
        jets[:] -= axes.T @ (impulses_N_s[:, 0] - impulses_N_s[:, 1])
        if push is not None:
            hull[:] += push.impulse_W_N_s
        step(dt_s, before, origins, axes, impulses_N_s, push)

    water.step = told
    home, hold = tank.state.X_WB.p_m, np.zeros(6)
    for _ in range(round(seconds / 0.02)):
        state = tank.state
        away = state.X_WB.R.T @ (state.X_WB.p_m - home)
        wrench = -np.array([20.0, 20.0, 20.0, 3.0, 3.0, 3.0]) * np.concatenate([away, 2 * state.X_WB.q[1:]])
        hold -= 0.02 * np.concatenate([10.0 * away, 2 * state.X_WB.q[1:]])
        wrench += hold - np.array([25.0, 30.0, 30.0, 1.0, 1.0, 1.0]) * state.nu_B
        tank.step(np.linalg.pinv(VEHICLE.allocation_matrix) @ wrench, 0.02)
    assert tank.water.counts.parcels > 0  # asked, since that waits for the last step
    return jets, hull


def test_a_neutral_vehicle_that_hovers_leaves_no_momentum():
    """What its jets give to the water of a current, its wake lacks: the sum is within 1 % of either."""
    tank = _tank()
    jets, hull = _hover(tank, 60.0)
    assert np.linalg.norm(tank.state.nu_B) < 2e-3
    assert np.linalg.norm(jets) > 20.0
    # The wake's deficit is against the current.
    assert hull @ np.array(CURRENT_M_S) < 0.0
    assert np.linalg.norm(jets + hull) < 0.01 * np.linalg.norm(jets)


def test_the_wake_is_in_the_water_and_can_be_left_out():
    """Downstream of the hull the water is slower than the current; with `hull_wake` false there is no such parcel."""
    wake_stream = 2 * len(VEHICLE.thrusters)
    for hull_wake in (True, False):
        tank = _tank(hull_wake=hull_wake)
        _, hull = _hover(tank, 20.0)
        sent = tank.water.parcels.take(tank.water.parcels.stream == wake_stream)
        if hull_wake:
            assert 2 < sent.count < 60
            downstream = (sent.position_m - tank.state.X_WB.p_m) @ np.array(CURRENT_M_S)
            assert np.all(downstream > 0.0)
            assert np.all(sent.impulse_m4_s @ np.array(CURRENT_M_S) < 0.0)
        else:
            assert sent.count == 0 and not hull.any()


def test_the_wake_does_not_feed_on_itself():
    """The drag that feeds it is that of the current alone: it is what a hull at rest in the current feels."""
    tank = _tank()
    _, hull = _hover(tank, 60.0)
    through, drag = tank._plant.drag()
    speed = np.array(
        [
            *(-np.array(CURRENT_M_S)),
        ]
    )
    assert through == pytest.approx(speed, abs=2e-3)
    assert hull / 60.0 == pytest.approx(drag, rel=0.05, abs=0.005)
