"""Write docs/results: the paper's tables beside ours, from as many trials as a budget of time holds.

Trials are kept in a folder of their own, so that the same command goes on where it was stopped, and a longer budget
only adds. What an earlier run left in docs/results and this one does not write is removed.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from wakewise.core.files import whole_folder, write_json
from wakewise.ui.cli.console import ProgressBars
from wakewise_paper.cli.reproduce import seconds
from wakewise_paper.reports.reproduction import write_results
from wakewise_paper.reproduction.claim import TABLES
from wakewise_paper.reproduction.run import ReproduceOptions, reproduce

OUT = Path(__file__).parents[1] / "docs" / "results"
MOST_MB = 3.0
"""What is committed stays small."""


def main() -> None:
    """Make trials, then write all pages whole."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", default="2h", help="time for all tables together, such as 30min (2h)")
    parser.add_argument("--tables", default=",".join(TABLES), help="with commas between; all if not given")
    parser.add_argument("--store", type=Path, default=Path("runs/results-trials"), help="folder that keeps the trials")
    parser.add_argument("--workers", type=int, default=2, help="trials at a time (2)")
    parser.add_argument("--collect", action="store_true", help="make nothing: write what earlier runs made")
    parser.add_argument("--note", default="", help="what readers should know of this run")
    told = parser.parse_args()
    names = [name.strip() for name in told.tables.split(",") if name.strip()]
    budget_s = 1.0 if told.collect else seconds("--budget", told.budget)
    with ProgressBars().stage("trials") as progress:
        options = ReproduceOptions(budget_s=budget_s, workers=told.workers, progress=progress)
        tables = reproduce(names, told.store, options)
    for table in tables.values() if told.collect else ():
        table["why"] = dict.fromkeys(table["why"], "there was no time for its trials")
    print(f"{OUT}: {write_all(tables, told.store, OUT, told.note):.1f} MB")


def write_all(tables: dict[str, dict[str, Any]], store: Path, out: Path, note: str = "") -> float:
    """Write the folder whole, or leave it as it was; its size, 10^6 bytes.

    Raises
    ------
    SystemExit
        If it would be larger than what is committed.
    """
    with tempfile.TemporaryDirectory() as name:
        kept = {key: {k: v for k, v in table.items() if k != "places"} for key, table in tables.items()}
        write_results(tables, store, Path(name), note)
        write_json(Path(name) / "results.json", {"tables": kept})
        files = sorted(Path(name).iterdir())
        size_MB = sum(file.stat().st_size for file in files) / 1e6
        if size_MB > MOST_MB:
            raise SystemExit(f"{out}: would be {size_MB:.1f} MB, at most {MOST_MB:g}; make fewer tables")
        with whole_folder(out) as folder:
            for file in files:
                (folder / file.name).write_bytes(file.read_bytes())
    return size_MB


if __name__ == "__main__":
    main()
