"""The station-keeping task: what an episode draws, what is observed, what an action does and what it costs.

A vehicle holds a level pose beside a target on the bed, in a steady current, while its own parameters differ
from the nominal ones. Both environments share this module.

Observation, float32, n thrusters:

    0-2         position of the goal from the vehicle, in B (m)
    3-5         rotation vector from the vehicle's attitude to the goal's, in B (rad)
    6-11        twist in B relative to the world (m/s, rad/s)
    12-17       wrench in B that the nominal vehicle does not explain: current, trim (N, N m)
    18-(17+n)   last action
    (18+n)-end  centre of the target from the vehicle, in B (m)

Action, n numbers in [-1, 1]: thrust over `max_thrust_N`. Reward of one step of `dt_s`, from true values:

    -dt_s (min((e_p / 0.02 m)^2 + (e_a / 0.05 rad)^2, 25) + w_wash u / (1 mm/s) + w_power P / (10 W))

with the errors' norms e_p and e_a, the root mean square speed u that the vehicle adds to the water at weighted points
in and around the target, and the electrical power P. An episode is terminated once e_p exceeds 1 m. The last step then
costs 25 per second of the time that was left, so that an early end never pays.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.checks import finite_number, whole_number
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.importers import any_vehicle
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region, Target, find_target, sample_region

ERROR_M, ERROR_RAD, COST_LIMIT = 0.02, 0.05, 25.0
"""Errors of position and attitude that cost 1 per second, and the most that errors cost per second."""
WASH_M_S, POWER_W = 1e-3, 10.0
"""Water speed and electrical power that cost `w_wash` and `w_power` per second."""
OUT_OF_RANGE_M = 1.0
"""Error of position that ends an episode."""
BOUNDS = np.array([5.0] * 3 + [np.pi] * 3 + [10.0] * 6 + [100.0] * 6)
"""Observations 0 to 17 are clipped to plus or minus these."""
TARGET_BOUND_M = 10.0


@dataclass(frozen=True, kw_only=True)
class StationKeepingTask:
    """Settings of the task; ranges are uniform. Defaults of the mismatch are those of the tank of a trial.

    Raises InputError if a number is out of range, or a range runs backwards.
    """

    vehicle: str = "paper"
    target: str = "branching"
    target_seed: int = 0
    depth_m: float = 1.5
    """Depth of the water, on whose bed the target stands."""
    rate_hz: float = 50.0
    """Steps of the environment per second: the control rate of a trial."""
    episode_s: float = 10.0
    max_thrust_N: float = 10.0
    """Thrust of an action of 1, both ways; at most the vehicle's limits."""
    standoff_m: tuple[float, float] = (0.45, 0.75)
    """Horizontal distance of the vehicle's origin from the target's centre."""
    height_m: tuple[float, float] = (0.25, 0.35)
    """Height of the vehicle's origin above the bed."""
    heading_rad: float = 1.0
    """Most angle between the heading and the direction to the target: with none, level jets pass the target by."""
    start_m: float = 0.02
    start_rad: float = 0.03
    """Error of the start, one sigma per axis, as in a trial."""
    current_m_s: float = 0.1
    """Most speed of the steady, level current."""
    mass_pct: float = 5.0
    damping_pct: float = 30.0
    added_mass_pct: float = 20.0
    thrust_pct: float = 5.0
    trim_N: float = 1.0
    """How far the vehicle's own parameters and trim differ from the nominal ones, at most."""
    wake: str = "jet"
    """Wake model of the vector environment: a name of `wakewise.wake.models` with the law of a single jet."""
    points: int = 60
    """Points in and around the target at which the water's speed is taken."""
    w_wash: float = 1.0
    w_power: float = 1.0

    def __post_init__(self) -> None:
        for name in ("depth_m", "rate_hz", "episode_s", "max_thrust_N"):
            finite_number(getattr(self, name), name, above=0.0)
        for name in ("heading_rad", "start_m", "start_rad", "current_m_s", "trim_N", "w_wash", "w_power"):
            finite_number(getattr(self, name), name, least=0.0)
        for name in ("standoff_m", "height_m"):
            low, high = getattr(self, name)
            if not 0.0 < low <= high:
                raise InputError(f"{name}: from {low:g} to {high:g}, the first must be above 0 and not the larger one")
        whole_number(self.points, "points", 2)
        limit_N = float(min(self.robot.thrust_upper_N.min(), -self.robot.thrust_lower_N.max()))
        if self.max_thrust_N > limit_N:
            raise InputError(f"max_thrust_N: {self.max_thrust_N:g}, the thrusters of {self.vehicle} give {limit_N:g}")

    @property
    def robot(self) -> Vehicle:
        """The nominal vehicle."""
        return _robot(self.vehicle)

    @property
    def dt_s(self) -> float:
        """Time of one step."""
        return 1.0 / self.rate_hz

    @property
    def steps(self) -> int:
        """Steps of an episode."""
        return max(1, round(self.episode_s * self.rate_hz))

    @property
    def mismatch(self) -> dict[str, float]:
        """The percentages of the mismatch, by name."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name.endswith("_pct")}

    def scene(self) -> tuple[Target, Region]:
        """The target on the bed, and the points of the water in and around it."""
        return _scene(self.target, self.target_seed, self.depth_m, self.points)

    def observation_bounds(self) -> Array:
        """Upper bounds of the observation, shape (21 + n,); lower bounds are their negatives."""
        n = len(self.robot.thrusters)
        return np.concatenate([BOUNDS, np.ones(n), np.full(3, TARGET_BOUND_M)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Episode:
    """What an episode draws beside the vehicle: the pose to hold, the start, the current."""

    goal: Pose
    start: Pose
    current_W_m_s: Array

    def __post_init__(self) -> None:
        freeze(self, current_W_m_s=(3,))


def draw_episode(task: StationKeepingTask, centre_W_m: Array, rng: np.random.Generator) -> Episode:
    """Draw an episode round a target's centre, shape (3,)."""
    azimuth, towards = rng.uniform(-np.pi, np.pi, 2)
    standoff, height = rng.uniform(*task.standoff_m), rng.uniform(*task.height_m)
    place = centre_W_m + standoff * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    place[2] = task.depth_m - height
    heading = azimuth + np.pi + rng.uniform(-task.heading_rad, task.heading_rad)
    turn = rng.normal(0.0, task.start_rad, 3)
    speed = rng.uniform(0.0, task.current_m_s)
    return Episode(
        goal=Pose(place, quat_from_euler(0.0, 0.0, heading)),
        start=Pose(place + rng.normal(0.0, task.start_m, 3), quat_from_euler(turn[0], turn[1], heading + turn[2])),
        current_W_m_s=speed * np.array([np.cos(towards), np.sin(towards), 0.0]),
    )


