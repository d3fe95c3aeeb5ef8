"""Setup functions and probes that the studies share: what is changed of a flight beforehand, and what is watched in it.

They are named in the settings of a trial (see `wakewise.experiments.campaigns.flights`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.allocation import disturbance_of
from wakewise.control.null_space_allocation import allocation_context
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TruthProvider
from wakewise.experiments.campaigns.flights import FlightProbe, settled
from wakewise.operation import Parts, fly
from wakewise.operation.flight_trim import flight_trim
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle
from wakewise.robot.vehicles.ballast import BallastBlock, with_blocks
from wakewise.vision.evaluation import attitude_rmse_deg
from wakewise_paper.routes import gentle_route, held, station_route

SOURCES = ("wakewise_paper:flights.py", "wakewise_paper:routes.py")
"""Sources of a study that flies what is here."""
HOVER_AND_ARC, STATION = f"{__name__}:hover_and_arc", f"{__name__}:station"
BALLASTED = f"{__name__}:ballasted"
CAMERA_ERRORS, DISTURBANCE_SERIES = f"{__name__}:CameraErrors", f"{__name__}:DisturbanceSeries"
HOVER_S = 15.0
"""How long the hover before ballasting is: by its end integral and estimate have settled for some seconds."""
SERIES, SERIES_EVERY_S = "series.npz", 0.2


def azimuth_of(seed: int) -> float:
    """Where a flight begins, seen from the target, in rad."""
    return float(np.random.default_rng([seed, 7]).uniform(-np.pi, np.pi))


def hover_and_arc(parts: Parts, about: str = "true") -> Parts:
    """Hover on the mission's middle orbit and fly part of its lowest, from a side that the seed draws.

    `about` is the target's "true" centre, or where it is "found", that is believed, to be.
    """
    mission = parts.scenario.mission
    elevations = sorted(mission.elevations_deg)
    target = parts.target if about == "true" else parts.surveyed_target
    route = gentle_route(
        target.centre_W_m,
        mission.standoff_m,
        azimuth_of(parts.scenario.seed),
        elevations_deg=(elevations[len(elevations) // 2], elevations[0]),
    )
    return parts.replace(route=route)


def station(parts: Parts) -> Parts:
    """Hold one view of the target from above for three minutes, from a side that the seed draws."""
    target = parts.surveyed_target
    return parts.replace(route=station_route(target, target.centre_W_m, azimuth_of(parts.scenario.seed)))


def ballasted(parts: Parts) -> tuple[Parts, dict[str, float]]:
    """Trim the true vehicle first, as a person with float blocks does: hover, read the estimated load, add blocks, fly.

    The estimate is the flight's own. Only the true vehicle changes: what was measured and the block that carries it
    cancel in what is believed of it. The figure `float_N` is the buoyancy added, N.
    """
    blocks = hover_blocks(parts)
    return with_true_blocks(parts, blocks), {"float_N": float(sum(block.float_N for block in blocks))}


def hover_blocks(parts: Parts) -> tuple[BallastBlock, ...]:
    """Blocks that `vehicle trim --flight` proposes after a hover at the start of the flight's own route."""
    hover = parts.replace(route=held(parts.route, HOVER_S))
    flown = fly(hover, checked=False, duration_s=HOVER_S, water_every_s=60).steps
    return tuple(flight_trim(parts.vehicle, flown).blocks)


def with_true_blocks(parts: Parts, blocks: tuple[BallastBlock, ...]) -> Parts:
    """The same flight with blocks on the true vehicle, all else drawn alike.

    Raises
    ------
    InputError
        If the world is not one of ours, which hold their vehicle.
    """
    world: Any = parts.world
    if not is_dataclass(world) or isinstance(world, type) or not hasattr(world, "vehicle"):
        raise InputError(f"+trim: world {parts.scenario.world} does not tell its vehicle")
    return parts.replace(world=replace(world, vehicle=with_blocks(world.vehicle, blocks)))


