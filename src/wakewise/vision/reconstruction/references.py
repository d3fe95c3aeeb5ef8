"""Reference camera positions: a folder of Strecha's .camera files or a CSV table."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError


def read_reference_cameras(path: Path) -> dict[str, Array]:
    """Camera centres in m, shape (3,), by photo name.

    Parameters
    ----------
    path : Path
        A folder of `<photo>.camera` files (C. Strecha et al., CVPR 2008, doi 10.1109/CVPR.2008.4587706: rows of K, a
        row of zeros, rows of the camera-to-world rotation, the camera centre, the image size), or a CSV file with
        columns name, x_m, y_m, z_m.

    Raises
    ------
    InputError
        If nothing is there, or a file does not hold what it should.
    """
    if path.is_dir():
        files = sorted(path.glob("*.camera"))
        if not files:
            raise InputError(f"{path}: holds no .camera files; a folder of them or a CSV file is needed")
        return {file.name.removesuffix(".camera"): _read_camera(file) for file in files}
    if not path.is_file():
        raise InputError(
            f"{path}: does not exist; a folder of .camera files or a CSV file (name,x_m,y_m,z_m) is needed"
        )
    return _read_csv(path)


def _read_camera(path: Path) -> Array:
    """Centre from one .camera file: the 8th row, after K (3 rows), zeros and R (3 rows)."""
    try:
        rows = [[float(word) for word in line.split()] for line in path.read_text(encoding="utf-8").splitlines()]
    except (ValueError, UnicodeDecodeError):
        raise InputError(f"{path}: is no .camera file, holds something that is no number") from None
    rows = [row for row in rows if row]
    if len(rows) < 8 or len(rows[7]) != 3 or not np.all(np.isfinite(rows[7])):
        raise InputError(f"{path}: is no .camera file; row 8 must hold the camera centre, 3 numbers")
    return np.array(rows[7])


def _read_csv(path: Path) -> dict[str, Array]:
    wanted = ("name", "x_m", "y_m", "z_m")
    out: dict[str, Array] = {}
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            missing = [column for column in wanted if column not in (reader.fieldnames or ())]
            if missing:
                how = other_separator(reader.fieldnames)
                raise InputError(f"{path}: has no column {', '.join(missing)}; needed are {', '.join(wanted)}{how}")
            for row in reader:
                if row["name"] in out:
                    raise InputError(f"{path}: line {reader.line_num}: {row['name']} is there twice")
                out[row["name"]] = _position(path, reader.line_num, [row[c] for c in wanted[1:]])
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path}: is no CSV text; needed is a table with columns {', '.join(wanted)}") from None
    if not out:
        raise InputError(f"{path}: holds no cameras, needs at least 3 rows")
    return out


def _position(path: Path, line: int, words: list[str | None]) -> Array:
    try:
        position = np.array([float(word or "") for word in words])
    except ValueError:
        raise InputError(f"{path}: line {line} holds {words}, allowed are three numbers x_m, y_m, z_m") from None
    if not np.all(np.isfinite(position)):
        raise InputError(f"{path}: line {line} holds {words}, every coordinate must be finite")
    return position


def match_references(references: dict[str, Array], names: Iterable[str]) -> dict[str, Array]:
    """References by the photos' own names; a name matches whole or without its suffix (0001.png for 0001.jpg).

    Raises
    ------
    InputError
        If fewer than three photos have a reference.
    """
    by_stem = {Path(name).stem: position for name, position in references.items()}
    photos = list(names)
    found = {n: references.get(n, by_stem.get(Path(n).stem)) for n in photos}
    matched = {name: np.asarray(p, dtype=np.float64) for name, p in found.items() if p is not None}
    if len(matched) < 3:
        example = f"{next(iter(references))} for {photos[0]}" if references and photos else "none given"
        raise InputError(
            f"reference cameras: {len(matched)} of {len(photos)} photos have one, at least 3 must; "
            f"the names must be the photos' names ({example})"
        )
    return matched
