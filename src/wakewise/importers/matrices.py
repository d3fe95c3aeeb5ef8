"""YAML of other projects: allocation matrices, lists of thruster positions and directions, and tables of parameters."""

from __future__ import annotations

import re

import numpy as np

from wakewise.arrays import Array
from wakewise.importers.bodies import pose_of
from wakewise.importers.found import Found, FoundThruster, Frame
from wakewise.importers.xml import PlacedError
from wakewise.importers.yaml_parameters import Entries, find, read_parameters, three
from wakewise.importers.yamls import Item

_MATRIX_KEY = re.compile(
    r"(^|_)(tam|b_matrix|mixer|mixing)(_|$)|allocation|configuration_matrix|thruster_matrix|thrust_matrix|input_matrix$",
    re.IGNORECASE,
)
_NOT_MATRIX = re.compile(r"weight|controller|update|rate|slack|topic|solver", re.IGNORECASE)
_POSITIONS = ("thruster_position", "thruster_positions", "positions", "thruster_locations", "locations")
_DIRECTIONS = (
    *("thruster_force_direction", "thruster_force_directions", "thruster_direction_matrix", "thruster_layout"),
    *("thruster_orientation", "thruster_orientations", "thruster_directions", "directions", "orientations", "axes"),
)
_ROW_NAMES = (("x", "y", "z", "rx", "ry", "rz"), ("fx", "fy", "fz", "mx", "my", "mz"), ("X", "Y", "Z", "K", "M", "N"))
_DOWN_WORDS = re.compile(r"(^|[^a-z])(ned|frd|fsd)([^a-z]|$)", re.IGNORECASE)
_UP_WORDS = re.compile(r"(^|[^a-z])(enu|flu|nwu)([^a-z]|$)", re.IGNORECASE)


def read_yaml(root: Item, name: str, found: Found) -> None:
    """Fill in what a YAML file says about a vehicle.

    Raises
    ------
    InputError
        If it holds no matrix, no thruster geometry and no vehicle parameters, or a matrix of the wrong shape.
    """
    if not root.table():
        raise PlacedError(f"{root.place}: holds no table of values (neither XML nor a vehicle's YAML)")
    if "thruster_layout" in root.table() and root.get("does_not_claim") is not None:
        raise PlacedError(f"{root.place}: is already a Wakewise vehicle file; use it where a vehicle is asked for")
    entries = list(root.walk())
    geometry = _geometry(entries, found)
    matrix = _matrix(entries, found)
    parameters = read_parameters(entries, found)
    if not (geometry or matrix or parameters):
        raise PlacedError(
            f"{root.place}: {name} holds no allocation matrix, no thruster positions with directions, "
            f"and no vehicle parameters under a key that is known"
        )
    found.frame, found.frame_why = _frame(entries, geometry=geometry)
    if geometry and not found.thrust_rule:
        found.thrust_rule = "positive thrust pushes along the directions that the file lists"


def read_matrix_only(root: Item, found: Found) -> None:
    """Find the allocation matrix of a YAML file, for comparison with a geometry.

    Raises
    ------
    InputError
        If there is none.
    """
    entries = list(root.walk())
    if not _matrix(entries, found):
        raise PlacedError(f"{root.place}: holds no allocation matrix under a key that is known")
    found.frame, found.frame_why = _frame(entries, geometry=False)


def _frame(entries: Entries, *, geometry: bool) -> tuple[Frame, str]:
    """FRD or FLU from the names of frames in the file; else what its kind of file uses."""
    for path, item in entries:
        if isinstance(item.value, str):
            for pattern, frame in ((_DOWN_WORDS, "FRD"), (_UP_WORDS, "FLU")):
                # Only names of frames tell; a comment or a topic may mention either.
                if re.search(r"frame|tf", " ".join(path), re.IGNORECASE) and pattern.search(item.value):
                    said = f"detected: {path[-1]} is {item.value} ({item.place.file.name}:{item.place.line})"
                    return ("FRD", said) if frame == "FRD" else ("FLU", said)
    if geometry:
        return "FRD", "inferred: lists of thruster positions in this form are FRD; nothing in the file says so"
    return "FLU", "inferred: ROS files state matrices in base_link, which is FLU; nothing in the file says so"


def _matrix(entries: Entries, found: Found) -> bool:
    for path, item in entries:
        key = path[-1]
        if not _MATRIX_KEY.search(key) or _NOT_MATRIX.search(key):
            continue
        named = next((names for names in _ROW_NAMES if all(name in item.table() for name in names)), None)
        if named is not None:
            rows = [item.table()[row].numbers(f"row {row} of {key}") for row in named]
            lengths = {len(row) for row in rows}
            if len(lengths) != 1 or 0 in lengths:
                raise PlacedError(
                    f"{item.place}: {key} has rows of {sorted(lengths)} numbers, all must be of one length"
                )
            matrix = np.stack(rows)
        elif item.is_matrix():
            matrix = item.rows(key)
        elif item.is_numbers():
            flat = item.numbers(key)
            if len(flat) % 6:
                raise PlacedError(f"{item.place}: {key} has {len(flat)} numbers, must be 6 rows")
            matrix = flat.reshape(6, -1)
        else:
            continue
        if matrix.shape[0] != 6 and matrix.shape[1] == 6:
            found.notes.append(f"{key}: {matrix.shape[0]} rows of 6 are taken for its transpose")
            matrix = matrix.T
        if matrix.shape[0] != 6:
            raise PlacedError(f"{item.place}: {key} has shape {matrix.shape}, must be (6, n), a column per thruster")
        found.matrix, found.matrix_name = matrix, key
        found.notes.append(
            f"allocation matrix: {key}, 6 x {matrix.shape[1]} ({item.place.file.name}:{item.place.line})"
        )
        return True
    return False


