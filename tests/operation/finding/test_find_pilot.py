"""Flights by the pilot `find`: what it is told, what it finds, and what holds the vehicle."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wakewise.control.pipeline import PipelineState
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Measurement, Plant, TargetEstimate
from wakewise.operation import Flight, Parts, Scenario, fly
from wakewise.operation.finding.camera_estimator import CameraEstimator
from wakewise.operation.finding.camera_frames import CameraFrames, CameraWorld
from wakewise.operation.finding.find_mission import FindPilot
from wakewise.operation.finding.find_parts import FOUND_PICTURE, found_region, write_found
from wakewise.operation.finding.region_controller import RegionController
from wakewise.perception.detector import Detection

SCENARIO = Scenario.preset(
    "quick",
    seed=4,
    pilot="find",
    world="payload",
    **{
        "method": "allocation-only",
        "perception.width_px": 480,
        "perception.rate_hz": 4.0,
        "tank.sensors.tracking_rate_hz": 0.0,
        "find.settle_s": 1.0,
    },
)
FLIGHT_S = 13.0


def target_at(centre_W_m: Array, version: int = 0, status: str = "tracked") -> TargetEstimate:
    """An estimate of a target with two points."""
    assert status in ("assumed", "tracked")
    centre = np.asarray(centre_W_m, dtype=np.float64)
    return TargetEstimate(
        time_s=0.0,
        status="tracked" if status == "tracked" else "assumed",
        centre_W_m=centre,
        covariance=1e-6 * np.eye(3),
        radius_m=0.1,
        points_W_m=centre + np.array([[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0], [0.0, 0.0, -0.1]]),
        weights=np.ones(3),
        distance_m=np.array([0.0, 0.0, 0.05]),
        version=version,
    )


@pytest.fixture(scope="module")
def flight() -> Flight:
    """The first seconds of a flight that finds its target."""
    return fly(SCENARIO.parts(), checked=False, duration_s=FLIGHT_S)


def test_controller_estimator_and_pilot_are_not_told_the_target(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are made without asking for the region, the surveyed target or the obstacles about it."""

    def refused(_: Parts) -> None:
        raise AssertionError("asked for what only the world knows")

    for name in ("region", "surveyed_target", "surroundings"):
        monkeypatch.setattr(Parts, name, property(refused))
    parts = SCENARIO.parts()
    assert isinstance(parts.controller, RegionController)
    assert isinstance(parts.estimator, CameraEstimator)
    assert isinstance(parts.pilot, FindPilot)
    assert parts.pipeline is parts.controller


def test_the_target_is_found_within_ten_seconds(flight: Flight) -> None:
    """It is accepted within the flight, and its place relative to the vehicle is right to 3 cm."""
    pilot, estimator = flight.parts.pilot, flight.parts.estimator
    assert isinstance(pilot, FindPilot)
    assert isinstance(estimator, CameraEstimator)
    assert pilot.found_s is not None
    assert pilot.found_s < FLIGHT_S
    target = estimator.seen.target
    assert target is not None
    last = flight.steps.row(-1, named=True)
    off = np.array([last[f"est_{axis}_m"] - last[f"true_{axis}_m"] for axis in "xyz"])
    assert np.linalg.norm(target.centre_W_m - flight.parts.target.centre_W_m - off) < 0.03


def test_what_was_found_is_written_with_a_picture(flight: Flight, tmp_path: Path) -> None:
    """found.json has time, place and error; the region of the reconstruction is that of the found target."""
    write_found(flight.parts, tmp_path)
    told = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert told["status"] == "tracked"
    assert told["centre_error_m"] < 0.05
    assert (tmp_path / FOUND_PICTURE).stat().st_size > 1000
    region = found_region(tmp_path)
    assert region is not None
    assert np.allclose(region[0], told["centre_W_m"])
    assert found_region(tmp_path / "nowhere") is None


def test_a_flight_flown_again_is_the_same(flight: Flight) -> None:
    """Pilot, estimator and controller begin anew with each flight of their parts."""
    again = fly(flight.parts, checked=False, duration_s=2.0)
    assert again.steps["est_x_m"].to_list() == flight.steps["est_x_m"].to_list()[: again.steps.height]


