"""The true water of the tank: turbulent jets as vortex parcels, walls, target, currents. Arrays and targets only.

The controllers' wake models (`wakewise.wake`) are not used here, nor is this room there: a planner that knew the
truth would prove nothing. Jets are made of impulse parcels that take time to travel, entrain, merge, strike the bed
and run out along it.

Start reading in `water.py` (what callers see), `stepping.py` (one compiled step of all of it) and `water_snapshot.py`
(the velocity at any points, now). `parcels.py`, `round_jet_closure.py` and `parcel_advection.py` are a free jet,
`colliding_jets.py` and `colliding_jets.py` jets that cross and meet, `hullwake.py` what a hull leaves, `bedjets.py` and
`bedjets*.py` jets on the bed, `blockage.py` and `blockage.py` the target and jets that come up to it, `faces.py`
walls, `clusters.py`, `induction.py`, `induction.py` and `induction.py` fast sums, `currents.py` (its turbulence
summed by `currents.py`) and `current_series.py` what moves without thrusters. Laws and their sources stand
beside the equations.
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
