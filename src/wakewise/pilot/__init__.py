"""Pilots: where an operator's commands come from: hands, and a model of the person at the sticks.

Start reading in `human.py` (what is seen late and roughly becomes pushes on two sticks); `people.py` holds the ranges
that each seed draws a person from, with their sources; `controls.py` is what hands do, whatever they hold: a script
(`script.py`), a record (`trace.py`), keys (`keyboard.py`), a gamepad (`gamepad.py`, the only file that knows SDL, and
`pad_mapping.py`); `sources.py` reads script and record. What the sticks move is not known here: `manual` in `control`
flies a vehicle with them, the pilot `human` of `operation` any method.
"""

from wakewise.pilot.controls import ACTIONS, CENTRED, CONTROL_AXES, Controls, ControlSource
from wakewise.pilot.human import AXES, Person, PersonState, Sticks, View, begin, draw_person, steer
from wakewise.pilot.people import PEOPLE, People

__all__ = [
    "ACTIONS",
    "AXES",
    "CENTRED",
    "CONTROL_AXES",
    "PEOPLE",
    "ControlSource",
    "Controls",
    "People",
    "Person",
    "PersonState",
    "Sticks",
    "View",
    "begin",
    "draw_person",
    "steer",
]
