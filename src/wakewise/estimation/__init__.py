"""Estimation: from camera poses, tracking, an inertial unit and depth to where the vehicle is, how it moves, how sure.

`ErrorStateFilter` is an error-state Kalman filter on the nominal vehicle's equations; `FilterSettings` states the noise
that it assumes. `dead_reckoned` is what is left without a camera: velocity and attitude, summed up.
"""

from wakewise.estimation.dead_reckoning import dead_reckoned, local_north_east_down
from wakewise.estimation.error_state import ErrorStateFilter, FilterState
from wakewise.estimation.settings import FilterSettings

__all__ = ["ErrorStateFilter", "FilterSettings", "FilterState", "dead_reckoned", "local_north_east_down"]
