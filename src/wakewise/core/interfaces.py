"""Records and Protocols that packages exchange.

Controller and simulated world never import one another; both speak the types of this page, and `operation` joins them.
World W is NED, body B is FRD, camera C has OpenCV axes. SI units and radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import instance_of
from wakewise.core.geometry import Pose

S = TypeVar("S")


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetEstimate:
    """What the camera knows of the target, and the points of the water round it that are to stay still.

    `time_s` is the time of the last picture, also of one that showed nothing. `status`: `assumed`, a ball at a stated
    distance; `proposed`, detected and not yet accepted; `tracked`; `lost`, no longer seen and kept where it was.
    `covariance`, shape (3, 3), is that of the centre. `points_W_m`, `weights` and `distance_m`, shapes (n, 3) and (n,),
    are the protected region as in `wakewise.scene.targets.Region`; `version` grows with each change of it. Where the
    surface was mapped, `surface_W_m` and `towards_W`, shapes (m, 3), are its points and directions to the cameras.
    """

    time_s: float
    status: Literal["assumed", "proposed", "tracked", "lost"]
    centre_W_m: Array
    covariance: Array
    radius_m: float
    points_W_m: Array
    weights: Array
    distance_m: Array
    version: int = 0
    surface_W_m: Array | None = None
    towards_W: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.weights)
        freeze(self, centre_W_m=(3,), covariance=(3, 3), points_W_m=(n, 3), weights=(n,), distance_m=(n,))
        if self.surface_W_m is not None:
            freeze(self, surface_W_m=(None, 3), towards_W=(len(self.surface_W_m), 3))

    @property
    def centre_std_m(self) -> float:
        """Standard deviation of the centre's distance from the true one."""
        return math.sqrt(float(np.trace(self.covariance)))


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyState:
    """Where the vehicle is and how it moves, in truth or as an estimate.

    `nu_B` is the twist of B relative to the world (not to the water), linear then angular, expressed in B, shape (6,).
    Of an estimate: `load_B`, shape (6,), is the wrench in B that the vehicle's model does not explain (trim, current,
    tether), and `covariance`, shape (12, 12), that of the errors of position in W, of attitude (rotation vector in B)
    and of `nu_B`; `current_W_m_s`, shape (3,), is the water's own motion, and `current_covariance`, shape (3, 3), how
    sure that is. `target` is what the camera knows of the target. Each is None where nobody computed it or it is not
    known yet.
    """

    X_WB: Pose
    nu_B: Array = field(default_factory=lambda: np.zeros(6))
    load_B: Array = field(default_factory=lambda: np.zeros(6))
    covariance: Array | None = None
    current_W_m_s: Array | None = None
    current_covariance: Array | None = None
    target: TargetEstimate | None = None

    def __post_init__(self) -> None:
        instance_of(self.X_WB, Pose, "X_WB")
        freeze(self, nu_B=(6,), load_B=(6,))
        for name, shape in (("covariance", (12, 12)), ("current_W_m_s", (3,)), ("current_covariance", (3, 3))):
            if getattr(self, name) is not None:
                freeze(self, **{name: shape})


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """What the sensors said at one instant. A sensor that was silent is None.

    `X_WB` is a camera-based pose, `p_WB_m` a position from optical tracking, shape (3,), `omega_B_rad_s` the gyro and
    `force_B_m_s2` the accelerometer (specific force: -g when at rest), both at the body origin, shape (3,), `depth_m`
    the pressure sensor (positive down), `tilt_rad` the angle of the camera's joint. `image`, grey or RGB, uint8, is a
    picture of the camera. `pose_std`, metres and radians, is the noise of `X_WB` where it is not the filter's setting.
    """

    time_s: float
    X_WB: Pose | None = None
    p_WB_m: Array | None = None
    omega_B_rad_s: Array | None = None
    force_B_m_s2: Array | None = None
    depth_m: float | None = None
    tilt_rad: float | None = None
    image: NDArray[np.uint8] | None = None
    pose_std: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal:
    """What the mission or the pilot wants now.

    `nu_B` is the desired twist, expressed in the goal's own body frame, shape (6,). `tilt_rad` is the desired angle
    of the camera's joint, positive upwards, 0 where the camera is fixed. `tracking_weight_scale`, more than 0, is how
    closely the goal is to be followed where that can be traded for still water: planners weigh their tracking by this
    many times what their settings say; other methods follow as closely as they can. `max_tracking_deviation` is the
    largest share of the way asked for that a plan should leave undone for the water's sake; None: as much as the
    weights say.
    """

    X_WB: Pose
    nu_B: Array = field(default_factory=lambda: np.zeros(6))
    tilt_rad: float = 0.0
    tracking_weight_scale: float = 1.0
    max_tracking_deviation: float | None = None

    def __post_init__(self) -> None:
        instance_of(self.X_WB, Pose, "X_WB")
        freeze(self, nu_B=(6,))


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """What a controller decided.

    `thrusts_N`, shape (n,), one per thruster, positive along its force axis. `wrench_B` is the wrench asked of the
    allocation, shape (6,). `disturbance` is D as the controller's own wake model sees it, None if it has none.
    `fallback` says that the answer is not the one the method wanted (late, infeasible), and why. `goal` is the one that
    was flown, where the controller chose another attitude and tilt for the same pose of the camera.
    """

    thrusts_N: Array
    wrench_B: Array
    disturbance: float | None = None
    fallback: str | None = None
    goal: Goal | None = None

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,), wrench_B=(6,))


