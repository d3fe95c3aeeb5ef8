"""A target designated by a box: its frustum, its distance, and what flies by it, over real bytes on loopback."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from loopback_sea import VEHICLE, Sea, session_at, until
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import TargetEstimate
from wakewise.perception.settings import DISTANCE_STD
from wakewise.vision.imaging import PinholeCamera
from wakewise_ardusub.link.session_log import read_journal
from wakewise_ardusub.session.boxed_target import box_of, boxed_target, target_distance
from wakewise_ardusub.session.session import MOVED_M
from wakewise_ardusub.session.video_stream import VideoSource

CAMERA = PinholeCamera(width=960, height=720, fov_rad=math.radians(80.0))
AT = Pose(np.array([3.0, -2.0, 5.0]), quat_from_euler(0.0, 0.0, 0.7))
X_WC = AT @ VEHICLE.X_BC
LEVEL = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
AHEAD, DOWN_AHEAD = np.array([1.0, 0.0, 0.0]), np.array([math.sqrt(0.5), 0.0, math.sqrt(0.5)])
ACCEPTED, DENIED = 0, 2


def test_the_frustum_lies_along_the_boxs_rays():
    """Its points fall into the box, from a fifth nearer to a fifth farther than the distance, in the world's frame."""
    box = (0.3, 0.4, 0.5, 0.7)
    found = boxed_target(box, CAMERA, X_WC, lambda way: (1.5, "stated"))
    p_C = X_WC.inverse().apply(found.region.points_W_m)
    shares = CAMERA.project(p_C) / (CAMERA.width, CAMERA.height)
    assert (shares > [0.3, 0.4]).all()
    assert (shares < [0.5, 0.7]).all()
    middle = p_C[[4, 13, 22]]
    assert np.linalg.norm(middle, axis=1) == pytest.approx(1.5 * np.array([0.8, 1.0, 1.2]))
    assert found.region.weights.sum() == pytest.approx(15.0)
    away = np.linalg.norm(found.region.points_W_m - found.centre_W_m, axis=1)
    assert away.max() <= found.radius_m + 1e-12
    assert found.words == f"target by a box, 1.50 m off (+-{DISTANCE_STD * 1.5:.2f}, stated)"


def test_where_a_target_is_in_the_picture():
    """In the box that it was drawn in, seen from there; nowhere in the picture of a camera that looks away."""
    found = boxed_target((0.3, 0.4, 0.5, 0.7), CAMERA, X_WC, lambda way: (1.5, "stated"))
    assert box_of(found, CAMERA, X_WC) == pytest.approx((0.32, 0.43, 0.48, 0.67))
    away = Pose(AT.p_m, quat_from_euler(0.0, 0.0, 0.7 + math.pi)) @ VEHICLE.X_BC
    aside = Pose(AT.p_m, quat_from_euler(0.0, 0.0, 0.7 + 1.2)) @ VEHICLE.X_BC
    for other in (away, aside):
        assert all(map(math.isnan, box_of(found, CAMERA, other)))


def test_a_distance_is_measured_before_it_is_stated():
    """Ahead by the rangefinder in whose beam the ray lies, else where the ray meets the bed, else as stated."""
    ranges = {0: (1.2, 10.0), 25: (0.8, 10.0)}
    here, camera = LEVEL, np.array([0.2, 0.0, 0.0])
    assert target_distance(AHEAD, here, camera, ranges, 11.0, 3.0) == (1.2, "rangefinder")
    found, said = target_distance(DOWN_AHEAD, here, camera, ranges, 11.0, 3.0)
    assert (found, said) == (pytest.approx(0.8 * math.sqrt(2.0)), "altitude")
    assert target_distance(AHEAD, here, camera, {25: (0.8, 10.0)}, 11.0, 3.0) == (3.0, "stated")
    assert target_distance(AHEAD, here, camera, ranges, 12.5, 3.0) == (3.0, "stated")
    level = np.array([1.0, 0.0, 0.01])
    assert target_distance(level / np.linalg.norm(level), here, camera, {25: (0.8, 10.0)}, 11.0, 3.0)[1] == "stated"
    for stated, words in ((math.nan, "no distance: no rangefinder, no --distance"), (50.0, "must be 0.1 to 20 m")):
        with pytest.raises(InputError, match=words):
            target_distance(AHEAD, here, camera, {}, 11.0, stated)


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def sea(port) -> Iterator[Sea]:
    made = Sea(port)
    yield made
    made.close()


