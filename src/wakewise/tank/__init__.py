"""The simulated world: a vehicle with its true parameters, water moved by its jets, silt on the bed, and sensors.

The water is made of impulse parcels and knows nothing of the controllers' wake models; a controller sees only what
`Tank.step` returns. Everything else on `Tank` is the truth of a trial, for its record and for the photographs.
"""

from wakewise.tank.current_series import CurrentSeries, read_current_series
from wakewise.tank.currents import (
    AiryWave,
    AmbientSum,
    BackgroundTurbulence,
    PumpJet,
    SteadyCurrent,
    build_ambient,
)
from wakewise.tank.grains import (
    beam_attenuation_per_m,
    erosion_rate_kg_m2_s,
    friction_velocity_m_s,
    settling_speed_m_s,
    threshold_stress_Pa,
)
from wakewise.tank.holding import Holding, holding
from wakewise.tank.instant import Ambient
from wakewise.tank.measuring import WaterMeasure
from wakewise.tank.plant import VehiclePlant
from wakewise.tank.sediment import Silt, SiltLaws
from wakewise.tank.sensors import Sensors
from wakewise.tank.settings import TankSettings, ThrusterFailure
from wakewise.tank.tank import Tank, tank_ambient
from wakewise.tank.tether import Tether
from wakewise.tank.water import Water, WaterCounts

__all__ = [
    "AiryWave",
    "Ambient",
    "AmbientSum",
    "BackgroundTurbulence",
    "CurrentSeries",
    "Holding",
    "PumpJet",
    "Sensors",
    "Silt",
    "SiltLaws",
    "SteadyCurrent",
    "Tank",
    "TankSettings",
    "Tether",
    "ThrusterFailure",
    "VehiclePlant",
    "Water",
    "WaterCounts",
    "WaterMeasure",
    "beam_attenuation_per_m",
    "build_ambient",
    "erosion_rate_kg_m2_s",
    "friction_velocity_m_s",
    "holding",
    "read_current_series",
    "settling_speed_m_s",
    "tank_ambient",
    "threshold_stress_Pa",
]
