"""Lists of thrusters in YAML: one table for each, with its position, direction or angles, limits and sense.

Thruster geometry in YAML: matrices of positions and directions or angles, and lists of thrusters with poses.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.robot.importers.angles import read_angles, unit_of
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle, unit_axis
from wakewise.robot.importers.robot_description import pose_of
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.thruster_checks import is_unit, require_count
from wakewise.robot.importers.xml import PlacedError
from wakewise.robot.importers.yaml_parameters import Entries, find, vector3

_BARE = re.compile(r"^thrusters?(_list)?$", re.IGNORECASE)
_NUMBERED = re.compile(r"^thruster_?\d+$", re.IGNORECASE)
_POSITION_KEYS = ("position", "xyz", "pos", "location", "p", "translation")
_DIRECTION_KEYS = ("direction", "axis", "force_direction", "thrust_direction", "dir")
_ANGLE_KEY = re.compile(r"^(rpy|euler|euler_angles|angles|orientation|rotation)(_(deg|rad)\w*)?$", re.IGNORECASE)
_SCALAR_ANGLE = re.compile(r"^(roll|pitch|yaw)(_(deg|rad)\w*)?$", re.IGNORECASE)
_MAYBE_DIRECTION = re.compile(r"orientation|rotation|angles", re.IGNORECASE)
_SLACK = 1e-3
_TWELFTH = np.pi / 12.0
_BOUNDS = re.compile(r"^(thrust|force)_?(bounds|limits|range)(_n)?$", re.IGNORECASE)
_HIGHEST = re.compile(r"^max_(thrust|force)(_n)?$", re.IGNORECASE)
LOOKS_LIKE_THRUSTERS = re.compile(r"thruster|motor|propeller|rotor|actuator", re.IGNORECASE)
POSES = re.compile(r"^(thrusters?_)?poses?(_(deg|rad)\w*)?$", re.IGNORECASE)
TURN_RULE = "inferred: positive thrust pushes along +x of each thruster's frame"


@dataclass(eq=False)
class _Placed:
    """A thruster of a list: where, and its direction or its angles (with the key that they stand under)."""

    name: str
    item: YamlNode
    p_m: Array
    axis: Array | None = None
    R: Array | None = None
    angles: Array | None = None
    key: str = ""


def read_list(entries: Entries, found: ParsedVehicle) -> tuple[str, ...]:
    """Thrusters as a list or table of tables, each with a position and a direction or angles, or with a pose.

    Returns the keys that lead to the list, () if there is none.
    """
    for path, item in [*entries, *_numbered(entries)]:
        if not LOOKS_LIKE_THRUSTERS.search(path[-1]):
            continue
        members = (
            [(f"thruster{i}", member) for i, member in enumerate(item.items())]
            if item.items()
            else [(key, member) for key, member in item.table().items()]
        )
        tables = [(name, member) for name, member in members if member.table()]
        if _BARE.match(path[-1]) and item.is_matrix() and {len(row.items()) for row in item.items()} <= {6, 7}:
            raise PlacedError(
                f"{item.place}: {path[-1]} are rows of {len(item.items()[0].items())} numbers: poses or columns of a "
                f"matrix? call them thruster_poses or tam"
            )
        placed = [_placed(name, member) for name, member in tables]
        located = [p for p in placed if p is not None]
        if not located:
            continue
        _require_all_placed(members, placed, tables, listed=bool(item.items()), found=found)
        require_count(len(located), f"{item.place}: ")
        _turn(located, found)
        flipped: list[str] = []
        bounded: dict[str, None] = {}
        for p in located:
            if p.axis is None:
                raise PlacedError(f"{p.item.place}: {p.name} has a position but no direction, which is needed too")
            given = p.item.get("name", "id")
            label = p.name if given is None else given.words() or p.name
            axis = unit_axis(p.axis, f"{p.item.place}: {p.name}")
            if p.R is None:
                require_direction(p.axis, p.item, p.name)
            thruster = ParsedThruster(label, p.p_m, axis, p.item.place, p.R)
            _sense(p.item, thruster, flipped)
            _bounds(p.item, thruster, bounded)
            found.thrusters.append(thruster)
        _tell(flipped, bounded, found)
        if any(t.R_BT is not None for t in found.thrusters):
            found.thrust_rule = TURN_RULE
        return path
    return ()


def _sense(item: YamlNode, thruster: ParsedThruster, flipped: list[str]) -> None:
    """`flipped: true` turns a thruster's force round, as in robosub files; other words for it are not sure."""
    value = item.get("flipped")
    if value is None:
        return
    word = value.words().strip().lower()
    if word not in {"true", "false", "yes", "no", "1", "0"}:
        raise PlacedError(f"{value.place}: flipped of {thruster.name} must be true or false")
    if word in {"true", "yes", "1"}:
        thruster.axis = -thruster.axis
        flipped.append(thruster.name)


