"""YAML of other projects: allocation matrices, thruster geometry, and tables of parameters.

Keys of a YAML file that no reader took: named, and questioned where they may change what was read.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.parsed_vehicle import QUESTION, Frame, ParsedVehicle
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.thruster_checks import claims_in, compare_names, require_count, require_same_count
from wakewise.robot.importers.thruster_lists import LOOKS_LIKE_THRUSTERS, listed_names, read_geometry
from wakewise.robot.importers.wrench_rows import (
    WrenchOrder,
    component_in_comment,
    order_in_comment,
    order_of,
    order_of_one,
    resolve_order,
)
from wakewise.robot.importers.xml import PlacedError
from wakewise.robot.importers.yaml_parameters import Entries, read_parameters

_TURNING = re.compile(
    r"flip|revers|invert|negat|mirror|backward|multipl|(^|_)signs?(_|$)|polarity|spin|(^|_)directions?$"
    r"|(^|_)(left_|right_)?hand(ed|edness)?(_|$)|(^|_)c?cw(_|$)|clockwise",
    re.IGNORECASE,
)
_SWITCH = re.compile(r"(^|_)(active|enabled?)(_|$)", re.IGNORECASE)
_OFF = re.compile(r"(^|_)(inactive|disabled?)(_|$)", re.IGNORECASE)
_LOWER = re.compile(r"min|lower", re.IGNORECASE)
"""Keys of lower ends, which are negative in any thruster."""
_NO = frozenset({"false", "no", "off", "0", "0.0", ""})
_HANDS = frozenset({"cw", "ccw", "clockwise", "counterclockwise", "counter_clockwise", "left", "reverse", "reversed"})
_NEGATIVE = re.compile(r"-\s*(\d+\.?\d*|\.\d+)(e[-+]?\d+)?")
_ODD_UNITS = re.compile(
    r"[cm]m|in|inch(es)?|ft|feet|foot|(centi|milli)(meter|metre)s?|k?gf|lb[sf]?|pounds?|g|grams?|percent|%|deg(ree)?s?"
)
_SI_UNITS = re.compile(r"m|meters?|metres?|kg|n|newtons?|n\*?m|rad(ian)?s?|s|si")
_ASKED = 6


def title(path: tuple[str, ...]) -> str:
    """Keys that lead to a value, joined by dots."""
    return ".".join(key for key in path if key)[:80]


def words_in(text: str) -> frozenset[str]:
    """Words of a name in snake case or camel case, in lower case."""
    return frozenset(word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", text))


def list_unused_keys(root: YamlNode) -> list[str]:
    """Keys that no reader took, each once; those that may turn or stop a thrust, or name a unit, are questioned."""
    parents = {path[:-1] for path, item in root.walk() if item.seen or any(below.seen for _, below in item.walk_all())}
    plain: dict[str, list[tuple[str, ...]]] = {}
    doubts: dict[tuple[str, str], list[tuple[str, ...]]] = {}
    for path, item in root.unread():
        inner = [(at, _doubt(at, one, parents)) for at, one in [(path, item), *item.walk(path)]]
        for at, why in inner:
            if why:
                doubts.setdefault((at[-1], why), []).append(at)
        if not inner[0][1]:
            plain.setdefault(path[-1], []).append(path)
    for (key, _), places in doubts.items():
        places.extend(plain.pop(key, []))
    asked = [f"{QUESTION}not read: {_said(key, places)}, which {why}" for (key, why), places in doubts.items()]
    notes = asked[:_ASKED]
    if len(asked) > _ASKED:
        rest = ", ".join(key[:60] for key, _ in list(doubts)[_ASKED:])
        notes.append(f"{QUESTION}not read: {rest[:200]}, of the same kind")
    if plain:
        more = f" and {len(plain) - 20} more" if len(plain) > 20 else ""
        notes.append(f"not read: {', '.join([_said(*entry) for entry in plain.items()][:20])}{more}")
    return notes


def _said(key: str, places: list[tuple[str, ...]]) -> str:
    return title(places[0]) if len(places) == 1 else f"{key[:60]} ({len(places)} times)"


def _doubt(path: tuple[str, ...], item: YamlNode, parents: set[tuple[str, ...]]) -> str:
    """What an unread key may mean for what was read; "" if nothing."""
    key, texts = path[-1], [item.value, *(below.value for _, below in item.walk_all())]
    values = [text.strip().lower() for text in texts if isinstance(text, str)]
    if not item.table() and any(_ODD_UNITS.fullmatch(value) for value in values):
        return "names a unit that is not taken"
    if words_in(key) & {"unit", "units"} and not all(_SI_UNITS.fullmatch(value) for value in values):
        return "names a unit that is not taken"
    among = any(LOOKS_LIKE_THRUSTERS.search(part) for part in path[:-1])
    if not (among or LOOKS_LIKE_THRUSTERS.search(key) or path[:-1] in parents):
        return ""
    if _SWITCH.search(key):
        return "may switch a thrust off" if any(value in _NO for value in values) else ""
    if _OFF.search(key):
        return "may switch a thrust off" if any(value not in _NO for value in values) else ""
    # In a list 0 may be the number of a thruster, by itself it says no.
    neutral = _NO if isinstance(item.value, str) else _NO - {"0"}
    if re.search("multipl", key, re.IGNORECASE):
        neutral |= {"1", "1.0", "+1"}
    if _TURNING.search(key) and any(value not in neutral for value in values):
        return "may turn the thrust round"
    alone = among and isinstance(item.value, str) and not _LOWER.search(key)
    return "may turn the thrust round" if alone and (values[0] in _HANDS or _NEGATIVE.fullmatch(values[0])) else ""


_MATRIX_KEY = re.compile(
    r"(^|_)(tam|b_matrix|mixer|mixing)(_|$)|allocation|configuration_matrix|thruster_matrix|thrust_matrix|input_matrix$",
    re.IGNORECASE,
)
_NOT_MATRIX = re.compile(r"weight|controller|update|rate|slack|topic|solver", re.IGNORECASE)
_DOWN_WORDS = re.compile(r"(^|[^a-z])(ned|frd|fsd)([^a-z]|$)", re.IGNORECASE)
_WORLD_WORDS = frozenset({"world", "odom", "map", "inertial", "earth", "global", "local"})
_BODY_WORDS = frozenset({"body", "base", "baselink", "vehicle", "robot"})
_BARE_WORDS = frozenset({"frame", "frames", "id", "tf", "name", "convention"})
_UP_WORDS = re.compile(r"(^|[^a-z])(enu|flu|nwu)([^a-z]|$)", re.IGNORECASE)


def read_yaml(root: YamlNode, name: str, found: ParsedVehicle, rows: WrenchOrder | None = None) -> None:
    """Fill in what a YAML file says about a vehicle; `rows` is what the user says the rows of a matrix are.

    Raises InputError if it holds no matrix, no thruster geometry and no vehicle parameters, or a matrix of the wrong
    shape.
    """
    if not root.table():
        raise PlacedError(
            f"{root.place}: holds no table of values; vehicles are read from URDF, xacro, SDF, Stonefish (.scn), YAML"
        )
    if "thruster_layout" in root.table() and root.get("does_not_claim") is not None:
        raise PlacedError(f"{root.place}: is already a Wakewise vehicle file; use it where a vehicle is asked for")
    entries = list(root.walk())
    geometry = read_geometry(entries, found)
    matrix = _matrix(root, entries, found, rows, flown=not geometry)
    require_same_count(entries, found)
    found.claims += claims_in(entries)
    parameters = read_parameters(entries, found)
    alike = [(path, item) for path, item in entries if LOOKS_LIKE_THRUSTERS.search(path[-1]) and _holds_figures(item)]
    if not (geometry or matrix or parameters):
        where = f" (line {alike[0][1].place.line})" if alike else ""
        said = f"; {title(alike[0][0])}{where} is of a form that is not known" if alike else ""
        raise PlacedError(
            f"{root.place}: {name} holds no allocation matrix, no thruster positions with directions, "
            f"and no vehicle parameters under a key that is known{said}"
        )
    if alike and not (geometry or matrix):
        where = alike[0][1].place.short
        names = ", ".join(title(path) for path, _ in alike[:4])
        found.notes.append(
            f"{QUESTION}not read: {names}, which look like thrusters in a form that is not known ({where})"
        )
        for _, item in alike:
            item.seen = True
    found.frame, found.frame_why = _frame(root, entries, found, geometry=geometry)
    if geometry and not found.thrust_rule:
        found.thrust_rule = "positive thrust pushes along the directions that the file lists"
    found.notes += list_unused_keys(root)


def read_matrix_only(root: YamlNode, found: ParsedVehicle, rows: WrenchOrder | None = None) -> None:
    """Find the allocation matrix of a YAML file, for comparison with a geometry.

    Raises InputError if there is none.
    """
    entries = list(root.walk())
    if not _matrix(root, entries, found, rows, flown=False):
        raise PlacedError(f"{root.place}: holds no allocation matrix under a key that is known")
    found.frame, found.frame_why = _frame(root, entries, found, geometry=False)


_ALONE = 0.9
_LIFT_M = 1e-3
_NEAR_LINES = 40
"""How far from the thrusters or the matrix a comment on their frame may stand."""


def _holds_figures(item: YamlNode) -> bool:
    """Whether an item that no reader took is a list of numbers, of lists or of tables, or a table of tables."""
    if item.seen or any(below.seen for _, below in item.walk_all()):
        return False
    tables = [member for member in item.table().values() if member.table()]
    return item.is_numbers() or any(not isinstance(member.value, str) for member in item.items()) or len(tables) > 1


def _frame(root: YamlNode, entries: Entries, found: ParsedVehicle, *, geometry: bool) -> tuple[Frame, str]:
    """FRD or FLU from the file's own frames, names of thrusters, or a comment; else a guess that is questioned."""
    if found.frame_why:
        return found.frame, found.frame_why
    named = _named_frame(entries, found)
    if named is not None:
        return named
    here = found.thrusters[0].place.line if found.thrusters else found.matrix_line
    spoken = {
        frame: place
        for text, place in root.comments
        if here is None or abs(place.line - here) <= _NEAR_LINES
        for pattern, frame in ((_DOWN_WORDS, "FRD"), (_UP_WORDS, "FLU"))
        if pattern.search(text)
    }
    names = [t.name for t in found.thrusters] or listed_names(entries, found.matrix) or found.column_names
    placed = _geometry(found)
    votes = compare_names(names, *placed) if names and len(names) == len(placed[0]) else None
    if votes is not None and votes.frame:
        if spoken and votes.frame not in spoken:
            found.notes.append(f"{QUESTION}a comment names {next(iter(spoken))}, the names of the thrusters do not")
        return ("FLU" if votes.frame == "FLU" else "FRD"), f"inferred: {votes.words}"
    if found.p_G_m is not None and found.p_buoyancy_m is not None:
        lift_m = float(found.p_buoyancy_m[2] - found.p_G_m[2])
        if abs(lift_m) > _LIFT_M:
            why = (
                "inferred: so the centre of buoyancy is above the centre of gravity, as a vehicle needs; no key says so"
            )
            return ("FLU", why) if lift_m > 0.0 else ("FRD", why)
    if len(spoken) == 1:
        frame, place = next(iter(spoken.items()))
        why = f"inferred: a comment says so, no key does ({place.short})"
        return ("FRD", why) if frame == "FRD" else ("FLU", why)
    what = "thruster positions" if geometry else "the matrix"
    if found.thrusters or found.matrix is not None:
        found.frame_doubt = (
            f"{QUESTION}the frame of {what} is a guess: no key, name of a thruster or comment says it; "
            f"--frame FLU or --frame FRD does"
        )
    if geometry:
        return "FRD", "inferred: lists of thruster positions in this form are FRD; no key says so"
    return "FLU", "inferred: ROS files state matrices in base_link, which is FLU; no key says so"


