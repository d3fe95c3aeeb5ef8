"""What a figure that is held against outside data is asked to be, and a row of `wakewise bench truth`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError, WakewiseError
from wakewise.core.interfaces import Progress


@dataclass(frozen=True, kw_only=True)
class Asked:
    """One figure, and the range that would be right; written down before anything is computed."""

    key: str  # name of the figure in the answer of its part
    what: str
    how: str  # where the range is from
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not self.low <= self.high or (math.isinf(self.low) and math.isinf(self.high)):
            raise InputError(f"truth {self.key}: asked from {self.low:g} to {self.high:g}, needs a range with an end")

    @property
    def words(self) -> str:
        """The range as it is printed."""
        if self.low == self.high:
            return f"= {self.low:.10g}"
        if math.isinf(self.low):
            return f"<= {self.high:.10g}"
        if math.isinf(self.high):
            return f">= {self.low:.10g}"
        return f"{self.low:.10g} to {self.high:.10g}"

    def met_by(self, value: float) -> bool:
        """Whether a value is in the range; a value that is not a number is not."""
        return self.low <= value <= self.high


Compute = Callable[[Path, Progress], Mapping[str, float | None]]
"""From a folder of data to the figures of a part, by key; a figure that has no value is None."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """All figures that are held against one folder of data."""

    name: str  # of the folder, and for `--only`
    source: str  # who measured or computed it
    asked: tuple[Asked, ...]
    compute: Compute
    slow: str = ""  # about how long it takes, where it is more than seconds


def rows_of(part: Part, data: Path | None, progress: Progress) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Rows of a part, and all that it computed; a figure that cannot be computed is None with `why`."""
    why, figures = "it has no value", {}
    if data is None:
        why = "no folder of reference data; name it with --data or WAKEWISE_DATA"
    elif not (data / part.name).is_dir():
        why = f"{data / part.name} is missing"
    else:
        try:
            figures = dict(part.compute(data / part.name, progress))
        except (WakewiseError, OSError) as fault:  # what is wrong with the files or the machine, not with the program
            why = " ".join(str(fault).split())
        except (ValueError, LookupError, StopIteration) as fault:  # a file that does not hold what its readers expect
            why = f"{data / part.name} cannot be read: {type(fault).__name__}, {' '.join(str(fault).split())}"
    rows = []
    for asked in part.asked:
        value = figures.get(asked.key)
        value = None if value is None or not math.isfinite(value) else float(value)
        row: dict[str, Any] = {
            "source": part.name,
            "what": asked.what,
            "asked": asked.words,
            "reached": value,
            "met": None if value is None else asked.met_by(value),
            "unit": asked.unit,
            "measured_by": part.source,
            "asked_because": asked.how,
        }
        rows.append(row if value is not None else row | {"why": why})
    return rows, figures
