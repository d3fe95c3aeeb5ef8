"""Allocation matrices and tables of motor factors in files of plain numbers."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.errors import InputError
from wakewise.robot.vehicles.mixing import factors_as_wrench

MOTOR_COLUMNS = ["motor", "roll", "pitch", "yaw", "throttle", "forward", "lateral"]
"""Header of a table of motor factors, a row per motor."""

LARGEST_FILE_BYTES = 1_000_000


def read_number_matrix(path: Path) -> tuple[Array, bool]:
    """Read a matrix of shape (6, n) or (n, 6) as it stands, and whether it holds signs only, then of shape (6, n).

    Allowed are six lines of n numbers separated by commas or blanks, a line of six for each thruster, and a table of
    motor factors with the header motor, roll, pitch, yaw, throttle, forward, lateral. Lines that begin with # are left
    out.

    Raises
    ------
    InputError
        If there is no such file, or no matrix of six rows in it.
    """
    if not path.is_file():
        raise InputError(f"matrix file {path}: no such file")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"matrix file {path}: {path.stat().st_size} bytes, at most {LARGEST_FILE_BYTES}")
    try:
        text = path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"matrix file {path}: not UTF-8 text") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    rows = list(csv.reader(lines)) if any("," in line for line in lines) else [line.split() for line in lines]
    if rows and [cell.strip() for cell in rows[0]] == MOTOR_COLUMNS:
        factors = _numbers([row[1:] for row in rows[1:]], path)
        if factors.ndim != 2 or factors.shape[1] != 6:
            raise InputError(f"matrix file {path}: motor factors of shape {factors.shape}, allowed (n, 6)")
        return factors_as_wrench(factors), True
    return _matrix(_numbers(rows, path), path), False


def _numbers(rows: list[Any], path: Path) -> Array:
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"matrix file {path}: rows of different length, all must be alike")
    try:
        return np.array([[float(cell) for cell in row] for row in rows])
    except (TypeError, ValueError) as error:
        raise InputError(f"matrix file {path}: holds what is not a number ({error})") from error


def _matrix(array: Array, path: Path) -> Array:
    if array.ndim != 2 or 6 not in array.shape:
        raise InputError(
            f"matrix file {path}: shape {array.shape}, allowed (6, n), a column per thruster, or (n, 6), a row for each"
        )
    return frozen(array, (None, None), f"matrix file {path}")
