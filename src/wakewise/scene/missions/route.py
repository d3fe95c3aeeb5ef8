"""Timed routes: legs joined with limits of speed and acceleration, and the instants of the shutter."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, quat_conjugate, quat_multiply
from wakewise.core.interfaces import BodyState, Goal
from wakewise.scene.missions.aim import CameraAim
from wakewise.scene.missions.orbit import (
    MissionSettings,
    camera_pose,
    camera_twist,
    layered_orbits,
    order_downstream_first,
)

SETTLING = "settle"
LONGEST_S = 24 * 3600.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """One stretch from rest to rest, straight in (azimuth, elevation, range).

    On circles the camera's speed is exactly as timed; on climbs, which slant across the sphere, within a few percent.
    `start` and `end` hold azimuth_rad, elevation_rad, range_m, shape (3,). `length_m` is that of the camera's path.
    `centre_W_m`, shape (3,): what it circles at its start, None for the route's centre; over the leg that moves by
    `shift_W_m`, shape (3,). With range 0 the centre is the camera's own place: a transect.
    """

    name: str
    start: Array
    end: Array
    length_m: float
    duration_s: float
    speed_m_s: float
    acceleration_m_s2: float
    centre_W_m: Array | None = None
    shift_W_m: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        freeze(self, start=(3,), end=(3,), shift_W_m=(3,))

    def progress(self, time_s: float) -> tuple[float, float]:
        """Fraction of the leg done and its rate of change in 1/s: speed up, cruise, slow down."""
        if self.length_m <= 0.0 or self.duration_s <= 0.0:
            return 1.0, 0.0
        t = min(max(time_s, 0.0), self.duration_s)
        a, v = self.acceleration_m_s2, self.speed_m_s
        ramp_s = v / a
        if t < ramp_s:
            s, rate = 0.5 * a * t * t, a * t
        elif t > self.duration_s - ramp_s:
            left = self.duration_s - t
            s, rate = self.length_m - 0.5 * a * left * left, a * left
        else:
            s, rate = v * (t - 0.5 * ramp_s), v
        return s / self.length_m, rate / self.length_m

    def time_at(self, fraction: float) -> float:
        """Time into the leg at which this fraction of its length is done (inverse of `progress`)."""
        a, v = self.acceleration_m_s2, self.speed_m_s
        ramp_m = 0.5 * v * v / a
        s = fraction * self.length_m
        if s < ramp_m:
            return float(np.sqrt(2 * s / a))
        if s > self.length_m - ramp_m:
            return self.duration_s - float(np.sqrt(2 * max(self.length_m - s, 0.0) / a))
        return s / v + 0.5 * v / a


def rest_to_rest(
    name: str,
    start: Array,
    end: Array,
    speed_m_s: float,
    acceleration_m_s2: float,
    centre_W_m: Array | None = None,
    shift_W_m: Array | None = None,
) -> Leg:
    """Time a leg with trapezoidal speed; short legs never reach the full speed. Centre and shift as `Leg` has them."""
    # The path is a straight line in spherical coordinates; its length by fine chords.
    shift = np.zeros(3) if shift_W_m is None else shift_W_m
    fractions = np.linspace(0.0, 1.0, 257)[:, None]
    az, el, rng = np.moveaxis((1 - fractions) * start + fractions * end, -1, 0)
    points = np.stack([rng * np.cos(el) * np.cos(az), rng * np.cos(el) * np.sin(az), -rng * np.sin(el)], axis=-1)
    points += fractions * shift
    length_m = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    peak = min(speed_m_s, float(np.sqrt(acceleration_m_s2 * length_m)))
    duration_s = length_m / peak + peak / acceleration_m_s2 if length_m > 0 else 0.0
    return Leg(
        name=name,
        start=start,
        end=end,
        length_m=length_m,
        duration_s=duration_s,
        speed_m_s=peak,
        acceleration_m_s2=acceleration_m_s2,
        centre_W_m=centre_W_m,
        shift_W_m=shift,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """Legs in order, the target's centre they circle, and when the shutter opens.

    `starts_s`, shape (legs,), is when each leg begins. `exposures_s`, shape (k,), increasing, is when the shutter
    opens; `exposure_names` names the photographs and `X_WC_planned` says where each should be taken from.
    """

    centre_W_m: Array
    legs: tuple[Leg, ...]
    starts_s: Array
    exposures_s: Array
    exposure_names: tuple[str, ...]
    X_WC_planned: tuple[Pose, ...]
    duration_s: float

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,), starts_s=(None,), exposures_s=(None,))

    def leg_name(self, time_s: float) -> str:
        """What the vehicle is doing: the name of the leg under way, or `SETTLING` before the first."""
        return SETTLING if time_s < self.starts_s[0] else self.legs[self.leg_at(time_s)].name

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """When photograph `number`, counted from 0, is taken, if before the step from `time_s` is over; else None."""
        if number >= len(self.exposures_s) or self.exposures_s[number] >= time_s + dt_s:
            return None
        return float(self.exposures_s[number])

    def photo(self, number: int) -> str:
        """Name of photograph `number`: the planned one's, or by its number where more are taken than were planned."""
        return self.exposure_names[number] if number < len(self.exposure_names) else f"{number:03d}.png"

    def leg_at(self, time_s: float) -> int:
        """Index of the leg under way; before the first leg begins it is the first, held at its start."""
        return min(max(bisect_right(self._starts, time_s) - 1, 0), len(self.legs) - 1)

    def camera(self, time_s: float) -> tuple[Pose, Array, Array]:
        """Desired camera pose X_WC, its velocity and its angular velocity in W (shape (3,) each)."""
        leg, fraction, speed = self._progress(time_s)
        place = ((1 - fraction) * leg.start + fraction * leg.end).tolist()
        v_W, omega_W = camera_twist(*place, *(speed * (leg.end - leg.start)).tolist())
        centre = self.centre_W_m if leg.centre_W_m is None else leg.centre_W_m
        return camera_pose(centre + fraction * leg.shift_W_m, *place), v_W + speed * leg.shift_W_m, omega_W

    def tilt(self, time_s: float, aim: CameraAim | Pose) -> tuple[float, float]:
        """Desired angle of the camera's joint and its rate; zeros where it is not aimed with."""
        if isinstance(aim, Pose):
            return 0.0, 0.0
        (_, elevation, _), (_, elevation_rate, _) = (numbers.tolist() for numbers in self.on_sphere(time_s))
        return aim.tilt(-elevation, -elevation_rate)

    def body(self, time_s: float, aim: CameraAim | Pose) -> BodyState:
        """Reference pose and twist of a body with this camera aim, or with a fixed mount X_BC."""
        X_WB, nu_B, _ = self.reference(time_s, CameraAim(X_BC=aim) if isinstance(aim, Pose) else aim)
        return BodyState(X_WB=X_WB, nu_B=nu_B)

    def reference(self, time_s: float, aim: CameraAim) -> tuple[Pose, Array, float]:
        """Desired pose of a body, its twist, shape (6,), and the angle of the camera's joint.

        As `camera` and `tilt`, in plain numbers, because each control step calls it.
        """
        X_WC, v_WC, omega_W = self.camera(time_s)
        tilt, tilt_rate = self.tilt(time_s, aim)
        X_BC = aim.mount(tilt)
        q_WB = quat_multiply(X_WC.q, quat_conjugate(X_BC.q))
        R_WB = matrix_from_quat(q_WB)
        v_BC, omega_BC = aim.camera_motion(tilt, tilt_rate)
        p, q, r = omega_B = omega_W @ R_WB - omega_BC
        x, y, z = X_BC.p_m
        v_B = v_WC @ R_WB - v_BC - np.array([q * z - r * y, r * x - p * z, p * y - q * x])
        return Pose(X_WC.p_m - R_WB @ X_BC.p_m, q_WB), np.concatenate([v_B, omega_B]), tilt

    @cached_property
    def _starts(self) -> list[float]:
        """`starts_s` as plain numbers, which are quicker to look one up in."""
        return list(self.starts_s.tolist())

    def on_sphere(self, time_s: float) -> tuple[Array, Array]:
        """Azimuth, elevation and range of the camera, and their rates, shape (3,) each."""
        leg, fraction, rate = self._progress(time_s)
        return (1 - fraction) * leg.start + fraction * leg.end, rate * (leg.end - leg.start)

    def _progress(self, time_s: float) -> tuple[Leg, float, float]:
        """Leg under way, how much of it is done, and how fast that grows, 1/s."""
        leg = self.legs[i := self.leg_at(time_s)]
        return leg, *leg.progress(time_s - self._starts[i])


