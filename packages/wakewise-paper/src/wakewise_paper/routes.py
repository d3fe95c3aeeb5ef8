"""How each scenario is flown: hover and arc, station, transect, brake; each a route of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.missions import CameraAim, Leg, Route, TankBounds, aim_of, check_clearance
from wakewise.scene.missions.route import rest_to_rest
from wakewise.scene.targets import Target

SETTLE_S, HOVER_S, ARC_S = 8.0, 15.0, 15.0
"""A jet of 0.1 N needs 5 s to a target 0.7 m away, and its remains drift there in 15 to 20 s."""
HOVER_DEG, ARC_DEG = 40.0, 20.0
"""Elevations of two orbits of the default mission."""
STANDOFF_M, ARC_SPEED_M_S, TRANSIT_SPEED_M_S, ACCELERATION_M_S2 = 0.5, 0.06, 0.10, 0.05
EXPOSURE_EVERY_S = 3.0
CLEARANCE_M = 0.05
"""The mission's own default."""

STATION_S, STATION_ABOVE_M = 180.0, 0.20
CLOSE_M = 0.35
TRANSECT_HALF_M = 0.8
"""A vehicle's length before and after the target."""
BRAKE_FROM_M, BRAKE_AT_M, BRAKE_SPEED_M_S, BRAKE_M_S2, BRAKE_REST_S = 1.6, 0.4, 0.3, 0.15, 15.0
"""From 0.3 m/s to rest within 0.3 m and 2 s: less way than is left to the target. Rest is as long as a hover."""
LIFT_DEG = 5.0


def gentle_route(
    centre_W_m: Any,
    standoff_m: float,
    azimuth_rad: float,
    elevations_deg: tuple[float, float] = (HOVER_DEG, ARC_DEG),
) -> Route:
    """Hover on a higher orbit, sink to a lower one, fly part of it towards larger azimuths."""
    high = np.array([azimuth_rad, np.radians(elevations_deg[0]), standoff_m])
    low = np.array([azimuth_rad, np.radians(elevations_deg[1]), standoff_m])
    turn = ARC_SPEED_M_S * ARC_S / (standoff_m * np.cos(low[1]))
    hover = resting("hover", high, HOVER_S)
    sink = rest_to_rest("transit", high, low, TRANSIT_SPEED_M_S, ACCELERATION_M_S2)
    arc = rest_to_rest("orbit", low, low + np.array([turn, 0.0, 0.0]), ARC_SPEED_M_S, ACCELERATION_M_S2)
    return joined(centre_W_m, (hover, sink, arc), ("hover", "orbit"))


def station_route(target: Target, centre_W_m: Array, azimuth_rad: float) -> Route:
    """Hold one view for `STATION_S`, the camera `STATION_ABOVE_M` above the target's top."""
    up_m = top_above_centre_m(target) + STATION_ABOVE_M
    place = np.array([azimuth_rad, np.arcsin(min(up_m / STANDOFF_M, np.sin(np.radians(80.0)))), STANDOFF_M])
    return joined(centre_W_m, (resting("hover", place, STATION_S),), ("hover",))


def brake_route(centre_W_m: Array, azimuth_rad: float, elevation_deg: float) -> Route:
    """Come straight at the target, brake, rest before it."""
    far = np.array([azimuth_rad, np.radians(elevation_deg), BRAKE_FROM_M])
    near = np.array([azimuth_rad, np.radians(elevation_deg), BRAKE_AT_M])
    come = rest_to_rest("approach", far, near, BRAKE_SPEED_M_S, BRAKE_M_S2)
    return joined(centre_W_m, (come, resting("hover", near, BRAKE_REST_S)), ("hover",))


@dataclass(frozen=True, kw_only=True, eq=False)
class TransectRoute(Route):
    """A route whose legs are straight in W and whose camera looks down; legs hold places from `centre_W_m`, NED.

    `heading_rad` is where the top of the picture points.
    """

    heading_rad: float

    def camera(self, time_s: float) -> tuple[Pose, Array, Array]:
        """Desired camera pose X_WC, its velocity and its angular velocity in W (shape (3,) each)."""
        place, velocity_W = self.on_sphere(time_s)
        ahead = np.array([np.cos(self.heading_rad), np.sin(self.heading_rad), 0.0])
        right = np.array([-ahead[1], ahead[0], 0.0])
        R_WC = np.stack([right, -ahead, np.array([0.0, 0.0, 1.0])], axis=1)  # x right, y down the picture, z ahead
        return Pose(self.centre_W_m + place, quat_from_matrix(R_WC)), velocity_W, np.zeros(3)

    def tilt(self, time_s: float, aim: CameraAim | Pose) -> tuple[float, float]:
        """The camera is mounted looking down: its joint, if it has one, stays."""
        del time_s, aim
        return 0.0, 0.0


