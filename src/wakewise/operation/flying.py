"""Flies the parts of a flight: one loop for scan, compare, benches, films and own scripts."""

from __future__ import annotations

import logging
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypedDict, cast

import polars as pl

from wakewise.core.checks import boolean, callable_of, finite_number, quoted
from wakewise.core.errors import InputError, StageError, WakewiseError
from wakewise.core.interfaces import Plant, TruthProvider, no_progress
from wakewise.core.jit.precompile import compile_kernels
from wakewise.core.optional_dependencies import has
from wakewise.operation.flight_log import ExposureRecord
from wakewise.operation.flight_trim import ballast_proposal
from wakewise.operation.loop import Step, never, run_loop
from wakewise.operation.parts import Parts
from wakewise.operation.preflight import check_initial_state
from wakewise.operation.recorder import FlightRecorder, PhotoSchedule
from wakewise.operation.scenario import Scenario
from wakewise.scene.missions import SETTLING
from wakewise.vision.evaluation import flight_figures
from wakewise.vision.imaging.settings import METERED

log = logging.getLogger(__name__)

FLIGHT_JOBS = ("plan", "fly")
"""What is compiled before a flight, if it is not yet (see `wakewise.core.jit.precompile`)."""

WATER_EVERY_S = 0.1
"""How often the water is asked about; in between the last answer stands."""

_IN_WORDS = (
    ("target_speed_mean_m_s", 1e3, "water at the target {:.2f} mm/s"),
    ("position_rmse_mm", 1.0, "{:.1f} mm off its way"),
    ("energy_kJ", 1.0, "{:.3f} kJ"),
    ("duration_s", 1.0, "{:.0f} s"),
)


class FlightFigures(TypedDict):
    """What a flight is judged by; the unit is in the name, each is defined at
    `wakewise.vision.evaluation.flight_figures`.

    None where it is not known: without the truth (at sea), before the first exposure, of a target that nothing moves.
    """

    method: str
    seed: int
    duration_s: float
    target_speed_mean_m_s: float | None
    target_speed_p95_m_s: float | None
    bed_speed_p95_m_s: float | None
    turbidity_mean_per_m: float | None
    target_pressure_mean_Pa: float | None
    target_pressure_p95_Pa: float | None
    bed_shear_p95_Pa: float | None
    tracer_speed_mean_m_s: float | None
    ray_optical_depth: float | None
    disturbance: float | None
    exceedance_1cm_s_pct: float | None
    exceedance_ambient_pct: float | None
    bed_over_threshold_pct: float | None
    bed_over_threshold_s: float | None
    exposure_speed_mean_m_s: float | None
    exposure_speed_p95_m_s: float | None
    exposure_pressure_mean_Pa: float | None
    exposure_pressure_p95_Pa: float | None
    exposure_optical_depth: float | None
    exposure_exceedance_1cm_s_pct: float | None
    silt_lifted_g: float | None
    silt_suspended_max_g: float | None
    sway_rms_mm: float | None
    sway_peak_mm: float | None
    sway_mean_mm: float | None
    sway_about_mean_mm: float | None
    sway_wash_mm: float | None
    target_stress_peak_Pa: float | None
    target_drag_peak_N: float | None
    shifted_mm: float | None
    position_rmse_mm: float | None
    path_rmse_mm: float | None
    estimate_rmse_mm: float | None
    tracking_rmse_mm: float | None
    velocity_deviation_pct: float | None
    roll_pitch_rms_deg: float | None
    roll_pitch_max_deg: float | None
    attitude_rmse_deg: float | None
    energy_kJ: float | None
    sign_flips_per_s: float | None
    collisions: int | None
    fallbacks: int | None


@dataclass(frozen=True, eq=False)
class Flight:
    """What a flight was: its parts and its record.

    `steps` has one row per control step, columns with units as in docs/conventions.md; `figures` are means over it
    from the first leg on, with the names of a trial's metrics.
    """

    parts: Parts
    recorder: FlightRecorder

    @cached_property
    def steps(self) -> pl.DataFrame:
        """One row per control step."""
        return self.recorder.frame()

    @cached_property
    def figures(self) -> FlightFigures:
        """What the flight is judged by, from the first leg on: wash at the target, errors, energy.

        A flight that was ended before its first leg is judged by all of it.
        """
        frame = self.steps.filter(pl.col("leg") != SETTLING)
        judged = frame if frame.height else self.steps
        named = {"method": self.parts.method, "seed": self.parts.scenario.seed}
        return cast("FlightFigures", named | flight_figures(judged))

    def __str__(self) -> str:
        """The flight in one line: the water at the target, the error of position, the energy, what went amiss."""
        figures: dict[str, Any] = dict(self.figures)
        words = [
            text.format(scale * float(value))
            for key, scale, text in _IN_WORDS
            if (value := figures[key]) is not None and math.isfinite(value)
        ]
        amiss = [f"{figures[key]} {key}" for key in ("collisions", "fallbacks") if figures[key]]
        hover = ""
        if (self.steps["leg"] == SETTLING).all():
            hover = f" (hover only: the first leg begins after {self.parts.route.starts_s[0]:.0f} s)"
        return f"{figures['method']}, seed {figures['seed']}: {', '.join([*words, *amiss])}{hover}"

    def write(self, folder: Path) -> None:
        """Write exposures.npz, timings.parquet; last steps.parquet, which says that the flight is whole.

        log.mcap, for viewers, is written where the extra `logs` is installed; a trial asks for it beforehand.
        """
        if has("logs"):
            from wakewise.operation.telemetry import write_mcap

            write_mcap(self.steps, folder / "log.mcap")
        self.recorder.write(folder)


