"""Where wash takes its time, quiet windows begin earlier, and nothing else changes."""

import numpy as np
from plan_cases import AROUND, CONE, REGION, VEHICLE

from wakewise.control import ControlSettings, planning_controller
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState
from wakewise.planning import PlanSettings
from wakewise.planning.problem import state_of


def test_the_delay_of_wash_grows_with_distance_and_falls_with_thrust():
    """Farther is later, harder is sooner, and without the lever there is no delay."""

    def delay(travel, height_m, thrust_N):
        settings = PlanSettings(iterations=1, travel=travel)
        controller = planning_controller(VEHICLE, REGION, CONE, ControlSettings(), settings, surroundings=AROUND)
        state = state_of(BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.4 - height_m]))))
        return controller._delay_s(state, np.full(8, thrust_N))

    assert delay(False, 0.5, 1.0) == 0.0
    assert 0.1 < delay(True, 0.4, 2.0) < delay(True, 0.4, 0.7) < delay(True, 0.8, 0.7) < 5.0