@dataclass(frozen=True, kw_only=True, eq=False)
class ScalarGrid:
    """A scalar field on a regular grid of the world, such as silt concentration in kg/m3.

    `values`, shape (nx, ny, nz), sits at `origin_W_m + spacing_m * (i, j, k)`; outside the grid the field is that of
    the coarser grid `outer`, and zero where there is none.
    """

    origin_W_m: Array
    spacing_m: float
    values: Array
    outer: ScalarGrid | None = None

    def __post_init__(self) -> None:
        freeze(self, origin_W_m=(3,), values=(None, None, None))

    @property
    def levels(self) -> tuple[Array, Array, float, Array, Array, float]:
        """Values, origin and spacing of the grid, then of the outer one; a single zero far away stands for none."""
        outer = self.outer
        coarse = _NOWHERE if outer is None else (outer.values, outer.origin_W_m, outer.spacing_m)
        return self.values, self.origin_W_m, self.spacing_m, *coarse

    @property
    def largest(self) -> float:
        """Largest value on either grid; 0 of an empty one."""
        highest = float(self.values.max(initial=0.0))
        return highest if self.outer is None else max(highest, self.outer.largest)

    def largest_near(self, p_W_m: Array, reach_m: float) -> float:
        """Largest value that either grid may have within reach of a place, shape (3,); 0 where there is no grid."""
        low = np.floor((p_W_m - reach_m - self.origin_W_m) / self.spacing_m).astype(np.int64)
        high = np.ceil((p_W_m + reach_m - self.origin_W_m) / self.spacing_m).astype(np.int64) + 1
        near = self.values[tuple(slice(max(0, a), max(0, b)) for a, b in zip(low, high, strict=True))]
        highest = float(near.max(initial=0.0))
        return highest if self.outer is None else max(highest, self.outer.largest_near(p_W_m, reach_m))


