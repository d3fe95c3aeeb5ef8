"""Thruster geometry in YAML: matrices of positions and directions or angles, and lists of thrusters with poses."""

from __future__ import annotations

import re

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.angles import read_angles, unit_of
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle
from wakewise.robot.importers.robot_description import pose_of
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.thruster_checks import is_unit, require_count
from wakewise.robot.importers.thruster_lists import (
    POSES,
    TURN_RULE,
    read_list,
    require_direction,
    unit_axis,
)
from wakewise.robot.importers.xml import PlacedError
from wakewise.robot.importers.yaml_parameters import Entries, find

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

    Raises
    ------
    InputError
        If what stands there cannot be read in one way only.
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
    found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: thruster positions and directions"
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
        axis = unit_axis(axes[:, i], directions, name)
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
    found.derived["thruster_limits"] = f"{found.kind} {found.file.name}:{high.place.line}"
