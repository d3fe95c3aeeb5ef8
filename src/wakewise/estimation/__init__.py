"""Estimation: from camera poses, tracking, an inertial unit and depth to where the vehicle is, how it moves, how sure.

Start reading in `eskf.py`: `ErrorStateFilter` is an error-state extended Kalman filter (EKF) on the nominal
vehicle's equations; `FilterSettings` states the noise of the sensors that it assumes, `Priors` in `settings.py` what
it takes for granted. `eskf_kernels.py` is the compiled motion, `eskf_kernels.py` and `corrections.py` what time and
what each kind of measurement do to mean and covariance, `eskf_kernels.py` what a vehicle at rest tells of its biases,
`current_from_drag.py` what its load tells of the current.
"""

from wakewise.estimation.eskf import ErrorStateFilter, FilterState
from wakewise.estimation.settings import FilterSettings

__all__ = ["ErrorStateFilter", "FilterSettings", "FilterState"]