def plan_route(centre_W_m: Array, settings: MissionSettings, current_W_m_s: Array | None = None) -> Route:
    """Settle, approach, then fly each orbit and the climb to the next; photographs on the orbits only.

    `current_W_m_s`, shape (3,): what is known of the current before the flight, for `settings.order`; None if nothing
    is. Shapes: `centre_W_m` (3,). Raises InputError if the flight would take longer than a day.
    """
    orbits = layered_orbits(settings)
    if settings.order == "current" and current_W_m_s is not None:
        orbits = order_downstream_first(orbits, current_W_m_s)
    far, near = settings.standoff_m + settings.approach_m, settings.standoff_m
    here = np.array([orbits[0].azimuths_rad[0], orbits[0].elevation_rad, far])
    legs: list[Leg] = []
    starts: list[float] = []
    exposures: list[float] = []
    names: list[str] = []
    planned: list[Pose] = []
    clock_s = settings.settle_s

    def go(name: str, end: Array) -> Leg:
        nonlocal here, clock_s
        leg = rest_to_rest(name, here, end, settings.speed_m_s, settings.acceleration_m_s2)
        legs.append(leg)
        starts.append(clock_s)
        clock_s += leg.duration_s
        here = end
        return leg

    for orbit in orbits:
        first, last = float(orbit.azimuths_rad[0]), float(orbit.azimuths_rad[-1])
        go("approach" if not exposures else f"climb to {orbit.name}", np.array([first, orbit.elevation_rad, near]))
        begin_s = clock_s
        leg = go(orbit.name, np.array([last, orbit.elevation_rad, near]))
        for azimuth in orbit.azimuths_rad:
            exposures.append(begin_s + leg.time_at((azimuth - first) / (last - first)))
            names.append(f"{len(names):03d}.png")
            planned.append(camera_pose(centre_W_m, float(azimuth), orbit.elevation_rad, near))
    if clock_s > LONGEST_S:
        path_m = sum(leg.length_m for leg in legs)
        raise InputError(
            f"mission: {path_m:.1f} m at {settings.speed_m_s:g} m/s and {settings.acceleration_m_s2:g} m/s2 take "
            f"{clock_s / 3600.0:.1f} h, at most {LONGEST_S / 3600.0:g} h are allowed"
        )
    return Route(
        centre_W_m=centre_W_m,
        legs=tuple(legs),
        starts_s=np.array(starts),
        exposures_s=np.array(exposures),
        exposure_names=tuple(names),
        X_WC_planned=tuple(planned),
        duration_s=clock_s + 0.5,  # the last shutter closes before the recording ends
    )