def test_a_ground_station_designates_a_target_by_a_box_while_the_link_drives(sea, port, tmp_path):
    """A box at the bed is protected, watched, kept off and told of, and the engagement goes on through it.

    Boxes that are none, or without a distance, are denied in one line and change nothing; to stop tracking
    brings the first target back.
    """
    session, close = session_at(port, tmp_path / "sea")
    try:
        until(lambda: session.boxes is not None and session._seen_from() is not None, "a flight")
        until(lambda: session.gate.engagement.state == "ready", "all to be well")
        assert session.gate.press() == "engaged"
        joined, pilot = session.sea, session.sea.parts.pilot.inner
        first, at_first = dict(joined.methods), pilot.target_W_m
        for box in ((0.4, 0.6, math.nan, 0.8), (0.4, 0.6, 1.3, 0.8), (0.5, 0.6, 0.5, 0.8), (0.4, 0.6, 0.6, 0.8)):
            assert sea.order(2005, *box) == DENIED
            assert dict(joined.methods) == first
        said = [one.text for one in sea.of("STATUSTEXT")]
        assert said[-1] == "no distance: no rangefinder, no --distance"
        assert "outside the picture" in said[1]
        sea.altitude_m = 1.0
        until(lambda: 25 in session.gate.known.ranges, "an altitude", 10.0)
        here = session._seen_from()
        assert here is not None
        assert sea.order(2005, 0.4, 0.6, 0.6, 0.8) == ACCEPTED
        found = session.boxes.target
        assert found.distance_from == "altitude"
        ray = here[1].R @ np.array([0.0, 0.2 * session.sea.bare.camera.height / session.sea.bare.camera.focal_px, 1.0])
        assert (found.centre_W_m - here[1].p_m) @ ray > 0.98 * np.linalg.norm(ray) * np.linalg.norm(
            found.centre_W_m - here[1].p_m
        )
        assert found.centre_W_m[2] == pytest.approx(here[0].X_WB.p_m[2] + 1.0, abs=0.1)
        assert all(joined.methods[name] is not made for name, made in first.items())
        assert pilot.target_W_m == pytest.approx(found.centre_W_m)
        assert pilot.keep_off.around.spheres[0, :3] == pytest.approx(found.centre_W_m)
        until(lambda: joined.figures.parts.target.centre_W_m == pytest.approx(found.centre_W_m), "figures of it", 10.0)
        until(lambda: len(sea.of("CAMERA_TRACKING_IMAGE_STATUS")) >= 2, "its place in the picture", 10.0)
        shown = sea.of("CAMERA_TRACKING_IMAGE_STATUS")[0]
        assert (shown.rec_top_x, shown.rec_bottom_x) == pytest.approx((0.42, 0.58), abs=0.05)
        sea.altitude_m = math.nan
        assert sea.order(2005, 0.4, 0.6, 0.6, 5.0) == DENIED
        assert session.boxes.target is found
        assert session.gate.entry is not None, session.gate.engagement.why
        assert "target by a box" in session.line()
        until(lambda: -40.0 < sea.autopilot.mount_deg < -10.0, "the camera to look down at it", 20.0)
        until(lambda: f"camera {sea.autopilot.mount_deg:+.0f} deg  " in session.line(), "its angle", 5.0)
        joined.operator.set(mode="scan")
        assert sea.order(2005, 0.3, 0.6, 0.6, 0.8) == DENIED
        joined.operator.set(mode="hold")
        assert session.boxes.target is found
        assert sea.order(2010) == ACCEPTED
        assert session.boxes.target is None
        assert pilot.target_W_m == pytest.approx(at_first)
        assert session.gate.entry is not None, session.gate.engagement.why
        assert session.gate.press().startswith("released")
        until(lambda: sea.autopilot.mount_deg == 0.0, "the mount to be the pilot's", 10.0)
    finally:
        close()
    assert session.fault is None
    told = [(line["result"], line["words"]) for line in read_journal(tmp_path / "sea" / "journal.jsonl")[0]
            if line["event"] == "box"]  # fmt: skip
    assert [result for result, _ in told] == [DENIED] * 4 + [ACCEPTED, DENIED, DENIED, ACCEPTED]