@dataclass(frozen=True, kw_only=True, eq=False)
class FlakeCloud:
    """Flakes that drift with the water, at one instant: those that a camera may see one by one.

    They are the same ones from instant to instant, evenly spread, `per_m3` in a cubic metre, in the box of the world
    from `low_W_m` to `high_W_m`; of them those at a depth below `depth_m` and with slopes x / z and y / z up to
    `slopes` in the camera's frame are given.

    `p_W_m`, `v_W_m_s`, shape (n, 3): where they are and how the water moves them. `looks`, shape (n, 3): of each flake,
    for good: its rank among them (0 to 1: where fewer are in the water than `per_m3`, those of the lowest ranks), its
    size (standard normal) and its shade (0 to 1).
    """

    p_W_m: Array
    v_W_m_s: Array
    looks: Array
    low_W_m: Array
    high_W_m: Array
    per_m3: float
    depth_m: float
    slopes: tuple[float, float]

    def __post_init__(self) -> None:
        n = len(self.p_W_m)
        freeze(self, p_W_m=(n, 3), v_W_m_s=(n, 3), looks=(n, 3), low_W_m=(3,), high_W_m=(3,))

    def covers(self, points_W_m: Array, X_WC: Pose) -> Array:
        """Whether places, shape (n, 3), lie where all flakes are given, shape (n,), for a camera at X_WC."""
        p_C = X_WC.inverse().apply(points_W_m)
        z = np.maximum(p_C[:, 2], 1e-9)
        ahead = (p_C[:, 2] > 0.0) & (p_C[:, 2] < self.depth_m)
        seen = (np.abs(p_C[:, 0]) < self.slopes[0] * z) & (np.abs(p_C[:, 1]) < self.slopes[1] * z)
        boxed = np.all((points_W_m >= self.low_W_m) & (points_W_m <= self.high_W_m), axis=1)
        covered: Array = ahead & seen & boxed
        return covered


_NOWHERE = (np.zeros((1, 1, 1)), np.full(3, 1e12), 1.0)


class WakeModel(Protocol):
    """What a controller believes a thruster's jet does to the water; speed grows with the square root of thrust."""

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        ...

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton.

        `points_W_m` has shape (n, 3). `origins_W_m`, `directions_W`, shape (m, 3): where each jet starts and the unit
        direction *of the jet* (opposite to the force on the vehicle). `area_m2`, shape (m,): disk area of each jet's
        thruster. Returns ndarray, shape (m, n, 3), in m/s/sqrt(N): multiply row i by sqrt(|T_i|) for the velocity that
        jet i adds at each point.
        """
        ...


class Flow(Protocol):
    """Moving water: the truth of a trial at its present instant."""

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s at points, both shape (n, 3), expressed in the world."""
        ...


