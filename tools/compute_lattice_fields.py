"""Compute the lattice's mean fields anew: about half an hour of one free core for the default.

    python tools/compute_lattice_fields.py --cache DIR [free swirl floor crossing past-box ...] [--out DIR]

A run that was stopped goes on from its last checkpoint in the cache, and a finished one is not repeated. Every shipped
case is also run on a coarser grid; how far the two differ at 0.3 m from a disk of 60 mm goes into the file.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from wakewise.simulation.lattice import meanfield
from wakewise.ui.cli.console import ProgressBars
from wakewise_paper.lattice_reference.crossing_jets import DATA, crossing_field, is_crossing, save_crossing
from wakewise_paper.lattice_reference.jet_past_box import is_past_box, past_field, save_past_box
from wakewise_paper.lattice_reference.mean_field import (
    SHIPPED,
    compute_mean_field,
    compute_run,
    convergence,
    save_mean_field,
)
from wakewise_paper.lattice_reference.reference_cases import CASES, find_case


def main() -> None:
    """Read the command line and compute."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=list(SHIPPED), help=f"of {', '.join(CASES)}; default: %(default)s")
    parser.add_argument("--cache", type=Path, required=True, help="folder for checkpoints, 0.3 GB per case")
    parser.add_argument("--out", type=Path, help="where the tables go; default: the packages' own data")
    options = parser.parse_args()
    bars = ProgressBars()
    for name in options.cases:
        case = find_case(name)
        if is_crossing(case) or is_past_box(case):
            with bars.stage(f"{name}, {case.cells_per_D} cells per diameter") as progress:
                run = compute_run(case, options.cache, progress)
            if is_crossing(case):
                save_crossing((options.out or DATA) / f"{name}.npz", crossing_field(run))
            else:
                save_past_box((options.out or DATA) / f"{name}.npz", past_field(run))
            continue
        tables = []
        for cells in (case.cells_per_D, SHIPPED.get(name)):
            if cells:
                with bars.stage(f"{name}, {cells} cells per diameter") as progress:
                    tables.append(compute_mean_field(case.resolved(cells), options.cache, progress))
        fine = tables[0]
        if len(tables) > 1:
            fine = replace(fine, figures=fine.figures | convergence(fine, tables[1]))
        save_mean_field((options.out or meanfield.DATA) / f"{name}.npz", fine)


if __name__ == "__main__":
    main()
