"""One way to name any vehicle: a library name, a vehicle file, or a file of another project.

Allocation matrices and tables of motor factors in files of plain numbers.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import path_of
from wakewise.core.errors import InputError
from wakewise.core.plugins import find, offered
from wakewise.robot.importers.wrench_rows import ARDUSUB, FORCES_FIRST, MOMENTS_FIRST, is_signs, nearest, parse_order
from wakewise.robot.vehicles.check import AnyVehicle
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.library import draft_names, load_draft
from wakewise.robot.vehicles.mixing import (
    MatrixComparison,
    compare_either_frame,
    compare_signs,
    compare_with_ardusub,
    factors_as_wrench,
)
from wakewise.robot.vehicles.vehicle import Vehicle

MOTOR_COLUMNS = ["motor", "roll", "pitch", "yaw", "throttle", "forward", "lateral"]
"""Header of a table of motor factors, a row per motor."""

LARGEST_FILE_BYTES = 1_000_000


def read_number_matrix(path: Path) -> tuple[Array, bool]:
    """Read a matrix of shape (6, n) or (n, 6) as it stands, and whether it holds signs only, then of shape (6, n).

    Allowed are six lines of n numbers separated by commas or blanks, a line of six for each thruster, and a table of
    motor factors with the header motor, roll, pitch, yaw, throttle, forward, lateral. Lines that begin with # are left
    out.

    Raises InputError if there is no such file, or no matrix of six rows in it.
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


_OURS = re.compile(r"^(does_not_claim|thruster_layout):", re.MULTILINE)
_BASED = re.compile(r"^base:\s*[\"']?([\w-]+)", re.MULTILINE)


def find_vehicle(
    name_or_path: str | Path,
    *,
    convention: str = "auto",
    thrust: str = "auto",
    matrix: Path | None = None,
    packages: Mapping[str, Path] | None = None,
    arguments: Mapping[str, str] | None = None,
    skip_missing: bool = False,
    rows: str | None = None,
) -> VehicleDraft:
    """Read a vehicle of the library, a vehicle file, or any file of another project that can be imported.

    The options are those of `importers.import_vehicle`; they concern files of other projects only.

    Raises InputError if there is no such vehicle or file, it cannot be read as a vehicle, or an option does not apply
    to it.
    """
    path = path_of(name_or_path, "vehicle")
    name_or_path = name_or_path if isinstance(name_or_path, str) else str(path)
    told = {
        "frame": convention != "auto",
        "thrust direction": thrust != "auto",
        "matrix": matrix is not None,
        "arguments": bool(arguments),
        "rows": rows is not None,
    }
    useless = ", ".join(word for word, given in told.items() if given)
    is_file, is_folder = path.is_file(), path.is_dir()
    if name_or_path and is_folder and name_or_path not in draft_names():
        raise InputError(f"vehicle {name_or_path}: is a folder, name the vehicle's file in it")
    reader = _reader_from_outside(path)
    if reader is not None or name_or_path in draft_names() or not is_file or _is_ours(path):
        if useless and (reader is not None or is_file or name_or_path in draft_names()):
            raise InputError(
                f"vehicle {name_or_path}: needs no {useless}; only files of other projects that we read do"
            )
        return load_draft(name_or_path) if reader is None else reader(path)
    from wakewise.robot.importers.read import import_vehicle

    return import_vehicle(
        path,
        convention=convention,
        thrust=thrust,
        matrix=matrix,
        packages=packages,
        arguments=arguments,
        skip_missing=skip_missing,
        rows=rows,
    )


def _reader_from_outside(path: Path) -> Callable[[Path], VehicleDraft] | None:
    """What an installed package offers for files of this ending (entry points `wakewise.vehicle_formats`)."""
    ending = path.suffix.removeprefix(".").lower()
    if ending not in offered("vehicle format") or not path.is_file():
        return None
    reader: Callable[[Path], VehicleDraft] = find("vehicle format", ending, {}).maker
    return reader


def any_vehicle(name_or_path: str | Path) -> Vehicle:
    """A vehicle that can fly, from the library or any file that can be read as a vehicle.

    `name_or_path`: a name of the library, or the path of a vehicle file: ours (YAML), URDF, xacro, SDF, Stonefish, a
    matrix, or a format that an installed package offers. Raises InputError if there is no such vehicle or file, it
    cannot be read as a vehicle, or lacks something that flying needs (the message lists it).

    Examples
    --------
    >>> import wakewise as ww
    >>> len(ww.load_vehicle("bluerov2-heavy").thrusters)
    8
    """
    draft = find_vehicle(name_or_path)
    draft.require_whole(str(name_or_path))
    return draft.vehicle()


def compare_with(vehicle: AnyVehicle, matrix: str, rows: str | None = None) -> MatrixComparison:
    """Compare the geometry with a stated matrix: the word ardusub, or a file of numbers or YAML that holds one.

    What the file leaves open, such as whether forces or moments come first, is read as the geometry agrees best;
    `rows` names its rows in their order, such as "roll,pitch,yaw,x,y,z".

    Raises InputError if there is no such file, it holds no matrix, or the matrix has another number of thrusters.
    """
    if not vehicle.thrusters:
        raise InputError(f"vehicle {vehicle.name}: holds no places of thrusters to compare {matrix} with")
    if matrix == "ardusub":
        if rows is not None:
            raise InputError("rows: ArduSub's factors need none")
        return compare_with_ardusub(vehicle)
    path, geometry = Path(matrix), vehicle.allocation_matrix
    signs_only = False
    if path.suffix in (".yaml", ".yml"):
        from wakewise.robot.importers.read import read_matrix

        stated, notes = read_matrix(path, geometry=geometry, rows=rows)
    else:
        stated, signs_only = read_number_matrix(path)
        notes, told = [], parse_order(rows)
        if not signs_only:
            orders = [FORCES_FIRST, MOMENTS_FIRST, ARDUSUB] if told is None else [told]
            best, words = nearest([stated], geometry, orders, ["FRD", "FLU"])
            if words and not np.array_equal(best, stated):
                stated, notes = best, [f"matrix read as {words}"]
    if signs_only or (is_signs(stated) and stated.shape == geometry.shape):
        found = compare_signs(vehicle, stated, path.name)
    else:
        found = compare_either_frame(vehicle, stated, path.name)
    return replace(found, notes=(*notes, *found.notes))


def _is_ours(path: Path) -> bool:
    if path.suffix not in (".yaml", ".yml"):
        return False
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        return True
    based = _BASED.search(text)
    return _OURS.search(text) is not None or (based is not None and based[1] in draft_names())
