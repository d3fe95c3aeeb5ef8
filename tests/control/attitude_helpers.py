"""A target, open water round it, and goals that look at it with a camera that tilts: shared by the tests of posture."""

from __future__ import annotations

import numpy as np

from wakewise.core.geometry import Pose, look_at
from wakewise.core.interfaces import Goal
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import WakeSettings, wake_model

VEHICLE = load_vehicle("paper-tilting")
HEAVY = load_vehicle("bluerov2-heavy")
CENTRE = np.array([0.0, 0.0, 1.4])
OPEN = Surroundings(spheres=np.array([[*CENTRE, 0.1]]))


def region() -> Region:
    rng = np.random.default_rng(0)
    points = CENTRE + rng.uniform(-0.1, 0.1, size=(120, 3))
    distance = rng.uniform(0.0, 0.1, 120)
    return Region(points_W_m=points, weights=np.exp(-distance / 0.05), distance_m=distance)


def believed():
    """Jets over a bed just below the target."""
    return wake_model(WakeSettings(), 1.5)


def looking(vehicle, elevation_rad, range_m=0.5, tilt=None) -> Goal:
    """The goal of a level body, as far as the stops let it, whose camera looks at the centre from the south."""
    eye = CENTRE + range_m * np.array([-np.cos(elevation_rad), 0.0, -np.sin(elevation_rad)])
    # A forward-right-down frame that looks there, its axes turned to the camera's (right, down, forward).
    R_WC = look_at(eye, CENTRE) @ np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    tilt = vehicle.tilt.within(-elevation_rad) if tilt is None else tilt
    return Goal(X_WB=Pose.from_matrix(R_WC, eye) @ vehicle.X_BC_at(tilt).inverse(), tilt_rad=tilt)


def gap_m(scale, goal) -> float:
    """How far the hull of a vehicle that is at its goal is from what it may not touch."""
    return scale.gap_m(goal.X_WB.p_m, goal.X_WB.R)