def transect_route(target: Target, centre_W_m: Array, azimuth_rad: float, altitude_m: float) -> Route:
    """From an azimuth straight over the target to the other side, camera down, `altitude_m` above its top."""
    up_m = top_above_centre_m(target) + altitude_m
    out = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    start, end = TRANSECT_HALF_M * out + [0.0, 0.0, -up_m], -TRANSECT_HALF_M * out + [0.0, 0.0, -up_m]
    length_m, ramp_s = 2.0 * TRANSECT_HALF_M, TRANSIT_SPEED_M_S / ACCELERATION_M_S2
    leg = Leg(
        name="transect",
        start=start,
        end=end,
        length_m=length_m,
        duration_s=length_m / TRANSIT_SPEED_M_S + ramp_s,
        speed_m_s=TRANSIT_SPEED_M_S,
        acceleration_m_s2=ACCELERATION_M_S2,
    )
    plain = joined(centre_W_m, (leg,), ("transect",))
    return TransectRoute(**_own(plain), heading_rad=azimuth_rad + np.pi)


def looking_down(vehicle: Vehicle) -> Vehicle:
    """The vehicle with its camera turned to look straight down, as for photomosaics; without a tilt joint."""
    down = Pose(vehicle.X_BC.p_m, quat_from_matrix(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])))
    return replace(vehicle, X_BC=down, tilt=None)


def lowest_clear_deg(
    vehicle: Vehicle, bounds: TankBounds, target: Target, standoff_m: float, from_deg: float = ARC_DEG
) -> float:
    """Lowest elevation, in steps of 5 deg from one on, of an orbit whose whole round clears floor and target.

    Raises
    ------
    InputError
        If none does.
    """
    for elevation in np.arange(from_deg, 80.0, LIFT_DEG):
        start, end = (np.array([turn, np.radians(elevation), standoff_m]) for turn in (0.0, 2 * np.pi))
        round_ = rest_to_rest("orbit", start, end, TRANSIT_SPEED_M_S, ACCELERATION_M_S2)
        route = joined(target.centre_W_m, (round_,), ())
        try:
            check_clearance(route, aim_of(vehicle), vehicle.size_m, bounds, target.mesh.vertices_m, CLEARANCE_M)
        except InputError:
            continue
        return float(elevation)
    raise InputError(f"close: no orbit of {vehicle.name} at {standoff_m:g} m clears {target.name} and the floor")


def held(route: Route, duration_s: float) -> Route:
    """The same route that waits this long at its start, without photographs."""
    return replace(
        route, starts_s=route.starts_s + duration_s, exposures_s=np.zeros(0), exposure_names=(), X_WC_planned=()
    )


def top_above_centre_m(target: Target) -> float:
    """Height of the target's top above its centre."""
    return float(target.centre_W_m[2] - target.mesh.vertices_m[:, 2].min())


def resting(name: str, place: Array, duration_s: float) -> Leg:
    """A leg that stays where it is."""
    return Leg(
        name=name,
        start=place,
        end=place,
        length_m=0.0,
        duration_s=duration_s,
        speed_m_s=TRANSIT_SPEED_M_S,
        acceleration_m_s2=ACCELERATION_M_S2,
    )


def joined(centre_W_m: Any, legs: tuple[Leg, ...], photographed: tuple[str, ...]) -> Route:
    """Settle, then the legs one after the other, with photographs every `EXPOSURE_EVERY_S` on those named."""
    starts = SETTLE_S + np.cumsum([0.0, *(leg.duration_s for leg in legs[:-1])])
    shots = [
        start + t
        for start, leg in zip(starts, legs, strict=True)
        if leg.name in photographed
        for t in np.arange(0.5 * EXPOSURE_EVERY_S, leg.duration_s, EXPOSURE_EVERY_S)
    ]
    return Route(
        centre_W_m=centre_W_m,
        legs=legs,
        starts_s=starts,
        exposures_s=np.array(shots),
        exposure_names=tuple(f"{k:03d}.png" for k in range(len(shots))),
        X_WC_planned=tuple(Pose(np.zeros(3)) for _ in shots),
        duration_s=float(starts[-1] + legs[-1].duration_s + 0.3),
    )


def _own(route: Route) -> dict[str, Any]:
    return {name: getattr(route, name) for name in Route.__dataclass_fields__}
