"""Orbits on a hemisphere about a target, with their settings: the camera keeps its standoff and looks at the centre.

Camera position from azimuth (from north towards east), elevation (above the horizontal) and range:
p_WC = centre + range * (cos el cos az, cos el sin az, -sin el), NED. The optical axis points at the centre without
roll: Euler angles of a forward-right-down frame are roll 0, pitch -el, yaw az + pi.

Order `current`: each orbit starts at its view downstream of the target. Upstream, the current carries the wash of
settling, approach and climbs to the target, and it is still measurable 15 s later (docs/research-log/0040). The views
are the same in both orders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose, quat_from_euler, quat_from_matrix, quat_multiply
from wakewise.core.settings import Settings

Elevation = Annotated[float, Field(gt=0.0, lt=85.0)]
Views = Annotated[int, Field(ge=3, le=360)]


class MissionSettings(Settings):
    """Layered hemispherical orbits about the target's centre, flown without stopping between photographs."""

    elevations_deg: tuple[Elevation, ...] = Field(
        (20.0, 40.0, 60.0), min_length=1, max_length=8, description="elevation of each orbit above the target's centre"
    )
    views: tuple[Views, ...] = Field(
        (20, 16, 12), min_length=1, max_length=8, description="photographs on each orbit, evenly spread"
    )
    order: Literal["plain", "current"] = Field(
        "plain",
        description="where orbits begin: plain, in the north; current, downstream of the target by the surveyed "
        "current, where the vehicle's wash is carried away",
    )
    aim: Literal["auto", "pitch", "tilt", "both"] = Field(
        "auto",
        description="what aims the camera: the vehicle's pitch, the camera's tilt joint, or the joint to its stops and "
        "pitch for the rest; auto is both where there is a joint, else pitch",
    )
    standoff_m: float = Field(0.5, gt=0.0, le=3.0, description="distance of the camera from the target's centre")
    speed_m_s: float = Field(0.10, ge=1e-3, le=0.5, description="speed of the camera along its path")
    acceleration_m_s2: float = Field(0.05, ge=1e-3, le=1.0, description="greatest acceleration along the path")
    approach_m: float = Field(0.3, ge=0.0, le=2.0, description="the flight starts this much farther out")
    settle_s: float = Field(
        12.0, ge=0.0, le=120.0, description="hover before the first leg, until the integral knows trim and current"
    )
    max_tracking_deviation: float | None = Field(
        0.02,
        gt=0.0,
        le=1.0,
        description="largest share of the next half second's way that a method which plans may leave undone for the "
        "water's sake; null: as much as control.plan.w_track lets it",
    )
    clearance_m: float = Field(0.05, ge=0.0, le=1.0, description="least distance of the hull to anything solid")

    @model_validator(mode="after")
    def _one_count_per_orbit(self) -> MissionSettings:
        if len(self.views) != len(self.elevations_deg):
            raise ValueError(
                f"views has {len(self.views)} entries, elevations_deg {len(self.elevations_deg)}: one count per orbit"
            )
        return self


# Axes of the camera C (right, down, forward) as seen from a forward-right-down frame at the same place.
R_FC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_Q_FC = quat_from_matrix(R_FC)


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbit:
    """One circle of constant elevation with evenly spread photographs.

    `azimuths_rad`, shape (n,), are increasing; the first of the next orbit continues where this one ended.
    """

    name: str
    elevation_rad: float
    azimuths_rad: Array

    def __post_init__(self) -> None:
        freeze(self, azimuths_rad=(None,))


def layered_orbits(settings: MissionSettings) -> tuple[Orbit, ...]:
    """Lay the orbits from the lowest listed to the last; each starts half a step on, so that views interleave."""
    orbits = []
    start_rad = 0.0
    for elevation_deg, count in zip(settings.elevations_deg, settings.views, strict=True):
        step_rad = 2 * math.pi / count
        azimuths = start_rad + step_rad * np.arange(count, dtype=np.float64)
        orbits.append(
            Orbit(name=f"orbit {elevation_deg:g} deg", elevation_rad=math.radians(elevation_deg), azimuths_rad=azimuths)
        )
        start_rad = float(azimuths[-1] + 0.5 * step_rad)
    return tuple(orbits)


def camera_pose(centre_W_m: Array, azimuth_rad: float, elevation_rad: float, range_m: float) -> Pose:
    """X_WC of a camera on the sphere, looking at the centre, image level with the horizon."""
    ca, sa = math.cos(azimuth_rad), math.sin(azimuth_rad)
    ce, se = math.cos(elevation_rad), math.sin(elevation_rad)
    p_WC = centre_W_m + range_m * np.array([ce * ca, ce * sa, -se])
    return Pose(p_WC, quat_multiply(quat_from_euler(0.0, -elevation_rad, azimuth_rad + math.pi), _Q_FC))


def camera_twist(
    azimuth_rad: float,
    elevation_rad: float,
    range_m: float,
    azimuth_rate_rad_s: float,
    elevation_rate_rad_s: float,
    range_rate_m_s: float,
) -> tuple[Array, Array]:
    """Velocity of the camera and its angular velocity, both shape (3,) and expressed in W (time derivative of above).

    The angular velocity is yaw rate about the world's down axis plus pitch rate about the level right axis.
    """
    ca, sa = math.cos(azimuth_rad), math.sin(azimuth_rad)
    ce, se = math.cos(elevation_rad), math.sin(elevation_rad)
    # Along the view's radius, towards growing azimuth (-sin az, cos az, 0), and towards growing elevation.
    out, turning, rising = range_rate_m_s, range_m * azimuth_rate_rad_s * ce, range_m * elevation_rate_rad_s
    v_W = np.array(
        [
            out * ce * ca - turning * sa - rising * se * ca,
            out * ce * sa + turning * ca - rising * se * sa,
            -out * se - rising * ce,
        ]
    )
    # Right axis of the level view frame with yaw az + pi: (-sin yaw, cos yaw, 0) = (sin az, -cos az, 0).
    omega_W = np.array([-elevation_rate_rad_s * sa, elevation_rate_rad_s * ca, azimuth_rate_rad_s])
    return v_W, omega_W


LEAST_CURRENT_M_S = 0.01
"""A slower current has no order: it needs the better part of a minute from the camera to the target, longer than wash
is felt."""


def order_downstream_first(orbits: tuple[Orbit, ...], current_W_m_s: Array) -> tuple[Orbit, ...]:
    """The same orbits, each begun at the first of its views from downstream on, in the direction in which it is listed.

    `current_W_m_s`, shape (3,): of which the level part counts; below `LEAST_CURRENT_M_S` orbits begin as listed. With
    the orbits' own azimuths, but for whole turns; each goes on from where the one before ended.
    """
    north, east = float(current_W_m_s[0]), float(current_W_m_s[1])
    if math.hypot(north, east) < LEAST_CURRENT_M_S:
        return orbits
    downstream = math.atan2(east, north)
    begun = []
    for turns, orbit in enumerate(orbits):
        on = np.sort(np.mod(orbit.azimuths_rad - downstream, 2 * math.pi))
        begun.append(replace(orbit, azimuths_rad=downstream + 2 * math.pi * turns + on))
    return tuple(begun)
