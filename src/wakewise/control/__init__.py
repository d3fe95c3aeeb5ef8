"""Control: from an estimate and a goal to thrusts, by methods that differ only in how they spend spare thrusters.

All methods share one tracker (a PID with feed-forward, slowed where its margins ask for it), so that what they do to
the water can be compared at equal wrench. `make_controller` makes one by name, ours or one from outside.

Start reading in `methods.py` (which methods there are; `dynamic_positioning.py`, `bow_rule.py`, `manual.py`,
`ardusub.py` with `motor_mix.py`, `pseudo_inverse.py` and `unaware.py` are the rivals), `wake_aware.py` (the product:
model predictive control and the exact allocator behind it) and `instant.py` (the tracker and the gentlest thrusts of an
instant). `tracker.py` and `stability.py` are the PID and its margins, `loop.py` flies it with any allocation,
`receding.py` flies a plan, `levers.py` adds the water that counts, `watch.py` follows it where the current carries it,
`meeting.py` says what jets that meet become, `spare.py` shares a plan's wrench out anew, `thrift.py` says how much
power that may cost, `posture.py` and `poised.py` choose the body's attitude, `pulses.py` sends thrusts that no thruster
can hold as pulses, `safeguard.py` sees to it that something that can be flown is sent in time, `intent.py` turns an
operator's stick into goals, `firmness.py` keeps a plan from putting them off, `easing.py` moves what must not jump,
`switching.py` changes the method in flight with what `carried.py` hands over, `trim.py` advises ballast for a mission,
`hover_trim.py` from a hover.
"""

from wakewise.control.levers import LeverSettings
from wakewise.control.loop import vehicle_layout
from wakewise.control.methods import MAKERS, METHODS, ControlTask, make_controller
from wakewise.control.pulses import in_pulses
from wakewise.control.receding import PlanningController, planning_controller
from wakewise.control.safeguard import Safeguard, safeguarded
from wakewise.control.settings import ControlSettings
from wakewise.control.stability import Gains, vehicle_axes, wished_gains
from wakewise.control.tracker import Tracker, TrackerState, make_tracker

__all__ = [
    "MAKERS",
    "METHODS",
    "ControlSettings",
    "ControlTask",
    "Gains",
    "LeverSettings",
    "PlanningController",
    "Safeguard",
    "Tracker",
    "TrackerState",
    "in_pulses",
    "make_controller",
    "make_tracker",
    "planning_controller",
    "safeguarded",
    "vehicle_axes",
    "vehicle_layout",
    "wished_gains",
]
