"""A tank's water as its settings say, before anything has moved in it."""

from __future__ import annotations

import numpy as np

from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.tank.settings import MAX_PARCELS, TankSettings
from wakewise.simulation.water import AmbientSum
from wakewise.simulation.water.blockage import Blockage
from wakewise.simulation.water.round_jet_closure import SWIRLING, JetSpreading
from wakewise.simulation.water.water import Water


def tank_water(
    vehicle: Vehicle, target: Target, settings: TankSettings, ambient: AmbientSum, rng: np.random.Generator
) -> Water:
    """Water of a tank before anything has moved in it; `rng` is the source of its jets' turbulence."""
    length, width, depth = settings.size_m
    return Water(
        vehicle.disk_areas_m2,
        density_kg_m3=settings.density_kg_m3,
        bed_z_m=depth,
        rng=rng,
        ambient=ambient,
        half_size_m=(length / 2, width / 2),
        turbulence=settings.jets.turbulence,
        max_parcels=MAX_PARCELS,
        spreading=SWIRLING if settings.jets.swirl else JetSpreading.of_width(settings.jets.half_width_growth),
        body=Blockage.of(target),
        wake_life=settings.jets.wake_life,
    )
