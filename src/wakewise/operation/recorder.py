"""Keeps what a flight did: one row per control step, one entry per exposure, solve times apart.

steps.parquet holds nothing that depends on the machine, so the same seed gives the same bytes; solve times are in
timings.parquet. Column names carry units; frames and meanings are in docs/conventions.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Protocol

import numpy as np
import polars as pl

from wakewise.arrays import Array
from wakewise.files import whole_file
from wakewise.geometry import Pose, quat_integrate
from wakewise.imaging.settings import METERED_EVERY_S
from wakewise.interfaces import BodyState, FlakeCloud, Posture, WaterTruth, Witness
from wakewise.operation.exposures import STANCE, ExposureRecord, write_exposures
from wakewise.operation.loop import Step
from wakewise.vehicles.tilt import TiltJoint

_STATE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
_WRENCH = ("wrench_X_N", "wrench_Y_N", "wrench_Z_N", "wrench_K_Nm", "wrench_M_Nm", "wrench_N_Nm")
LOAD = ("load_X_N", "load_Y_N", "load_Z_N", "load_K_Nm", "load_M_Nm", "load_N_Nm")
"""What the estimator says that pulls at the vehicle, in B (see `wakewise.interfaces.BodyState`)."""
_WATER = tuple(figure.name for figure in fields(WaterTruth))
_POSTURE = (
    "sway_m", "sway_peak_m", "sway_x_m", "sway_y_m", "sway_z_m", "target_stress_Pa", "shifted_m", "sway_wash_m",
)  # fmt: skip


def step_columns(thrusters: int, yields: bool = False) -> list[str]:
    """Names of the numeric columns of steps.parquet, in order, for a vehicle with this many thrusters.

    Those of a target that `yields` (see `wakewise.interfaces.Posture`) come last.
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


class Timetable(Protocol):
    """Says when photographs are taken and what each stretch of a flight is called; a route is one."""

    def leg_name(self, time_s: float) -> str:
        """What the vehicle is doing."""
        ...

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """When photograph `number`, counted from 0, is taken, if in the step that begins at `time_s`; else None."""
        ...


