"""The thread that tracks a designated target: from a box of a picture to its region, and what may go wrong."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np
import pytest
from ball_on_sand import CAMERA, CENTRE_W_M, RADIUS_M, BallOnSand, ball_jpeg

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TargetEstimate
from wakewise.operation.teleop.target_tracking import PERCEPTION, STALE_S, SeenPicture, TargetTracking, grey_of
from wakewise.perception import TargetTracker
from wakewise.scene.missions.orbit import camera_pose
from wakewise.ui.cockpit.state import target_message

BOX = (0.36, 0.3, 0.64, 0.7)
FRAME_S, STEP_RAD = 0.2, 0.02
STD = (0.003, 0.003)


class Rig:
    """A tracking thread, the regions that it protected, and a camera that goes round the target."""

    def __init__(self, protect: Callable[[TargetEstimate | None], None] | None = None) -> None:
        self.regions: list[TargetEstimate | None] = []
        tracker = TargetTracker(camera=CAMERA, settings=PERCEPTION)
        self.tracking = TargetTracking(tracker, protect or self.regions.append)
        self.water, self.frame, self.time_s = BallOnSand(), 0, 5.0
        self.X_WC = self.pose()

    def pose(self) -> Pose:
        return camera_pose(CENTRE_W_M, STEP_RAD * self.frame, np.radians(35.0), 0.7)

    def see(self, jpeg: bytes | None = None, width: int = CAMERA.width) -> None:
        """The next picture, tracked where a target is designated."""
        self.frame, self.time_s, self.X_WC = self.frame + 1, self.time_s + FRAME_S, self.pose()
        data = ball_jpeg(self.water, self.X_WC, width) if jpeg is None else jpeg
        self.tracking.see(SeenPicture(frame=self.frame, time_s=self.time_s, image=data, X_WC=self.X_WC, std=STD))

    def told(self) -> dict:
        told = target_message(self.tracking, self.time_s, self.X_WC)
        json.dumps(told, allow_nan=False)
        return told or {}

    def until(self, right: Callable[[dict], object]) -> dict:
        end_s = time.monotonic() + 30.0
        while not right(told := self.told()):
            assert time.monotonic() < end_s, told
            time.sleep(0.005)
        return told

    def track(self, right: Callable[[dict], object], most: int = 80, **how: int) -> dict:
        """See pictures, each tracked before the next, until it is right."""
        for _ in range(most):
            self.see(**how)
            told = self.until(lambda told: told["age_ms"] == 0)
            if right(told):
                return told
        raise AssertionError(told)


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    made.tracking.start()
    yield made
    made.tracking.close()
    assert not made.tracking._thread.is_alive()


def test_a_box_becomes_a_ball_and_then_the_target_itself(rig: Rig) -> None:
    """First a ball at an assumed distance is protected; seen from other sides the target is where it is.

    Smaller pictures, as under load, change nothing. Without pictures the last region stays; forgotten, the first one is
    protected again.
    """
    assert rig.tracking.now(5.0) is None
    rig.see()
    rig.tracking.designate(BOX, rig.frame)
    first = rig.until(lambda told: told["outline"])
    assert first["status"] == "assumed"
    assert first["outline"]["u"] == pytest.approx(0.5, abs=0.02)
    assert rig.tracking.notes(rig.time_s)[0][1].startswith("target designated")
    told = rig.track(lambda told: told["status"] == "tracked")
    assert rig.tracking.notes(rig.time_s) == (("info", "target tracked; its region is protected"),)
    assert told["distance_m"] == pytest.approx(0.7, abs=0.05)
    assert told["std_m"] < 0.05
    region = rig.regions[-1]
    assert region is not None
    assert np.linalg.norm(np.average(region.points_W_m, axis=0) - CENTRE_W_M) < 0.08
    assert told["outline"]["u"] == pytest.approx(0.5, abs=0.05)
    assert told["outline"]["radius"] == pytest.approx(CAMERA.fx * RADIUS_M / 0.7 / CAMERA.width, rel=0.5)
    narrower_pictures_are_tracked_in_the_same_size(rig)
    without_pictures_it_is_lost(rig)
    forgotten_it_is_the_scenarios(rig)


def narrower_pictures_are_tracked_in_the_same_size(rig: Rig) -> None:
    for width in (400, 320):
        told = rig.track(lambda told: not told["trouble"], width=width)
        assert told["status"] == "tracked"
    assert grey_of(ball_jpeg(rig.water, rig.X_WC, 256), CAMERA).shape == (360, 480)


def without_pictures_it_is_lost(rig: Rig) -> None:
    rig.tracking.notes(rig.time_s)
    rig.time_s += STALE_S + 0.1
    told = rig.told()
    assert (told["status"], told["trouble"]) == ("lost", "no pictures")
    assert told["outline"] is not None
    assert rig.tracking.notes(rig.time_s) == (("warn", "target lost; its last region stays protected"),)
    assert rig.regions[-1] is not None


def forgotten_it_is_the_scenarios(rig: Rig) -> None:
    rig.tracking.forget()
    assert rig.tracking.now(rig.time_s) is None
    assert "forgotten" in rig.tracking.notes(rig.time_s)[0][1]
    assert rig.tracking.notes(rig.time_s) == ()
    end_s = time.monotonic() + 10.0
    while rig.regions[-1] is not None:
        assert time.monotonic() < end_s
        time.sleep(0.005)


def test_a_proposal_waits_until_it_is_accepted(rig: Rig) -> None:
    """Without a box the ball on the bed is proposed and protected, and tracked once the pilot accepts it."""
    rig.tracking.propose()
    rig.track(lambda told: told["status"] == "assumed")
    assert rig.tracking.notes(rig.time_s)[0][1].startswith("no target is proposed yet")
    rig.track(lambda told: told["status"] == "proposed")
    assert rig.tracking.notes(rig.time_s)[0][1].startswith("a target is proposed")
    for _ in range(20):
        assert rig.track(lambda _: True)["status"] == "proposed"
    rig.tracking.answer(accepted=True)
    assert rig.track(lambda told: told["status"] == "tracked", most=2)["distance_m"] == pytest.approx(0.7, abs=0.05)
    assert rig.regions[-1] is not None


def test_a_refused_body_is_not_proposed_again_until_a_box_is_drawn(rig: Rig) -> None:
    """After the answer a ball is protected again; a box on the same body takes it."""
    rig.tracking.propose()
    rig.track(lambda told: told["status"] == "proposed")
    rig.tracking.answer(accepted=False)
    rig.until(lambda told: told["status"] == "assumed" and told["outline"] is None)
    for _ in range(20):
        assert rig.track(lambda _: True)["status"] == "assumed"
    rig.tracking.designate(BOX, rig.frame)
    rig.track(lambda told: told["status"] == "tracked")


@pytest.mark.parametrize("accepted", [True, False])
def test_an_answer_without_a_proposal_changes_nothing(rig: Rig, accepted: bool) -> None:
    """Neither before a target is asked for nor of a box, which is the pilot's own."""
    with pytest.raises(InputError, match="no target is proposed"):
        rig.tracking.answer(accepted=accepted)
    rig.see()
    rig.tracking.designate(BOX, rig.frame)
    before = rig.until(lambda told: told["outline"])
    with pytest.raises(InputError, match="no target is proposed"):
        rig.tracking.answer(accepted=accepted)
    assert rig.told() == before