def _named_frame(entries: Entries, found: ParsedVehicle) -> tuple[Frame, str] | None:
    """Frame that a key names: of the body before a bare frame before any other; keys of the world's frame do not count.

    Raises InputError if two keys name different frames of the body.
    """
    ranked: list[tuple[int, Frame, str, YamlNode]] = []
    for path, item in entries:
        # Only names of frames count; a topic may mention either.
        if not isinstance(item.value, str) or not re.search(r"frame|tf", " ".join(path), re.IGNORECASE):
            continue
        down, up = _DOWN_WORDS.search(item.value), _UP_WORDS.search(item.value)
        rank = _rank(path, item.value)
        if rank is not None and (down or up):
            ranked.append((rank, "FRD" if down else "FLU", path[-1], item))
    if not ranked:
        return None
    best = min(rank for rank, *_ in ranked)
    ranked = [entry for entry in ranked if entry[0] == best]
    _, frame, key, item = ranked[0]
    said = f"{key} is {item.value} ({item.place.short})"
    for _, other, name, against in ranked[1:]:
        if other != frame and best == 0:
            raise PlacedError(
                f"{against.place}: {name} is {against.value}, but {said}; both name the body's frame, which is one"
            )
        if other != frame:
            found.notes.append(
                f"{QUESTION}frames differ: {said}, which is taken, and {name} is {against.value} "
                f"({against.place.short})"
            )
            break
    item.seen = True
    return frame, f"detected: {said}"


