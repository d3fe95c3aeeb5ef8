"""The simulated world: a vehicle with its true parameters in its water, silt on the bed, and sensors, on one clock.

A controller sees only what `Tank.step` returns. Everything else on `Tank` is the truth of a trial, for its record and
for the photographs; the water itself is the room `wakewise.simulation.water`.

Start reading in `tank.py` (the clock; `ambient.py` makes its water, `tank.py` moves water and silt
beside the vehicle), `settings.py` (what a world is) and `tank.py` (how a flight begins in it; `ambient.py` is its
current). `plant.py` is the vehicle with `tether.py`, `plant.py` and `contact.py`; `sensors.py` and
`sensors.py` what it senses, `sensors.py` the joint of its camera; `sediment*.py`, `grains.py` and `grains.py`
silt and its laws, `settings.py` beds by name; `soft_body.py` moves a soft or loose target, `flakes.py` what drifts
before the camera; `water_truth.py` and `water_truth.py` are what a flight is judged by, `station_keeping.py` what is
refused beforehand, `validation_limits.py` what the water gets wrong; `probe.py` and `probe.py` the truth for outsiders
(`wakewise tank probe`).
"""

from wakewise.simulation.tank.ambient import build_ambient
from wakewise.simulation.tank.grains import beam_attenuation_per_m
from wakewise.simulation.tank.plant import VehiclePlant
from wakewise.simulation.tank.sensors import Sensors
from wakewise.simulation.tank.settings import TankSettings, ThrusterFailure
from wakewise.simulation.tank.station_keeping import StationKeepingDemand, station_keeping_demand
from wakewise.simulation.tank.tank import Tank, TankWorld, tank_ambient
from wakewise.simulation.tank.tether import Tether

__all__ = [
    "Sensors",
    "StationKeepingDemand",
    "Tank",
    "TankSettings",
    "TankWorld",
    "Tether",
    "ThrusterFailure",
    "VehiclePlant",
    "beam_attenuation_per_m",
    "build_ambient",
    "station_keeping_demand",
    "tank_ambient",
]
