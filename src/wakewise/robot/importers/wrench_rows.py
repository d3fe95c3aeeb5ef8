"""Which six numbers a matrix holds, and in what order: forces or moments first, in rows or in columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.importers.parsed_vehicle import QUESTION, wrench_rows_to_frd
from wakewise.robot.importers.thruster_checks import UNIT_SLACK, is_unit
from wakewise.robot.importers.xml import PlacedError, SourceLocation

_WORDS = (
    ("surge", "x", "fx", "forcex", "xforce", "forward", "forceinx"),
    ("sway", "y", "fy", "forcey", "yforce", "lateral", "forceiny"),
    ("heave", "z", "fz", "forcez", "zforce", "vertical", "forceinz"),
    ("roll", "k", "mx", "rx", "tx", "taux", "torquex", "momentx", "p"),
    ("pitch", "m", "my", "ry", "ty", "tauy", "torquey", "momenty", "q"),
    ("yaw", "n", "mz", "rz", "tz", "tauz", "torquez", "momentz", "r"),
)
_COMPONENT = {word: i for i, words in enumerate(_WORDS) for word in words} | {"throttle": 2}
_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
_TWIST_M = 0.1
"""Most moment along its own force, in N m per newton, that a propeller's reaction makes."""
ROWS_OPTION = "--rows roll,pitch,yaw,x,y,z"


@dataclass(frozen=True)
class WrenchOrder:
    """What the six numbers are, in the file's order: indices of surge ... yaw, and whether the third force is up."""

    places: tuple[int, ...]
    throttle: bool = False
    words: str = ""
    why: str = ""

    def wrench(self, raw: Array) -> Array:
        """Rows in the order surge, sway, heave, roll, pitch, yaw, shape (6, n)."""
        rows = np.empty_like(raw)
        rows[list(self.places)] = raw
        if self.throttle:
            rows[2] = -rows[2]
        return rows + 0.0


FORCES_FIRST = WrenchOrder((0, 1, 2, 3, 4, 5), words="forces first")
MOMENTS_FIRST = WrenchOrder((3, 4, 5, 0, 1, 2), words="moments first")
ARDUSUB = WrenchOrder((3, 4, 5, 2, 0, 1), throttle=True, words="roll, pitch, yaw, throttle, forward, lateral")


def order_of(labels: Sequence[str], why: str = "") -> WrenchOrder | None:
    """Order that six names state, such as roll, pitch, yaw, throttle, forward, lateral; None if they are other names.

    Throttle and lateral beside it are ArduSub's: up and to the right.
    """
    plain = [re.sub(r"[^a-z]", "", label.lower()) for label in labels]
    places = tuple(_COMPONENT.get(label, -1) for label in plain)
    if len(places) != 6 or sorted(places) != [0, 1, 2, 3, 4, 5]:
        return None
    return WrenchOrder(places, "throttle" in plain, ", ".join(label.strip() for label in labels), why)


def order_of_one(label: str) -> bool:
    """Whether a name is one of the six's."""
    return re.sub(r"[^a-z]", "", label.lower()) in _COMPONENT


def parse_order(rows: str | None) -> WrenchOrder | None:
    """Order of the option `--rows`.

    Raises InputError if it does not name each of the six once.
    """
    if rows is None:
        return None
    order = order_of([word for word in re.split(r"[,\s]+", rows) if word], "told")
    if order is None:
        raise InputError(
            f"rows {rows[:80]!r}: must name x, y, z, roll, pitch, yaw once each in the file's order, or roll, pitch, "
            f"yaw, throttle, forward, lateral as ArduSub does"
        )
    return order


def order_in_comment(text: str) -> WrenchOrder | None:
    """Order that six words beside one another in a comment state."""
    words = re.findall(r"[A-Za-z_]+", text)
    return next((order for i in range(len(words) - 5) if (order := order_of(words[i : i + 6])) is not None), None)


def component_in_comment(text: str) -> str:
    """The one component that a comment beside a row names; "" if it names none or several."""
    words = [w for w in re.findall(r"[A-Za-z_]+", text) if re.sub(r"[^a-z]", "", w.lower()) in _COMPONENT]
    kinds = {_COMPONENT[re.sub(r"[^a-z]", "", w.lower())] for w in words}
    return words[0] if len(kinds) == 1 else ""


def candidate_layouts(matrix: Array) -> list[tuple[Array, str]]:
    """Every way of reading numbers as six rows of n: as rows, as a row per thruster; a flat list reads both ways."""
    if matrix.ndim == 1:
        return [(matrix.reshape(6, -1), "six rows"), (matrix.reshape(-1, 6).T, "a row of 6 per thruster")]
    found = [(matrix, "six rows")] if matrix.shape[0] == 6 else []
    return found + ([(matrix.T, "a row of 6 per thruster")] if matrix.shape[1] == 6 else [])


def is_signs(matrix: Array) -> bool:
    """Whether a matrix holds -1, 0 and 1 only and is no matrix of forces: motor factors of a mixer."""
    signs = bool(np.isin(matrix, (-1.0, 0.0, 1.0)).all())
    return signs and not bool(is_unit(np.linalg.norm(matrix[:3], axis=0)).all())


