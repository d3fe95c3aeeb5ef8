"""Blocks of foam and lead on a vehicle: what they add to mass, inertia, displaced volume and the two centres.

A block is a point of a mass and a volume of its own: a float of polyurethane foam, 192 kg/m3 (General Plastics
R-3312, 12 lb/ft3, sold for ROVs), or a weight of lead, 11,340 kg/m3 (CRC Handbook). Masses, first and second moments
of mass and volumes add up, which is all that rigid bodies do when they are joined. Added mass and drag stay as they
are: 3 N of float are 0.4 l, a tenth of the smallest vehicle's volume, inside its frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.settings import Settings
from wakewise.robot.vehicles.vehicle import Vehicle

FOAM_KG_M3, LEAD_KG_M3 = 192.0, 11340.0
Coordinate = Annotated[float, Field(ge=-5.0, le=5.0)]


class BallastBlock(Settings):
    """One block of ballast on the vehicle; the controller's model has it, too."""

    float_N: float = Field(ge=-5000.0, le=5000.0, description="what it lifts in water, a negative one is lead")
    at_B_m: tuple[Coordinate, Coordinate, Coordinate] | None = Field(
        None, description="where, in the body frame; null: at the centre of buoyancy"
    )


def with_blocks(vehicle: Vehicle, blocks: Sequence[BallastBlock]) -> Vehicle:
    """The vehicle with blocks of ballast fixed to it.

    `blocks`: places of null mean the centre of buoyancy of the vehicle without them.
    """
    held = [block for block in blocks if block.float_N != 0.0]
    if not held:
        return vehicle
    places = np.array([vehicle.p_BB_m if b.at_B_m is None else np.array(b.at_B_m) for b in held])
    density = np.array([FOAM_KG_M3 if b.float_N > 0.0 else LEAD_KG_M3 for b in held])
    volumes = np.array([b.float_N for b in held]) / (GRAVITY_M_S2 * (TRIM_WATER_KG_M3 - density))
    masses = density * volumes
    mass_kg = vehicle.mass_kg + float(masses.sum())
    volume_m3 = vehicle.displaced_volume_m3 + float(volumes.sum())
    p_BG_m = (vehicle.mass_kg * vehicle.p_BG_m + masses @ places) / mass_kg
    inertia = vehicle.inertia_kg_m2 + _moved(vehicle.mass_kg, vehicle.p_BG_m - p_BG_m)
    for m, place in zip(masses, places, strict=True):
        inertia = inertia + _moved(float(m), place - p_BG_m)
    return replace(
        vehicle,
        mass_kg=mass_kg,
        inertia_kg_m2=inertia,
        displaced_volume_m3=volume_m3,
        p_BG_m=p_BG_m,
        p_BB_m=(vehicle.displaced_volume_m3 * vehicle.p_BB_m + volumes @ places) / volume_m3,
    )


def net_buoyancy_N(vehicle: Vehicle) -> float:
    """Buoyancy less weight in fresh water of 1000 kg/m3, positive floats."""
    return GRAVITY_M_S2 * (TRIM_WATER_KG_M3 * vehicle.displaced_volume_m3 - vehicle.mass_kg)


def ballasted(vehicle: Vehicle, float_N: float, shift_mm: float = 0.0) -> Vehicle:
    """The vehicle with a block of this net buoyancy at its centre of buoyancy and its own mass this far forward.

    Raises InputError if `float_N` is not within what a block may have.
    """
    if not abs(float_N) <= 5000.0:
        raise InputError(f"ballast: {float_N:g} N, a block has -5000 to 5000 N")
    shifted = replace(vehicle, p_BG_m=vehicle.p_BG_m + np.array([1e-3 * shift_mm, 0.0, 0.0]))
    return with_blocks(shifted, [BallastBlock(float_N=float_N)])


def _moved(mass_kg: float, away_m: Array) -> Array:
    """Inertia of a point mass about a place this far away, shape (3, 3): m (r'r I - r r')."""
    return mass_kg * (float(away_m @ away_m) * np.eye(3) - np.outer(away_m, away_m))
