"""Lists of thrusters in YAML: one table for each, with its position, direction or angles, limits and sense."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.robot.importers.angles import read_angles, unit_of
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle
from wakewise.robot.importers.robot_description import pose_of
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.thruster_checks import is_unit, require_count
from wakewise.robot.importers.xml import PlacedError
from wakewise.robot.importers.yaml_parameters import Entries, vector3

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
            axis = unit_axis(p.axis, p.item, p.name)
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
        found.derived["thruster_limits"] = f"{found.kind} {found.file.name}: {', '.join(bounded)}"


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
            # The angles (1, 0, 0) are nobody's; as a direction they are.
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


def unit_axis(axis: Array, item: YamlNode, name: str) -> Array:
    """An axis of length 1; refuses one of length 0."""
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise PlacedError(f"{item.place}: {name}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    return axis / length


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
