"""Estimation: from camera poses, tracking, an inertial unit and depth to where the vehicle is, how it moves, how sure.

Start reading in `error_state.py`: `ErrorStateFilter` is an error-state extended Kalman filter (EKF) on the nominal
vehicle's equations; `FilterSettings` states the noise of the sensors that it assumes, `Priors` in `settings.py` what
it takes for granted. `kernels.py` is the compiled motion, `prediction.py` and `corrections.py` what time and what each
kind of measurement do to mean and covariance, `resting.py` what a vehicle at rest tells of its biases, `current.py`
what its load tells of the current.
"""

from wakewise.estimation.error_state import ErrorStateFilter, FilterState
from wakewise.estimation.settings import FilterSettings

__all__ = ["ErrorStateFilter", "FilterSettings", "FilterState"]