def _rank(path: tuple[str, ...], value: str) -> int | None:
    """0 for a key of the body's frame, 1 for a bare frame, 2 for any other, None for the world's."""
    own = words_in(path[-1])
    bare = own <= _BARE_WORDS
    around = [own, *(words_in(key) for key in path[-2::-1])] if bare else [own]
    told = next((words for words in around if words & (_WORLD_WORDS | _BODY_WORDS)), frozenset[str]())
    if told & _WORLD_WORDS or (words_in(value) & _WORLD_WORDS and not words_in(value) & _BODY_WORDS):
        return None
    return 0 if told else 1 if bare else 2


def _geometry(found: ParsedVehicle) -> tuple[Array, Array]:
    """Places and axes, each (n, 3), of the thrusters; of a matrix what its columns along x and along z tell of them."""
    if found.thrusters or found.matrix is None:
        return np.array([t.p_m for t in found.thrusters]), np.array([t.axis for t in found.thrusters])
    force, moment = found.matrix[:3].T, found.matrix[3:].T
    places = np.zeros_like(force)
    for place, f, m in zip(places, force, moment, strict=True):
        # From moment = place x force; what a column does not tell stays 0, which says nothing.
        if abs(f[0]) > _ALONE and np.all(f[1:] == 0.0):
            place[1:] = -m[2] / f[0], m[1] / f[0]
        elif abs(f[2]) > _ALONE and np.all(f[:2] == 0.0):
            place[:2] = -m[1] / f[2], m[0] / f[2]
    return places, force