def open_route(
    centre_W_m: Array, duration_s: float, name: str = "free", still: Sequence[float] | Array = (0.0, 0.0, 1.0)
) -> Route:
    """A stretch of time at one place, azimuth, elevation and range, without photographs."""
    still = np.array(still)
    leg = Leg(
        name=name,
        start=still,
        end=still,
        length_m=0.0,
        duration_s=duration_s,
        speed_m_s=0.1,
        acceleration_m_s2=0.1,
    )
    return Route(
        centre_W_m=centre_W_m,
        legs=(leg,),
        starts_s=np.zeros(1),
        exposures_s=np.zeros(0),
        exposure_names=(),
        X_WC_planned=(),
        duration_s=duration_s,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class RoutePilot:
    """A `Pilot` that follows a route by the clock; `max_tracking_deviation` as of its goals."""

    route: Route
    aim: CameraAim | Pose
    max_tracking_deviation: float | None = None

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Reference pose and twist of the body, and angle of the camera's joint; by the clock alone."""
        del estimate
        X_WB, nu_B, tilt = self.route.reference(time_s, self._aim)
        return Goal(X_WB=X_WB, nu_B=nu_B, tilt_rad=tilt, max_tracking_deviation=self.max_tracking_deviation)

    @cached_property
    def _aim(self) -> CameraAim:
        return CameraAim(X_BC=self.aim) if isinstance(self.aim, Pose) else self.aim
