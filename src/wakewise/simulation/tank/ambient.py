"""Ambient flow and still water of a tank from its settings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Current
from wakewise.core.plugins import make, offered
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.tank.settings import EDDY_M, MAX_PARCELS, TankSettings
from wakewise.simulation.water import (
    AiryWave,
    AmbientSum,
    BackgroundTurbulence,
    PumpJet,
    SteadyCurrent,
    read_current_series,
)
from wakewise.simulation.water.blockage import Blockage
from wakewise.simulation.water.current_series import CurrentSeries
from wakewise.simulation.water.currents import NamedCurrent
from wakewise.simulation.water.round_jet_closure import SWIRLING, JetSpreading
from wakewise.simulation.water.water import Water


def build_ambient(settings: TankSettings, rng: np.random.Generator) -> AmbientSum:
    """Ambient flow of the settings; the generator draws the background turbulence only.

    Raises InputError if the series' file is not usable, or the pump's outlet is outside the water.
    """
    length, width, depth = settings.size_m
    parts: list[Current] = []
    if settings.current.file is not None:
        parts.append(_current(settings))
    elif any(settings.current.velocity_m_s):
        parts.append(SteadyCurrent(velocity_W_m_s=np.array(settings.current.velocity_m_s)))
    if settings.waves.amplitude_m > 0.0:
        parts.append(
            AiryWave(
                amplitude_m=settings.waves.amplitude_m,
                period_s=settings.waves.period_s,
                heading_rad=math.radians(settings.waves.heading_deg),
                depth_m=depth,
            )
        )
    if settings.pump.speed_m_s > 0.0:
        x, y, z = settings.pump.at_m
        if abs(x) > length / 2 or abs(y) > width / 2 or not 0.0 <= z <= depth:
            raise InputError(
                f"tank.pump.at_m: ({x:g}, {y:g}, {z:g}) m is outside the water of {length:g} x {width:g} x {depth:g} m"
            )
        parts.append(
            PumpJet(
                outlet_W_m=np.array(settings.pump.at_m),
                towards_W=np.array(settings.pump.towards),
                speed_m_s=settings.pump.speed_m_s,
                diameter_m=settings.pump.diameter_m,
                bed_z_m=depth,
                reach_m=math.hypot(length, width),
            )
        )
    if settings.current.turbulence_m_s > 0.0:
        parts.append(BackgroundTurbulence.drawn(settings.current.turbulence_m_s, EDDY_M, rng))
    return AmbientSum(parts=tuple(parts))


def _current(settings: TankSettings) -> Current:
    """What the settings name in place of a steady current: a series' file, or a current from outside."""
    named = settings.current.file or ""
    if not Path(named).expanduser().exists() and (named in offered("current") or ":" in named):
        return make("current", named, {}, checked=lambda made: NamedCurrent(made, named))
    return _series(settings)


def _series(settings: TankSettings) -> CurrentSeries:
    return read_current_series(
        Path(settings.current.file or "").expanduser(),
        start_s=settings.current.from_s,
        stop_s=settings.current.to_s,
        gain=settings.current.gain,
        longest_gap_s=settings.current.gap_s,
    )


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
