"""A small planner and a problem for the tests of planning."""

import numpy as np

from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import Goal
from wakewise.planning.obstacles import Surroundings
from wakewise.planning.planner import compile_plan
from wakewise.planning.problem import PlanProblem, PlanSettings, PlanTerms, reference_of
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import WakeSettings, wake_model

VEHICLE = load_vehicle("paper")
_RNG = np.random.default_rng(3)
CENTRE = np.array([0.0, 0.0, 1.4])
_POINTS = _RNG.normal(size=(120, 3))
_POINTS *= (0.08 * _RNG.random(120) ** (1 / 3) / np.linalg.norm(_POINTS, axis=1))[:, None]
REGION = Region(points_W_m=CENTRE + _POINTS, weights=_RNG.uniform(0.5, 1.5, 120), distance_m=np.full(120, 0.01))
SHARES = REGION.weights / REGION.weights.sum()
SHARES.flags.writeable = False
AROUND = Surroundings.tank(np.array([-3.0, -2.5, 0.0]), np.array([3.0, 2.5, 1.5]), np.array([[*CENTRE, 0.08]]))
CONE = wake_model(WakeSettings(model="paper-calibrated", edge_width_deg=3.0, floor=False))


def model(wake=CONE, region=REGION, around=AROUND, **settings):
    limits = {name: settings.pop(name) for name in ("lower_N", "upper_N", "majorise") if name in settings}
    terms = PlanTerms(**{name: settings.pop(name) for name in list(settings) if name in PlanTerms.__dataclass_fields__})
    return compile_plan(VEHICLE, region, wake, PlanSettings(**settings), around, terms, **limits)


def problem(seed=0, weight_N=1.5, stages=20, away=0.02):
    rng = np.random.default_rng(seed)
    place = CENTRE + np.array([0.33, 0.1, -0.27])
    X_WB = Pose(place, quat_from_euler(*(0.05 * rng.normal(size=2)), 0.3 + np.pi))
    goal = Goal(
        X_WB=Pose(place + away * rng.normal(size=3), quat_from_euler(0.0, 0.0, 0.33 + np.pi)),
        nu_B=np.array([0.0, -0.1, 0.0, 0.0, 0.0, 0.3]),
    )
    return PlanProblem(
        state=np.concatenate([X_WB.p_m, X_WB.q, 0.05 * rng.normal(size=6)]),
        thrusts_N=0.5 * rng.normal(size=8),
        command_N=0.5 * rng.normal(size=8),
        reference=reference_of(goal, stages, 0.1),
        force_W_N=np.array([0.2, -0.1, weight_N]),
        moment_B_Nm=np.array([0.01, -0.02, 0.01]),
        current_W_m_s=np.array([0.1, 0.05, 0.0]),
    )