def _matrix(root: YamlNode, entries: Entries, found: ParsedVehicle, rows: WrenchOrder | None, *, flown: bool) -> bool:
    for path, item in entries:
        key = path[-1]
        if not _MATRIX_KEY.search(key) or _NOT_MATRIX.search(key):
            continue
        raw, order = _numbers(key, item, found)
        if raw is None:
            continue
        if raw.ndim == 2 and 6 not in raw.shape:
            raise PlacedError(f"{item.place}: {key} has shape {raw.shape}, must be (6, n), a column per thruster")
        if 0 in raw.shape:
            raise PlacedError(f"{item.place}: {key} has no columns, must have one per thruster")
        n = raw.size // 6
        require_count(n, f"{item.place}: {key}: ")
        order = rows or order or _stated_order(root, path, item, entries)
        found.matrix, stated = resolve_order(raw, order, key, item.place if flown else None, found.notes)
        found.matrix_name, found.matrix_line, found.raw_matrix = key, item.place.line, None if stated else raw
        if order is not None and order.throttle:
            how = "inferred" if order.why.startswith("inferred") else "detected"
            found.frame, found.frame_why = "FRD", f"{how}: {key} is of throttle, up, and lateral, to the right"
        found.notes.append(f"allocation matrix: {key}, 6 x {n} ({item.place.short})")
        return True
    return False


