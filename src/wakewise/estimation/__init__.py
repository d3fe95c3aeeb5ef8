"""Estimation: from camera poses, gyro and depth to where the vehicle is and how it moves.

`PoseFilter` is a steady-state Kalman filter on the nominal vehicle's equations; `FilterSettings` states the noise that
it assumes.
"""

from wakewise.estimation.pose_filter import FilterGains, FilterState, PoseFilter, filter_gains, steady_gain
from wakewise.estimation.settings import FilterSettings

__all__ = ["FilterGains", "FilterSettings", "FilterState", "PoseFilter", "filter_gains", "steady_gain"]
