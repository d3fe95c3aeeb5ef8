"""One Runge-Kutta step of the vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np

from wakewise.experiments.benches.cases import VEHICLE
from wakewise.experiments.benches.timing import BenchOptions, timed_us
from wakewise.vehicles import compile_body, step_rk4


def run(options: BenchOptions) -> dict[str, Any]:
    """One Runge-Kutta step of the vehicle."""
    body = compile_body(VEHICLE)
    p, q, nu = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.05, 0.0, 0.0, 0.1, 0.2])
    wrench, current = np.array([1.0, 0.0, 0.5, 0.0, 0.1, 0.0]), np.array([0.03, 0.02, 0.0])
    return {"step": timed_us(lambda: step_rk4(body, p, q, nu, wrench, current, 0.005), 5000)}