def test_the_box_is_taken_in_the_picture_in_which_it_was_drawn(rig: Rig) -> None:
    """Pictures that came since are of elsewhere."""
    rig.see()
    frame, X_WC = rig.frame, rig.X_WC
    for _ in range(8):
        rig.see()
    rig.tracking.designate((0.7, 0.3, 0.9, 0.6), frame)
    rig.until(lambda told: told["outline"])
    outline = rig.tracking.outline(X_WC) or {}
    assert outline["u"] == pytest.approx(0.8, abs=0.01)
    assert outline["v"] == pytest.approx(0.45, abs=0.01)


@pytest.mark.parametrize(
    ("jpeg", "words"),
    [
        (b"", "no picture"),
        (b"\xff\xd8 no JPEG", "no picture"),
        (cv2.imencode(".jpg", np.full((200, 480), 90, np.uint8))[1].tobytes(), "picture of 480 x 200 px"),
        (cv2.imencode(".jpg", np.full((360, 480), 90, np.uint8))[1].tobytes(), "uniform picture"),
    ],
)
def test_a_picture_that_shows_nothing_is_a_trouble_and_the_region_stays(rig: Rig, jpeg: bytes, words: str) -> None:
    """The next picture goes on as if there had been none."""
    rig.see()
    rig.tracking.designate(BOX, rig.frame)
    rig.track(lambda _: True)
    regions = len(rig.regions)
    rig.see(jpeg)
    told = rig.until(lambda told: told["trouble"])
    assert words in told["trouble"]
    assert told["age_ms"] == pytest.approx(1e3 * FRAME_S)
    assert len(rig.regions) == regions
    rig.track(lambda told: not told["trouble"])


def test_a_region_that_cannot_be_protected_is_told() -> None:
    """The thread goes on, and another box may be drawn."""

    def refuse(target: TargetEstimate | None) -> None:
        raise ValueError("no\nroom")

    other = Rig(refuse)
    other.tracking.start()
    try:
        other.see()
        other.tracking.designate(BOX, other.frame)
        assert other.until(lambda told: told["outline"])["trouble"].endswith("ValueError: no room")
        other.tracking.designate(BOX, 10**6)
        assert other.told()["trouble"] == "no picture yet"
    finally:
        other.tracking.close()
