"""What gentle control may use beyond the free jet of one instant; each lever has its own switch.

Water near the target is stirred in more ways than a free jet's: jets that strike the bed run along it to the target's
foot, and what leaves a thruster now arrives seconds later. The levers tell a controller of this. None of them knows the
simulated world's truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wakewise.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.interfaces import BodyState, Command, Controller, Goal
from wakewise.settings import Settings
from wakewise.targets import Region
from wakewise.wake import arrival_time_s

DECAY = 1.5
"""Power of time with which the square of the speed of a jet's remains falls."""

BED_HEIGHTS_M = (0.01, 0.03)
"""Bed points lie between these heights: where a wall jet half a metre from its strike point is fastest."""
GOLDEN_RAD = float(np.pi * (3.0 - np.sqrt(5.0)))
"""Angle of a sunflower's spiral, which spreads points evenly over a disk (H. Vogel, Math. Biosci. 44 (1979) 179)."""

KRONECKER = 1.2207440846057596 ** -np.arange(1.0, 4.0)
"""Steps of a Kronecker sequence that fills a box evenly: powers of the root of x^4 = x + 1."""


Component = Annotated[float, Field(ge=-1.0, le=1.0)]


class LeverSettings(Settings):
    """Switches of the levers; all off is the cost of the paper."""

    bed: bool = Field(default=False, description="also keep the water still on the bed around the target")
    bed_points: int = Field(default=80, description="how many bed points", ge=4, le=2000)
    bed_radius_m: float = Field(
        default=0.3, description="how far from the target's foot they reach (m)", gt=0.0, le=2.0
    )
    bed_weight: float = Field(
        default=0.5, description="weight of all bed points together, over that of the region", gt=0.0, le=100.0
    )
    halo: bool = Field(
        default=False, description="also keep the water round the target still: what is stirred there drifts onto it"
    )
    halo_points: int = Field(default=160, description="how many points of that water", ge=4, le=2000)
    halo_m: float = Field(default=0.3, description="how far from the target it reaches (m)", gt=0.0, le=2.0)
    halo_weight: float = Field(
        default=0.5, description="weight of all of it together, over that of the region", gt=0.0, le=100.0
    )
    quiet: bool = Field(default=False, description="weigh disturbance more where its water arrives during an exposure")
    quiet_gain: float = Field(default=10.0, description="how many times more it weighs then", ge=1.0, le=1000.0)
    quiet_lead_s: float = Field(
        default=1.0,
        description="how long before the shutter opens that begins: a wake's time to arrive",
        ge=0.0,
        le=5.0,
    )
    incoherent: bool = Field(default=False, description="add squares of speeds: no cancelling of jets that meet")
    tilt_deg: float = Field(
        default=0.0,
        description="roll and pitch that the camera tolerates and the planner may use (deg)",
        ge=0.0,
        le=20.0,
    )
    level_deg: float = Field(
        default=0.0,
        description="fly this much nearer to level than asked, as far as the camera tolerates it (deg)",
        ge=0.0,
        le=20.0,
    )
    spare: bool = Field(
        default=False, description="share out the plan's wrench anew at every step by the exact allocator"
    )
    meet: bool = Field(
        default=False, description="count what jets become that meet: they join and run on between them; needs spare"
    )
    drift: bool = Field(
        default=False, description="also keep the water still that the current will bring to the target"
    )
    drift_m_s: tuple[Component, Component, Component] = Field(
        default=(0.0, 0.0, 0.0), description="that current as measured before the flight: north, east, down"
    )
    drift_s: float = Field(default=25.0, description="how long before it arrives that begins", gt=0.0, le=120.0)
    drift_spread_m_s: float = Field(
        default=0.02, description="how fast what a jet leaves grows wider on the way (m/s)", ge=0.0, le=0.2
    )
    drift_points: int = Field(default=160, description="how many points of that water", ge=4, le=2000)
    drift_weight: float = Field(
        default=0.5, description="weight of all of it together, over that of the region", gt=0.0, le=100.0
    )


