"""One flight that finds its target: start in the world, then estimator, controller and pilot without its place."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Controller, TruthProvider, no_progress
from wakewise.core.jit.precompile import compile_kernels
from wakewise.operation.finding.camera_estimator import CameraEstimator, camera_estimator
from wakewise.operation.finding.camera_frames import CameraFrames
from wakewise.operation.finding.find_mission import FindPilot, FindSettings
from wakewise.operation.finding.region_controller import region_controller
from wakewise.operation.flying import FLIGHT_JOBS, recorder_of
from wakewise.operation.loop import Step, run_loop
from wakewise.operation.parts import Parts
from wakewise.operation.recorder import FlightRecorder
from wakewise.perception import PerceptionSettings
from wakewise.scene.missions.orbit import camera_pose

START_RANGE_M, START_ELEVATION_DEG = (0.8, 1.1), (20.0, 35.0)
OFF_AXIS_RAD = math.radians(12.0)
"""The vehicle starts at a range and elevation drawn evenly, and looks past the target by an angle of this deviation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FindFlight:
    """What a flight was: its record, what found the target, and when."""

    parts: Parts
    recorder: FlightRecorder
    estimator: CameraEstimator
    pilot: FindPilot
    targets: list[tuple[float, str, Array, float]]
    """Time, status, centre and radius of the estimated target at each step at which it changed."""


def drawn_start(parts: Parts) -> Pose:
    """Camera pose X_WC of the start: within sight of the true target, whose place the vehicle is not told."""
    rng = np.random.default_rng([parts.scenario.seed, 43])
    distance = float(rng.uniform(*START_RANGE_M))
    elevation, azimuth = math.radians(float(rng.uniform(*START_ELEVATION_DEG))), float(rng.uniform(-math.pi, math.pi))
    past = distance * math.tan(OFF_AXIS_RAD) * rng.normal(size=3) * np.array([1.0, 1.0, 0.3])
    return camera_pose(parts.target.centre_W_m + past, azimuth, elevation, distance)


def fly_find(
    parts: Parts,
    perception: PerceptionSettings,
    find: FindSettings,
    *,
    duration_s: float | None = None,
    use_map: bool = True,
    known_region: bool = False,
    lost_s: tuple[tuple[float, float], ...] = (),
    progress: Callable[..., None] = no_progress,
    watch: Callable[[Step, TruthProvider | None], None] | None = None,
) -> FindFlight:
    """Fly the mission `find` once.

    Parameters
    ----------
    duration_s : float, optional
        Longest flight; the mission's own length if not given.
    use_map : bool
        Whether the vehicle is localised by the map; other sensors alone if not.
    known_region : bool
        Whether the controller is given the region of the surveyed target in place of what the camera finds; for
        comparison.
    lost_s : tuple
        Spans in which the camera gives no picture.
    """
    X_WC = drawn_start(parts)
    aim = parts.aim
    tilt = aim.tilt(math.asin(-float(X_WC.R[2, 2])))[0] if aim.joint is not None else 0.0
    start = BodyState(X_WB=X_WC @ aim.mount(tilt).inverse())
    parts = parts.replace(start=start)
    compile_kernels(FLIGHT_JOBS, progress)
    plant, witness = parts.world.begin()
    assert witness is not None, "a simulated world has a witness"
    frames = CameraFrames(plant, witness, parts, perception, lost_s)
    estimator = camera_estimator(parts, perception, use_map)
    pilot = FindPilot(X_WC, perception.assumed_distance_m, aim, parts.scenario.mission, find)
    controller: Controller[Any] = parts.pipeline
    if not known_region:
        controller = region_controller(parts, pilot.centre_W_m.copy(), perception.assumed_radius_m)
    recorder = recorder_of(parts, witness, pilot)
    targets: list[tuple[float, str, Array, float]] = []
    version = -1

    def record(step: Step) -> None:
        nonlocal version
        recorder(step)
        target = step.estimate.target
        if target is not None and (target.version != version or target.status != targets[-1][1]):
            version = target.version
            targets.append((step.time_s, target.status, target.centre_W_m, target.radius_m))
        if watch is not None:
            watch(step, witness)

    dt_s = 1.0 / parts.scenario.control.rate_hz
    run: Callable[..., Any] = partial(run_loop, duration_s=duration_s or 1e4, dt_s=dt_s, progress=progress)
    run(
        pilot=pilot,
        controller=controller,
        estimator=estimator,
        plant=frames,
        witness=witness,
        start=parts.start,
        thrusters=len(parts.vehicle.thrusters),
        record=record,
        tilt_rad=tilt,
        stop=lambda: pilot.done,
    )
    return FindFlight(parts=parts, recorder=recorder, estimator=estimator, pilot=pilot, targets=targets)
