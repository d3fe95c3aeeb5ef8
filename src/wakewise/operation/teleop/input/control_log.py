"""Record of an operator's inputs in a flight, for analysis and replay.

A table with the columns `time_s`, the five axes, `pressed` (names, separated by commas) and `settings` (the settings as
JSON). It has a row at each change, which holds until the next one, and a last one at the end. Without inputs the axes
are null. The file is Parquet or CSV; a teleoperated flight writes `controls.parquet` into its folder.
"""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.operation.teleop.input.controls import CONTROL_AXES, Controls, TimedControls

TRACE_FILE = "controls.parquet"
"""Name of the record in the folder of a flight."""
_NOBODY = (math.nan,) * len(CONTROL_AXES)


@dataclass(eq=False)
class ControlLogWriter:
    """Collects inputs and settings as they are read; only changes are kept."""

    _rows: array[float] = field(default_factory=lambda: array("d"), init=False)
    _pressed: dict[int, str] = field(default_factory=dict, init=False)
    _settings_rows: dict[int, str] = field(default_factory=dict, init=False)
    _axes: tuple[float, ...] | None = field(default=None, init=False)
    _settings: Mapping[str, Any] | None = field(default=None, init=False)
    _last_s: float = field(default=0.0, init=False)

    def take(self, time_s: float, controls: Controls | None, settings: Mapping[str, Any]) -> None:
        """Take in the inputs and settings of a step."""
        axes = _NOBODY if controls is None else tuple(controls.axes.tolist())
        pressed = () if controls is None else controls.pressed
        same = self._axes is axes or (axes is not _NOBODY and self._axes == axes)
        if not same or pressed or settings != self._settings:
            row = len(self._rows) // (1 + len(CONTROL_AXES))
            if pressed:
                self._pressed[row] = ",".join(pressed)
            if settings != self._settings:
                self._settings_rows[row] = json.dumps(dict(settings))
            self._rows.extend((time_s, *axes))
            self._axes, self._settings = axes, settings
        self._last_s = time_s

    def frame(self) -> pl.DataFrame:
        """The table, with its last row."""
        wide = np.array(self._rows).reshape(-1, 1 + len(CONTROL_AXES))
        n = len(wide)
        if n and self._last_s > wide[-1, 0]:
            wide = np.vstack([wide, [self._last_s, *wide[-1, 1:]]])
        columns = {name: wide[:, k] for k, name in enumerate(("time_s", *CONTROL_AXES))}
        words = {
            name: [said.get(k) for k in range(len(wide))]
            for name, said in (("pressed", self._pressed), ("settings", self._settings_rows))
        }
        frame = pl.DataFrame({**columns, **words}, schema_overrides={"pressed": pl.String, "settings": pl.String})
        return frame.with_columns(pl.col(CONTROL_AXES).fill_nan(None))

    def write(self, path: Path) -> None:
        """Write the table, whole or not at all; its ending says whether as CSV or Parquet."""
        with whole_file(path) as temporary:
            if path.suffix == ".csv":
                self.frame().write_csv(temporary)
            else:
                self.frame().write_parquet(temporary)


class ControlLog(TimedControls):
    """A `ControlSource` from a record; after its end there are no inputs.

    Raises InputError if the table lacks a column, times do not increase, or a row is nonsense; the row is named.
    """

    def __init__(self, frame: pl.DataFrame, what: str = "trace") -> None:
        times_s, rows, self._settings_rows = _checked(frame, what)
        super().__init__(times_s, rows, before=None)

    @property
    def end_s(self) -> float:
        """When the record ends."""
        return float(self._times_s[-1])

    def read(self, time_s: float) -> Controls | None:
        """The entry at `time_s`; None before the first and after the end."""
        held = super().read(time_s)
        return None if time_s > self.end_s + 1e-9 else held

    def settings_at(self, time_s: float) -> Mapping[str, Any] | None:
        """The settings at `time_s`; None if they are not in the record."""
        at = int(np.searchsorted(self._times_s, time_s + 1e-9, side="right")) - 1
        return self._settings_rows[at] if at >= 0 else None


def read_trace(path: Path) -> ControlLog:
    """Trace from a Parquet or CSV file.

    Raises InputError if it cannot be read, or see `ControlLog`.
    """
    try:
        frame = pl.read_csv(path) if path.suffix == ".csv" else pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as fault:
        raise InputError(f"{path}: cannot be read as a table ({' '.join(str(fault).split())})") from fault
    return ControlLog(frame, str(path))


def _checked(
    frame: pl.DataFrame, what: str
) -> tuple[np.ndarray, list[Controls | None], list[Mapping[str, Any] | None]]:
    missing = [name for name in ("time_s", *CONTROL_AXES) if name not in frame.columns]
    if missing or not frame.height:
        raise InputError(f"{what}: {'no column ' + missing[0] if missing else 'no rows'}, needed: time_s, the axes")
    try:
        wide = frame.select(pl.col("time_s", *CONTROL_AXES).cast(pl.Float64)).to_numpy()
    except pl.exceptions.PolarsError as fault:
        raise InputError(f"{what}: time_s and the axes must be numbers") from fault
    times_s = np.array(wide[:, 0])
    if not (np.isfinite(times_s).all() and np.all(np.diff(times_s) > 0.0) and times_s[0] >= 0.0):
        raise InputError(f"{what}: time_s must increase from 0 or more")
    words = {
        name: frame[name].to_list() if name in frame.columns else [None] * frame.height
        for name in ("pressed", "settings")
    }
    rows: list[Controls | None] = []
    all_settings: list[Mapping[str, Any] | None] = []
    settings: Mapping[str, Any] | None = None
    for k, (axes, pressed, said) in enumerate(zip(wide[:, 1:], words["pressed"], words["settings"], strict=True), 1):
        try:
            names = tuple(str(pressed).split(",")) if pressed else ()
            rows.append(None if np.isnan(axes).all() and not names else Controls(axes=axes, pressed=names))
            settings = json.loads(said) if said else settings
        except (InputError, ValueError) as fault:
            raise InputError(f"{what}: row {k}: {fault}") from fault
        if settings is not None and not isinstance(settings, dict):
            raise InputError(f"{what}: row {k}: settings must be an object of JSON")
        all_settings.append(settings)
    return times_s, rows, all_settings
