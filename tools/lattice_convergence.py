"""Compute one lattice case on several grids and say how far they differ: on a graphics card if there is one.

    python tools/lattice_convergence.py --cache DIR [crossing | floor | free ...] [--grids 6 8 10] [--device auto]

Prints one JSON object: the figures on each grid, and the change from each grid to the next in per cent. `crossing` on
grids of 6, 8 and 10 cells per diameter takes a quarter of an hour of one core; 15 (4 mm for 60 mm) is for a card.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from wakewise.core.errors import WakewiseError
from wakewise.ui.cli.console import ProgressBars
from wakewise_paper.lattice_reference.crossing_jets import crossing_figures, is_crossing
from wakewise_paper.lattice_reference.engines import DEVICES
from wakewise_paper.lattice_reference.mean_field import compute_run, figures, mean_field
from wakewise_paper.lattice_reference.reference_cases import CASES, find_case
from wakewise_paper.lattice_reference.run import LatticeRun


def measured(run: LatticeRun) -> dict[str, Any]:
    """Figures of a run: those of a crossing, or those of the laws of jets."""
    return crossing_figures(run) if is_crossing(run.case) else figures(mean_field(run))


def change_pct(fine: Any, coarse: Any) -> Any:
    """Coarse against fine, in per cent of fine, number by number; None where either is missing."""
    if isinstance(fine, list):
        return [change_pct(a, b) for a, b in zip(fine, coarse, strict=False)]
    return round(100 * (coarse / fine - 1), 1) if fine and coarse is not None else None


def main() -> None:
    """Read the command line and compute."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="?", default="crossing", choices=sorted(CASES), metavar="case")
    parser.add_argument("--cache", type=Path, required=True, help="folder for checkpoints")
    parser.add_argument("--grids", type=int, nargs="+", default=[6, 8, 10], help="cells per diameter, coarse to fine")
    parser.add_argument("--device", choices=DEVICES, default="auto")
    options = parser.parse_args()
    options.cache.mkdir(parents=True, exist_ok=True)
    bars, grids = ProgressBars(), {}
    for n in options.grids:
        case = find_case(options.case).resolved(n)
        began = time.perf_counter()
        with bars.stage(f"{case.name}, {n} cells per diameter") as progress:
            run = compute_run(case, options.cache, progress, options.device)
        grids[n] = measured(run) | {"wall_s": round(time.perf_counter() - began, 1)}
    changes = {
        f"{coarse} against {fine}": {
            key: change_pct(grids[fine][key], grids[coarse][key])
            for key in grids[fine]
            if not key.endswith("_D") or key.startswith("half")
            if key != "wall_s"
        }
        for coarse, fine in zip(options.grids, options.grids[1:], strict=False)
    }
    print(json.dumps({"case": options.case, "grids": grids, "change_pct": changes}, indent=1))


if __name__ == "__main__":
    try:
        main()
    except WakewiseError as fault:
        sys.exit(str(fault))
