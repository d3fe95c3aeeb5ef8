"""Tracking of a designated target in the stream of the vehicle's camera.

    stream -> newest picture, five a second -> the camera's pose at its time -> `TargetTracking` -> protected region

A picture is `VideoSource.delay_s` old when it arrives: exposure, encoder, network and decoder. The estimate's poses of
the last seconds are kept, so that each picture has the pose at which it was taken.
"""

from __future__ import annotations

import math
import threading
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from wakewise.core.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation.finding.camera_estimator import known_camera
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.target_tracking import (
    PERCEPTION,
    SeenPicture,
    TargetTracking,
    TrackedTarget,
    grey_of,
    pose_std,
)
from wakewise.perception import CalibratedCamera, TargetTracker
from wakewise_ardusub.link.tracking_commands import Box
from wakewise_ardusub.session.video_stream import Picture, VideoReader, VideoSource

KEPT_S = 5.0
"""Poses are kept so long: a picture may be `MOST_DELAY_S` old when it arrives."""
GAP_S = 0.5
"""A picture has no pose if the nearest estimates are farther apart than this."""


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
        if k == len(poses):  # a pose to come: the vehicle hardly moves within a control period
            return (before.X_WC, before.std) if time_s - before.time_s < GAP_S else None
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
        Of the stream, in any size of the same shape.
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
    ) -> None:
        self._camera = camera.scaled(PERCEPTION.width_px)
        self._clock, self._protect, self._poses = clock, protect, PoseHistory()
        self._reader = VideoReader(source, clock, self.see, PERCEPTION.rate_hz)
        self._changes = threading.Lock()
        self._newest: SeenPicture | None = None
        self._tracking: TargetTracking | None = None
        self.pictures = 0
        self.ages_s: deque[float] = deque(maxlen=10_000)
        """From each picture to its region in control."""

    def start(self) -> None:
        """Start reading the stream."""
        self._reader.start()

    def note(self, time_s: float, X_WC: Pose, estimate: BodyState) -> None:
        """Note the camera's pose by the estimate now."""
        self._poses.add(time_s, X_WC, pose_std(estimate))

    def see(self, picture: Picture, time_s: float) -> None:
        """Take a picture, BGR, shape (h, w, 3), of the time at which it was taken."""
        found = self._poses.at(time_s)
        if found is None:
            return
        X_WC, std = found
        self.pictures += 1
        small = grey_of(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), self._camera)
        self._newest = newest = SeenPicture(frame=self.pictures, time_s=time_s, image=small, X_WC=X_WC, std=std)
        tracking = self._tracking
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
        if self._reader.trouble:
            return f"video: {self._reader.trouble}"
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
            before, self._tracking = self._tracking, begun()
        if before is not None:  # not while the changes are locked: it may wait for that
            before.close()

    def _tracked(self, box: Box, distance_m: float) -> TargetTracking:
        def protect(target: TargetEstimate | None) -> None:
            if target is None or target.status == "assumed":
                return  # until it is mapped the box's frustum is protected
            with self._changes:
                if self._tracking is tracking:
                    self._protect(target)
                    self.ages_s.append(self._clock() - target.time_s)

        settings = PERCEPTION.model_copy(update={"assumed_distance_m": distance_m})
        tracking = TargetTracking(TargetTracker(camera=self._camera, settings=settings), protect)
        tracking.start()
        newest = self._newest
        if newest is not None:
            tracking.see(newest)
        tracking.designate(box, -1 if newest is None else newest.frame)
        return tracking


def video_tracking(
    source: VideoSource, parts: Parts, clock: Callable[[], float], protect: Callable[[TargetEstimate], None]
) -> VideoTracking:
    """Tracking in the stream of the camera of a flight's parts."""
    return VideoTracking(source, known_camera(parts, PERCEPTION)[0], clock, protect)