def with_bed_points(region: Region, levers: LeverSettings, bed_z_m: float | None = None) -> Region:
    """The region and, if the lever is on, a disk of points just above the bed around the target's foot.

    Parameters
    ----------
    region : Region
    levers : LeverSettings
    bed_z_m : float, optional
        Depth of the bed; the lowest point of the region where it is not known.

    Returns
    -------
    Region
        The weights of the bed points add up to `bed_weight` times those of the region.
    """
    if not levers.bed:
        return region
    surface = region.points_W_m[region.distance_m <= 0.0]
    foot = (surface if len(surface) else region.points_W_m)[:, :2].mean(axis=0)
    bed = float(region.points_W_m[:, 2].max()) if bed_z_m is None else bed_z_m
    k = np.arange(levers.bed_points)
    reach = levers.bed_radius_m * np.sqrt((k + 0.5) / levers.bed_points)
    low, high = BED_HEIGHTS_M
    # Heights by the golden ratio, so that every part of the disk has low and high points.
    height = low + (high - low) * ((k + 1) * 0.6180339887498949 % 1.0)
    ring = np.stack(
        [foot[0] + reach * np.cos(GOLDEN_RAD * k), foot[1] + reach * np.sin(GOLDEN_RAD * k), bed - height], axis=1
    )
    share = levers.bed_weight * float(region.weights.sum()) / levers.bed_points
    return Region(
        points_W_m=np.concatenate([region.points_W_m, ring]),
        weights=np.concatenate([region.weights, np.full(levers.bed_points, share)]),
        # Not on the target's surface, whatever their distance: what reads surface points must not take them for it.
        distance_m=np.concatenate([region.distance_m, np.maximum(reach, 1e-3)]),
    )


def with_halo(region: Region, levers: LeverSettings, bed_z_m: float | None = None) -> Region:
    """The region and, if the lever is on, evenly spread points of the water within `halo_m` of the target's box.

    A jet that misses the target leaves moving water beside it, which the current (and the next seconds of the flight)
    bring back: what is near now may be there later. Arguments as for `with_bed_points`.
    """
    if not levers.halo:
        return region
    surface = region.points_W_m[region.distance_m <= 0.0]
    near = surface if len(surface) else region.points_W_m
    low, high = near.min(axis=0) - levers.halo_m, near.max(axis=0) + levers.halo_m
    high[2] = float(region.points_W_m[:, 2].max()) if bed_z_m is None else bed_z_m
    steps = np.arange(1, levers.halo_points + 1)[:, None]
    points = low + (high - low) * ((0.5 + steps * KRONECKER) % 1.0)
    away = np.linalg.norm(points - near.mean(axis=0), axis=1)
    share = levers.halo_weight * float(region.weights.sum()) / levers.halo_points
    return Region(
        points_W_m=np.concatenate([region.points_W_m, points]),
        weights=np.concatenate([region.weights, np.full(levers.halo_points, share)]),
        distance_m=np.concatenate([region.distance_m, np.maximum(away, 1e-3)]),
    )


