"""The pilot `survey`: transects, then orbits round parts that are chosen by what was mapped."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation import Parts, Scenario
from wakewise.operation.finding.camera_estimator import CameraEstimator
from wakewise.operation.finding.find_parts import found_region, read_found, write_found
from wakewise.operation.finding.region_controller import NEAR_M, RegionController, near_spheres
from wakewise.operation.finding.survey_mission import OrbitPlanner, SurveyPilot
from wakewise.perception.target_shape import protected_region
from wakewise.scene.missions import check_clearance
from wakewise.scene.targets.reef import CELL_M, reef_patch

SCENARIO = Scenario.preset("reef", method="allocation-only", **{"target.seed": 1})
BED_M = SCENARIO.tank.size_m[2]


def mapped(share: float = 1.0) -> TargetEstimate:
    """The patch as a flight may have mapped it: points 2 cm apart, seen from above; a share of it from the south."""
    up = reef_patch(1).vertices_m
    row, column = (np.round(up[:, k] / CELL_M).astype(int) for k in (0, 1))
    points = (up * [1.0, -1.0, -1.0] + [0.0, 0.0, BED_M])[(row % 2 == 0) & (column % 2 == 0)]
    points = points[points[:, 0] < -1.0 + 2.0 * share]
    return TargetEstimate(
        time_s=0.0,
        status="tracked",
        centre_W_m=points.mean(axis=0),
        covariance=1e-4 * np.eye(3),
        radius_m=1.0,
        points_W_m=points,
        weights=np.ones(len(points)),
        distance_m=np.zeros(len(points)),
        version=0,
        surface_W_m=points,
        towards_W=np.tile([0.0, 0.0, -1.0], (len(points), 1)),
    )


def flown(parts: Parts, target: TargetEstimate | None) -> tuple[SurveyPilot, list[str], Array]:
    """The pilot after its mission, followed without error; its legs in their order, and the camera's places."""
    pilot = parts.pilot
    assert isinstance(pilot, SurveyPilot)
    pilot.begin()
    time_s, taken, legs, places = 0.0, 0, list[str](), list[Array]()
    estimate = BodyState(X_WB=parts.start.X_WB, target=target)
    while not pilot.done() and time_s < pilot.most_s():
        goal = pilot.goal(time_s, estimate)
        estimate = BodyState(X_WB=goal.X_WB, nu_B=goal.nu_B, target=target)
        taken += pilot.shutter_s(taken, time_s, 0.1) is not None
        name = pilot.leg_name(time_s)
        legs += [name] if not legs or legs[-1] != name else []
        places.append((goal.X_WB @ parts.aim.mount(goal.tilt_rad)).p_m)
        time_s += 0.1
    assert taken == pilot.planned
    return pilot, legs, np.array(places)


