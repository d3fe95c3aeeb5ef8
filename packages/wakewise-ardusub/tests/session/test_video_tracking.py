"""The stream of the vehicle's camera, the poses of its pictures, and the target that is tracked in it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from ball_on_sand import CAMERA, CENTRE_W_M, RADIUS_M, BallOnSand

from loopback_sea import until
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation.teleop.target_tracking import PERCEPTION, TargetTracking
from wakewise.perception.feature_tracks import fitted
from wakewise.scene.missions.orbit import camera_pose
from wakewise_ardusub.session.video_stream import VideoReader, VideoSource
from wakewise_ardusub.session.video_tracking import FRESH_S, LASTS_S, PoseHistory, VideoTracking

BOX = (0.36, 0.3, 0.64, 0.7)
STD = (0.003, 0.003)


@pytest.mark.parametrize(
    ("place", "delay_s", "words"),
    [
        ("film.mp4", 0.2, "must be an address"),
        ("rtsp://127.0.0.1:8554/video", 4.0, "--video-delay 4: must be 0 to 1.5 s"),
        ("rtsp://127.0.0.1:8554/video", float("nan"), "--video-delay nan"),
        ("ftp://127.0.0.1/video", 0.2, "must be an address"),
        ("nowhere.sdp", 0.2, "no such file"),
        ("", 0.2, "must be an address"),
    ],
)
def test_what_is_no_stream_is_refused(place: str, delay_s: float, words: str) -> None:
    """A film is not of now; so its pictures have no pose."""
    with pytest.raises(InputError, match=words):
        VideoSource(place=place, delay_s=delay_s)


def test_a_picture_has_the_pose_between_its_neighbours_in_time() -> None:
    """Halfway is half the way and half the turn; there is none before the first, in a gap, or long after the last."""
    poses = PoseHistory()
    assert poses.at(0.0) is None
    poses.add(1.0, Pose(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0)), STD)
    poses.add(1.4, Pose(np.array([0.4, 0.0, 0.2]), quat_from_euler(0.0, 0.0, 0.2)), STD)
    found, std = poses.at(1.2) or pytest.fail("no pose")
    assert found.p_m == pytest.approx([0.2, 0.0, 0.1])
    assert found.q == pytest.approx(quat_from_euler(0.0, 0.0, 0.1))
    assert std == STD
    assert poses.at(0.9) is None
    assert poses.at(1.4 + 0.9 * LASTS_S) is not None
    assert poses.at(1.4 + 1.1 * LASTS_S) is None
    poses.add(3.0, Pose(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0)), STD)
    assert poses.at(2.0) is None
    poses.add(7.0, Pose(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0)), STD)
    assert poses.at(1.2) is None


class Streamer:
    """A camera at a port of this computer that sends JPEGs over HTTP, of a grey level that is a number."""

    def __init__(self, port: int = 0) -> None:
        streamer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=next")
                self.end_headers()
                while not streamer.over.is_set():
                    jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), streamer.level, np.uint8))[1].tobytes()
                    head = f"--next\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    try:
                        self.wfile.write(head.encode() + jpeg + b"\r\n")
                    except OSError:
                        return
                    time.sleep(0.01)

            def log_message(self, *_: object) -> None:
                pass

        self.level, self.over = 60, threading.Event()
        self.server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()

    @property
    def port(self) -> int:
        return self.server.server_address[1]

    def close(self) -> None:
        self.over.set()
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


def test_a_stream_is_read_as_it_comes_and_opened_anew_when_it_ends() -> None:
    """Pictures are new ones, not those that wait in a buffer, at the rate asked for, each of the time it was taken."""
    camera, seen = Streamer(), list[tuple[float, float]]()
    source = VideoSource(place=f"http://127.0.0.1:{camera.port}/", delay_s=0.5)

    def take(picture: np.ndarray, time_s: float) -> None:
        assert picture.shape == (48, 64, 3)
        seen.append((float(picture.mean()), time_s - time.monotonic()))

    reader = VideoReader(source, time.monotonic, take, rate_hz=20.0)
    try:
        reader.start()
        until(lambda: len(seen) >= 10, "pictures")
        assert all(level == pytest.approx(60, abs=3) for level, _ in seen)
        assert all(-1.0 < late <= -0.5 for _, late in seen)
        camera.level = 200
        until(lambda: seen[-1][0] == pytest.approx(200, abs=3), "the new picture", 2.0)
        assert reader.trouble == ""
        camera.close()
        until(lambda: reader.trouble != "", "the end of the stream")
        camera, before = Streamer(camera.port), len(seen)
        until(lambda: len(seen) > before, "the stream again")
        assert reader.trouble == ""
    finally:
        reader.close()
        camera.close()
    assert not reader._thread.is_alive()


class Flight:
    """Tracking without a stream: a camera on an arc about the ball; pictures are given as they are asked for."""

    def __init__(self, folder: Path | None = None) -> None:
        self.protected = list[TargetEstimate]()
        self.time_s, self.water, self.k = 10.0, BallOnSand(), 0
        source = VideoSource(place="rtsp://127.0.0.1:9/none", delay_s=0.0)
        self.tracking = VideoTracking(source, CAMERA, lambda: self.time_s, self.protected.append, folder=folder)

    def see(self) -> None:
        """The next picture, a fifth of a second and a fiftieth of a radian on; waits until it is tracked."""
        self.k, self.time_s = self.k + 1, self.time_s + 0.2
        X_WC = camera_pose(CENTRE_W_M, 0.02 * self.k, np.radians(35.0), 0.7)
        self.tracking.note(self.time_s, X_WC, BodyState(X_WB=X_WC, covariance=STD[0] ** 2 * np.eye(12)))
        self.tracking.see(np.repeat(self.water.grey(X_WC)[:, :, None], 3, axis=2), self.time_s)
        now = self.tracking.now()
        if now is not None:
            until(lambda: (self.tracking.now() or now).time_s == self.time_s, "the picture to be tracked")


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Flight]:
    made = Flight(tmp_path)
    yield made
    made.tracking.close()


def test_what_lies_in_a_box_is_protected_once_it_is_mapped(flight: Flight, tmp_path: Path) -> None:
    """Nothing is, while only its direction is known; what follows a box is done before anything is tracked.

    The picture of the box is kept.
    """
    assert flight.tracking.now() is None
    flight.see()
    done = list[str]()
    flight.tracking.designate(BOX, 0.7, lambda: done.append("frustum"))
    assert done == ["frustum"]
    assert flight.tracking.now().status == "assumed"
    for _ in range(80):
        flight.see()
        if flight.protected:
            break
    assert flight.tracking.now().status == "tracked"
    assert np.linalg.norm(flight.protected[-1].centre_W_m - CENTRE_W_M) < 0.5 * RADIUS_M
    figures = flight.tracking.figures()
    assert figures["pictures"] == flight.k
    assert figures["picture_to_region_ms_p99"] == pytest.approx(0.0, abs=1e-6)  # time stands still here
    assert flight.tracking.words() == "video: not opened yet"
    (kept,) = tmp_path.glob("box-1-*.png")
    drawn = cv2.imread(str(kept), cv2.IMREAD_GRAYSCALE)
    assert drawn.shape == (360, 480)
    assert (drawn[108, 173:307] == 255).all()


class JitteryVideo:
    """An open stream of black pictures, 20 s long, whose times differ from those of an even rate by 5 ms at most."""

    def __init__(self, flight: Flight, rate_hz: float) -> None:
        times_s = np.arange(1, round(20.0 * rate_hz)) / rate_hz
        self.times_s = iter(flight.time_s + times_s + np.random.default_rng(0).uniform(-0.005, 0.005, len(times_s)))
        self.flight, self.taken_s = flight, set[float]()

    def grab(self) -> bool:
        self.flight.time_s = float(next(self.times_s, math.inf))
        there = math.isfinite(self.flight.time_s)
        if there:
            X_WC = camera_pose(CENTRE_W_M, 0.0, np.radians(35.0), 0.7)
            self.flight.tracking.note(self.flight.time_s, X_WC, BodyState(X_WB=X_WC))
        self.taken_s.add(self.flight.tracking._tracking._taken_s)
        return there

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)

    def release(self) -> None:
        pass


@pytest.mark.parametrize("rate_hz", [24.0, 30.0, 60.0])
def test_pictures_are_tracked_at_the_rate_of_the_tracker(flight: Flight, rate_hz: float) -> None:
    """A stream whose rate is no multiple of it, and jitter of its pictures, lower it by less than a tenth."""
    flight.see()
    flight.tracking.designate(BOX, 0.7, lambda: None)
    video = JitteryVideo(flight, rate_hz)
    flight.tracking._reader._read(video)
    assert len(video.taken_s) / 20.0 > 0.9 * PERCEPTION.rate_hz


def test_a_box_that_is_refused_leaves_the_tracked_target(flight: Flight) -> None:
    """Forgotten, or with another box, nothing of it is protected any more."""
    flight.see()
    flight.tracking.designate(BOX, 0.7, lambda: None)
    until_tracked(flight)

    def refuse() -> None:
        raise InputError("into the hull")

    with pytest.raises(InputError, match="into the hull"):
        flight.tracking.designate((0.0, 0.0, 0.1, 0.1), 0.7, refuse)
    assert flight.tracking.now().status == "tracked"
    flight.tracking.designate((0.0, 0.0, 0.1, 0.1), 0.7, lambda: None)
    count = len(flight.protected)
    for _ in range(3):
        flight.see()
    assert len(flight.protected) == count
    flight.tracking.forget(lambda: None)
    assert flight.tracking.now() is None


def until_tracked(flight: Flight) -> None:
    for _ in range(80):
        flight.see()
        if flight.tracking.now().status == "tracked":
            return
    raise AssertionError(flight.tracking.now())


def test_a_box_waits_for_its_picture_a_second_only(flight: Flight) -> None:
    """It was drawn in what the operator saw then: an old picture, or one that comes much later, is of elsewhere."""
    flight.see()
    flight.time_s += 2.0 * FRESH_S
    flight.tracking.designate(BOX, 0.7, lambda: None)
    flight.time_s += 2.0 * FRESH_S
    flight.see()
    assert flight.tracking.now() is None
    assert flight.tracking._expired == "no picture to find the box in, draw it again"
    flight.tracking.designate(BOX, 0.7, lambda: None)
    until_tracked(flight)


class ForgottenMeanwhile(VideoTracking):
    """Another thread forgets the target between any two lines: a second look finds none."""

    looks: list[TargetTracking]

    @property
    def _tracking(self) -> TargetTracking | None:
        return self.looks.pop() if self.looks else None

    @_tracking.setter
    def _tracking(self, value: TargetTracking | None) -> None:
        self.looks = [] if value is None else [value]


def test_a_target_may_be_forgotten_while_a_picture_comes(flight: Flight) -> None:
    """The picture goes to what was tracked as it came."""
    flight.see()
    flight.tracking.designate(BOX, 0.7, lambda: None)
    tracked = flight.tracking._tracking
    before_s = tracked._taken_s
    flight.tracking.__class__ = ForgottenMeanwhile
    flight.tracking._tracking = tracked
    flight.see()
    assert tracked._taken_s > before_s
    tracked.close()


class DesignatedMeanwhile:
    """A lock that another thread takes first, once, to designate a box."""

    def __init__(self, designate: Callable[[], None]) -> None:
        self.designate, self.lock = designate, threading.Lock()

    def __enter__(self) -> None:
        designate, self.designate = self.designate, lambda: None
        designate()
        self.lock.acquire()

    def __exit__(self, *_: object) -> None:
        self.lock.release()


def test_a_new_box_is_not_forgotten_with_one_that_waited_too_long(flight: Flight) -> None:
    """Where it comes while the late picture is looked at, it is tracked from that picture on."""
    flight.see()
    flight.time_s += 2.0 * FRESH_S
    flight.tracking.designate(BOX, 0.7, lambda: None)
    first = flight.tracking._tracking
    flight.time_s += 2.0 * FRESH_S
    flight.tracking._changes = DesignatedMeanwhile(lambda: flight.tracking.designate(BOX, 0.7, lambda: None))
    flight.see()
    assert flight.tracking._tracking not in (None, first)
    assert flight.tracking._expired == ""


@pytest.mark.parametrize(
    "size", [(256, 145), (160, 91), (256, 144), (1920, 1080), (1920, 1088), (640, 361), (854, 480)]
)
def test_pictures_are_taken_exactly_where_they_fit_the_camera(size: tuple[int, int]) -> None:
    """A picture that the tracker would refuse is told of as one of another shape."""
    camera = replace(CAMERA, width=480, height=270)
    source = VideoSource(place="rtsp://127.0.0.1:9/none", delay_s=0.0)
    tracking = VideoTracking(source, camera, lambda: 1.0, lambda target: None)
    tracking.see(np.zeros((size[1], size[0], 3), np.uint8), 1.0)
    fits = fitted(np.zeros((size[1], size[0]), np.uint8), camera).shape == (270, 480)
    assert (tracking._unlike == "") == fits


def test_pictures_of_another_shape_are_told_at_once(flight: Flight) -> None:
    """With what is to be set."""
    flight.tracking.see(np.zeros((1080, 1920, 3), np.uint8), flight.time_s)
    assert flight.tracking._unlike == (
        "pictures of 1920 x 1080: give --set imaging.width=1920 --set imaging.height=1080"
    )
    assert flight.tracking.pictures == 0
    flight.see()
    assert flight.tracking._unlike == ""