def _bounds(item: YamlNode, thruster: ParsedThruster, bounded: dict[str, None]) -> None:
    """Limits of a thruster's own, in newton, as two numbers or as a largest and a smallest thrust."""
    for key, value in item.table().items():
        if _BOUNDS.match(key) and len(value.items()) == 2 and value.is_numbers():
            low, high = value.numbers(f"{key} of {thruster.name}")
        elif _HIGHEST.match(key) and (lowest := item.get(key.replace("max", "min"))) is not None:
            high, low = value.scalar(key), lowest.scalar(key.replace("max", "min"))
        else:
            continue
        if not low <= 0.0 <= high or low == high:
            raise PlacedError(
                f"{value.place}: {key} of {thruster.name} {low:g} and {high:g} must be on both sides of 0"
            )
        if max(high, -low) <= 1.0:
            # A share of the full thrust, or a command: no newtons.
            value.seen = False
            continue
        thruster.max_forward_N, thruster.max_reverse_N = float(high), float(-low)
        bounded[key] = None
        return


def _tell(flipped: list[str], bounded: dict[str, None], found: ParsedVehicle) -> None:
    if flipped:
        found.notes.append(
            f"flipped: the thrust of {', '.join(flipped)[:300]} is turned round, as the file's word says"
        )
    if bounded:
        found.notes.append(f"thrust limits: {', '.join(bounded)} of each thruster, taken as newtons")
        found.derived["thruster_limits"] = f"{found.origin}: {', '.join(bounded)}"


def _numbered(entries: Entries) -> Entries:
    """Tables `thruster_1`, `thruster_2` ... beside one another, as if they stood below `thrusters`."""
    groups: dict[tuple[str, ...], dict[str, YamlNode]] = {}
    for path, item in entries:
        if _NUMBERED.match(path[-1]) and item.table():
            groups.setdefault(path[:-1], {})[path[-1]] = item
    return [((*path, "thrusters"), YamlNode(group, next(iter(group.values())).place)) for path, group in groups.items()]


def _require_all_placed(
    members: list[tuple[str, YamlNode]],
    placed: list[_Placed | None],
    tables: list[tuple[str, YamlNode]],
    *,
    listed: bool,
    found: ParsedVehicle,
) -> None:
    """Refuse a list that places some thrusters and not others: none is dropped."""
    if listed and len(tables) != len(members):
        name, member = next((n, m) for n, m in members if not m.table())
        raise PlacedError(f"{member.place}: {name} is not a table with a position, as the other thrusters are")
    for (name, member), p in zip(tables, placed, strict=True):
        if p is not None:
            continue
        keys = [key for key in member.table() if key in _DIRECTION_KEYS or _ANGLE_KEY.match(key)]
        if listed or keys:
            raise PlacedError(f"{member.place}: {name} has no position that can be read, the other thrusters have one")
        found.notes.append(f"{QUESTION}entry {name} beside the thrusters has no position; it is not taken for one")


def _turn(located: list[_Placed], found: ParsedVehicle) -> None:
    """Turn angles into frames; thrusters whose angles stand under one key share a unit."""
    for key in dict.fromkeys(p.key for p in located if p.angles is not None):
        group = [p for p in located if p.key == key and p.angles is not None]
        for p in group:
            # (1, 0, 0) is implausible as angles, and common as a direction.
            unit = p.angles is not None and abs(float(np.linalg.norm(p.angles)) - 1.0) < _SLACK
            if unit and _MAYBE_DIRECTION.search(key) and unit_of(key) == "":
                raise PlacedError(
                    f"{p.item.place}: {p.name}: {key} has length 1: direction or angles? say direction or rpy"
                )
        what = f"{key} of {group[0].name}" if len(group) == 1 else f"{key} of the thrusters"
        rows, note = read_angles([(p.angles, p.item.place) for p in group if p.angles is not None], what, key)
        found.notes += [note] if note else []
        for p, row in zip(group, rows, strict=True):
            p.R = pose_of(np.zeros(3), row).R
            p.axis = p.R[:, 0]


