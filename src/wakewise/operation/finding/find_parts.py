"""Parts of a flight by the pilots `find` and `survey`, which are told neither the target's mesh nor its place."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file, write_json
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.operation.finding import SURFACE_FILE
from wakewise.operation.finding.camera_estimator import CameraEstimator
from wakewise.operation.finding.camera_frames import CameraWorld
from wakewise.operation.finding.find_mission import FindPilot, on_sphere
from wakewise.operation.finding.missed_parts import ViewChooser
from wakewise.operation.finding.region_controller import RegionController, region_controller
from wakewise.operation.finding.survey_mission import SurveyPilot, waiting_route
from wakewise.operation.parts import Parts
from wakewise.operation.worlds.makers import make_world
from wakewise.perception.surface_map import CELL_M, VIEW_CELL_M
from wakewise.scene.missions import Route, open_route
from wakewise.scene.missions.orbit import camera_pose
from wakewise.vision.reconstruction import write_cloud

START_RANGE_M, START_ELEVATION_DEG = (0.8, 1.1), (20.0, 35.0)
OFF_AXIS_RAD = math.radians(12.0)
"""The vehicle starts at a range and elevation drawn evenly, and looks past the target by an angle of this deviation."""
FOUND_FILE, FOUND_PICTURE, FOUND_FILM = "found.json", "found.png", "found.webp"


def drawn_start(parts: Parts) -> Pose:
    """Camera pose X_WC of the start: within sight of the true target, whose place the vehicle is not told."""
    rng = np.random.default_rng([parts.scenario.seed, 43])
    distance = float(rng.uniform(*START_RANGE_M))
    elevation, azimuth = math.radians(float(rng.uniform(*START_ELEVATION_DEG))), float(rng.uniform(-math.pi, math.pi))
    past = distance * math.tan(OFF_AXIS_RAD) * rng.normal(size=3) * np.array([1.0, 1.0, 0.3])
    return camera_pose(parts.target.centre_W_m + past, azimuth, elevation, distance)


def start_camera(parts: Parts) -> Pose:
    """Camera pose X_WC at the start: the drawn one, or that of a start that was given."""
    if "start" in parts.given:
        return parts.start.X_WB @ parts.aim.mount(0.0)
    return parts.route.camera(0.0)[0] if parts.scenario.pilot == "survey" else drawn_start(parts)


def find_start(parts: Parts) -> BodyState:
    """Start of the vehicle."""
    if parts.scenario.pilot == "survey":
        return BodyState(X_WB=parts.route.body(0.0, parts.aim).X_WB)
    X_WC = drawn_start(parts)
    tilt, _ = parts.aim.tilt(math.asin(-float(X_WC.R[2, 2])))
    return BodyState(X_WB=X_WC @ parts.aim.mount(tilt).inverse())


def find_route(parts: Parts) -> Route:
    """The start's place for as long as the mission may last: nothing else of its path is known beforehand.

    Of a survey the transects are.
    """
    if parts.scenario.pilot == "survey":
        return waiting_route(survey_pilot(parts))
    X_WC = start_camera(parts)
    centre = X_WC.p_m + parts.scenario.perception.assumed_distance_m * X_WC.R[:, 2]
    here = on_sphere(X_WC.p_m - centre)
    return open_route(centre, find_pilot(parts).most_s(), "find", here)


def find_pilot(parts: Parts) -> FindPilot:
    """`find`: looks, detects, approaches and scans."""
    scenario = parts.scenario
    ahead_m = scenario.perception.assumed_distance_m
    chooser = _chooser(parts, CELL_M)
    return FindPilot(start_camera(parts), ahead_m, parts.aim, scenario.mission, scenario.find, chooser)


def survey_pilot(parts: Parts) -> SurveyPilot:
    """`survey`: transects over a patch, then orbits round parts of it."""
    scenario, bed_z_m = parts.scenario, float(parts.bounds.high_W_m[2])
    return SurveyPilot(bed_z_m, parts.aim, scenario.mission, scenario.survey, _chooser(parts, VIEW_CELL_M))


def _chooser(parts: Parts, cell_m: float) -> ViewChooser:
    return ViewChooser(
        lens=parts.camera,
        aim=parts.aim,
        size_m=parts.vehicle.size_m,
        bounds=parts.bounds,
        mission=parts.scenario.mission,
        cell_m=cell_m,
    )


def find_controller(parts: Parts) -> RegionController:
    """Controller whose region follows the estimate."""
    return region_controller(parts, start_camera(parts))


def find_world(parts: Parts) -> CameraWorld:
    """The scenario's world with pictures of its camera."""
    return CameraWorld(inner=make_world(parts), parts=parts, settings=parts.scenario.perception)


def write_found(parts: Parts, folder: Path) -> None:
    """Write what a flight found: found.json, found.png, the target over the picture, its surface, and a film."""
    pilot, estimator = parts.pilot, parts.estimator
    if not isinstance(pilot, FindPilot | SurveyPilot) or not isinstance(estimator, CameraEstimator):
        return
    told: dict[str, Any] = dict.fromkeys(("centre_W_m", "radius_m", "centre_std_m"))
    told |= {"found_s": pilot.found_s, "accepted_s": pilot.accepted_s}
    seen = estimator.seen
    if isinstance(pilot, SurveyPilot):
        told |= {
            "orbits": [[*orbit.centre_W_m.tolist(), math.degrees(orbit.elevation_rad)] for orbit in pilot.parts],
            "replanned_ms": pilot.replanned_ms,
        }
    elif seen.target is not None and pilot.accepted_s is not None:
        target = seen.target
        told |= {
            "centre_W_m": target.centre_W_m.tolist(),
            "radius_m": target.radius_m,
            "centre_std_m": target.centre_std_m,
            "centre_error_m": float(np.linalg.norm(target.centre_W_m - parts.target.centre_W_m)),
            "status": target.status,
        }
    for name in (SURFACE_FILE, FOUND_FILM):
        (folder / name).unlink(missing_ok=True)
    if pilot.photographed is not None:
        told["photographed"] = pilot.photographed.as_dict()
        write_cloud(folder / SURFACE_FILE, pilot.photographed.as_cloud())
    (folder / FOUND_PICTURE).unlink(missing_ok=True)
    if seen.picture is not None:
        with whole_file(folder / FOUND_PICTURE) as path:
            path.write_bytes(cv2.imencode(".png", seen.drawn(estimator.tracker.camera))[1].tobytes())
    seen.film.write(folder / FOUND_FILM)
    write_json(folder / FOUND_FILE, told)


def read_found(folder: Path) -> dict[str, Any] | None:
    """What found.json of a trial's folder holds; None where there is none.

    Raises InputError if it cannot be read or holds something else.
    """
    path = folder / FOUND_FILE
    if not path.exists():
        return None
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        centre = told["centre_W_m"]
        known = centre is None or (np.array(centre, dtype=np.float64).shape == (3,) and float(told["radius_m"]) > 0.0)
        known &= all(np.isfinite(float(share)) for share in told.get("photographed", {}).values())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        known = False
    if not known:
        raise InputError(f"{path}: must hold the found target's centre_W_m and radius_m; remove it to fly again")
    found: dict[str, Any] = told
    return found


def found_region(folder: Path) -> tuple[Array, float] | None:
    """Centre, shape (3,), and radius of the target that a flight found; None where it did not look for one."""
    told = read_found(folder)
    if told is None or told["centre_W_m"] is None:
        return None
    return np.array(told["centre_W_m"], dtype=np.float64), float(told["radius_m"])