def test_pictures_arrive_late_and_stamped(flight: Flight) -> None:
    """A picture is handed over after its latency with the time at which it was taken; none while the camera is lost."""
    parts = flight.parts
    plant, witness = parts.world.begin()
    assert isinstance(plant, CameraFrames)
    assert witness is not None
    settings = SCENARIO.perception
    came = []
    thrusts = np.zeros(len(parts.vehicle.thrusters))
    for k in range(40):
        came += [((k + 1) * 0.02, m.time_s) for m in plant.step(thrusts, 0.02) if m.image is not None]
    assert len(came) == 3
    assert [now_s - taken_s for now_s, taken_s in came] == pytest.approx([settings.latency_s] * 3, abs=0.021)
    assert isinstance(parts.world, CameraWorld)
    inner, knows = parts.world.inner.begin()
    assert knows is not None
    blind = CameraFrames(inner, knows, parts, settings, lost_s=((0.0, 1.0),))
    assert all(m.image is None for _ in range(20) for m in blind.step(thrusts, 0.02))


def test_the_controller_takes_over_a_new_region_and_keeps_its_state(flight: Flight) -> None:
    """A new version of the target makes a new pipeline; the same version, or one too soon, does not."""
    controller = region_controller_of(flight)
    state: PipelineState = controller.init()
    start, goal = flight.parts.start, flight.parts.pilot.goal(0.0, flight.parts.start)
    made = [id(controller._pipeline)]
    for version in (0, 0, 1):
        seen = BodyState(X_WB=start.X_WB, target=target_at(np.array([0.3, 0.0, 1.4]), version))
        for _ in range(11):
            state, command = controller.step(state, 0.02, seen, goal)
        made.append(id(controller._pipeline))
        assert np.isfinite(command.thrusts_N).all()
    assert made[0] != made[1] == made[2] != made[3]
    assert state.begun


def region_controller_of(flight: Flight) -> RegionController:
    """The controller of a flight."""
    controller = flight.parts.controller
    assert isinstance(controller, RegionController)
    return controller


def test_the_mission_goes_from_look_to_scan_and_ends() -> None:
    """With a target from the start it looks from two sides, approaches, holds, scans with photographs, and is done."""
    parts = SCENARIO.replace(**{"find.hold_s": 2.0, "mission.elevations_deg": (30.0,), "mission.views": (8,)}).parts()
    pilot = parts.pilot
    assert isinstance(pilot, FindPilot)
    centre = parts.target.centre_W_m
    seen: list[str] = []
    photographs, ranges = 0, []
    for k in range(int(pilot.most_s() / 0.1)):
        time_s = 0.1 * k
        goal = pilot.goal(time_s, BodyState(X_WB=parts.start.X_WB, target=target_at(centre)))
        if not seen or seen[-1] != pilot.phase:
            seen.append(pilot.phase)
        photographs += pilot.shutter_s(photographs, time_s, 0.1) is not None
        if pilot.phase == "scan":
            X_WC = goal.X_WB @ parts.vehicle.X_BC
            ranges.append(float(np.linalg.norm(X_WC.p_m - parts.target.centre_W_m)))
        if pilot.done():
            break
    assert seen == ["look", "approach", "hold", "scan", "done"]
    assert photographs == 8
    assert ranges == pytest.approx([parts.scenario.mission.standoff_m] * len(ranges), abs=0.03)


def test_without_a_target_the_mission_gives_up() -> None:
    """If nothing is accepted within its time the mission is over, and nothing is photographed."""
    parts = SCENARIO.replace(**{"find.give_up_s": 20.0}).parts()
    pilot = parts.pilot
    assert isinstance(pilot, FindPilot)
    time_s = 0.0
    while not pilot.done():
        pilot.goal(
            time_s, BodyState(X_WB=parts.start.X_WB, target=target_at(np.array([9.0, 9.0, 1.0]), status="assumed"))
        )
        assert pilot.shutter_s(0, time_s, 0.1) is None
        time_s += 0.1
        assert time_s < 120.0
    assert pilot.found_s is None


def test_goals_have_the_velocity_of_their_own_motion() -> None:
    """The wished twist agrees with the difference of wished positions, also while the centre moves."""
    parts = SCENARIO.parts()
    pilot = parts.pilot
    estimate = BodyState(X_WB=parts.start.X_WB, target=target_at(parts.target.centre_W_m))
    goals = [pilot.goal(0.02 * k, estimate) for k in range(400)]
    places = np.array([goal.X_WB.p_m for goal in goals])
    rates = np.array([goal.X_WB.R @ goal.nu_B[:3] for goal in goals])
    assert np.abs(np.diff(places, axis=0) / 0.02 - rates[1:]).max() < 0.01