def reward(task: StationKeepingTask, figures: Array, left_s: Array) -> tuple[Array, BoolArray]:
    """Reward of a step and whether it terminates the episode, shape (N,) each.

    `figures`, shape (N, 4): errors of position (m) and attitude (rad), wash (m/s), power (W). `left_s`, shape (N,):
    time left after the step.
    """
    place, attitude, wash, power = figures.T
    errors = np.minimum((place / ERROR_M) ** 2 + (attitude / ERROR_RAD) ** 2, COST_LIMIT)
    out = place > OUT_OF_RANGE_M
    cost = errors + task.w_wash * wash / WASH_M_S + task.w_power * power / POWER_W
    return -task.dt_s * cost - np.where(out, COST_LIMIT * left_s, 0.0), out


def checked_actions(actions: object, shape: tuple[int, ...]) -> Array:
    """Actions as float64, clipped to [-1, 1].

    Raises InputError if the shape differs or an action is not finite.
    """
    array = np.array(actions, dtype=np.float64)
    if array.shape != shape:
        raise InputError(f"action: shape {array.shape}, allowed {shape}")
    if not np.isfinite(array).all():
        raise InputError("action: holds NaN or infinity, every element must be finite")
    return np.clip(array, -1.0, 1.0)


_robot = cache(any_vehicle)


@cache
def _scene(kind: str, seed: int, depth_m: float, points: int) -> tuple[Target, Region]:
    target = find_target(kind, depth_m, seed)
    return target, sample_region(target, points, np.random.default_rng(0))
