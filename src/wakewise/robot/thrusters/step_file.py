"""Read a measured step of a thruster."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError

COLUMNS = ("time_s", "command", "thrust_N")
LARGEST_FILE_BYTES = 200_000_000


def read_step(path: Path | str) -> tuple[Array, Array, Array]:
    """Read a measured step from a CSV with the columns `time_s`, `command` and `thrust_N`; others are not read.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing or a cell is no finite number; the message names the line.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"step {path}: no such file")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"step {path}: {path.stat().st_size} bytes, at most {LARGEST_FILE_BYTES}")
    rows = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                how = other_separator(reader.fieldnames)
                raise InputError(f"step {path}: no column {', '.join(missing)}, needs {', '.join(COLUMNS)}{how}")
            for row in reader:
                try:
                    values = [float(row[name]) for name in COLUMNS]
                except (TypeError, ValueError):
                    values = [math.nan]
                if not all(map(math.isfinite, values)):
                    raise InputError(
                        f"step {path}: line {reader.line_num}: {', '.join(COLUMNS)} must be finite numbers"
                    )
                rows.append(values)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"step {path}: not readable as CSV ({error})") from error
    if not rows:
        raise InputError(f"step {path}: no rows")
    time_s, command, thrust_N = np.array(rows).T
    return time_s, command, thrust_N
