"""What the thrusters do to the water, as a controller sees it: jet models and the disturbance D of a target.

The simulated tank never uses this room: a planner that knew the truth would prove nothing.
"""

from wakewise.wake.cones import PaperJet, PowerJet
from wakewise.wake.disturbance import disturbance, gram, incoherent, point_disturbance, split_roots
from wakewise.wake.floor import FloorJet
from wakewise.wake.gradients import (
    DisturbanceSlopes,
    GaussNewton,
    GramSlopes,
    Superposition,
    disturbance_slopes,
    gauss_newton,
    gram_with_derivatives,
    smooth_roots,
)
from wakewise.wake.jets import AxialJet, GaussianJet, RoundJet
from wakewise.wake.models import WakeSettings, model_names, wake_model
from wakewise.wake.travel import arrival_time_s, arrival_times_s

__all__ = [
    "AxialJet",
    "DisturbanceSlopes",
    "FloorJet",
    "GaussNewton",
    "GaussianJet",
    "GramSlopes",
    "PaperJet",
    "PowerJet",
    "RoundJet",
    "Superposition",
    "WakeSettings",
    "arrival_time_s",
    "arrival_times_s",
    "disturbance",
    "disturbance_slopes",
    "gauss_newton",
    "gram",
    "gram_with_derivatives",
    "incoherent",
    "model_names",
    "point_disturbance",
    "smooth_roots",
    "split_roots",
    "wake_model",
]
