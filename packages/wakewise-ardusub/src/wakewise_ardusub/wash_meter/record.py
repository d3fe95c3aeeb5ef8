"""The dive on disk: a row of CSV for every reading while thrusters run, and how it ended as JSON."""

from __future__ import annotations

import csv
from itertools import count
from pathlib import Path
from typing import IO, Any

from wakewise.core.files import write_json
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_meter.meter import MeterReading
from wakewise_ardusub.wash_savings import SHARES

ROWS, SUMMARY = "meter.csv", "meter.json"


class DiveRecord:
    """Writes one dive into a folder; a row is whole or not there.

    Parameters
    ----------
    folder : Path
        Made where it is not there; a record in it is gone on with where its columns are the same, else put aside.
    craft : VehicleSummary
    """

    def __init__(self, folder: Path, craft: VehicleSummary) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        names = ["time_s", *(f"disturbance_{share}" for share in SHARES), "peak_flown_m_s", "peak_gentle_m_s"]
        names += [f"{share}_{i + 1}_N" for share in ("flown", "gentle") for i in range(craft.count)]
        path = folder / ROWS
        before = path.read_text(encoding="utf-8").partition("\n")[0] if path.is_file() else ""
        if before not in ("", ",".join(names)):
            numbers = (n for n in count(1) if not (folder / f"meter-{n}.csv").exists())
            path.rename(folder / f"meter-{next(numbers)}.csv")
            before = ""
        self._file: IO[str] = path.open("a", encoding="utf-8", newline="", buffering=1)
        self._rows = csv.writer(self._file, lineterminator="\n")
        if not before:
            self._rows.writerow(names)

    def add(self, unix_s: float, reading: MeterReading) -> None:
        """Write a reading under the time of day, if thrusters ran."""
        if reading.spared is None or not reading.running:
            return
        spared = reading.spared
        row = [f"{unix_s:.3f}", *(f"{spared.disturbance[share]:.9g}" for share in SHARES)]
        row += [f"{reading.peak_m_s['flown']:.6g}", f"{reading.peak_m_s['gentle']:.6g}"]
        row += [f"{thrust:.5g}" for share in ("flown", "gentle") for thrust in spared.thrusts_N[share]]
        self._rows.writerow(row)

    def close(self, summary: dict[str, Any]) -> None:
        """End with how it came out."""
        self._file.close()
        write_json(self._folder / SUMMARY, summary)
