"""Lattice Boltzmann solver (D3Q19) for jets in a box of water, and the stored mean fields of its reference cases.

It shares no jet law with the water of the tank (`wakewise.simulation.water`) nor with the wake models, so both can be
compared with it. The reference computations themselves are in `wakewise_paper.lattice_reference`.

- `kernel.py`: one time step, streaming and collision fused; `stencil.py`: the D3Q19 velocities, weights and layout.
- `collision.py`: regularised collision with a Smagorinsky eddy viscosity; `faces.py`: open and solid boundaries.
- `streaming_stores.py`: store instructions that bypass the cache.
- `forced_lattice.py`: the solver as the water of a flight, forced by the thrusters' actuator disks.
- `cases.py`: records of the reference cases; `meanfield.py`: the stored time average of a case, and the steady velocity
  of several thrusters' jets made from it.
"""

from wakewise.simulation.lattice.cases import SHIPPED_CASES, DiskJet, LatticeCase, case_hash
from wakewise.simulation.lattice.meanfield import LatticeFlow, MeanField, load_mean_field

__all__ = [
    "SHIPPED_CASES",
    "DiskJet",
    "LatticeCase",
    "LatticeFlow",
    "MeanField",
    "case_hash",
    "load_mean_field",
]
