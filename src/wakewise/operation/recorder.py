"""Keeps what a flight did: one row per control step, one entry per exposure, solve times apart.

steps.parquet holds nothing that depends on the machine, so the same seed gives the same bytes; solve times are in
timings.parquet. Column names carry units; frames and meanings are in docs/conventions.md.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Protocol

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose, quat_integrate
from wakewise.core.interfaces import BodyState, FlakeCloud, TargetDeformation, TruthProvider, WaterTruth
from wakewise.operation.flight_log import STANCE, ExposureRecord, FlightLog, steps_of, timings_of, write_exposures
from wakewise.operation.loop import Step
from wakewise.robot.vehicles.vehicle import TiltJoint
from wakewise.vision.imaging.settings import METERED_EVERY_S

_STATE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
_WRENCH = ("wrench_X_N", "wrench_Y_N", "wrench_Z_N", "wrench_K_Nm", "wrench_M_Nm", "wrench_N_Nm")
LOAD = ("load_X_N", "load_Y_N", "load_Z_N", "load_K_Nm", "load_M_Nm", "load_N_Nm")
"""What the estimator says that pulls at the vehicle, in B (see `wakewise.core.interfaces.BodyState`)."""
_WATER = tuple(figure.name for figure in fields(WaterTruth))
_POSTURE = (
    "sway_m", "sway_peak_m", "sway_x_m", "sway_y_m", "sway_z_m", "target_stress_Pa", "shifted_m", "sway_wash_m",
    "target_drag_N",
)  # fmt: skip


def step_columns(thrusters: int, yields: bool = False) -> list[str]:
    """Names of the numeric columns of steps.parquet, in order, for a vehicle with this many thrusters.

    Those of a target that `yields` (see `wakewise.core.interfaces.TargetDeformation`) come last.
    """
    return [
        "time_s",
        *(f"{who}_{what}" for who in ("true", "est", "goal") for what in _STATE),
        *(f"thrust_{i + 1}_N" for i in range(thrusters)),
        *(f"command_{i + 1}_N" for i in range(thrusters)),
        *_WRENCH,
        *LOAD,
        "disturbance",
        *_WATER,
        "power_W",
        *(_POSTURE if yields else ()),
        *(f"{who}_tilt_deg" for who in ("true", "est", "goal")),
    ]


class PhotoSchedule(Protocol):
    """Says when photographs are taken and what each stretch of a flight is called; a route is one."""

    def leg_name(self, time_s: float) -> str:
        """What the vehicle is doing."""
        ...

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """When photograph `number`, counted from 0, is taken, if in the step that begins at `time_s`; else None."""
        ...


@dataclass(kw_only=True, eq=False)
class FlightRecorder:
    """Collects a flight in its log and writes it whole at its end.

    Parameters
    ----------
    route : PhotoSchedule
        Gives the exposures and the names of the legs.
    X_BC : Pose
        Camera mount.
    joint : TiltJoint or None
        What tilts the camera; true poses go with its true angle, estimated ones with the measured angle.
    exposure_s : float
        How long the shutter stays open, from the first row to the last.
    instants : int
        How many true poses are kept across each exposure.
    metered : int
        How many true poses are kept from before each exposure, for automatic exposure.
    truth_provider : TruthProvider or None
        Without one, true columns and water columns are NaN and no exposure is rendered.
    water_every_s : float
        How often the water is asked about; in between the last answer stands.
    exposed : callable, optional
        Called as `(number, exposure)` for each exposure when it has been recorded; number counts from 0.
    log : FlightLog
        Where rows and exposures go; by default they are kept in memory.
    """

    route: PhotoSchedule
    X_BC: Pose
    exposure_s: float
    instants: int
    thrusters: int
    dt_s: float
    truth_provider: TruthProvider | None
    water_every_s: float = 0.1
    exposed: Callable[[int, ExposureRecord], None] | None = None
    joint: TiltJoint | None = None
    metered: int = 0
    log: FlightLog = field(default_factory=FlightLog)
    _opened: int = 0
    _recent: deque[Array] = field(init=False)
    _water: WaterTruth | None = None
    _posture: TargetDeformation | None = None
    _water_time_s: float = -np.inf

    def __post_init__(self) -> None:
        self._every = max(1, round(METERED_EVERY_S / self.dt_s))
        self._recent = deque(maxlen=self._every * max(self.metered - 1, 0) + 1)

    def __call__(self, step: Step) -> None:
        """Take in one step of the loop."""
        opens_s = self.route.shutter_s(self._opened, step.time_s, self.dt_s)
        exposing = opens_s is not None
        if self.truth_provider is not None and (
            exposing or step.time_s >= self._water_time_s + self.water_every_s - 1e-9
        ):
            self._water, self._water_time_s = self.truth_provider.water(), step.time_s
            self._posture = _posture_of(self.truth_provider)
        elif self.truth_provider is not None and not self.log.count:
            self._posture = _posture_of(self.truth_provider)  # all rows have its columns or none has
        water = [getattr(self._water, name) if self._water is not None else np.nan for name in _WATER]
        truth = step.truth
        lost = np.full(13, np.nan)
        row = [
            np.array([step.time_s]),
            state_vector(truth.state) if truth else lost,
            state_vector(step.estimate),
            state_vector(BodyState(X_WB=step.goal.X_WB, nu_B=step.goal.nu_B)),
            truth.thrusts_N if truth else np.full(self.thrusters, np.nan),
            step.command.thrusts_N,
            step.command.wrench_B,
            step.estimate.load_B,
            np.array([np.nan if step.command.disturbance is None else step.command.disturbance, *water]),
            np.array([truth.power_W if truth else np.nan]),
            _posture_row(self._posture),
            np.degrees([truth.tilt_rad if truth else np.nan, step.tilt_rad, step.goal.tilt_rad]),
        ]
        if not self.log.count:
            self.log.names = step_columns(self.thrusters, yields=self._posture is not None)
        numbers = np.concatenate(row)
        tags: dict[str, bool | str] = {
            "exposing": exposing,
            "collision": bool(truth and truth.collision),
            "fallback": step.command.fallback or "",
            "leg": self.route.leg_name(step.time_s),
        }
        self._recent.append(numbers)
        self.log.add(numbers, tags, 1e3 * step.solve_s)
        self._opened += exposing
        if opens_s is not None and truth is not None and self.truth_provider is not None:
            exposure = ExposureRecord(
                time_s=opens_s,
                X_WC_true=tuple(
                    moved(truth.state, opens_s - step.time_s + after_s) @ self._mount(truth.tilt_rad)
                    for after_s in np.linspace(0.0, self.exposure_s, self.instants)
                ),
                X_WC_est=moved(step.estimate, opens_s - step.time_s + 0.5 * self.exposure_s)
                @ self._mount(step.tilt_rad),
                silt=self.truth_provider.silt(),
                X_WC_before=self._before(),
                flakes=_flakes_before(self.truth_provider, truth.state.X_WB @ self._mount(truth.tilt_rad)),
                **_stance(self._posture),
            )
            self.log.expose(exposure)
            if self.exposed is not None:
                self.exposed(self.log.opened - 1, exposure)

    def _mount(self, tilt_rad: float) -> Pose:
        return self.X_BC if self.joint is None else self.joint.mount(self.X_BC, tilt_rad)

    def _before(self) -> tuple[Pose, ...]:
        """True camera poses until now, the last of them now; the first of the flight stand for those before it."""
        last = len(self._recent) - 1
        rows = [self._recent[max(0, last - self._every * k)] for k in reversed(range(self.metered))]
        # The last three numbers of a row are the camera's tilt, true, measured and desired.
        return tuple(Pose(row[1:4], row[4:8]) @ self._mount(math.radians(float(row[-3]))) for row in rows)

    @property
    def duration_s(self) -> float:
        """How long the flight has taken so far."""
        return self.log.count * self.dt_s

    @property
    def exposures(self) -> list[ExposureRecord]:
        """What was exposed, where it is kept in memory."""
        return self.log.exposures

    def frame(self) -> pl.DataFrame:
        """The steps as a table, of a flight that is kept in memory."""
        return steps_of(self.log.frame().lazy()).collect()

    def write(self, folder: Path) -> None:
        """Write exposures.npz and timings.parquet, then steps.parquet, whose presence says that the flight is whole."""
        write_record(folder, self.log.frame().lazy(), self.exposures, self.exposure_s)


def write_record(folder: Path, table: pl.LazyFrame, exposures: list[ExposureRecord], exposure_s: float) -> None:
    """Write a flight's exposures.npz and timings.parquet, then steps.parquet, which says that the flight is whole."""
    if exposures:
        write_exposures(folder / "exposures.npz", exposures, exposure_s)
    with whole_file(folder / "timings.parquet") as path:
        timings_of(table).write_parquet(path)
    with whole_file(folder / "steps.parquet") as path:
        steps_of(table).sink_parquet(path)


