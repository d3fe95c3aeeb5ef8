"""`--points`: what is to be spared, from a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wakewise.core.arrays import Array
    from wakewise.core.geometry import Pose
    from wakewise.robot.vehicles import Vehicle


_MOST_BYTES = 20_000_000


def read_points(path: Path, vehicle: Vehicle, X_WB: Pose) -> tuple[Array, Array]:
    """Points, shape (n, 3), in the frame that X_WB places the vehicle in, and weights, shape (n,), of a CSV file.

    Raises InputError if the file holds no such points, or one lies inside the vehicle's box.
    """
    import csv

    import numpy as np

    from wakewise.core.csv_separators import other_separator
    from wakewise.core.errors import InputError
    from wakewise.core.safe_yaml import YamlError, text_of

    columns = ("x_m", "y_m", "z_m", "weight")
    try:
        rows = list(csv.reader(text_of(path, _MOST_BYTES, "utf-8-sig").splitlines(), strict=True))
    except (OSError, YamlError, UnicodeDecodeError, csv.Error) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise InputError(f"--points {path}: cannot be read as CSV, {why}") from None
    head = [name.strip() for name in rows[0]] if rows else []
    if sorted(head) != sorted(columns):
        how = other_separator(head)
        lacks = ", ".join(name for name in columns if name not in head)
        what = f"columns {', '.join(head) or 'none'}" + (f", lacks {lacks}" if lacks else "")
        raise InputError(f"--points {path}: {what}, allowed: {', '.join(columns)}{how}")
    values = []
    for line, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        try:
            values.append([float(row[head.index(name)]) for name in columns])
        except (ValueError, IndexError):
            raise InputError(f"--points {path}: line {line} '{','.join(row)}', four numbers are needed") from None
        if len(row) != len(columns) or not np.all(np.isfinite(values[-1])):
            raise InputError(f"--points {path}: line {line} '{','.join(row)}', four finite numbers are needed")
        if values[-1][3] < 0.0:
            raise InputError(f"--points {path}: line {line} has weight {values[-1][3]:g}, must not be negative")
    table = np.array(values).reshape(-1, 4)
    if not np.sum(table[:, 3]) > 0.0:
        what = "holds no points" if not len(table) else "all weights are 0, at least one must be more"
        raise InputError(f"--points {path}: {what}")
    inside = np.all(np.abs(X_WB.inverse().apply(table[:, :3])) < 0.5 * vehicle.size_m, axis=1)
    if np.any(inside):
        raise InputError(
            f"--points {path}: {int(inside.sum())} of {len(table)} points lie inside the vehicle's box "
            f"({' '.join(f'{side:g}' for side in vehicle.size_m)} m), the target must be outside"
        )
    return table[:, :3], table[:, 3]