@dataclass(kw_only=True, eq=False)
class FlightRecorder:
    """Collects a flight in memory and writes it whole at its end.

    Parameters
    ----------
    route : Timetable
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
    thrusters : int
    witness : Witness or None
        Without one, true columns and water columns are NaN and no exposure is rendered.
    water_every_s : float
        How often the water is asked about; in between the last answer stands.
    exposed : callable, optional
        Called as `(number, exposure)` for each exposure when it has been recorded; number counts from 0.
    """

    route: Timetable
    X_BC: Pose
    exposure_s: float
    instants: int
    thrusters: int
    dt_s: float
    witness: Witness | None
    water_every_s: float = 0.1
    exposed: Callable[[int, ExposureRecord], None] | None = None
    joint: TiltJoint | None = None
    metered: int = 0
    exposures: list[ExposureRecord] = field(default_factory=list)
    _rows: list[Array] = field(default_factory=list)
    _legs: list[str] = field(default_factory=list)
    _fallbacks: list[str] = field(default_factory=list)
    _exposing: list[bool] = field(default_factory=list)
    _opened: int = 0
    _collisions: list[bool] = field(default_factory=list)
    _solve_ms: list[float] = field(default_factory=list)
    _water: WaterTruth | None = None
    _posture: Posture | None = None
    _water_time_s: float = -np.inf

    def __call__(self, step: Step) -> None:
        """Take in one step of the loop."""
        opens_s = self.route.shutter_s(self._opened, step.time_s, self.dt_s)
        exposing = opens_s is not None
        if self.witness is not None and (exposing or step.time_s >= self._water_time_s + self.water_every_s - 1e-9):
            self._water, self._water_time_s = self.witness.water(), step.time_s
            self._posture = _posture_of(self.witness)
        elif self.witness is not None and not self._rows:
            self._posture = _posture_of(self.witness)  # all rows have its columns or none has
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
        self._rows.append(np.concatenate(row))
        self._legs.append(self.route.leg_name(step.time_s))
        self._fallbacks.append(step.command.fallback or "")
        self._exposing.append(exposing)
        self._opened += exposing
        self._collisions.append(bool(truth and truth.collision))
        self._solve_ms.append(1e3 * step.solve_s)
        if opens_s is not None and truth is not None and self.witness is not None:
            self.exposures.append(
                ExposureRecord(
                    time_s=opens_s,
                    X_WC_true=tuple(
                        _moved(truth.state, opens_s - step.time_s + after_s) @ self._mount(truth.tilt_rad)
                        for after_s in np.linspace(0.0, self.exposure_s, self.instants)
                    ),
                    X_WC_est=_moved(step.estimate, opens_s - step.time_s + 0.5 * self.exposure_s)
                    @ self._mount(step.tilt_rad),
                    silt=self.witness.silt(),
                    X_WC_before=self._before(),
                    flakes=_flakes_before(self.witness, truth.state.X_WB @ self._mount(truth.tilt_rad)),
                    **_stance(self._posture),
                )
            )
            if self.exposed is not None:
                self.exposed(len(self.exposures) - 1, self.exposures[-1])

    def _mount(self, tilt_rad: float) -> Pose:
        return self.X_BC if self.joint is None else self.joint.mount(self.X_BC, tilt_rad)

    def _before(self) -> tuple[Pose, ...]:
        """True camera poses until now, the last of them now; the first of the flight stand for those before it."""
        every = max(1, round(METERED_EVERY_S / self.dt_s))
        rows = [self._rows[max(0, len(self._rows) - 1 - every * k)] for k in reversed(range(self.metered))]
        # The last three numbers of a row are the camera's tilt, true, measured and wished.
        return tuple(Pose(row[1:4], row[4:8]) @ self._mount(math.radians(float(row[-3]))) for row in rows)

    @property
    def duration_s(self) -> float:
        """How long the flight has taken so far."""
        return len(self._rows) * self.dt_s

    def frame(self) -> pl.DataFrame:
        """The steps as a table."""
        table = np.array(self._rows).reshape(len(self._rows), -1)
        names = step_columns(self.thrusters, yields=self._posture is not None)
        columns = {name: table[:, i] for i, name in enumerate(names)}
        return pl.DataFrame(columns).with_columns(
            exposing=pl.Series(self._exposing, dtype=pl.Boolean),
            collision=pl.Series(self._collisions, dtype=pl.Boolean),
            fallback=pl.Series(self._fallbacks, dtype=pl.String),
            leg=pl.Series(self._legs, dtype=pl.String),
        )

    def write(self, folder: Path) -> None:
        """Write exposures.npz and timings.parquet, then steps.parquet, whose presence says that the flight is whole."""
        if self.exposures:
            write_exposures(folder / "exposures.npz", self.exposures, self.exposure_s)
        with whole_file(folder / "timings.parquet") as path:
            pl.DataFrame({"solve_ms": self._solve_ms}).write_parquet(path)
        with whole_file(folder / "steps.parquet") as path:
            self.frame().write_parquet(path)


def state_vector(state: BodyState) -> Array:
    """Position, quaternion and twist in the order of the columns, shape (13,)."""
    return np.concatenate([state.X_WB.p_m, state.X_WB.q, state.nu_B])


def _posture_of(witness: Witness) -> Posture | None:
    """How a target that yields stands now; None of one that does not, and where a witness knows of none."""
    ask = getattr(witness, "posture", None)
    posture: Posture | None = ask() if ask is not None else None
    return posture


def _posture_row(posture: Posture | None) -> Array:
    """The values of the columns `_POSTURE`; none of a target that does not yield."""
    if posture is None:
        return np.zeros(0)
    far = float(np.hypot(posture.shift_m[0], posture.shift_m[1]))
    mean = posture.sway_mean_W_m
    return np.array([posture.sway_m, posture.sway_peak_m, *mean, posture.target_stress_Pa, far, posture.sway_wash_m])


def _stance(posture: Posture | None) -> dict[str, Array]:
    """The fields of an exposure that tell of a target that yields."""
    return {} if posture is None else {name: getattr(posture, name) for name in STANCE}


def _flakes_before(witness: Witness, X_WC: Pose) -> FlakeCloud | None:
    """Flakes of a witness that knows them."""
    look = getattr(witness, "flakes", None)
    found: FlakeCloud | None = None if look is None else look(X_WC)
    return found


def _moved(state: BodyState, dt_s: float) -> Pose:
    """X_WB after a short while at constant twist; the error is a dt^2 / 2, 0.02 mm over 28 ms at 0.05 m/s2."""
    X_WB = state.X_WB
    return Pose(
        X_WB.p_m + X_WB.R @ state.nu_B[:3] * dt_s,
        quat_integrate(X_WB.q, state.nu_B[3:], dt_s),
    )