def _placed(name: str, member: YamlNode) -> _Placed | None:
    pose_key = next((key for key in member.table() if POSES.match(key)), None)
    if pose_key is not None:
        pose = member.table()[pose_key]
        if pose.table():
            inner = _placed(name, pose)
            if inner is None:
                raise PlacedError(f"{pose.place}: {pose_key} of {name} has no position that can be read")
            inner.item = member
            return inner
        values = pose.numbers(f"{pose_key} of {name}", 6)
        return _with_direction(_Placed(name, member, values[:3], angles=values[3:], key=pose_key), member)
    item = member.get(*_POSITION_KEYS)
    if item is not None:
        place = vector3(item, "position")
    elif all(key in member.table() for key in "xyz"):
        place = np.array([member.table()[key].scalar(key) for key in "xyz"])
    else:
        return None
    return _with_direction(_Placed(name, member, place), member)


def _with_direction(placed: _Placed, member: YamlNode) -> _Placed:
    item = member.get(*_DIRECTION_KEYS)
    if item is not None:
        placed.axis, placed.angles, placed.key = vector3(item, "direction"), None, ""
        return placed
    for key, value in member.table().items():
        if _ANGLE_KEY.match(key):
            if all(part in value.table() for part in "xyzw"):
                placed.R = _quaternion(value, placed.name)
                placed.axis, placed.angles = placed.R[:, 0], None
            elif len(value.items()) == 4:
                raise PlacedError(
                    f"{value.place}: {key} of {placed.name} has 4 numbers: a quaternion's order is not known, write "
                    f"{{x: ., y: ., z: ., w: .}}"
                )
            else:
                placed.angles, placed.key = vector3(value, "angles"), key
            return placed
    scalars = [key for key in member.table() if _SCALAR_ANGLE.match(key)]
    if scalars and placed.angles is None:
        units = {unit_of(key) for key in scalars}
        if len(units) > 1:
            raise PlacedError(f"{member.place}: {placed.name}: {', '.join(scalars)} are of different units")
        angles = np.zeros(3)
        for key in scalars:
            angles["rpy".index(key[0].lower())] = member.table()[key].scalar(f"{key} of {placed.name}")
        placed.angles = angles
        placed.key = {"degrees": "rpy_deg", "radians": "rpy_rad", "": "roll, pitch, yaw"}[units.pop()]
    return placed


def _quaternion(item: YamlNode, name: str) -> Array:
    w, x, y, z = (item.table()[part].scalar(f"{part} of {name}") for part in "wxyz")
    length = float(np.linalg.norm([w, x, y, z]))
    if abs(length - 1.0) > 0.01:
        raise PlacedError(f"{item.place}: quaternion of {name} has length {length:g}, must be 1")
    return Pose(np.zeros(3), np.array([w, x, y, z]) / length).R


def require_direction(row: Array, item: YamlNode, name: str) -> None:
    """Refuse what stands as a direction and can only be angles: entries of a twelfth of a half turn, or of degrees."""
    length = float(np.linalg.norm(row))
    twelfths = np.abs(row) / _TWELFTH
    odd = (np.abs(row) > 0.1) & (np.abs(twelfths - np.round(twelfths)) < 4e-3)
    if is_unit(length) or (length <= 10.0 and not odd.any()):
        return
    raise PlacedError(
        f"{item.place}: {name}: direction {np.round(row, 6).tolist()} has length {length:g} and looks like angles; "
        f"call the key thruster_rpy (radians) or thruster_rpy_deg, or give directions of length 1"
    )


_NAMES = re.compile(r"^(thrusters?|motors?)(_?(names?|ids?|labels?|order))?$|^names$", re.IGNORECASE)
_POSITIONS = ("thruster_position", "thruster_positions", "positions", "thruster_locations", "locations")
_DIRECTIONS = (
    *("thruster_force_direction", "thruster_force_directions", "thruster_direction_matrix", "thruster_layout"),
    *("thruster_orientation", "thruster_orientations", "thruster_directions", "directions", "orientations", "axes"),
)
_ANGLES = re.compile(
    r"^(thrusters?_)?(rpys?|eulers?|euler_angles|angles|rotations?|orientations?)(_(deg|rad)\w*)?$", re.I
)