def test_poses_of_other_sensors_are_left_out_while_the_map_gives_some(flight: Flight) -> None:
    """Within half a second of a pose by the map, a pose sensor far off does not move the estimate."""
    estimator = flight.parts.estimator
    assert isinstance(estimator, CameraEstimator)
    thrusts = np.zeros(len(flight.parts.vehicle.thrusters))
    start = flight.parts.start
    wrong = Measurement(time_s=0.02, X_WB=Pose(start.X_WB.p_m + np.array([0.02, 0.0, 0.0]), start.X_WB.q))
    fresh = estimator.init(start)
    _, moved = estimator.step(fresh, 0.02, (wrong,), thrusts)
    _, kept = estimator.step(replace(fresh, posed_s=0.0), 0.02, (wrong,), thrusts)
    assert moved.X_WB.p_m[0] - start.X_WB.p_m[0] > 0.01
    assert abs(kept.X_WB.p_m[0] - start.X_WB.p_m[0]) < 1e-3


def test_a_world_without_truth_gives_no_pictures() -> None:
    """The pilot needs a world that pictures can be rendered from."""
    parts = SCENARIO.parts()

    class Sea:
        name = "sea"

        def begin(self) -> tuple[Plant, None]:
            return parts.world.begin()[0], None

    with pytest.raises(InputError, match="no truth"):
        CameraWorld(inner=Sea(), parts=parts, settings=SCENARIO.perception).begin()


def red_box() -> object:
    """A detector whose answer is a fixed box."""

    class Fixed:
        name = "fixed"
        latency_s = 0.01

        def detect(self, image: np.ndarray) -> tuple[Detection, ...]:
            mask = np.zeros(image.shape[:2], np.bool_)
            mask[100:160, 200:260] = True
            return (Detection(mask=mask, score=0.9),)

    return Fixed()


def test_a_detectors_box_is_proposed_and_not_accepted(flight: Flight) -> None:
    """The best detection of the first picture designates the target, which waits for its acceptance."""
    parts = SCENARIO.replace(**{"perception.detector": f"{__name__}:red_box"}).parts()
    estimator = parts.estimator
    assert isinstance(estimator, CameraEstimator)
    image = np.random.default_rng(0).integers(0, 255, (360, 480, 3)).astype(np.uint8)
    state = estimator.init(parts.start)
    thrusts = np.zeros(len(parts.vehicle.thrusters))
    state, _ = estimator.step(state, 0.02, (Measurement(time_s=0.01, image=image),), thrusts)
    assert state.tracker.designation is not None
    assert state.tracker.designation.box == (200, 100, 260, 160)
    assert not state.tracker.accepted
    assert getattr(flight.parts.estimator, "detector", "missing") is None


def test_a_flight_that_is_over_can_be_flown_again() -> None:
    """The pilot of the same parts begins anew, also after a mission that ended."""
    parts = SCENARIO.replace(**{"find.give_up_s": 5.0, "perception.rate_hz": 0.5}).parts()
    first = fly(parts, checked=False)
    assert 5.0 <= first.recorder.duration_s < 6.0
    assert fly(parts, checked=False).steps["true_x_m"].to_list() == first.steps["true_x_m"].to_list()


@pytest.mark.parametrize(
    ("fields", "word"),
    [({"perception.protect": "view"}, "perception.protect"), ({"mission.order": "current"}, "mission.order")],
)
def test_what_needs_the_targets_place_is_refused(fields: dict[str, str], word: str) -> None:
    """One line names the field that does not go with the pilot."""
    with pytest.raises(InputError, match=word):
        SCENARIO.replace(**fields)


@pytest.mark.parametrize("text", ["", "[]", '{"centre_W_m": [0, 1]}', '{"centre_W_m": "here", "radius_m": 1}'])
def test_a_broken_record_of_what_was_found_is_refused(text: str, tmp_path: Path) -> None:
    """found.json that is cut off, or is something else, is told in one line."""
    (tmp_path / "found.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="centre_W_m"):
        found_region(tmp_path)