def resolve_order(
    raw: Array, order: WrenchOrder | None, what: str, place: SourceLocation | None, notes: list[str]
) -> tuple[Array, bool]:
    """Wrench per thruster, shape (6, n), in the file's axes, and whether its order was stated.

    Of the ways of reading, those count in which every force has length 1 and no moment lies along its own force, as no
    thruster makes it. Where none or several are left, the file is refused or questioned, with the option that tells.

    `raw`: numbers as they stand: flat, or of two dimensions of which one is 6. `order`: what the file or the user says.
    `what`: name of the matrix, for notes and messages. `place`: where it is, if the vehicle has nothing else to fly
    with; None if a geometry is at hand to settle doubts. Raises InputError if no way of reading makes a thruster's
    wrench of every column, and no geometry is at hand.
    """
    orders = [FORCES_FIRST, MOMENTS_FIRST] if order is None else [order]
    read = [(one.wrench(m), f"{way}, {one.words}", one) for one in orders for m, way in candidate_layouts(raw)]
    unit = [r for r in read if bool(is_unit(np.linalg.norm(r[0][:3], axis=0)).all())]
    fits = [r for r in unit if not _along(r[0])]
    if order is not None:
        said = f"rows are {order.words} ({order.why})"
        pushing = [r for r in read if np.linalg.norm(r[0][:3], axis=0).min() > 0.5]
        chosen = (fits or unit or pushing or read)[0]
        stated = not order.why.startswith("inferred")
        if not unit and place is not None and bool(np.isin(chosen[0], (-1.0, 0.0, 1.0)).all()):
            notes.append(
                f"{QUESTION}{what} holds motor factors, -1, 0 and 1: forces are scaled to length 1; which axes it "
                f"makes can be told, moments in N m cannot; {said}"
            )
            return chosen[0] / np.maximum(np.linalg.norm(chosen[0][:3], axis=0), 1e-12), stated
        notes.append(f"{what}: {said}")
        return chosen[0], stated
    if fits:
        chosen = fits[0]
        others = [r for r in fits[1:] if not np.array_equal(r[0], chosen[0])]
        if place is not None and np.isin(raw, (-1.0, 0.0, 1.0)).all():
            notes.append(
                f"{QUESTION}{what} holds -1, 0 and 1 only, like motor factors; taken as {chosen[1]}, a guess; "
                f"{ROWS_OPTION} (or ArduSub's roll,pitch,yaw,throttle,forward,lateral) says what the rows are"
            )
        if others:
            notes.append(
                f"{QUESTION}{what} reads as {chosen[1]} and as {others[0][1]}; the first is taken, a guess; "
                f"{ROWS_OPTION} says what the rows are"
            )
        elif chosen is not read[0]:
            notes.append(f"{what}: {chosen[1]}, inferred: only so every force has length 1 and no moment is along it")
        return chosen[0], False
    chosen = (unit or read)[0]
    if place is not None:
        _refuse(chosen, bool(unit), f"{place}: {what}")
    return chosen[0], False


def _along(wrench: Array) -> bool:
    """Whether a moment lies along its own force by more than a propeller's reaction makes."""
    along = np.abs(np.sum(wrench[:3] * wrench[3:], axis=0)) / np.maximum(np.linalg.norm(wrench[:3], axis=0), 1e-12)
    return bool((along > _TWIST_M).any())


def _refuse(chosen: tuple[Array, str, WrenchOrder], unit: bool, what: str) -> None:
    matrix = chosen[0]
    if np.isin(matrix, (-1.0, 0.0, 1.0)).all():
        raise PlacedError(
            f"{what} holds -1, 0 and 1 only, like motor factors; say {ROWS_OPTION} or whatever its rows are "
            f"(ArduSub: roll,pitch,yaw,throttle,forward,lateral), or hold it against a geometry with --matrix"
        )
    if unit:
        along = np.abs(np.sum(matrix[:3] * matrix[3:], axis=0))
        raise PlacedError(
            f"{what} read as {chosen[1]}: column {int(np.argmax(along)) + 1} has {along.max():.3g} N m along its own "
            f"force, which no thruster makes; say what the rows are, for instance {ROWS_OPTION}"
        )


def nearest(
    raws: Iterable[Array], geometry: Array, orders: Sequence[WrenchOrder], frames: Sequence[str]
) -> tuple[Array, str]:
    """Of all ways of reading numbers, the one in FRD of which most entries agree with a geometry, shape (6, n).

    The first way wins a tie; the words say which it was and how many entries agree, and in the plain way.
    """
    found: list[tuple[int, Array, str]] = []
    for raw in raws:
        for way, words in candidate_layouts(raw):
            for order in orders:
                for frame in ("FRD",) if order.throttle else frames:
                    wrench = order.wrench(way)
                    wrench = wrench_rows_to_frd(wrench) if frame == "FLU" else wrench
                    if wrench.shape == geometry.shape:
                        agree = matching_entries(wrench, geometry)
                        found.append((agree, wrench, f"{words}, {order.words}, {frame}"))
    if not found:
        return np.zeros((6, 0)), ""
    best = max(found, key=lambda entry: entry[0])
    return best[1], f"{best[2]}: {best[0]} of {geometry.size} entries agree so, {found[0][0]} as {found[0][2]}"


def matching_entries(stated: Array, geometry: Array) -> int:
    """How many entries agree: in value, or in sign where the matrix holds signs only."""
    largest = np.maximum(np.abs(geometry).max(axis=1, keepdims=True), 1e-12)
    if is_signs(stated):
        signs = np.where(np.abs(geometry) > UNIT_SLACK * largest, np.sign(geometry), 0.0)
        return int(np.sum(stated == signs))
    return int(np.sum(np.abs(stated - geometry) <= 1e-3))