def read_geometry(entries: Entries, found: ParsedVehicle) -> bool:
    """Fill in thrusters from positions with directions or angles; False if the file places none.

    Raises InputError if what stands there cannot be read in one way only.
    """
    positions = find(entries, _POSITIONS)
    directions, key = _direction_matrix(entries)
    within: tuple[str, ...] = ()
    if positions is not None and directions is not None:
        _from_matrices(positions, directions, key, entries, found)
    elif not _from_poses(entries, found):
        within = read_list(entries, found)
    if not found.thrusters:
        if positions is not None:
            raise PlacedError(f"{positions.place}: thruster positions without directions, which are needed too")
        return False
    _limits(entries, within, found)
    found.derived["thruster_layout"] = f"{found.origin}: thruster positions and directions"
    return True


def _direction_matrix(entries: Entries) -> tuple[YamlNode | None, str]:
    for key in _DIRECTIONS:
        item = find(entries, (key,))
        if item is not None:
            return item, key
    for path, item in entries:
        if _ANGLES.match(path[-1]) and item.items():
            return item, path[-1]
    return None, ""


def _from_matrices(positions: YamlNode, directions: YamlNode, key: str, entries: Entries, found: ParsedVehicle) -> None:
    places, axes, turned = _columns(positions, directions, key, found)
    if places.shape != axes.shape:
        raise PlacedError(
            f"{directions.place}: {axes.shape[1]} directions for {places.shape[1]} thruster positions, must be as many"
        )
    n = places.shape[1]
    require_count(n, f"{positions.place}: ")
    count = find(entries, ("num",), inside="thrusters")
    if count is not None and round(count.scalar("number of thrusters")) != n:
        raise PlacedError(f"{positions.place}: {n} positions, but num says {count.value}")
    Rs: list[Array | None] = [None] * n
    names = listed_names(entries, axes) or [f"thruster{i}" for i in range(n)]
    if turned:
        rows, note = read_angles([(axes[:, i], directions.place) for i in range(n)], key, key)
        found.notes += [f"{key}: roll, pitch and yaw of each thruster", *([note] if note else [])]
        found.thrust_rule = TURN_RULE
        Rs = [pose_of(np.zeros(3), row).R for row in rows]
        axes = np.stack([R[:, 0] for R in Rs if R is not None], axis=1)
    for i, name in enumerate(names):
        axis = unit_axis(axes[:, i], f"{directions.place}: {name}")
        if not turned:
            require_direction(axes[:, i], directions, name)
        found.thrusters.append(ParsedThruster(name, places[:, i], axis, directions.place, Rs[i]))


def listed_names(entries: Entries, columns: Array | None) -> list[str]:
    """Names of thrusters, one for each column, that stand in a list of their own; [] if none does."""
    if columns is None:
        return []
    for path, item in entries:
        listed = [member.value for member in item.items() if isinstance(member.value, str)]
        if _NAMES.match(path[-1]) and len(listed) == len(item.items()) == columns.shape[1]:
            item.seen = True
            return listed
    return []


def _columns(positions: YamlNode, directions: YamlNode, key: str, found: ParsedVehicle) -> tuple[Array, Array, bool]:
    """Positions and directions (or angles, then True), each 3 x n, by whichever way of writing makes directions unit.

    Three rows of n (as flat lists, too) and n rows of three are both in use; where a list reads both ways, directions
    of unit length decide, for the positions beside them as well.
    """
    ways = _ways(directions, "directions")
    lengths = [np.linalg.norm(way, axis=0) for way in ways]
    units = [bool(is_unit(length).all()) for length in lengths]
    angles = bool(_ANGLES.match(key)) and not any(units)
    if angles and "orient" in key.lower() and unit_of(key) == "" and not _angular(directions):
        raise PlacedError(
            f"{directions.place}: {key} are neither of length 1 nor angles that are known; call them "
            f"thruster_directions, thruster_rpy (radians) or thruster_rpy_deg"
        )
    places = _ways(positions, "positions")
    if len(ways) == 1 and len(places) == 1:
        return places[0], ways[0], angles
    flat = not directions.is_matrix()
    chosen = 0
    if angles:
        # Angles have no length to tell by: one row per thruster, unless they stand as three rows of n.
        if len(ways) > 1:
            raise PlacedError(
                f"{directions.place}: {key} read both ways, as three rows and as rows of three; write one "
                f"{{position: [x, y, z], rpy: [roll, pitch, yaw]}} per thruster"
            )
    elif len(ways) > 1 and not units[0] and units[1]:
        chosen = 1
        found.notes.append(f"{key}: three numbers per thruster, since only so every direction has length 1")
    elif (
        len(ways) > 1
        and all(units)
        and not (np.array_equal(ways[0], ways[1]) and (len(places) == 1 or np.array_equal(places[0], places[1])))
    ):
        if not flat:
            raise PlacedError(
                f"{directions.place}: {key} are 3 x 3 and read both ways, by rows and by columns; write one "
                f"{{position: [x, y, z], direction: [x, y, z]}} per thruster"
            )
        found.notes.append(
            f"{QUESTION}{key} would have length 1 read as three numbers per thruster, too; taken as rows of x, y and z"
        )
    elif len(ways) > 1 and not any(units) and all(length.min() > 1e-6 for length in lengths):
        raise PlacedError(
            f"{directions.place}: {key} are not of length 1, as three rows or as rows of three, so the way of writing "
            f"cannot be told"
        )
    return places[min(chosen, len(places) - 1)], ways[min(chosen, len(ways) - 1)], angles


