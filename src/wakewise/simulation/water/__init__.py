"""Water of the simulated tank: turbulent jets as vortex impulse parcels, walls, solid target, currents.

It depends on arrays and targets only and does not use the controllers' wake models (`wakewise.wake`).

- `water.py`: the water as callers see it. `stepping.py`: one compiled step; `water_snapshot.py`: velocity at any points
  of one instant.
- `parcels.py`, `round_jet_closure.py`, `parcel_advection.py`: free jets. `colliding_jets.py`: opposed and crossing
  jets.
- `bedjets.py`, `bedjets_sums.py`: wall jets on bed, walls and surface. `faces.py`: those faces. `blockage.py`: solid
  target, and jets that flow round or strike it. `hullwake.py`: wake of the hull.
- `induction.py`: induced velocity of impulses; `clusters.py`: treecode for many impulses.
- `currents.py`: steady current, waves, pump jet, turbulence; `current_series.py`: measured currents.
"""

from wakewise.simulation.water.current_series import read_current_series
from wakewise.simulation.water.currents import AiryWave, AmbientSum, BackgroundTurbulence, PumpJet, SteadyCurrent
from wakewise.simulation.water.water import Water

__all__ = [
    "AiryWave",
    "AmbientSum",
    "BackgroundTurbulence",
    "PumpJet",
    "SteadyCurrent",
    "Water",
    "read_current_series",
]
