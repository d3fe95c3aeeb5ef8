"""The stand-in's table of parameters, which a script may add to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

LONGEST_NAME = 16
MOST = 4000
"""More than the firmware has; a script that adds without end is stopped here."""


class ParameterTable:
    """Values by name, in the order of the names, as 32-bit floats like the firmware's.

    Names that release 4.7 changed (SYSID_THISMAV to MAV_SYSID) are whatever the values given say.
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values: dict[str, float] = {}
        for name, value in values.items():
            self._values[name] = _single(value)
        self._tables: dict[int, tuple[str, int]] = {}
        self._sort()

    def __len__(self) -> int:
        """How many there are."""
        return len(self._values)

    def __iter__(self) -> Iterator[str]:
        """Names, in their order."""
        return iter(self._names)

    def get(self, name: str) -> float | None:
        """A value, or None where there is no such parameter."""
        return self._values.get(name)

    def value(self, *names: str, otherwise: float) -> float:
        """The value of the first of these names that there is."""
        return next((self._values[name] for name in names if name in self._values), otherwise)

    def set(self, name: str, value: float) -> bool:
        """Set one; False where there is no such parameter or the value is no number."""
        if name not in self._values or not math.isfinite(value):
            return False
        self._values[name] = _single(value)
        return True

    def at(self, index: int) -> str | None:
        """Name at a place of the list."""
        return self._names[index] if 0 <= index < len(self._names) else None

    def index(self, name: str) -> int:
        """Place in the list."""
        return self._places[name]

    def add_table(self, key: int, prefix: str, count: int) -> bool:
        """Reserve a table for a script; False where its key is another prefix's, or the numbers make no sense."""
        if not (0 <= key <= 200 and 0 < count <= 63 and 0 < len(prefix) < LONGEST_NAME):
            return False
        if self._tables.get(key, (prefix, 0))[0] != prefix:
            return False
        self._tables[key] = (prefix, count)
        return True

    def add_param(self, key: int, index: int, name: str, value: float) -> bool:
        """Add one to a table; one that is there keeps its value."""
        if key not in self._tables or not 1 <= index <= self._tables[key][1] or len(self._values) >= MOST:
            return False
        full = self._tables[key][0] + name
        if len(full) > LONGEST_NAME or not math.isfinite(value):
            return False
        self._values.setdefault(full, _single(value))
        self._sort()
        return True

    def forget_tables(self) -> None:
        """What a start does: tables are reserved anew; values stay."""
        self._tables.clear()

    def _sort(self) -> None:
        self._names = sorted(self._values)
        self._places = {name: place for place, name in enumerate(self._names)}


def _single(value: float) -> float:
    return float(np.float32(value))
