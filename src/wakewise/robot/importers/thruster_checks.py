"""What a vehicle's thrusters must be, whatever file they are from: few enough, of unit force, as many as it says.

What thrusters' own names say of where they are, held against the axes that their places are read in.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedVehicle
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.xml import PlacedError, SourceLocation
from wakewise.robot.importers.yaml_parameters import Entries
from wakewise.robot.vehicles.check import directions
from wakewise.robot.vehicles.draft import MAX_THRUSTERS, VehicleDraft

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
_VERTICAL = re.compile(r"vertical|heave|dive", re.IGNORECASE)
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
        """FLU or FRD if all names that state a side or up and down agree; else ""."""
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

    Left and port, right and starboard concern y; front and bow, back and stern x; top and bottom z, compared
    with one another; up and down of the force of a vertical thruster.
    """
    votes = AxisVotes()
    # First letters of short forms: where L stands beside R, R is the right side and not the rear.
    sides = [side for name in names for token in _tokens(name) if (side := _SIDE_FIRST.fullmatch(token)) is not None]
    letters = {side["side"] or side["second"] for side in sides}
    meanings = [_meaning(name, letters) for name in names]
    # Bow and stern are compared with each other: bodies with their origin at the nose are about.
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
    # Where a horizontal thruster is called up or down, the words mean places.
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
    wrong = [n for n, a in zip(names, axes, strict=True) if _VERTICAL.search(n) and abs(a[2]) < 0.5]
    return [f"by the names {_some(wrong)} push up or down, by their axes they do not"] if wrong else []


def _some(names: list[str]) -> str:
    return ", ".join(names[:4]) + (" ..." if len(names) > 4 else "")


def _tokens(name: str) -> list[str]:
    tokens = [token.lower() for token in _TOKEN.findall(name)]
    # A left-handed propeller is on no side.
    following = [*tokens, ""][1:]
    return [t for t, after in zip(tokens, following, strict=True) if not after.startswith("hand") and t != "upright"]


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


UNIT_SLACK = 0.02
"""How far a force column may be from length 1: entries of two digits, such as 0.7 for cos 45 deg, pass."""

_ROUNDING = 0.02
MAX_ARM_M = 10.0
"""Longest plausible arm of a thruster about the body's origin."""
_COUNT = re.compile(r"^((num|number|n|no|count)_?(of_)?thrusters?|thrusters?_(count|num|number))$", re.IGNORECASE)
_LIST = re.compile(
    r"^thrusters?(_(names?|ids?|joints?|links?|frames?|topics?|pins?|channels?|labels?|list))?$", re.IGNORECASE
)
_LAYOUT_KEY = re.compile(r"frame|layout|config|mixer|type|dofs?$|degrees_of_freedom|actuation", re.IGNORECASE)
_DOF_WORDS = re.compile(r"(?<![0-9.])([3-6])[ _-]?dofs?(?![a-z])", re.IGNORECASE)
_FULL_WORDS = re.compile(r"(fully|over)[ _-]?actuated|holonomic", re.IGNORECASE)
_MANY = 6
_DOF_KEY = re.compile(r"^(dofs?|num_dofs?|degrees_of_freedom)$", re.IGNORECASE)


def question_inertia(found: ParsedVehicle) -> None:
    """Question principal moments of inertia of which one exceeds the sum of the others, as no body's does."""
    if found.inertia_kg_m2 is None:
        return
    low, middle, high = np.linalg.eigvalsh(0.5 * (found.inertia_kg_m2 + found.inertia_kg_m2.T))
    if high > (low + middle) * (1.0 + _ROUNDING):
        found.notes.append(
            f"{QUESTION}inertia: the principal moments {low:.4g}, {middle:.4g} and {high:.4g} kg m2 are no body's: "
            f"the largest must not exceed the sum of the others"
        )


def is_unit(length: Any) -> Any:
    """Whether lengths are 1 within `UNIT_SLACK`."""
    return np.abs(np.asarray(length) - 1.0) <= UNIT_SLACK


def require_count(n: int, where: str = "") -> None:
    """Refuse more thrusters than any vehicle has.

    Raises InputError naming the cap.
    """
    if n > MAX_THRUSTERS:
        raise PlacedError(f"{where}{n} thrusters, at most {MAX_THRUSTERS} are read")


def require_force_columns(matrix: Array, what: str) -> None:
    """Refuse a matrix, shape (6, n), that would be flown with and is no wrench per newton of each thruster.

    Raises InputError if it has no columns or too many, a force column is not of length 1, or a moment has an arm beyond
    `MAX_ARM_M`.
    """
    if matrix.shape[1] == 0:
        raise PlacedError(f"{what} has no columns, must have one per thruster")
    require_count(matrix.shape[1], f"{what}: ")
    lengths = np.linalg.norm(matrix[:3], axis=0)
    odd = np.flatnonzero(~is_unit(lengths))
    if odd.size:
        i = int(odd[0])
        raise PlacedError(
            f"{what}: the force of column {i + 1} has length {lengths[i]:.4g}, must be 1 (a column is the wrench that "
            f"one newton of a thruster makes)"
        )
    arms_m = np.linalg.norm(matrix[3:], axis=0) / lengths
    i = int(np.argmax(arms_m))
    if not arms_m[i] <= MAX_ARM_M:
        raise PlacedError(
            f"{what}: the moment of column {i + 1} is {arms_m[i]:.4g} N m per newton, an arm of more than "
            f"{MAX_ARM_M:g} m; are these metres?"
        )