class Controller(Protocol, Generic[S]):
    """Turns an estimate and a goal into thrusts. State goes in and comes out; nothing is hidden."""

    @property
    def name(self) -> str:
        """Method name used in scenario files and tables."""
        ...

    def init(self) -> S:
        """State before the first step."""
        ...

    def step(self, state: S, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[S, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        ...


class Estimator(Protocol, Generic[S]):
    """Turns measurements into an estimate of the state."""

    def init(self, start: BodyState) -> S:
        """State at the start, from a first guess."""
        ...

    def step(
        self, state: S, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[S, BodyState]:
        """Advance by `dt_s` under the commanded thrusts, take in what was measured, and say where the vehicle is."""
        ...


class Plant(Protocol):
    """The vehicle in its water: simulated tank, autopilot or sea.

    One whose camera has a joint may have a method `aim(tilt_rad)`, which is called before each step with the desired
    angle, and hands the angle that it measured over with the step's measurements. Without it the camera is fixed.
    `push(wrench_B)`, where there is one, pushes it from outside the water until the next call: N, N m, body frame.
    """

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Hold the commanded thrusts for `dt_s` and return what the sensors said meanwhile, oldest first."""


class Pilot(Protocol):
    """Where goals come from: a mission, a script or a person."""

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Say what is wanted at `time_s`."""


@dataclass(frozen=True, kw_only=True)
class WaterTruth:
    """What the water does at the target at one instant, in the figures that a trial is judged by.

    Speeds of `target_*` and `bed_*` are in excess of the same water without the vehicle: on points spread evenly over
    the target's surface, and 1 to 2 cm above the bed within 0.3 m of its foot. What follows is of the whole water, with
    currents: `target_pressure_*` is 1/2 rho u^2 on the surface, `bed_shear_p95_Pa` the stress on the bed within the
    0.3 m, and `tracer_speed_mean_m_s` what PIV would call the speed there, the straight way of tracers over the time
    of one picture. `turbidity_per_m` is the mean beam attenuation by silt in the water within 0.3 m of the target's
    centre, and `ray_optical_depth` that attenuation along the rays from the camera to the side of the target that it
    faces, from end to end, a mean without unit. `silt_lifted_g` is what the bed has given up since the start, settled
    again or not, `silt_suspended_g` what is in the water now. `target_over_1cm_s` and
    `target_over_ambient` are the shares of the surface where the excess is more than 1 cm/s, and more than the mean
    speed there of the same water without the vehicle (NaN where that is still). `bed_over_threshold` is the share of
    the bed within 0.2 m of the target's foot where the stress moves grains (NaN where neither bed nor water holds any).
    NaN where a truth provider does not know.
    """

    target_speed_mean_m_s: float
    target_speed_p95_m_s: float
    bed_speed_p95_m_s: float
    turbidity_per_m: float
    target_pressure_mean_Pa: float = math.nan
    target_pressure_p95_Pa: float = math.nan
    bed_shear_p95_Pa: float = math.nan
    tracer_speed_mean_m_s: float = math.nan
    ray_optical_depth: float = math.nan
    silt_lifted_g: float = math.nan
    silt_suspended_g: float = math.nan
    target_over_1cm_s: float = math.nan
    target_over_ambient: float = math.nan
    bed_over_threshold: float = math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What really was at one instant, for the record only: no controller sees it."""

    state: BodyState
    thrusts_N: Array
    power_W: float
    collision: bool
    tilt_rad: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetDeformation:
    """How a soft or a loose target stands at one instant, for the record only.

    `tips_m` and `tip_speeds_m_s`, shape (k, 2), are the way and the speed of its k stems' tips along their two axes
    (see `wakewise.scene.targets.BendingModes`), and `shift_m`, shape (2,), how far it has slid north and east. Of the
    surface above the bed, against its shape at rest in still water and without the sliding: `sway_m` is the root mean
    square distance, `sway_peak_m` the largest, and `sway_mean_W_m`, shape (3,), the mean way. `target_stress_Pa` is the
    largest bending stress. `sway_wash_m` is the root mean square distance from where the same water without the vehicle
    would have the surface, `drag_N` the drag of the water on the whole target.
    """

    tips_m: Array
    tip_speeds_m_s: Array
    shift_m: Array
    sway_m: float
    sway_peak_m: float
    sway_mean_W_m: Array
    target_stress_Pa: float
    sway_wash_m: float = math.nan
    drag_N: float = math.nan

    def __post_init__(self) -> None:
        k = len(self.tips_m)
        freeze(self, tips_m=(k, 2), tip_speeds_m_s=(k, 2), shift_m=(2,), sway_mean_W_m=(3,))


class TruthProvider(Protocol):
    """Knows the truth of a simulated world; there is none at sea.

    Beside what follows it may have `posture()`, which gives how a soft or a loose target stands now, a
    `TargetDeformation`, or None of one that nothing moves.
    """

    def observe(self) -> Truth:
        """Vehicle, thrusters and collisions now."""

    def water(self) -> WaterTruth:
        """Water at the target now; dearer than `observe`, so asked less often."""

    def silt(self) -> ScalarGrid:
        """Silt concentration around the target now, kg/m3."""


class World(Protocol):
    """Where a vehicle flies: simulated tank, the paper's water, an autopilot, the sea.

    One that does not wait for its controller says so by an attribute `waits` that is False; thrusts that come too late
    are not sent there (see `wakewise.control.failsafe`).
    """

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""

    def begin(self) -> tuple[Plant, TruthProvider | None]:
        """The vehicle in its water at the start of a flight, and who knows the truth of it; a fresh one at each call.

        A simulated world begins alike each time, so that flights in it can be compared.
        """


class Current(Protocol):
    """Water that no thruster moves.

    Beside `velocity` it may say, and is asked with these defaults where it does not: `steady` (False) and `uniform`
    (False), whether it is the same at all times and everywhere; `end_s` (infinite), until when it is known;
    `stirred_bed()` (none), circles (x, y, radius), shape (n, 3), in which it sweeps the bed.
    """

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity in m/s at points, both shape (n, 3), in the world, `time_s` after the start."""
        ...


Progress = Callable[..., None]
"""A callable `(done, total, note)` that a long stage calls now and then; see `no_progress`."""


def no_progress(done: float, total: float, note: str = "") -> None:
    """Ignore progress."""