def fly(
    flight: Parts | Scenario,
    *,
    duration_s: float | None = None,
    progress: Callable[..., None] = no_progress,
    checked: bool = True,
    water_every_s: float = WATER_EVERY_S,
    watch: Callable[[Step, TruthProvider | None], None] | None = None,
    exposed: Callable[[int, ExposureRecord], None] | None = None,
) -> Flight:
    """Fly the parts once, from the beginning of their world; flown again they give the same flight.

    Raises InputError if the parts do not fit each other, or the duration is not at least one control step; StageError
    if a part from outside, other than the controller, ends the flight.

    Parameters
    ----------
    duration_s : float, optional
        Only the first part of the mission.
    progress : callable
        Called as `(done, total, note)`. Without it, compiling, which happens once, is told of on standard error.
    checked : bool
        Hold the parts against each other first (see `Parts.preflight`).
    water_every_s : float
        How often the water at the target is measured.
    watch : callable, optional
        Called as `(step, truth_provider)` at each step, after the record.
    exposed : callable, optional
        Called as `(number, exposure)` when the shutter has opened, number counting from 0.

    Returns
    -------
    Flight

    Examples
    --------
    >>> import wakewise as ww
    >>> flight = ww.fly(ww.Scenario.preset("quick", method="dp"), duration_s=1.0)
    >>> flight.steps.height, flight.parts.method
    (50, 'dp')
    """
    callable_of(progress, "progress")
    for name, call in (("watch", watch), ("exposed", exposed)):
        if call is not None:
            callable_of(call, name)
    checked = boolean(checked, "checked")
    if not (isinstance(water_every_s, (float, int)) and water_every_s == math.inf):  # never
        finite_number(water_every_s, "water_every_s", above=0.0)
    parts = parts_of(flight)
    route = parts.route
    _ = parts.vehicle, parts.estimator  # what cannot be used is refused before minutes of compiling
    lasts_s = check_duration(route.duration_s if duration_s is None else duration_s, parts.scenario)
    compile_kernels(FLIGHT_JOBS, _Notice() if progress is no_progress else progress)
    if checked:
        _ = parts.preflight
    else:
        check_initial_state(parts)
    progress(0, 1, "at the start")
    with name_external_parts(parts):
        plant, truth_provider = parts.world.begin()
    if parts.finds:
        pilot: Any = parts.pilot
        pilot.begin()
    # A pilot that takes its own photographs says when, and when its mission is over.
    timetable = cast("PhotoSchedule", parts.pilot) if parts.finds else route
    recorder = recorder_of(parts, truth_provider, timetable, water_every_s=water_every_s, exposed=exposed)

    before = ""

    def record(step: Step) -> None:
        nonlocal before
        recorder(step)
        left, before = before, timetable.leg_name(step.time_s)
        if left == SETTLING != before:
            _say_trim(parts, recorder)
        if watch is not None:
            watch(step, truth_provider)

    with name_external_parts(parts, recorder):
        over = pilot.done if parts.finds else never
        loop_of(parts, plant, truth_provider, record)(duration_s=lasts_s, progress=progress, stop=over)
    return Flight(parts, recorder)


def check_duration(duration_s: float, scenario: Scenario) -> float:
    """The duration of a flight, s; raises InputError if it is less than one control step."""
    lasts_s, dt_s = finite_number(duration_s, "duration_s"), 1.0 / scenario.control.rate_hz
    if round(lasts_s / dt_s) < 1:
        raise InputError(f"duration_s: {lasts_s:g}, must be at least one control step, {dt_s:g} s")
    return lasts_s


def _say_trim(parts: Parts, recorder: FlightRecorder) -> None:
    """Log the ballast that the settling hover asks for, before the first photograph; the flight goes on."""
    if (words := ballast_proposal(parts.vehicle, recorder.frame())) is not None:
        advice = "after a trial `wakewise vehicle trim --flight FOLDER --write FILE` writes it down"
        log.warning("settling hover: out of trim, %s; %s", words, advice)


