"""The Runge-Kutta step is of fourth order, and is given up where drag is too stiff for it."""

import numpy as np
from moving_vehicles import LEVEL, vehicle_named

from wakewise.core.arrays import Array
from wakewise.robot.vehicles import compile_body, step_rk4


def test_halving_the_step_cuts_the_error_by_sixteen() -> None:
    # No sign of the velocity changes here, so that |u| u is smooth.
    body = compile_body(vehicle_named("crooked"))
    wrench, current = np.array([8.0, 5.0, 6.0, 0.4, 0.4, 0.4]), np.array([-0.2, -0.1, -0.1])
    start = np.array([0.5, 0.4, 0.3, 0.4, 0.3, 0.5])

    def end(steps: int) -> Array:
        p, q, nu = np.zeros(3), LEVEL, start
        for _ in range(steps):
            p, q, nu = step_rk4(body, p, q, nu, wrench, current, 0.4 / steps)
        return np.concatenate([p, q, nu])

    exact = end(640)
    ratio = np.linalg.norm(end(10) - exact) / np.linalg.norm(end(20) - exact)
    assert 12.0 < ratio < 22.0
