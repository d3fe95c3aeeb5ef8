"""Simulated tank: a vehicle with its true parameters in its water, silt on the bed, and sensors, on one clock.

A controller sees only what `Tank.step` returns. Everything else on `Tank` is ground truth for the record and the
photographs.

- `tank.py`: clock, water and silt beside the vehicle; the tank as a world. `settings.py`: settings and beds by name.
- `ambient.py`: current and waves from the settings.
- `plant.py`: true vehicle with thrust losses; `tether.py`: cable; `contact.py`: hull against walls and target.
- `sensors.py`: camera pose, tracking, inertial unit, pressure; the camera's joint.
- `sediment.py`, `sediment_motion.py`, `grains.py`: silt, its compiled motion, its laws.
- `soft_body.py`: bending and sliding targets. `flakes.py`: drifting flakes before the camera.
- `water_truth.py`: water speeds, pressure and shear at the target. `probe.py`: true flow at given points (`wakewise
  tank probe`).
- `station_keeping.py`: loads that exceed the vehicle. `validation_limits.py`: accuracy of the water by law.
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
