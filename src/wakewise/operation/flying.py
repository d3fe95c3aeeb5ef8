"""Flies a scenario in the tank and leaves steps.parquet, exposures.npz, timings.parquet and, if it can, log.mcap."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wakewise.errors import StageError
from wakewise.extras import has
from wakewise.interfaces import no_progress
from wakewise.operation.build import Mission, build_flight
from wakewise.operation.loop import fly
from wakewise.operation.recorder import FlightRecorder
from wakewise.operation.scenario import Scenario


def fly_mission(
    scenario: Scenario, mission: Mission, folder: Path, progress: Callable[..., None] = no_progress
) -> None:
    """Fly the mission once. steps.parquet is written last: where it is, the flight is whole.

    log.mcap, for viewers, is written where the extra `logs` is installed; a trial asks for it beforehand.

    Raises
    ------
    StageError
        If the flight ended with no exposure.
    """
    progress(0, 1, "compiling, about a minute the first time")
    flight = build_flight(scenario, mission)
    dt_s = 1.0 / scenario.control.rate_hz
    recorder = FlightRecorder(
        route=mission.route,
        X_BC=mission.vehicle.X_BC,
        exposure_s=scenario.imaging.exposure_s,
        instants=scenario.imaging.instants,
        thrusters=len(mission.vehicle.thrusters),
        dt_s=dt_s,
        witness=flight.witness,
    )
    fly(
        pilot=flight.pilot,
        controller=flight.controller,
        estimator=flight.estimator,
        plant=flight.tank,
        witness=flight.witness,
        start=flight.start,
        thrusters=len(mission.vehicle.thrusters),
        duration_s=mission.route.duration_s,
        dt_s=dt_s,
        record=recorder,
        progress=progress,
    )
    if len(recorder.exposures) != len(mission.route.exposures_s):
        raise StageError(f"{len(recorder.exposures)} of {len(mission.route.exposures_s)} exposures were made")
    if has("logs"):
        from wakewise.operation.telemetry import write_mcap

        write_mcap(recorder.frame(), folder / "log.mcap")
    recorder.write(folder)
