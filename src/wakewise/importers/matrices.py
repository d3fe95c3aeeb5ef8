"""YAML of other projects: allocation matrices, thruster geometry, and tables of parameters."""

from __future__ import annotations

import re

import numpy as np

from wakewise.importers.found import QUESTION, Found, Frame
from wakewise.importers.layouts import read_geometry
from wakewise.importers.plausible import claims_in, require_count, require_same_count, upright
from wakewise.importers.xml import PlacedError
from wakewise.importers.yaml_parameters import Entries, read_parameters
from wakewise.importers.yamls import Item

_MATRIX_KEY = re.compile(
    r"(^|_)(tam|b_matrix|mixer|mixing)(_|$)|allocation|configuration_matrix|thruster_matrix|thrust_matrix|input_matrix$",
    re.IGNORECASE,
)
_NOT_MATRIX = re.compile(r"weight|controller|update|rate|slack|topic|solver", re.IGNORECASE)
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
    geometry = read_geometry(entries, found)
    matrix = _matrix(entries, found)
    require_same_count(entries, found)
    found.claims += claims_in(entries)
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
            if matrix.shape == (6, 6):
                matrix = upright(matrix, matrix.T, key, found.notes)
        elif item.is_numbers():
            flat = item.numbers(key)
            if len(flat) % 6:
                raise PlacedError(f"{item.place}: {key} has {len(flat)} numbers, must be 6 rows")
            matrix = upright(flat.reshape(6, -1), flat.reshape(-1, 6).T, key, found.notes)
        elif item.table() and all(len(column.items()) == 6 and column.is_numbers() for column in item.table().values()):
            matrix = np.stack([column.numbers(f"{name} of {key}", 6) for name, column in item.table().items()], axis=1)
            found.notes.append(f"{key}: a column for each of {', '.join(item.table())[:120]}")
        else:
            if item.items():
                found.notes.append(
                    f"{QUESTION}{key} is not read, neither rows nor columns of numbers ({item.place.file.name}:"
                    f"{item.place.line})"
                )
            continue
        if matrix.shape[0] != 6 and matrix.shape[1] == 6:
            found.notes.append(f"{key}: {matrix.shape[0]} rows of 6 are taken for its transpose")
            matrix = matrix.T
        if matrix.shape[0] != 6:
            raise PlacedError(f"{item.place}: {key} has shape {matrix.shape}, must be (6, n), a column per thruster")
        if matrix.shape[1] == 0:
            raise PlacedError(f"{item.place}: {key} has no columns, must have one per thruster")
        require_count(matrix.shape[1], f"{item.place}: {key}: ")
        found.matrix, found.matrix_name = matrix, key
        found.notes.append(
            f"allocation matrix: {key}, 6 x {matrix.shape[1]} ({item.place.file.name}:{item.place.line})"
        )
        return True
    return False
