"""Pilots: where an operator's commands come from; so far a model of the person at the sticks.

Start reading in `human.py` (what is seen late and roughly becomes pushes on two sticks); `people.py` holds the ranges
that each seed draws a person from, with their sources. What the sticks move is not known here: `manual` in `control`
flies a vehicle with them, the pilot `human` of `operation` any method.
"""

from wakewise.pilot.human import AXES, Person, PersonState, Sticks, View, begin, draw_person, steer
from wakewise.pilot.people import PEOPLE, People

__all__ = [
    "AXES",
    "PEOPLE",
    "People",
    "Person",
    "PersonState",
    "Sticks",
    "View",
    "begin",
    "draw_person",
    "steer",
]
