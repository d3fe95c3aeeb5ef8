"""What thrusters' own names say of where they are, held against the axes that their places are read in."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array

_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_LEFT, _RIGHT = ("left", "port", "lft"), ("right", "starboard", "stbd", "rgt")
_FRONT, _BACK = ("front", "fore", "bow"), ("back", "rear", "aft", "stern")
_TOP, _BOTTOM = ("top", "upper"), ("bottom", "lower")
_MEANINGS = {
    **{"left": _LEFT, "right": _RIGHT, "front": _FRONT, "back": _BACK, "top": _TOP, "bottom": _BOTTOM},
    **{"up": ("up",), "down": ("down",)},
}
_OTHER = ("mid", "middle", "center", "centre", "vertical", "vert", "horizontal", "hor", "thruster", "dive")
_ALL = sorted((*(part for parts in _MEANINGS.values() for part in parts), *_OTHER), key=len, reverse=True)
_PART = re.compile("|".join(_ALL))
_WORD = re.compile(f"(?:{'|'.join(_ALL)})+")
_SHORT = re.compile(r"[hvt]?(?P<end>[fbram])(?P<side>[lr])[hvtb]?")
"""Short forms: FL, FRH, VBL, rr; the first of two letters is the end, the second the side."""
_SIDE_FIRST = re.compile(r"(?:[hv](?P<second>[lr])|(?P<side>[lr])(?P<rest>[fbvh])?)")
"""Short forms that begin with the side: L, RV, LF; and VL, VR, HR."""
_NEAR_M = 1e-3
_UPRIGHT = 0.7


@dataclass(eq=False)
class AxisVotes:
    """Names for and against each axis: y to port, x ahead, and z up; a name that says nothing is in neither list."""

    port: tuple[list[str], list[str]] = field(default_factory=lambda: ([], []))
    ahead: tuple[list[str], list[str]] = field(default_factory=lambda: ([], []))
    up: tuple[list[str], list[str]] = field(default_factory=lambda: ([], []))

    @property
    def frame(self) -> str:
        """FLU or FRD if all names that speak of a side or of up and down agree; else ""."""
        for_, against = (*self.port[0], *self.up[0]), (*self.port[1], *self.up[1])
        if bool(for_) == bool(against):
            return ""
        return "FLU" if for_ else "FRD"

    @property
    def words(self) -> str:
        """The names that decide, for a note."""
        side = "port" if self.port[0] else "starboard"
        if self.port[0] or self.port[1]:
            return f"by the names {_some([*self.port[0], *self.port[1]])} {side} is at y > 0"
        return f"by the names {_some([*self.up[0], *self.up[1]])} {'up' if self.up[0] else 'down'} is along +z"


def compare_names(names: Sequence[str], places: Array, axes: Array) -> AxisVotes:
    """Hold names against places, shape (n, 3), and axes of positive thrust, shape (n, 3), of one frame.

    Left and port, right and starboard speak of y; front and bow, back and stern of x; top and bottom of z, compared
    with one another; up and down of the force of a vertical thruster.
    """
    votes = AxisVotes()
    letters = {letter for name in names for letter in _letters(name)}
    meanings = [_meaning(name, letters) for name in names]
    # Bow and stern speak of one another: bodies with their origin at the nose are about.
    middle = np.array([float(places[:, 0].mean()), 0.0, 0.0])
    for name, meaning, place in zip(names, meanings, places - middle, strict=True):
        for pair, axis, for_, against in (("port", 1, "left", "right"), ("ahead", 0, "front", "back")):
            if abs(place[axis]) > _NEAR_M and (for_ in meaning) != (against in meaning):
                getattr(votes, pair)[0 if (place[axis] > 0.0) == (for_ in meaning) else 1].append(name)
    top = [float(p[2]) for p, m in zip(places, meanings, strict=True) if "top" in m]
    bottom = [float(p[2]) for p, m in zip(places, meanings, strict=True) if "bottom" in m]
    if top and bottom and abs(np.mean(top) - np.mean(bottom)) > _NEAR_M:
        votes.up[0 if np.mean(top) > np.mean(bottom) else 1].append("top and bottom")
    pushing = [(n, m, a) for n, m, a in zip(names, meanings, axes, strict=True) if ("up" in m) != ("down" in m)]
    # Where a horizontal thruster is called up or down, the words speak of places.
    if all(abs(a[2]) > _UPRIGHT for _, _, a in pushing):
        for name, meaning, axis in pushing:
            votes.up[0 if (axis[2] > 0.0) == ("up" in meaning) else 1].append(name)
    return votes


def contradictions(names: Sequence[str], places: Array, axes: Array) -> list[str]:
    """Where names contradict places, shape (n, 3), and axes, shape (n, 3), in x forward, y right, z down."""
    votes, said = compare_names(names, places, axes), []
    for (_, against), wrong, words in (
        (votes.port[::-1], "y", "port and starboard lie on the other sides"),
        (votes.ahead, "x", "bow and stern lie at the other ends"),
        (votes.up[::-1], "z", "up and down are the other way"),
    ):
        if against:
            said.append(f"by the names {_some(against)} {words} (along {wrong})")
    return said


def mislabelled_vertical(names: Sequence[str], axes: Array) -> list[str]:
    """Where thrusters that are called vertical push along the horizon, axes of shape (n, 3)."""
    wrong = [n for n, a in zip(names, axes, strict=True) if _says_vertical(n) and abs(a[2]) < 0.5]
    return [f"by the names {_some(wrong)} push up or down, by their axes they do not"] if wrong else []


def _says_vertical(name: str) -> bool:
    return bool(re.search(r"vertical|heave|dive", name, re.IGNORECASE))


def _some(names: list[str]) -> str:
    return ", ".join(names[:4]) + (" ..." if len(names) > 4 else "")


def _tokens(name: str) -> list[str]:
    tokens = [token.lower() for token in _TOKEN.findall(name)]
    # A left-handed propeller is on no side.
    following = [*tokens, ""][1:]
    return [t for t, after in zip(tokens, following, strict=True) if not after.startswith("hand") and t != "upright"]


def _letters(name: str) -> set[str]:
    """First letters of short forms: where L stands beside R, R is the right side and not the rear."""
    return {(m["side"] or m["second"]) for t in _tokens(name) if (m := _SIDE_FIRST.fullmatch(t)) is not None}


def _meaning(name: str, letters: set[str]) -> set[str]:
    found: set[str] = set()
    for token in _tokens(name):
        if _WORD.fullmatch(token):
            for part in _PART.findall(token):
                found |= {word for word, parts in _MEANINGS.items() if part in parts}
        elif (short := _SHORT.fullmatch(token)) is not None:
            found.add("left" if short["side"] == "l" else "right")
            found |= {"f": {"front"}, "b": {"back"}, "r": {"back"}, "a": {"back"}}.get(short["end"], set())
        elif (side := _SIDE_FIRST.fullmatch(token)) is not None and "l" in letters:
            found.add("left" if (side["second"] or side["side"]) == "l" else "right")
            found |= {"f": {"front"}, "b": {"back"}}.get(side["rest"] or "", set())
    return found
