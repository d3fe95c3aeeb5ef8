"""The loops that such vehicles are shipped with: they hold a pose, and what is lowered keeps its margins."""

import numpy as np
import pytest

from wakewise.control import ControlSettings, make_controller
from wakewise.control.ardusub import lowered_gains
from wakewise.control.motor_mix import motor_mix
from wakewise.core.geometry import Pose, quat_conjugate, quat_from_euler, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body, load_vehicle, step_rk4
from wakewise.scene.targets import Region
from wakewise.wake import wake_model

REGION = Region(points_W_m=np.array([[1.0, 0.0, 0.0]]), weights=np.ones(1), distance_m=np.zeros(1))
DT_S = 0.02


def held(name, pitch_deg, weight_N, seconds=30.0, start_m=0.1):
    """Distance and angle from the goal, shape (steps,) each, of a true vehicle with true thrusters, no noise."""
    vehicle = load_vehicle(name)
    controller = make_controller("ardusub", vehicle, REGION, wake_model("jet"), ControlSettings())
    goal = Goal(X_WB=Pose(np.zeros(3), quat_from_euler(0.0, np.radians(pitch_deg), 0.4)))
    body, state = compile_body(vehicle), controller.init()
    p, q, nu, thrusts = np.array([-start_m, 0.0, 0.0]), goal.X_WB.q, np.zeros(6), np.zeros(8)
    away, turned = [], []
    for _ in range(round(seconds / DT_S)):
        state, command = controller.step(state, DT_S, BodyState(X_WB=Pose(p, q), nu_B=nu), goal)
        thrusts = thruster_lag(thrusts, command.thrusts_N, vehicle.time_constants_s, DT_S)
        wrench = vehicle.allocation_matrix @ thrusts
        wrench[:3] += Pose(p, q).R.T @ [0.0, 0.0, weight_N]
        p, q, nu = step_rk4(body, p, q, nu, wrench, np.zeros(3), DT_S)
        away.append(np.linalg.norm(p))
        turned.append(np.linalg.norm(rotvec_from_quat(quat_multiply(quat_conjugate(q), goal.X_WB.q))))
    return np.array(away), np.degrees(turned)


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
@pytest.mark.parametrize(("pitch_deg", "weight_N"), [(0.0, 1.0), (-40.0, 4.0)])
def test_it_holds_a_pose_level_or_pitched_light_or_heavy(name, pitch_deg, weight_N):
    """Within four centimetres and three degrees after 20 s, which the dead band of its pulses leaves open."""
    away, turned = held(name, pitch_deg, weight_N)
    assert away[-500:].max() < 0.04 and turned[-500:].max() < 3.0


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_gains_are_only_ever_lowered_and_by_more_where_the_loop_is_faster(name):
    """Each factor lies in (0, 1]; at a fifth of the rate none is larger than at the full one."""
    vehicle = load_vehicle(name)
    mix = motor_mix(vehicle)
    fast, slow = lowered_gains(vehicle, mix, 0.005), lowered_gains(vehicle, mix, 0.05)
    assert np.all((fast > 0.0) & (fast <= 1.0)) and np.all(slow <= fast + 1e-9)