def require_same_count(entries: Entries, found: ParsedVehicle) -> None:
    """Hold the number of thrusters against the file's own lists and counts of them.

    Raises InputError if they disagree.
    """
    columns = None if found.matrix is None else int(found.matrix.shape[1])
    n = len(found.thrusters) or columns
    if not n:
        return
    if columns is not None and n != columns:
        raise PlacedError(f"{found.file}: {found.matrix_name} has {columns} columns, but the file places {n} thrusters")
    for path, item in entries:
        said = _said_count(path, item)
        item.seen = item.seen or said is not None
        if said is not None and said != n:
            what = f"{found.matrix_name} has" if not found.thrusters else "the file places"
            raise PlacedError(f"{item.place}: {path[-1]} says {said} thrusters, but {what} {n}")


def _said_count(path: tuple[str, ...], item: YamlNode) -> int | None:
    key = path[-1]
    inside = len(path) > 1 and re.fullmatch(r"thrusters?", path[-2], re.IGNORECASE)
    if isinstance(item.value, str):
        plain = key.lower() == "thrusters" or (inside and key.lower() in {"num", "count", "number"})
        if (_COUNT.match(key) or plain) and re.fullmatch(r"\d{1,6}", item.value.strip()):
            return int(item.value)
        return None
    listed = item.items()
    if listed and _LIST.match(key) and all(isinstance(member.value, str) for member in listed):
        return len(listed)
    return None


def claims_in(entries: Entries) -> list[tuple[int, str, SourceLocation, bool]]:
    """Axes that a YAML file's own words say its thrusters make: how many, the words, where, and whether they bind."""
    said: list[tuple[int, str, SourceLocation, bool]] = []
    for path, item in entries:
        if not isinstance(item.value, str):
            continue
        key = path[-1]
        inside = len(path) > 1 and _DOF_KEY.match(path[-2])
        if (_DOF_KEY.match(key) or (inside and key.lower() in {"num", "count"})) and item.value.strip() in set(
            "123456"
        ):
            item.seen = True
            said.append((int(item.value), f"{'.'.join(path[-2:])}: {item.value}", item.place, True))
        elif _LAYOUT_KEY.search(key):
            axes = claimed(item.value)
            if axes:
                item.seen = True
                said.append((axes, f"{key}: {item.value[:60]}", item.place, True))
    return said


def claimed(words: str) -> int:
    """Axes that words such as `vectored_6dof` or `fully actuated` claim; 0 if none."""
    match = _DOF_WORDS.search(words)
    return int(match[1]) if match else 6 if _FULL_WORDS.search(words) else 0


def question_rank(found: ParsedVehicle, matrix: Array, name: str) -> list[str]:
    """Hold the rank of an allocation matrix, shape (6, n), against what the file's own words claim.

    Returns notes that question it. Raises InputError if the layout claims more axes than it has thrusters, so that it
    cannot be right.
    """
    notes: list[str] = []
    rank = directions(matrix).rank
    claims = list(found.claims)
    for word in dict.fromkeys((name, found.file.stem)):
        axes = claimed(word)
        if axes:
            claims.append((axes, f"the name {word[:60]}", SourceLocation(found.file, 1), False))
    for axes, words, place, binds in claims:
        if axes > matrix.shape[1] and binds:
            raise PlacedError(
                f"{place}: {words} claims {axes} axes, but {matrix.shape[1]} thrusters make at most that many"
            )
        if rank < axes:
            notes.append(f"{QUESTION}{words} claims {axes} axes, but the thrusters make only {rank} (rank {rank})")
    return notes


def question_names(found: ParsedVehicle, draft: VehicleDraft, *, told: bool) -> list[str]:
    """Hold places and axes against the thrusters' own names, and a guess of axes against what any vehicle can do.

    `draft`: in FRD. `told`: whether the user gave the axis along which thrusters push. Returns notes that question the
    places. Raises InputError if nothing but a guess says which way thrusters push, and the vehicle it makes is none.
    """
    if not draft.thrusters:
        return []
    places = np.array([t.p_BT_m for t in draft.thrusters])
    axes = np.array([t.axis_B for t in draft.thrusters])
    names = [t.name for t in draft.thrusters]
    against = mislabelled_vertical(names, axes)
    n, rank = len(axes), directions(draft.allocation_matrix).rank
    if found.guessed and not told:
        if n >= 3 and bool((np.abs(axes[:, 2]) > 0.99).all()):
            against.append(f"all {n} push up or down")
        elif n >= _MANY and rank <= n // 2:
            against.append(f"{n} of them make only {rank} axes (rank {rank})")
        if against:
            rule = found.thrust_rule.removeprefix("inferred from names: ")
            raise PlacedError(
                f"{found.file}: {found.guessed}, {rule}, and that is wrong: {against[0]}; "
                f"say how they push with --thrust-direction (+x, -x, +y, -y, +z or -z)"
            )
    against += contradictions(names, places, axes)
    return [f"{QUESTION}{words}: the frame, the places or the names are wrong" for words in against]