class CameraErrors(FlightProbe):
    """Errors of the true camera's place and attitude, root mean square over steps."""

    def figures(self, steps: pl.DataFrame) -> Mapping[str, float]:
        """`camera_rmse_mm` and `camera_attitude_rmse_deg`."""
        return camera_errors(settled(steps), self.parts.vehicle)


def camera_errors(frame: pl.DataFrame, vehicle: Vehicle) -> dict[str, float]:
    """Distance in mm and angle in degrees of the true camera from the desired one, root mean square over steps."""
    poses = {who: _camera_poses(frame, vehicle, who) for who in ("true", "goal")}
    apart = poses["true"][0] - poses["goal"][0]
    return {
        "camera_rmse_mm": 1e3 * float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))),
        "camera_attitude_rmse_deg": attitude_rmse_deg(poses["true"][1], poses["goal"][1]),
    }


def _camera_poses(frame: pl.DataFrame, vehicle: Vehicle, who: str) -> tuple[Array, Array]:
    """Places, shape (n, 3), and attitudes, shape (n, 4), of the camera in W."""
    places = frame.select(f"{who}_x_m", f"{who}_y_m", f"{who}_z_m").to_numpy()
    turns = frame.select(f"{who}_qw", f"{who}_qx", f"{who}_qy", f"{who}_qz").to_numpy()
    tilts = np.radians(frame[f"{who}_tilt_deg"].to_numpy())
    cameras = [Pose(p, q) @ vehicle.X_BC_at(float(tilt)) for p, q, tilt in zip(places, turns, tilts, strict=True)]
    return np.array([X.p_m for X in cameras]), np.array([X.q for X in cameras])


class DisturbanceSeries(FlightProbe):
    """D of the thrusts by the controller's own wake model, five times a second; left in series.npz for a page.

    One yardstick for all methods: what the allocator knows, in the current that the estimator finds.
    """

    def __init__(self, parts: Parts, folder: Path) -> None:
        super().__init__(parts, folder)
        self._context = allocation_context(parts.vehicle, parts.region, parts.wake, parts.control)
        self._every = max(1, round(SERIES_EVERY_S * parts.control.rate_hz))
        self._count = 0
        self._D: list[tuple[float, float]] = []

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Take D of every tenth step or so."""
        del truth_provider
        self._count += 1
        if self._count % self._every == 1 and step.truth is not None:
            thrusts = step.truth.thrusts_N
            self._D.append((step.time_s, float(disturbance_of(self._context.gram(step.estimate, thrusts), thrusts))))

    def figures(self, steps: pl.DataFrame) -> Mapping[str, float]:
        """`disturbance`, the mean of D from the end of settling on, (m/s)^2; thrusts, D and water over time are
        kept.
        """
        begins_s = float(settled(steps)["time_s"][0])
        D = np.array(self._D)
        rows = steps.gather_every(self._every)
        thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(len(self.parts.vehicle.thrusters))).to_numpy()
        with whole_file(self.folder / SERIES) as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                time_s=rows["time_s"].to_numpy(),
                thrusts_N=thrusts.astype(np.float32),
                speed_m_s=rows["target_speed_mean_m_s"].to_numpy(),
                D_time_s=D[:, 0],
                D=D[:, 1],
                begins_s=np.array(begins_s),
            )
        judged = D[D[:, 0] >= begins_s, 1]
        return {"disturbance": float(np.mean(judged if len(judged) else D[-1:, 1]))}


def read_series(folder: Path) -> dict[str, Array] | None:
    """`time_s`, `thrusts_N` (steps, thrusters), `speed_m_s`, `D_time_s`, `D` and `begins_s`; None if there is none."""
    try:
        with np.load(folder / SERIES) as kept:
            return {name: np.asarray(kept[name]) for name in kept.files}
    except (OSError, ValueError, EOFError):
        return None
