"""Thrusters: mounting, thrust curves over supply voltage, lag and dead zone, and the laboratory that fits them.

Start reading in `thruster.py` (one thruster on a body), `thrust_curve.py` (command to thrust and back, at a voltage;
`curve_library.py` has them by name) and `rotor_lag.py` (how it follows). `thrust_table.py` reads bench tables and
`data/` holds a published one, `step_file.py` and `lag_fit.py` find a lag in a recorded step, `correlated.py` helps
them, `actuators.py` are the limits, losses and power that a simulation needs, `thrust_steps.py` the thrusts that can be
held at all, `thruster_facts.py` says it in words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.robot.thrusters.actuators import electrical_power_W, saturate, scale_to_limits, thruster_lag
    from wakewise.robot.thrusters.curve_library import library_curve
    from wakewise.robot.thrusters.thrust_steps import ThrustSteps
    from wakewise.robot.thrusters.thruster import Thruster

__all__ = [
    "ThrustSteps",
    "Thruster",
    "electrical_power_W",
    "library_curve",
    "saturate",
    "scale_to_limits",
    "thruster_lag",
]

lazy_attributes(__name__)