def parts_of(flight: Parts | Scenario) -> Parts:
    """The parts themselves, or those of a scenario.

    Raises InputError if it is neither.
    """
    if isinstance(flight, Scenario):
        return flight.parts()
    if not isinstance(flight, Parts):
        raise InputError(f"flight: {quoted(flight)}, must be Parts or a Scenario")
    return flight


class _Notice:
    """Progress of compiling for somebody who gave no way to show it: a line on standard error, the first time."""

    told = False

    def __call__(self, done: float, total: float, _note: str = "") -> None:
        """Say once that kernels are compiled, and about how long that takes."""
        if not self.told and total > done:
            self.told = True
            minutes = max(1, round((total - done) / 60.0 / min(4, os.cpu_count() or 1)))
            print(
                f"wakewise: compiling kernels, some {minutes} min; only this time (wakewise compile does so "
                "beforehand)",
                file=sys.stderr,
                flush=True,
            )


def recorder_of(
    parts: Parts, truth_provider: TruthProvider | None, timetable: PhotoSchedule, **more: Any
) -> FlightRecorder:
    """The recorder of a flight of these parts, `more` as for `FlightRecorder`."""
    scenario, vehicle = parts.scenario, parts.vehicle
    return FlightRecorder(
        route=timetable,
        X_BC=vehicle.X_BC,
        joint=vehicle.tilt,
        exposure_s=scenario.imaging.window_s,
        metered=METERED if scenario.imaging.auto_exposure else 0,
        instants=scenario.imaging.instants,
        thrusters=len(vehicle.thrusters),
        dt_s=1.0 / scenario.control.rate_hz,
        truth_provider=truth_provider,
        **more,
    )


def loop_of(
    parts: Parts, plant: Plant, truth_provider: TruthProvider | None, record: Callable[[Step], None]
) -> Callable[..., None]:
    """The loop of a flight of these parts; what is left to say is how long, and by which clock (see `run_loop`)."""
    return partial(
        run_loop,
        pilot=parts.pilot,
        controller=parts.pipeline,
        estimator=parts.estimator,
        plant=plant,
        truth_provider=truth_provider,
        start=parts.start,
        thrusters=len(parts.vehicle.thrusters),
        dt_s=1.0 / parts.scenario.control.rate_hz,
        record=record,
        tilt_rad=parts.start_tilt_rad,
    )


@contextmanager
def name_external_parts(parts: Parts, recorder: FlightRecorder | None = None) -> Iterator[None]:
    """Name the parts from outside, where there are any, as what may have ended a flight.

    Raises StageError in place of what was raised; InputError without a recorder, that is before the first step.
    """
    try:
        yield
    except (WakewiseError, MemoryError) as fault:  # for memory that ran out no part is to blame
        if recorder is None or not isinstance(fault, InputError) or "current" not in parts.external_parts:
            raise
        raise StageError(f"fly: ended after {recorder.duration_s:.1f} s, {fault}") from fault
    except Exception as fault:
        foreign = parts.external_parts
        if not foreign:
            raise
        words = ", ".join(f"{name} {what}" for name, what in foreign.items())
        if recorder is None:
            raise InputError(f"fly: does not begin, {type(fault).__name__}: {fault}; from outside: {words}") from fault
        raise StageError(
            f"fly: ended after {recorder.duration_s:.1f} s by {type(fault).__name__}: {fault}; from outside: {words}"
        ) from fault


def fly_trial(
    parts: Parts,
    folder: Path,
    progress: Callable[..., None] = no_progress,
    exposed: Callable[[int, ExposureRecord], None] | None = None,
) -> None:
    """Fly the mission once and leave its record. steps.parquet is written last: where it is, the flight is whole.

    log.mcap, for viewers, is written where the extra `logs` is installed; a trial asks for it beforehand. `exposed` is
    called with each exposure as it is recorded (see `fly`).

    Raises StageError if the flight ended with no exposure.
    """
    flight = fly(parts, progress=progress, exposed=exposed)
    made, planned = len(flight.recorder.exposures), len(parts.route.exposures_s)
    if parts.finds:
        from wakewise.operation.finding.find_parts import write_found

        write_found(parts, folder)
        pilot: Any = parts.pilot
        if pilot.accepted_s is None:
            missed = "no target was found" if pilot.found_s is None else "a target was found and not accepted"
            raise StageError(f"find: {missed}, so nothing was photographed")
        if made != pilot.planned:
            raise StageError(f"{parts.scenario.pilot}: {made} of {pilot.planned} exposures were made")
    elif made != planned:
        raise StageError(f"{made} of {planned} exposures were made")
    flight.write(folder)
