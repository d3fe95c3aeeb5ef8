"""An oracle for the wakes: a lattice-Boltzmann solver for jets in a box, and the mean fields it computed.

The water of a trial is made of parcels (`wakewise.tank.water`), which are laws of jets put together. The lattice knows
no law of jets: it solves for the flow of a pushing disk, and laws, parcels and wake models are held against it.
"""

from wakewise.tank.lattice.cases import CASES, Case, DiskJet, case_hash, find_case
from wakewise.tank.lattice.compute import compute_mean_field, compute_run
from wakewise.tank.lattice.flow import LatticeFlow
from wakewise.tank.lattice.meanfield import MeanField, load_mean_field, read_mean_field, save_mean_field
from wakewise.tank.lattice.run import LatticeRun

__all__ = [
    "CASES",
    "Case",
    "DiskJet",
    "LatticeFlow",
    "LatticeRun",
    "MeanField",
    "case_hash",
    "compute_mean_field",
    "compute_run",
    "find_case",
    "load_mean_field",
    "read_mean_field",
    "save_mean_field",
]
