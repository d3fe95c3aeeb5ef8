"""State estimation: an error-state extended Kalman filter (ESKF, EKF) on the vehicle's equations of motion.

It estimates pose, twist, unmodelled load, current and sensor biases, with their covariance, from camera poses, optical
tracking, an inertial unit and depth.

- `eskf.py`: the filter (`ErrorStateFilter`); measurement queue, gates, adaptive noise.
- `eskf_kernels.py`: layout of the state; compiled prediction of mean and covariance.
- `corrections.py`: compiled measurement updates.
- `current_from_drag.py`: current from the estimated load at rest.
- `settings.py`: sensor noise (`FilterSettings`) and prior standard deviations (`Priors`).
"""

from wakewise.estimation.eskf import ErrorStateFilter, FilterState
from wakewise.estimation.settings import FilterSettings

__all__ = ["ErrorStateFilter", "FilterSettings", "FilterState"]
