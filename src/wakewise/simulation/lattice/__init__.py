"""An oracle for the wakes: a lattice-Boltzmann solver for jets in a box, and the mean fields it computed.

The water of a trial is made of parcels (`wakewise.simulation.water`), which are laws of jets put together. The lattice
knows no law of jets: it solves for the flow of a pushing disk, and laws, parcels and wake models are held against it.

Start reading in `cases.py` (what was computed) and `flow.py` (its velocity at points). `kernel.py` is the solver with
its parts `stencil.py`, `collision.py`, `faces.py` and `streaming_stores.py`, and `reference_step.py` its readable twin;
`engines.py` picks that or a graphics card (`cuda_engine.py`, `cuda_engine.py`). `run.py` and `meanfield.py` are a
computation, `forced_lattice.py` with `forced_lattice.py` water for a flight, `engines.py` solid boxes,
`engines.py` and `meanfield.py` what is kept of it, `meanfield.py` what it says of the laws of round jets, `crossing.py`
of jets that cross and `crossing.py` past a box.
"""

from wakewise.simulation.lattice.cases import CASES, DiskJet, LatticeCase, case_hash, find_case
from wakewise.simulation.lattice.flow import LatticeFlow
from wakewise.simulation.lattice.meanfield import (
    MeanField,
    compute_mean_field,
    compute_run,
    load_mean_field,
    save_mean_field,
)
from wakewise.simulation.lattice.run import LatticeRun

__all__ = [
    "CASES",
    "DiskJet",
    "LatticeCase",
    "LatticeFlow",
    "LatticeRun",
    "MeanField",
    "case_hash",
    "compute_mean_field",
    "compute_run",
    "find_case",
    "load_mean_field",
    "save_mean_field",
]