def _angular(item: YamlNode) -> bool:
    """Whether every number may be an angle: within a turn and a half degree, in radians or in whole degrees."""
    values = np.abs(item.numbers("angles"))
    halves = np.abs(2.0 * values - np.round(2.0 * values)) < 1e-6
    twelfths = values / (np.pi / 36.0)
    nice = np.abs(twelfths - np.round(twelfths)) < 0.03
    return bool(nice.all() or (halves.all() and values.max(initial=0.0) <= 360.0))


def _ways(item: YamlNode, what: str) -> list[Array]:
    """3 x n, the likelier way of reading first: flat lists and 3 x 3 matrices have two."""
    if item.is_matrix():
        matrix = item.rows(what)
        if matrix.shape == (3, 3):
            return [matrix, matrix.T]
        if matrix.shape[1] == 3:
            return [matrix.T]
        if matrix.shape[0] == 3 and matrix.shape[1]:
            return [matrix]
        raise PlacedError(f"{item.place}: {what} have shape {matrix.shape}, must be (3, n) or (n, 3)")
    flat = item.numbers(what)
    if not len(flat) or len(flat) % 3:
        raise PlacedError(f"{item.place}: {what} hold {len(flat)} numbers, must be three rows of one length")
    if len(flat) == 3:
        return [flat.reshape(3, 1)]
    return [flat.reshape(3, -1), flat.reshape(-1, 3).T]


def _from_poses(entries: Entries, found: ParsedVehicle) -> bool:
    """Thrusters as rows of x, y, z, roll, pitch, yaw."""
    for path, item in entries:
        if not (POSES.match(path[-1]) and any("thruster" in key.lower() for key in path) and item.is_matrix()):
            continue
        rows = item.rows(path[-1])
        require_count(len(rows), f"{item.place}: ")
        if rows.shape[1] != 6:
            raise PlacedError(
                f"{item.place}: {path[-1]} have {rows.shape[1]} numbers each, must have 6 (position and angles)"
            )
        angles, note = read_angles([(row[3:], item.place) for row in rows], path[-1], path[-1])
        found.notes += [note] if note else []
        for i, (row, rpy) in enumerate(zip(rows, angles, strict=True)):
            R = pose_of(np.zeros(3), rpy).R
            found.thrusters.append(ParsedThruster(f"thruster{i}", row[:3], R[:, 0], item.place, R))
        found.thrust_rule = TURN_RULE
        return True
    return False


def _limits(entries: Entries, within: tuple[str, ...], found: ParsedVehicle) -> None:
    # A thruster's own limits are read with it; here are those of all.
    common = [(path, item) for path, item in entries if not within or path[: len(within)] != within]
    high, low = find(common, ("max_force", "max_thrust")), find(common, ("min_force", "min_thrust"))
    if high is None or low is None or any(t.max_forward_N is not None for t in found.thrusters):
        return
    forward, reverse = high.scalar("max_force"), -low.scalar("min_force")
    if forward < 0.0 or reverse < 0.0:
        return
    for thruster in found.thrusters:
        thruster.max_forward_N, thruster.max_reverse_N = forward, reverse
    found.derived["thruster_limits"] = f"{found.origin}:{high.place.line}"
