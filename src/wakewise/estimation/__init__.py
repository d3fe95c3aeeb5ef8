"""Estimation: from camera poses, tracking, an inertial unit and depth to where the vehicle is, how it moves, how sure.

`ErrorStateFilter` is an error-state Kalman filter on the nominal vehicle's equations; `FilterSettings` states the noise
of the sensors that it assumes, `Priors` in `settings.py` what it takes for granted.
"""

from wakewise.estimation.error_state import ErrorStateFilter, FilterState
from wakewise.estimation.settings import FilterSettings

__all__ = ["ErrorStateFilter", "FilterSettings", "FilterState"]
