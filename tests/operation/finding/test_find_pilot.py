"""Flights by the pilot `find`: what it is told, what it finds, and what holds the vehicle."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

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
from wakewise.scene.missions.orbit import camera_pose

SCENARIO = Scenario.preset(
    "quick",
    seed=1,
    pilot="find",
    world="payload",
    **{
        "method": "allocation-only",
        "perception.width_px": 480,
        "perception.rate_hz": 4.0,
        "tank.sensors.tracking_rate_hz": 0.0,
        "find.settle_s": 0.5,
        "target.points": 60,
    },
)
FOUND_S, FLIGHT_S = 10.0, 18.0


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
    """It is accepted once it was seen from a sixth of a circle, and its place relative to the vehicle right to 3 cm."""
    pilot, estimator = flight.parts.pilot, flight.parts.estimator
    assert isinstance(pilot, FindPilot)
    assert isinstance(estimator, CameraEstimator)
    assert pilot.found_s is not None
    assert pilot.accepted_s is not None
    assert pilot.found_s < FOUND_S < pilot.accepted_s < FLIGHT_S
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
    plant, truth_provider = parts.world.begin()
    assert isinstance(plant, CameraFrames)
    assert truth_provider is not None
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


ONE_ORBIT = {"mission.elevations_deg": (30.0,), "mission.views": (24,)}
SIDE_RAD = math.radians(100.0)
BALL_M = 0.1


def mapped_at(centre_W_m: Array) -> TargetEstimate:
    """An estimate of a target whose surface was mapped as a ball."""
    n = round(4.0 * math.pi * BALL_M**2 / 0.005**2)
    k = np.arange(n) + 0.5
    down, turn = np.arccos(1.0 - 2.0 * k / n), math.pi * (1.0 + math.sqrt(5.0)) * k
    out = np.stack([np.cos(turn) * np.sin(down), np.sin(turn) * np.sin(down), np.cos(down)], axis=1)
    return replace(target_at(centre_W_m), surface_W_m=centre_W_m + BALL_M * out, towards_W=out)


@dataclass(frozen=True, kw_only=True)
class Flown:
    """What a pilot did, and where the camera was at each photograph: azimuth, elevation and range."""

    phases: dict[str, float]  # when each began
    legs: list[str]
    places: list[tuple[float, float, float]]
    opens_s: list[float]


def azimuth_of(X_WC: Pose, centre_W_m: Array) -> float:
    return math.atan2(X_WC.p_m[1] - centre_W_m[1], X_WC.p_m[0] - centre_W_m[0])


def flown(parts: Parts, target: TargetEstimate | None, pilot: FindPilot | None = None, dt_s: float = 0.2) -> Flown:
    """A mission whose goals are followed, but that in its scan the camera stays within 100 degrees of its first place.

    The pilot is that of the parts unless another is given.
    """
    pilot = pilot or pilot_of(parts)
    centre = parts.target.centre_W_m
    X_WB, first_rad, step = parts.start.X_WB, 0.0, 0
    known = Flown(phases={}, legs=[], places=[], opens_s=[])
    while not pilot.done():
        time_s = step * dt_s
        goal = pilot.goal(time_s, BodyState(X_WB=X_WB, target=target))
        X_BC = parts.aim.mount(goal.tilt_rad)
        X_WB, X_WC = goal.X_WB, goal.X_WB @ X_BC
        azimuth = azimuth_of(X_WC, centre)
        up = math.atan2(centre[2] - X_WC.p_m[2], math.hypot(*(X_WC.p_m - centre)[:2]))
        range_m = float(np.linalg.norm(X_WC.p_m - centre))
        if pilot.phase == "scan":
            first_rad = first_rad if "scan" in known.phases else azimuth
            turned = (azimuth - first_rad + 0.1) % (2.0 * math.pi) - 0.1
            azimuth = first_rad + turned * SIDE_RAD / (2.0 * math.pi)
            X_WB = camera_pose(centre, azimuth, up, range_m) @ X_BC.inverse()
        known.phases.setdefault(pilot.phase, time_s)
        if pilot.leg_name(time_s) not in known.legs:
            known.legs.append(pilot.leg_name(time_s))
        opens_s = pilot.shutter_s(len(known.places), time_s, dt_s)
        if opens_s is not None:
            known.places.append((azimuth, up, range_m))
            known.opens_s.append(opens_s)
        step += 1
        assert step < 10_000
    return known


def pilot_of(parts: Parts) -> FindPilot:
    """The pilot of a mission that finds."""
    assert isinstance(parts.pilot, FindPilot)
    return parts.pilot


@cache
def one_orbit(further_views: int) -> tuple[Parts, Flown]:
    """A mission of one orbit about a mapped ball that has been flown, and its parts."""
    parts = SCENARIO.replace(**ONE_ORBIT, **{"find.further_views": further_views}).parts()
    assert pilot_of(parts).planned == 24
    return parts, flown(parts, mapped_at(parts.target.centre_W_m))


def told_by(pilot: FindPilot) -> dict[str, float] | None:
    """What the pilot tells of its photographs."""
    return None if pilot.photographed is None else pilot.photographed.as_dict()


def test_what_a_scan_from_one_side_missed_is_photographed() -> None:
    """After the scan the vehicle flies to views of the other side, photographs once at each, numbered on, and ends."""
    parts, mission = one_orbit(5)
    pilot = pilot_of(parts)
    assert list(mission.phases) == ["look", "approach", "scan", "missed parts", "done"]
    assert len(mission.places) == pilot.planned == 24 + 5
    assert (np.diff(mission.opens_s) >= 0.0).all()
    assert mission.opens_s[23] < mission.phases["missed parts"] < mission.opens_s[24]
    assert mission.opens_s[-1] < mission.phases["done"]
    scanned, further = mission.places[:24], mission.places[24:]
    middle = 0.5 * (scanned[0][0] + scanned[-1][0])
    assert abs(math.remainder(further[0][0] - middle, 2.0 * math.pi)) > math.radians(90.0)
    assert [place[2] for place in further] == pytest.approx([parts.scenario.mission.standoff_m] * 5, abs=0.01)


def test_the_legs_to_what_was_missed_have_names() -> None:
    """On the way to a further view its number is told; the scan before it has the names of its orbits."""
    legs = one_orbit(5)[1].legs
    assert legs[:4] == ["look", "approach", "orbit 30 deg", "view 1"]
    assert legs[-1] == "done"
    assert set(legs[3:-1]) <= {f"view {number}" for number in range(1, 6)}


def test_coverage_is_told_after_the_scan_and_after_the_further_views() -> None:
    """What is told in the end counts all photographs, and is more than what the scan alone has seen."""
    told = []
    for views in (0, 5):
        photographed = pilot_of(one_orbit(views)[0]).photographed
        assert photographed is not None
        told.append(photographed.as_dict())
    assert [shares["photographs"] for shares in told] == [24.0, 29.0]
    assert told[0]["seen_well_pct"] > 20.0
    assert told[1]["seen_well_pct"] > told[0]["seen_well_pct"] + 5.0
    assert told[1]["unseen_pct"] < told[0]["unseen_pct"]


def test_with_no_further_views_the_mission_ends_after_the_scan() -> None:
    """It only tells what was seen."""
    parts, mission = one_orbit(0)
    pilot = pilot_of(parts)
    assert list(mission.phases) == ["look", "approach", "scan", "done"]
    assert len(mission.places) == pilot.planned == 24
    assert pilot.photographed is not None
    assert pilot.photographed.coverage.photos == 24


def test_without_a_mapped_surface_or_a_chooser_the_mission_ends_after_the_scan() -> None:
    """What is not known is not told, and nothing is flown to for it."""
    parts = SCENARIO.replace(**ONE_ORBIT).parts()
    centre, scenario = parts.target.centre_W_m, parts.scenario
    pilot = pilot_of(parts)
    start = parts.start.X_WB @ parts.aim.mount(0.0)
    alone = FindPilot(start, scenario.perception.assumed_distance_m, parts.aim, scenario.mission, scenario.find)
    for one, target in ((pilot, target_at(centre)), (alone, mapped_at(centre))):
        mission = flown(parts, target, one)
        assert list(mission.phases) == ["look", "approach", "scan", "done"]
        assert len(mission.places) == one.planned == 24
        assert one.photographed is None


def test_a_pilot_that_begins_anew_has_forgotten_all() -> None:
    """After `begin` nothing is photographed or planned beyond the scan, and the same mission is flown again."""
    parts = SCENARIO.replace(**ONE_ORBIT, **{"find.further_views": 3}).parts()
    pilot, target = pilot_of(parts), mapped_at(parts.target.centre_W_m)
    most_s = pilot.most_s()
    first = flown(parts, target)
    assert pilot.planned == 27
    before = told_by(pilot)
    pilot.begin()
    assert (pilot.phase, pilot.done(), pilot.planned) == ("look", False, 24)
    assert (told_by(pilot), pilot.found_s, pilot.accepted_s) == (None, None, None)
    assert pilot.most_s() == most_s
    assert flown(parts, target) == first
    assert told_by(pilot) == before is not None


def test_no_photograph_is_taken_between_the_scan_and_the_first_further_view() -> None:
    """The shutter stays shut until the vehicle is where the further view is."""
    parts = SCENARIO.replace(**ONE_ORBIT, **{"find.further_views": 1}).parts()
    mission = flown(parts, mapped_at(parts.target.centre_W_m))
    assert mission.opens_s[24] > mission.phases["missed parts"] + 3.0
    assert mission.phases["done"] - mission.opens_s[24] == pytest.approx(0.5, abs=0.2)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"find.give_up_s": 5.0, "find.further_views": 1},
        {"find.give_up_s": 5.0, "find.further_views": 40, "find.hold_s": 3.0},
        {"find.give_up_s": 5.0, "mission.standoff_m": 0.7, "mission.speed_m_s": 0.2},
        {"find.give_up_s": 5.0, "mission.elevations_deg": (75.0,)},
    ],
)
def test_no_mission_takes_longer_than_it_says_at_most(fields: dict[str, Any]) -> None:
    """Neither a mission as a whole nor its further views last longer than the pilot allows for at the start."""
    scenario = SCENARIO.replace(**(ONE_ORBIT | fields))
    parts, scan_only = scenario.parts(), scenario.replace(**{"find.further_views": 0}).parts()
    most_s = pilot_of(parts).most_s()
    for_further_s = most_s - pilot_of(scan_only).most_s()
    phases = flown(parts, mapped_at(parts.target.centre_W_m)).phases
    assert phases["done"] <= most_s
    assert phases["done"] - phases["missed parts"] <= for_further_s


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
    assert (pilot.found_s, pilot.accepted_s) == (None, None)


def test_goals_have_the_velocity_of_their_own_motion() -> None:
    """The desired twist agrees with the difference of desired positions, also while the centre moves."""
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


@pytest.mark.slow
@pytest.mark.parametrize("answer", [True, False])
def test_an_operator_accepts_or_refuses_what_is_proposed(answer: bool) -> None:
    """Nothing is accepted by time; what is accepted is tracked, what is refused is not asked of again."""
    parts = Parts(SCENARIO).replace(**{"perception.accept_s": 600.0})
    asked: list[TargetEstimate] = []

    def ask(target: TargetEstimate) -> bool | None:
        asked.append(target)
        return answer if len(asked) == 3 else None

    estimator, pilot = parts.estimator, parts.pilot
    assert isinstance(estimator, CameraEstimator)
    assert isinstance(pilot, FindPilot)
    fly(parts.replace(estimator=replace(estimator, answer=ask)), duration_s=10.0)
    assert len(asked) >= 3
    assert {target.status for target in asked} == {"proposed"}
    if answer:
        assert len(asked) == 3
        assert estimator.seen.target is not None
        assert estimator.seen.target.status == "tracked"
    else:
        refused = asked[2]
        away = [float(np.linalg.norm(later.centre_W_m - refused.centre_W_m)) for later in asked[3:]]
        assert all(metres > 0.03 for metres in away)


@pytest.mark.slow
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


def test_orbits_keep_the_hull_off_the_floor(caplog: pytest.LogCaptureFixture) -> None:
    """A target found low beside the floor is scanned from higher orbits than asked for, which is told once an orbit."""
    parts = SCENARIO.parts()
    pilot = parts.pilot
    assert isinstance(pilot, FindPilot)
    floor_z_m, asked = float(parts.bounds.high_W_m[2]), parts.scenario.mission.elevations_deg
    low = target_at(np.array([0.0, 0.0, floor_z_m - 0.01]))
    for _ in range(2):
        pilot._keep_clear(low)
    raised = pilot._mission.elevations_deg
    assert raised[0] > asked[0]
    assert all(now >= before for now, before in zip(raised, asked, strict=True))
    told = [record.getMessage() for record in caplog.records if "raised to" in record.getMessage()]
    assert len(told) == sum(now > before for now, before in zip(raised, asked, strict=True))
    assert all("the floor" in line for line in told)
    pilot.begin()
    assert pilot._mission.elevations_deg == asked
