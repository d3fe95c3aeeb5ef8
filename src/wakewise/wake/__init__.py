"""What the thrusters do to the water, as a controller sees it: jet models and the disturbance D of a target.

The simulated tank never uses this room: a planner that knew the truth would prove nothing.
"""

from wakewise.wake.disturbance import disturbance, gram, point_disturbance, split_roots
from wakewise.wake.jets import AxialJet, PaperJet, RoundJet, wake_model

__all__ = [
    "AxialJet",
    "PaperJet",
    "RoundJet",
    "disturbance",
    "gram",
    "point_disturbance",
    "split_roots",
    "wake_model",
]
