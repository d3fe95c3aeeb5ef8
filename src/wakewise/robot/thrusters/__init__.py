"""Thrusters: mounting, thrust curves over supply voltage, lag and dead zone, and the laboratory that fits them.

Start reading in `thruster.py` (one thruster on a body), `thrust_curve.py` (command to thrust and back, at a voltage;
`thrust_table.py` has them by name) and `rotor_lag.py` (how it follows). `thrust_table.py` reads bench tables and
`data/` holds a published one, `lag_fit.py` and `lag_fit.py` find a lag in a recorded step, `lag_fit.py` helps
them, `thruster.py` are the limits, losses and power that a simulation needs, `thrust_curve.py` the thrusts that can be
held at all, `thruster_facts.py` says it in words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.robot.thrusters.thrust_curve import ThrustSteps
    from wakewise.robot.thrusters.thrust_table import library_curve
    from wakewise.robot.thrusters.thruster import Thruster, electrical_power_W, saturate, scale_to_limits, thruster_lag

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
