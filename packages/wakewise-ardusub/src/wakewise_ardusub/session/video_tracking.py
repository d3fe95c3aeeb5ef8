"""Tracking of a designated target in the stream of the vehicle's camera.

    stream -> newest picture, five a second -> the camera's pose at its time -> `TargetTracking` -> protected region

A picture is `VideoSource.delay_s` old when it arrives: exposure, encoder, network and decoder. The estimate's poses of
the last seconds are kept, so that each picture has the pose at which it was taken.
"""

from __future__ import annotations

import math
import threading
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from wakewise.core.errors import WakewiseError
from wakewise.core.files import write_bytes
from wakewise.core.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation.finding.camera_estimator import known_camera
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.input.controls import Box
from wakewise.operation.teleop.target_tracking import (
    PERCEPTION,
    SeenPicture,
    TargetTracking,
    TrackedTarget,
    grey_of,
    pose_std,
)
from wakewise.perception import CalibratedCamera, TargetTracker
from wakewise.perception.feature_tracks import has_shape
from wakewise_ardusub.session.video_stream import Picture, VideoReader, VideoSource

KEPT_S = 5.0
"""Poses are kept so long: a picture may be `MOST_DELAY_S` old when it arrives."""
GAP_S, LASTS_S = 0.5, 0.15
"""A picture has no pose if the estimates before and after it are farther apart than this, or the last one is older."""
FRESH_S = 1.0
"""A box was drawn in a picture that is not older when it arrived; without one, in one that comes within this time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _TimedPose:
    time_s: float
    X_WC: Pose
    std: tuple[float, float]


@dataclass(eq=False)
class PoseHistory:
    """Camera poses X_WC of the last seconds, by the estimate; one thread adds, another asks."""

    _poses: deque[_TimedPose] = field(default_factory=deque)

    def add(self, time_s: float, X_WC: Pose, std: tuple[float, float]) -> None:
        """Note a pose, later than the last one, with its standard deviations per axis, m and rad."""
        self._poses.append(_TimedPose(time_s=time_s, X_WC=X_WC, std=std))
        while self._poses[0].time_s < time_s - KEPT_S:
            self._poses.popleft()

    def at(self, time_s: float) -> tuple[Pose, tuple[float, float]] | None:
        """The pose between its neighbours in time; None if they are more than `GAP_S` apart or off."""
        poses = list(self._poses)
        k = bisect_right(poses, time_s, key=lambda pose: pose.time_s)
        if k == 0 or not poses:
            return None
        before = poses[k - 1]
        if k == len(poses):  # a pose to come: the vehicle hardly moves until then
            return (before.X_WC, before.std) if time_s - before.time_s < LASTS_S else None
        after = poses[k]
        span_s = after.time_s - before.time_s
        if span_s > GAP_S:
            return None
        share = (time_s - before.time_s) / span_s
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(before.X_WC.q), after.X_WC.q))
        p_m = (1.0 - share) * before.X_WC.p_m + share * after.X_WC.p_m
        return Pose(p_m, quat_multiply(before.X_WC.q, quat_from_rotvec(share * turn))), before.std


class VideoTracking:
    """Tracks what lies in a box of the newest picture, and has its region protected once it is mapped.

    Parameters
    ----------
    source : VideoSource
    camera : CalibratedCamera
        Of the stream's pictures, in the size in which they are tracked.
    ahead_m : float
        How far its projection centre lies before the lens's, behind a flat port.
    folder : Path
        Keeps the picture of each box.
    clock : callable
        The time now, s.
    protect : callable
        Called in a thread of its own with the estimate of a mapped target when its region changes.
    """

    def __init__(
        self,
        source: VideoSource,
        camera: CalibratedCamera,
        clock: Callable[[], float],
        protect: Callable[[TargetEstimate], None],
        ahead_m: float = 0.0,
        folder: Path | None = None,
    ) -> None:
        self._camera = camera
        self._clock, self._protect, self._poses = clock, protect, PoseHistory()
        self._ahead_m, self._folder, self._boxes = ahead_m, folder, 0
        TargetTracker(camera=self._camera, settings=PERCEPTION).init()  # its kernel is loaded before anything flies
        self._reader = VideoReader(source, clock, self.see, PERCEPTION.rate_hz)
        self._changes = threading.Lock()
        self._newest: SeenPicture | None = None
        self._arrived: tuple[float, float] = (-math.inf, math.nan)
        """When the newest picture with a pose arrived, by this clock and in UTC."""
        self._begun_s = math.inf
        self._until_s = math.inf
        """Until when the picture of a box is waited for; inf where it is there."""
        self._unlike = self._expired = ""
        """What is wrong with the pictures' shape, and with the last box, for people."""
        self._tracking: TargetTracking | None = None
        self.pictures = 0
        self.ages_s: deque[float] = deque(maxlen=10_000)
        """From each picture to its region in control."""

    def start(self) -> None:
        """Start reading the stream."""
        self._reader.start()

    def note(self, time_s: float, X_WC: Pose, estimate: BodyState) -> None:
        """Note the camera's pose by the estimate now."""
        if self._begun_s == math.inf:
            self._begun_s, self._until_s = time_s, time_s + FRESH_S
        self._poses.add(time_s, X_WC, pose_std(estimate))

    def see(self, picture: Picture, time_s: float) -> None:
        """Take a picture, BGR, shape (h, w, 3), of the time at which it was taken."""
        self._unlike = self._compared(picture)
        found = self._poses.at(time_s)
        if found is None or self._unlike:
            return
        X_WC, std = found
        self.pictures += 1
        small = grey_of(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), self._camera)
        self._newest = newest = SeenPicture(frame=self.pictures, time_s=time_s, image=small, X_WC=X_WC, std=std)
        now_s = self._clock()
        self._arrived = now_s, time.time()
        tracking = self._tracking  # before `_until_s`, which a new box sets first
        if self._until_s < math.inf:
            tracking = self._awaiting(now_s)
        if tracking is not None:
            tracking.see(newest)

    def designate(self, box: Box, distance_m: float, follow: Callable[[], None]) -> None:
        """Run `follow`, which has something protected meanwhile, then track what is in the box, in shares.

        `distance_m`: of the target, until it is mapped. Nothing changes if `follow` raises.
        """
        self._begin(lambda: self._tracked(box, distance_m), follow)

    def forget(self, follow: Callable[[], None]) -> None:
        """Run `follow`, then track nothing any more; nothing changes if it raises."""
        self._begin(lambda: None, follow)

    def close(self) -> None:
        """End reading and tracking, after the picture in hand."""
        self._reader.close()
        self.forget(lambda: None)

    def now(self) -> TrackedTarget | None:
        """What is known of the target; None if none is designated."""
        tracking = self._tracking
        return None if tracking is None else tracking.now(self._clock())

    def words(self) -> str:
        """How it stands, for people."""
        known = self.now()
        trouble = self._reader.trouble or self._unlike or self._expired
        if trouble:
            return f"video: {trouble}"
        if known is None:
            return f"video: {self.pictures} pictures, no box"
        age_s = self._clock() - known.time_s
        seen = f"picture {age_s:.1f} s old" if math.isfinite(age_s) else "no picture with a pose yet"
        return ", ".join(filter(None, (f"video: {known.status}", seen, known.trouble)))

    def figures(self) -> dict[str, float | None]:
        """How many pictures had a pose, and how old they were when their regions were protected."""
        ages_s = list(self.ages_s)
        age_ms = round(1e3 * float(np.percentile(ages_s, 99.0)), 1) if ages_s else None
        return {"pictures": self.pictures, "picture_to_region_ms_p99": age_ms}

    def _begin(self, begun: Callable[[], TargetTracking | None], follow: Callable[[], None]) -> None:
        with self._changes:
            follow()
            self._expired, self._until_s = "", math.inf
            before, self._tracking = self._tracking, begun()
        if before is not None:  # not while the changes are locked: it may wait for that
            before.close()

    def _awaiting(self, now_s: float) -> TargetTracking | None:
        """What waits for a picture that arrived now; forgotten if that is too late."""
        with self._changes:
            tracking, late = self._tracking, now_s > self._until_s
            self._until_s = math.inf
            if tracking is None or not late:
                return tracking
            self._tracking, self._expired = None, "no picture to find the box in, draw it again"
        tracking.close()  # see `_begin`
        return None

    def _tracked(self, box: Box, distance_m: float) -> TargetTracking:
        def protect(target: TargetEstimate | None) -> None:
            if target is None or target.status == "assumed":
                return  # until it is mapped the box's frustum is protected
            with self._changes:
                if self._tracking is tracking:
                    self._protect(target)
                    self.ages_s.append(self._clock() - target.time_s)

        newest = self._newest if self._clock() - self._arrived[0] <= FRESH_S else None
        self._until_s = max(self._clock(), self._begun_s) + FRESH_S if newest is None else math.inf
        # The reader hands on `PERCEPTION.rate_hz` pictures a second; a second limit would drop some of them.
        settings = PERCEPTION.model_copy(update={"assumed_distance_m": distance_m, "rate_hz": math.inf})
        tracker = TargetTracker(camera=self._camera, settings=settings)
        tracking = TargetTracking(tracker, protect, self._ahead_m, begun_s=min(self._begun_s, self._clock()))
        tracking.start()
        if newest is not None:
            tracking.see(newest)
            self._keep(newest, box)
        tracking.designate(box, -1 if newest is None else newest.frame)
        return tracking

    def _compared(self, picture: Picture) -> str:
        """What is wrong with a picture's shape; empty if nothing is."""
        if has_shape(picture.shape, self._camera):
            return ""
        height, width = picture.shape[:2]
        return f"pictures of {width} x {height}: give --set imaging.width={width} --set imaging.height={height}"

    def _keep(self, picture: SeenPicture, box: Box) -> None:
        """Keep the picture of a box with the box drawn in it; its name has the time in UTC at which it arrived."""
        assert not isinstance(picture.image, bytes)
        if self._folder is None:
            return
        self._boxes += 1
        left, top, right, bottom = (
            round(share * side) for share, side in zip(box, 2 * picture.image.shape[::-1], strict=True)
        )
        drawn = cv2.rectangle(picture.image.copy(), (left, top), (right, bottom), 255, 1)
        utc_s = self._arrived[1]
        stamp = time.strftime("%H%M%S", time.gmtime(utc_s)) + f".{int(1e3 * (utc_s % 1.0)):03d}"
        with suppress(OSError, WakewiseError):  # a full disk ends no flight
            write_bytes(self._folder / f"box-{self._boxes}-{stamp}.png", cv2.imencode(".png", drawn)[1].tobytes())


def video_tracking(
    source: VideoSource,
    parts: Parts,
    clock: Callable[[], float],
    protect: Callable[[TargetEstimate], None],
    folder: Path,
) -> VideoTracking:
    """Tracking in the stream of the camera of a flight's parts."""
    camera, ahead_m = known_camera(parts, PERCEPTION)
    return VideoTracking(source, camera, clock, protect, ahead_m, folder)