def _numbers(key: str, item: YamlNode, found: ParsedVehicle) -> tuple[Array | None, WrenchOrder | None]:
    """Numbers of a matrix as they stand, and their order where each row has a name; None if these are none."""
    named = order_of(list(item.table()), f"names of the rows of {key}") if len(item.table()) == 6 else None
    if named is not None:
        rows = [row.numbers(f"row {name} of {key}") for name, row in item.table().items()]
        lengths = {len(row) for row in rows}
        if len(lengths) != 1 or 0 in lengths:
            raise PlacedError(f"{item.place}: {key} has rows of {sorted(lengths)} numbers, all must be of one length")
        return np.stack(rows), named
    if item.is_matrix():
        return item.rows(key), None
    if item.is_numbers():
        flat = item.numbers(key)
        if len(flat) % 6:
            raise PlacedError(f"{item.place}: {key} has {len(flat)} numbers, must be 6 rows")
        return flat, None
    if item.table() and all(len(column.items()) == 6 and column.is_numbers() for column in item.table().values()):
        found.notes.append(f"{key}: six numbers for each of {', '.join(item.table())[:120]}")
        found.column_names = list(item.table())
        return np.stack([column.numbers(f"{name} of {key}", 6) for name, column in item.table().items()]), None
    members = item.items() or list(item.table().values())
    tables = [{name: v for name, v in m.table().items() if order_of_one(name)} for m in members]
    alike = {tuple(table) for table in tables}
    order = order_of(next(iter(alike)), f"keys of each thruster in {key}") if len(alike) == 1 else None
    if order is not None:
        found.column_names = list(item.table())
        return np.array([[v.scalar(f"{name} of {key}") for name, v in table.items()] for table in tables]), order
    if item.items():
        found.notes.append(
            f"{QUESTION}{key} is not read, neither rows nor columns of numbers ({item.place.file.name}:"
            f"{item.place.line})"
        )
    return None, None


def _stated_order(root: YamlNode, path: tuple[str, ...], item: YamlNode, entries: Entries) -> WrenchOrder | None:
    """Order that a list of six names beside the matrix states, or a comment; None if none does, or several differ."""
    beside = [(p, e) for p, e in entries if p[:-1] == path[:-1]] or entries
    for key, entry in [*beside, *entries]:
        labels = [member.value for member in entry.items() if isinstance(member.value, str)]
        if isinstance(entry.value, str):
            labels = re.split(r"[,;\s]+", entry.value.strip())
        order = order_of(labels, f"{key[-1]} says so") if len(labels) in (len(entry.items()), 6) else None
        if order is not None:
            entry.seen = True
            return order
    at = {place.line: text for text, place in root.comments}
    if len(item.items()) == 6 and item.is_matrix():
        labels = [component_in_comment(at.get(row.place.line, "")) for row in item.items()]
        order = order_of(labels, "comments beside the rows say so")
        if order is not None:
            return order
    spoken = {order.words.lower(): (order, place) for text, place in root.comments if (order := order_in_comment(text))}
    if len(spoken) != 1:
        return None
    order, place = next(iter(spoken.values()))
    return replace(order, why=f"inferred: a comment says so, {place.short}")