def state_vector(state: BodyState) -> Array:
    """Position, quaternion and twist in the order of the columns, shape (13,)."""
    return np.concatenate([state.X_WB.p_m, state.X_WB.q, state.nu_B])


def _posture_of(truth_provider: TruthProvider) -> TargetDeformation | None:
    """How a target that yields stands now; None of one that does not, and where a truth provider knows of none."""
    ask = getattr(truth_provider, "posture", None)
    posture: TargetDeformation | None = ask() if ask is not None else None
    return posture


def _posture_row(posture: TargetDeformation | None) -> Array:
    """The values of the columns `_POSTURE`; none of a target that does not yield."""
    if posture is None:
        return np.zeros(0)
    far = float(np.hypot(posture.shift_m[0], posture.shift_m[1]))
    mean = posture.sway_mean_W_m
    swayed = posture.sway_m, posture.sway_peak_m, *mean, posture.target_stress_Pa
    return np.array([*swayed, far, posture.sway_wash_m, posture.drag_N])


def _stance(posture: TargetDeformation | None) -> dict[str, Array]:
    """The fields of an exposure that tell of a target that yields."""
    return {} if posture is None else {name: getattr(posture, name) for name in STANCE}


def _flakes_before(truth_provider: TruthProvider, X_WC: Pose) -> FlakeCloud | None:
    """Flakes of a truth provider that knows them."""
    look = getattr(truth_provider, "flakes", None)
    found: FlakeCloud | None = None if look is None else look(X_WC)
    return found


def moved(state: BodyState, dt_s: float) -> Pose:
    """X_WB after a short while at constant twist; the error is a dt^2 / 2, 0.02 mm over 28 ms at 0.05 m/s2."""
    X_WB = state.X_WB
    return Pose(
        X_WB.p_m + X_WB.R @ state.nu_B[:3] * dt_s,
        quat_integrate(X_WB.q, state.nu_B[3:], dt_s),
    )