def test_nothing_that_flies_is_told_the_patch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Controller, estimator and pilot are made without region, surveyed target, its mesh or obstacles."""

    def refused(_: Parts) -> None:
        raise AssertionError("asked for what only the world knows")

    for name in ("region", "surveyed_target", "surroundings", "target"):
        monkeypatch.setattr(Parts, name, property(refused))
    parts = SCENARIO.parts()
    assert isinstance(parts.controller, RegionController)
    assert isinstance(parts.estimator, CameraEstimator)
    assert isinstance(parts.pilot, SurveyPilot)


def test_a_survey_flies_transects_then_at_least_three_close_orbits() -> None:
    """Legs come in this order without a jump; orbits keep clear of the true relief; all photographs are taken."""
    parts = SCENARIO.parts()
    pilot, legs, places = flown(parts, mapped())
    assert legs[0] == "settle"
    assert legs.index("transect 4") < legs.index("orbit 1") < legs.index("orbit 3")
    assert legs[-1] == "done"
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 0.02
    assert 3 <= len(pilot.parts) <= SCENARIO.survey.most_orbits
    assert pilot.replanned_ms is not None
    size, vertices = parts.vehicle.size_m, parts.target.mesh.vertices_m
    assert check_clearance(pilot._route, parts.aim, size, parts.bounds, vertices, 0.0) > 0.0
    seen = pilot.photographed
    assert seen is not None
    assert seen.coverage.share > 0.9


def test_what_was_not_mapped_gets_an_orbit() -> None:
    """Where the north of the patch is not mapped, orbits go there."""
    pilot, _, _ = flown(SCENARIO.parts(), mapped(0.7))
    assert max(orbit.centre_W_m[0] for orbit in pilot.parts) > 0.5


def test_a_survey_without_a_map_flies_its_orbits_all_the_same() -> None:
    """Nothing is known of the relief: as many orbits as it may fly, and no coverage is told."""
    pilot, _, _ = flown(SCENARIO.parts(), None)
    assert len(pilot.parts) == SCENARIO.survey.most_orbits
    assert pilot.photographed is None


@pytest.mark.parametrize("all_blocked", [False, True])
def test_a_part_without_a_clear_orbit_is_left_out(
    all_blocked: bool, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line of the log names each; the mission ends well, also where none is left."""
    clear = OrbitPlanner._clear

    def blocked(planner: OrbitPlanner, X_WC: Pose, solid_W_m: Array) -> bool:
        """As if something stood in all orbits, or in those of the north."""
        return clear(planner, X_WC, solid_W_m) and not all_blocked and X_WC.p_m[0] < 0.5

    monkeypatch.setattr(OrbitPlanner, "_clear", blocked)
    with caplog.at_level("WARNING"):
        pilot, legs, _ = flown(SCENARIO.parts(), mapped())
    northmost = [orbit.centre_W_m[0] + orbit.range_m * math.cos(orbit.elevation_rad) for orbit in pilot.parts]
    told = [line for line in caplog.messages if line.startswith("no orbit round the part at")]
    assert told
    assert all(north_m < 0.5 + 1e-9 for north_m in northmost)
    assert (not pilot.parts) == all_blocked
    assert legs[-1] == "done"
    assert pilot.photographed is not None


@pytest.mark.slow
@pytest.mark.parametrize(("orbits", "count"), [("none", 0), ("everywhere", 16)])
def test_baselines_are_settings(orbits: str, count: int) -> None:
    """Transects alone, and orbits side by side over the whole patch."""
    parts = SCENARIO.replace(**{"survey.orbits": orbits, "survey.orbit_views": 4}).parts()
    pilot, legs, _ = flown(parts, mapped())
    assert len(pilot.parts) == count
    assert sum(leg.startswith("orbit") for leg in legs) == count


def test_what_a_survey_found_is_written(tmp_path: Path) -> None:
    """found.json has the orbits and the time of choosing them; there is no region that the model is cut to."""
    parts = SCENARIO.parts()
    pilot, _, _ = flown(parts, mapped())
    write_found(parts, tmp_path)
    told = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert len(told["orbits"]) == len(pilot.parts)
    assert told["replanned_ms"] > 0.0
    assert told["photographed"]["photographs"] == pilot.planned
    assert read_found(tmp_path) == told
    assert found_region(tmp_path) is None


def test_obstacles_in_view_are_what_is_near() -> None:
    """Spheres lie about surface points near the vehicle, and are none where nothing is near."""
    surface = mapped().points_W_m
    region = protected_region(surface, None, 300)
    above = np.array([0.0, 0.0, BED_M - 0.5])
    spheres = near_spheres(region, above)
    assert len(spheres)
    assert np.linalg.norm(spheres[:, :3] - above, axis=1).max() < NEAR_M
    assert len(near_spheres(region, above - [0.0, 0.0, 5.0])) == 0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"perception.protect": "target"}, "perception.protect: target, take view with pilot survey"),
        ({"mission.order": "current"}, "mission.order: current needs the target's place"),
        ({"survey.least_orbits": 7}, "least_orbits 7, most_orbits 6"),
        ({"survey.size_m": (0.1, 2.0)}, "survey.size_m"),
    ],
)
def test_a_survey_that_cannot_be_flown_is_refused(fields: dict[str, object], words: str) -> None:
    """One line names the field and what would be right."""
    with pytest.raises(InputError, match=words):
        SCENARIO.replace(**fields)


def test_transects_that_touch_something_are_refused_before_the_flight() -> None:
    """Too little water over the bed: the line names the height of the transects."""
    parts = SCENARIO.replace(**{"survey.height_m": 2.1}).parts()
    with pytest.raises(InputError, match=r"survey\.height_m: on leg 'transect 1' the hull comes within"):
        _ = parts.preflight
    assert math.isclose(SCENARIO.survey.height_m, 0.8)
