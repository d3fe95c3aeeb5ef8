"""Wakewise: fly over-actuated underwater vehicles so gently that the target's water stays still.

Scenario, Parts, fly
    Take a scenario or preset apart into vehicle, target, region, route, world, estimator and controller; put others in
    their place; fly.
trial, compare
    Whole trials: photographs, model, report.
allocate, disturbance, velocity
    Thruster allocation of one wrench; the disturbance D of thrusts at a pose, and the velocity of the water they make.
reconstruct, evaluate
    Photographs to a model; a model against the truth.
plot
    Plots of flights and allocations on matplotlib, and a film of a trial.
load_vehicle, load_target, wake_model, methods
    Things by name or file.
Pose, BodyState, Goal, Command
    What an own controller is told and what it answers.

Packages are imported when a name is first used. SI units and radians; the world is north, east, down.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.jit import cache_dir as cache_dir  # before Numba is imported anywhere
from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.api import (
        allocate,
        compare,
        disturbance,
        evaluate,
        load_target,
        methods,
        reconstruct,
        trial,
        velocity,
    )
    from wakewise.core.geometry import Pose
    from wakewise.core.interfaces import BodyState, Command, Goal
    from wakewise.operation import Parts, Scenario, fly
    from wakewise.robot.importers import any_vehicle as load_vehicle
    from wakewise.ui import plot
    from wakewise.wake import wake_model

__all__ = [
    "BodyState",
    "Command",
    "Goal",
    "Parts",
    "Pose",
    "Scenario",
    "allocate",
    "compare",
    "disturbance",
    "evaluate",
    "fly",
    "load_target",
    "load_vehicle",
    "methods",
    "plot",
    "reconstruct",
    "trial",
    "velocity",
    "wake_model",
]

__version__ = "0.1.0"

lazy_attributes(__name__)
