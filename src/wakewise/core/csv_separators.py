"""CSV tables of users: rows by column; commas are read, and another separator is named in the error."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from wakewise.core.errors import InputError


def other_separator(names: Iterable[str] | None) -> str:
    """What to add to a message about a table's columns: their separator if it is no comma, else nothing.

    `names`: the first line, split at commas.
    """
    line = ",".join(names or ())
    for sign, word in ((";", "semicolons"), ("\t", "tabs")):
        if sign in line:
            return f" (its columns are separated by {word}, commas are needed)"
    return ""


def csv_rows(path: Path, columns: Sequence[str], needed: str) -> Iterator[tuple[str, dict[str, str | None]]]:
    """Rows by column, each after its place (file and line) for messages, of a CSV file with a header.

    Raises InputError, which says what is `needed`, if the file cannot be read or lacks one of `columns`.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            # Blanks after the commas belong to no name.
            names = reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
            missing = [name for name in columns if name not in names]
            if missing:
                raise InputError(f"{path}: no column {', '.join(missing)}{other_separator(names)}; needed is {needed}")
            for row in reader:
                yield f"{path}: line {reader.line_num}", row
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise InputError(f"{path}: cannot be read as CSV ({fault}); needed is {needed}") from None