def with_drift(region: Region, levers: LeverSettings) -> Region:
    """The region and, if the lever is on, the water that the current will bring to the target within `drift_s`.

    A weak jet that passes the target at a third of a metre is carried on to it by a current of 3 cm/s in ten seconds,
    by when its water has slowed but not stopped. The water at the target in t seconds is now upstream by t times the
    current, so the points are those of the target's surface, moved there, t spread evenly, and farther apart the
    farther they are, since what a jet leaves grows wider meanwhile (a front runs as 2.57 M^(1/4) t^(1/2): for 0.1 N
    at 15 s with 3 cm/s, its sides with about two thirds of that). Their weight falls with the
    square of the speed of a patch of water that a jet has left, (1 + t)^(-3/2) with t in s: the front of a jet's
    remains goes as t^(1/4) when momentum is kept, their speed as t^(-3/4).
    """
    current = np.array(levers.drift_m_s, dtype=np.float64)
    if not levers.drift or not np.any(current):
        return region
    near = np.flatnonzero(region.distance_m <= 0.0)
    near = near if len(near) else np.arange(len(region.weights))
    steps = np.arange(1, levers.drift_points + 1)
    ages_s = levers.drift_s * ((0.5 + steps * KRONECKER[0]) % 1.0)
    chosen = near[((0.5 + steps * KRONECKER[1]) % 1.0 * len(near)).astype(np.int64)]
    weights = region.weights[chosen] * (1.0 + ages_s) ** -DECAY
    weights *= levers.drift_weight * float(region.weights.sum()) / float(weights.sum())
    aside = region.points_W_m[chosen] - region.points_W_m[near].mean(axis=0)
    aside[:, 2] = 0.0
    aside /= max(float(np.linalg.norm(aside, axis=1).max()), 1e-9)
    upstream = region.points_W_m[chosen] + ages_s[:, None] * (levers.drift_spread_m_s * aside - current)
    return Region(
        points_W_m=np.concatenate([region.points_W_m, upstream]),
        weights=np.concatenate([region.weights, weights]),
        distance_m=np.concatenate([region.distance_m, np.maximum(ages_s * float(np.linalg.norm(current)), 1e-3)]),
    )


def watched(region: Region, levers: LeverSettings, bed_z_m: float | None = None) -> Region:
    """The region with what the levers add to it."""
    with_drift_and_bed = with_bed_points(with_drift(region, levers), levers, bed_z_m)
    return with_halo(with_drift_and_bed, levers, bed_z_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Early:
    """A controller that is told of the shutter ahead of time: the water it moves now arrives `lead_s` later.

    Implements `wakewise.interfaces.Controller`; the announced opening is moved forward, and may then lie in the past
    while the shutter's own time has not come.
    """

    inner: Controller[Any]
    lead_s: float

    @property
    def name(self) -> str:
        """Method name of the controller within."""
        return self.inner.name

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        return self.inner.step(state, dt_s, estimate, replace(goal, exposure_in_s=goal.exposure_in_s - self.lead_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class Level:
    """A controller whose goal is nearer to level by up to `level_rad`: it need not hold so much righting moment.

    Implements `wakewise.interfaces.Controller`. Where the body is asked to be stays; the camera then looks past the
    middle of the target, and stands up to its lever arm times the angle aside.
    """

    inner: Controller[Any]
    level_rad: float

    @property
    def name(self) -> str:
        """Method name of the controller within."""
        return self.inner.name

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        return self.inner.step(state, dt_s, estimate, nearer_level(goal, self.level_rad))


def levelled(controller: Controller[Any], levers: LeverSettings) -> Controller[Any]:
    """The controller, flown nearer to level if that lever is on."""
    return (
        Level(inner=controller, level_rad=float(np.radians(levers.level_deg))) if levers.level_deg > 0.0 else controller
    )


def nearer_level(goal: Goal, by_rad: float) -> Goal:
    """The goal with roll and pitch reduced by up to an angle each; position, heading and velocities in W stay."""
    roll, pitch, yaw = euler_from_quat(goal.X_WB.q)
    less = [float(np.sign(a)) * max(abs(float(a)) - by_rad, 0.0) for a in (roll, pitch)]
    X_WB = Pose(goal.X_WB.p_m, quat_from_euler(less[0], less[1], float(yaw)))
    turn = X_WB.R.T @ goal.X_WB.R
    return replace(goal, X_WB=X_WB, nu_B=np.concatenate([turn @ goal.nu_B[:3], turn @ goal.nu_B[3:]]))


def lead_of(distance_m: float, thrust_N: float, area_m2: float) -> float:
    """Time in s for a steady jet's water to arrive, for `quiet_lead_s` of a mission; see `wakewise.wake.travel`."""
    return float(arrival_time_s(distance_m, thrust_N, area_m2, how="steady"))