def test_the_fence_stays_about_the_first_target(sea, port, tmp_path):
    """A message cannot widen where the companion drives: distances are judged to the target that was typed."""
    session, close = session_at(port, tmp_path / "sea", box=(0.4, 0.4, 0.6, 0.6), distance_m=4.0)
    try:
        until(lambda: session._seen_from() is not None, "a flight")
        assert session.boxes.target.distance_m == 4.0
        assert session.gate.facts().distance_m == pytest.approx(1.0 + 0.5 * VEHICLE.size_m[0], abs=0.3)
    finally:
        close()


def test_a_box_that_reaches_into_the_hull_is_denied(sea, port, tmp_path):
    """What is 0.15 m before the camera lies where no plan could be good: one line, and the first target stays."""
    session, close = session_at(port, tmp_path / "sea", distance_m=0.15)
    try:
        until(lambda: session._seen_from() is not None, "a flight")
        assert sea.order(2005, 0.1, 0.1, 0.9, 0.9) == DENIED
        assert sea.of("STATUSTEXT")[-1].text.startswith("here: ")
        assert session.boxes.target is None
        assert session.sea.parts.pilot.inner.target_W_m == pytest.approx(session.sea.bare.target.centre_W_m)
    finally:
        close()


@pytest.mark.parametrize(("distance_m", "fault"), [(1.2, None), (math.nan, "no distance")])
def test_a_box_may_be_given_as_the_session_begins(sea, port, tmp_path, distance_m, fault):
    """At the stated distance from where the vehicle is then; without one the session ends in one line."""
    session, close = session_at(port, tmp_path / "sea", box=(0.4, 0.4, 0.6, 0.6), distance_m=distance_m)
    try:
        until(lambda: session.boxes is not None or not session.running, "the box")
        if fault is None:
            centre = session.boxes.target.centre_W_m
            assert np.linalg.norm(centre - session._here().X_WB.p_m) == pytest.approx(1.2, abs=0.35)
            assert session.sea is None or session.sea.parts.pilot.inner.target_W_m == pytest.approx(centre)
    finally:
        close()
    assert session.fault is None if fault is None else fault in str(session.fault)


def mapped(centre_W_m) -> TargetEstimate:
    """A target of 8 cm that the camera has mapped, of 14 points."""
    points = centre_W_m + 0.08 * np.vstack([np.eye(3), -np.eye(3), np.zeros((8, 3))])
    return TargetEstimate(
        time_s=0.0,
        status="tracked",
        centre_W_m=np.asarray(centre_W_m),
        covariance=1e-4 * np.eye(3),
        radius_m=0.08,
        points_W_m=points,
        weights=np.ones(14),
        distance_m=np.repeat([0.0, 0.05], [6, 8]),
    )