def _geometry(entries: Entries, found: Found) -> bool:
    positions = find(entries, _POSITIONS)
    directions = find(entries, _DIRECTIONS)
    if positions is not None and directions is not None:
        places, axes = _columns(positions, "positions"), _columns(directions, "directions")
        if places.shape != axes.shape:
            raise PlacedError(
                f"{directions.place}: {axes.shape[1]} directions for {places.shape[1]} thruster positions, "
                f"must be as many"
            )
        count = find(entries, ("num",), inside="thrusters")
        if count is not None and round(count.scalar("number of thrusters")) != places.shape[1]:
            raise PlacedError(f"{positions.place}: {places.shape[1]} positions, but num says {count.value}")
        for i in range(places.shape[1]):
            found.thrusters.append(
                FoundThruster(
                    f"thruster{i}", places[:, i], _axis(axes[:, i], directions, f"thruster{i}"), directions.place
                )
            )
    else:
        _listed(entries, found)
    if not found.thrusters:
        if positions is not None:
            raise PlacedError(f"{positions.place}: thruster positions without directions, which are needed too")
        return False
    _limits(entries, found)
    found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: thruster positions and directions"
    return True


def _axis(axis: Array, item: Item, name: str) -> Array:
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise PlacedError(f"{item.place}: {name}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    return axis / length


def _columns(item: Item, what: str) -> Array:
    """3 x n: from a flat list in rows (x..., y..., z...), from three rows, or from n rows of three."""
    if item.is_matrix():
        matrix = item.rows(what)
        if matrix.shape[1] == 3 and matrix.shape[0] != 3:
            return matrix.T
        if matrix.shape[0] == 3:
            return matrix
        raise PlacedError(f"{item.place}: {what} have shape {matrix.shape}, must be (3, n) or (n, 3)")
    flat = item.numbers(what)
    if not len(flat) or len(flat) % 3:
        raise PlacedError(f"{item.place}: {what} hold {len(flat)} numbers, must be three rows of one length")
    return flat.reshape(3, -1)


def _listed(entries: Entries, found: Found) -> None:
    """Thrusters as a list or table of tables, each with a position and a direction or angles."""
    for path, item in entries:
        if "thruster" not in path[-1].lower():
            continue
        members = (
            [(f"thruster{i}", member) for i, member in enumerate(item.items())]
            if item.items()
            else [(key, member) for key, member in item.table().items()]
        )
        members = [(name, member) for name, member in members if member.table()]
        placed = [(n, m, _position(m)) for n, m in members]
        located = [(n, m, p) for n, m, p in placed if p is not None]
        if not located:
            continue
        for name, member, place in located:
            axis, R = _direction(member)
            if axis is None:
                raise PlacedError(f"{member.place}: {name} has a position but no direction, which is needed too")
            given = member.get("name", "id")
            label = given.value if given is not None and isinstance(given.value, str) else name
            found.thrusters.append(FoundThruster(label, place, _axis(axis, member, name), member.place, R))
        if any(t.R_BT is not None for t in found.thrusters):
            found.thrust_rule = "inferred: positive thrust pushes along +x of each thruster's frame"
        return


def _position(member: Item) -> Array | None:
    item = member.get("position", "xyz", "pos", "location", "p", "translation")
    if item is not None:
        return three(item, "position")
    if all(key in member.table() for key in "xyz"):
        return np.array([member.table()[key].scalar(key) for key in "xyz"])
    return None


def _direction(member: Item) -> tuple[Array | None, Array | None]:
    item = member.get("direction", "axis", "force_direction", "thrust_direction", "dir")
    if item is not None:
        return three(item, "direction"), None
    item = member.get("rpy", "orientation", "rotation")
    if item is not None:
        R = pose_of(np.zeros(3), three(item, "angles")).R
        return R[:, 0], R
    return None, None


def _limits(entries: Entries, found: Found) -> None:
    high, low = find(entries, ("max_force", "max_thrust")), find(entries, ("min_force", "min_thrust"))
    if high is None or low is None:
        return
    forward, reverse = high.scalar("max_force"), -low.scalar("min_force")
    if forward < 0.0 or reverse < 0.0:
        return
    for thruster in found.thrusters:
        thruster.max_forward_N, thruster.max_reverse_N = forward, reverse
    found.derived["thruster_limits"] = f"{found.kind} {found.file.name}:{high.place.line}"