def test_a_mapped_target_takes_the_place_of_its_box(sea, port, tmp_path, monkeypatch):
    """Its region is protected; one that moved or grew is flown by as it is now, but not once a mission has begun.

    One that would reach into the hull is refused, and the last one stays.
    """
    monkeypatch.setattr("wakewise_ardusub.session.video_stream.open_video", lambda place: None)
    video = VideoSource(place="rtsp://127.0.0.1:9/none", delay_s=0.1)
    session, close = session_at(port, tmp_path / "sea", box=(0.4, 0.4, 0.6, 0.6), distance_m=1.5, video=video)
    try:
        until(lambda: session._seen_from() is not None and session.tracking is not None, "a flight")
        joined, pilot, protect = session.sea, session.sea.parts.pilot.inner, session.tracking._protect
        assert session.tracking.now().status == "assumed"
        assert "video: " in session.line()
        methods, middle = dict(joined.methods), session._here().X_WB.p_m + np.array([1.4, 0.0, 0.1])

        def protected(centre_W_m) -> bool:
            """Whether its region is protected; its target is told of in any case."""
            nonlocal methods
            before, methods = methods, dict(joined.methods)
            assert session.boxes.target.distance_from == "mapped"
            assert session.boxes.target.centre_W_m == pytest.approx(centre_W_m)
            return all(methods[name] is not made for name, made in before.items())

        protect(mapped(middle))
        assert protected(middle)
        assert pilot.target_W_m == pytest.approx(middle)
        assert "(+-0.02, mapped)" in session.line()
        swayed = middle + np.array([0.0, 0.5 * MOVED_M, 0.0])
        protect(mapped(swayed))
        assert protected(swayed)
        assert pilot.target_W_m == pytest.approx(middle)
        joined.operator.set(mode="scan")
        away = middle + np.array([0.0, 2.0 * MOVED_M, 0.0])
        protect(mapped(away))
        assert protected(away)
        assert pilot.target_W_m == pytest.approx(middle)
        joined.operator.set(mode="hold")
        begun, pilot._scan = pilot._scan, replace(pilot._scan, mission_s=3.0)
        protect(mapped(away))
        assert protected(away)
        assert pilot.target_W_m == pytest.approx(middle)
        pilot._scan = begun
        protect(mapped(away))
        assert protected(away)
        assert pilot.target_W_m == pytest.approx(away)
        grown = replace(mapped(away), radius_m=0.08 + 2.0 * MOVED_M)
        protect(grown)
        assert protected(away)
        assert pilot.keep_off.around.spheres[0, 3] == pytest.approx(0.18)
        with pytest.raises(InputError, match="here: "):
            protect(mapped(session._here().X_WB.p_m))
        assert not protected(away)
        assert sea.order(2010) == ACCEPTED
        assert session.tracking.now() is None
        assert session.boxes.target is None
    finally:
        close()
    assert session.fault is None
    assert session.figures()["picture_to_region_ms_p99"] is None


def test_a_camera_whose_mount_is_not_reported_is_fixed(port, tmp_path):
    """It points as stated: a box lies on that ray, and the controller has no joint to turn."""
    sea, tilt_rad = Sea(port, MNT1_TYPE=0.0), math.radians(-30.0)
    session, close = session_at(port, tmp_path / "sea", box=(0.4, 0.4, 0.6, 0.6), distance_m=1.2, tilt_rad=tilt_rad)
    try:
        until(lambda: session._seen_from() is not None, "a flight")
        assert session.sea.bare.vehicle.tilt is None
        camera, target = session._here().X_WB @ session.mount.X_BC(), session.boxes.target
        assert math.asin(camera.R[2, 2]) == pytest.approx(-tilt_rad, abs=0.02)
        way = target.centre_W_m - camera.p_m
        assert math.asin(way[2] / np.linalg.norm(way)) == pytest.approx(-tilt_rad, abs=0.1)
        assert "camera -30 deg (stated)" in session.line()
        assert not session.mount.reported
    finally:
        close()
        sea.close()
    assert session.fault is None


def test_an_engagement_begins_with_the_camera_where_the_pilot_turned_it(sea, port, tmp_path):
    """The first angle that is asked of the mount is the one that it has, not that of the mission."""
    sea.autopilot.mount_target_deg = -38.0
    session, close = session_at(port, tmp_path / "sea")
    try:
        until(lambda: session._seen_from() is not None, "a flight")
        until(lambda: session.gate.engagement.state == "ready", "all to be well")
        assert session.gate.press() == "engaged"
        until(lambda: any(one.command == 205 for one in sea.of("COMMAND_LONG")), "an angle", 10.0)
        first = next(one for one in sea.of("COMMAND_LONG") if one.command == 205)
        assert first.param1 == pytest.approx(-38.0, abs=3.0)
    finally:
        close()
    assert session.fault is None
