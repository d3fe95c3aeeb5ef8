"""Tracking of the target that the pilot designated by a box of a live picture, in a thread of its own.

What lies in the box is mapped and tracked by `wakewise.perception`, with the estimated pose of the camera at the time
of each picture. The tracker begins with the picture in which the box was drawn. Neither the flight nor the pictures
wait for it: the newest picture that waits takes the place of an older one. Without a box a target is proposed, which
the pilot accepts or refuses.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import cv2
import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation.teleop.input.controls import Box
from wakewise.perception import CalibratedCamera, PerceptionSettings, TargetTracker, TrackerState
from wakewise.perception.feature_tracks import Grey, fitted

PERCEPTION = PerceptionSettings(width_px=480, rate_hz=5.0, accept_s=600.0)
"""Live pictures change their width under load; they are tracked in one. A proposal waits for the pilot."""
STALE_S = 2.0
"""A target is lost if no picture was tracked for this time."""
NEAREST_M = 0.05
"""A target nearer to the camera along its axis, or behind it, has no outline."""
KEPT = 32
"""Last pictures in which a box may have been drawn: about 2 s."""
STD = (0.02, 0.03)
"""Standard deviation of the camera's pose per axis, m and rad, where the estimate states none."""
_NOTES = {
    "assumed": "target designated; a ball is protected until it was seen from other sides: move sideways",
    "asked": "no target is proposed yet; a ball is protected until a body is mapped: move sideways",
    "proposed": "a target is proposed: accept or refuse it; its region is protected",
    "tracked": "target tracked; its region is protected",
    "lost": "target lost; its last region stays protected",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenPicture:
    """A live picture with its number, and the camera's pose X_WC by the estimate at its time in the flight.

    `image`: a JPEG, or grey levels, shape (h, w). `std`: standard deviations of that pose per axis, m and rad.
    """

    frame: int
    time_s: float
    image: bytes | Grey
    X_WC: Pose
    std: tuple[float, float] = STD


@dataclass(frozen=True, kw_only=True, eq=False)
class _Request:
    """A box in shares of a picture, and that picture if it is still known; without a box a target is proposed."""

    box: Box | None = None
    first: SeenPicture | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackedTarget:
    """The designated target: `target` after a picture, None before the first one.

    `time_s` is the time of the last picture that was used, -inf before the first. `status` is the estimate's, or `lost`
    where no picture was used for `STALE_S`. `trouble` says what is wrong with the last picture; empty if nothing is.
    """

    status: Literal["assumed", "proposed", "tracked", "lost"] = "assumed"
    target: TargetEstimate | None = None
    time_s: float = -math.inf
    trouble: str = "no picture yet"


class TargetTracking:
    """Tracks a designated target in the pictures of one flight.

    Parameters
    ----------
    tracker : TargetTracker
        Of the camera as the crew has calibrated it.
    protect : callable
        Called in the thread with the target's estimate when its region changes; with None when the target is forgotten.
    ahead_m : float
        How far the calibrated camera's projection centre lies before the lens's.
    begun_s : float
        When the flight began: the estimator's first poses are not used.
    """

    def __init__(
        self,
        tracker: TargetTracker,
        protect: Callable[[TargetEstimate | None], None],
        ahead_m: float = 0.0,
        begun_s: float = 0.0,
    ) -> None:
        self._tracker, self._protect, self._begun_s = tracker, protect, begun_s
        self._X_CM, self._changed = Pose(np.array([0.0, 0.0, ahead_m])), threading.Condition()
        self._recent: deque[SeenPicture] = deque(maxlen=KEPT)
        self._waiting: SeenPicture | None = None
        self._request: _Request | None = None
        self._accepted: bool | None = None
        self._last: TrackedTarget | None = None
        self._taken_s = -np.inf
        self._over = False
        self._said: str | None = None
        self._thread = threading.Thread(target=self._run, name="target", daemon=True)

    def start(self) -> None:
        """Start the thread, which waits until a target is designated."""
        self._thread.start()

    def close(self) -> None:
        """End the thread, after the picture that it has in hand."""
        with self._changed:
            self._over = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def see(self, picture: SeenPicture) -> None:
        """Take a picture in, which is tracked if it is due."""
        with self._changed:
            self._recent.append(picture)
            if self._request is None or picture.time_s < self._taken_s + 1.0 / self._tracker.settings.rate_hz - 1e-6:
                return
            self._waiting, self._taken_s = picture, picture.time_s
            self._changed.notify()

    def designate(self, box: Box, frame: int) -> None:
        """Track what lies in a box of a picture, (left, top, right, bottom) in shares of it.

        `frame` is the picture's number; the next picture is taken if it is not known any more.
        """
        with self._changed:
            first = next((picture for picture in self._recent if picture.frame == frame), None)
            self._begin(_Request(box=box, first=first))

    def propose(self) -> None:
        """Propose as the target what stands on the bed nearest to the middle of the picture."""
        with self._changed:
            self._begin(_Request())

    def _begin(self, request: _Request) -> None:
        self._request, self._last, self._waiting, self._accepted = request, None, None, None
        self._taken_s = -np.inf if request.first is None else request.first.time_s
        self._said = None
        self._changed.notify()

    def answer(self, *, accepted: bool) -> None:
        """Accept or refuse the proposed target; raises InputError if none is proposed."""
        with self._changed:
            if self._last is None or self._last.target is None or self._last.target.status != "proposed":
                raise InputError("proposal: no target is proposed that could be accepted or refused")
            self._accepted = accepted
            self._changed.notify()

    def forget(self) -> None:
        """Track nothing any more, and protect the first region again."""
        with self._changed:
            self._request = self._last = self._waiting = self._accepted = None
            self._changed.notify()

    def now(self, now_s: float) -> TrackedTarget | None:
        """What is known of the target at a time of the flight; None if none is designated."""
        with self._changed:
            request, last = self._request, self._last
        if request is None:
            return None
        if last is None:
            return TrackedTarget()
        if last.target is None or not now_s - last.time_s > STALE_S:
            return last
        status = last.status if last.status == "assumed" else "lost"
        return replace(last, status=status, trouble=last.trouble or "no pictures")

    def outline(self, X_WC: Pose) -> dict[str, float] | None:
        """Circle round the target in a picture taken at the camera's pose; None if it does not lie before the camera.

        Centre u, v in shares of the picture's width and height, and radius in shares of its width.
        """
        last, camera = self._last, self._tracker.camera
        if last is None or last.target is None:
            return None
        X_WM = X_WC @ self._X_CM
        p_C = X_WM.R.T @ (last.target.centre_W_m - X_WM.p_m)
        if not p_C[2] > NEAREST_M:
            return None
        u, v = (camera.pixels(p_C[None])[0] + 0.5) / (camera.width, camera.height)
        radius = camera.focal_px * last.target.radius_m / float(p_C[2]) / camera.width
        return {"u": float(u), "v": float(v), "radius": float(radius)}

    def notes(self, now_s: float) -> tuple[tuple[str, str], ...]:
        """Level and text of what changed since the last call."""
        known = self.now(now_s)
        if known is not None and known.time_s == -math.inf:
            return ()
        status = None if known is None else known.status
        before, self._said = self._said, status
        if status == before:
            return ()
        if status is None:
            return (("info", "target forgotten; the scenario's own target is protected"),)
        request = self._request
        asked = status == "assumed" and request is not None and request.box is None
        return (("warn" if status == "lost" else "info", _NOTES["asked" if asked else status]),)

    def _run(self) -> None:
        request: _Request | None = None
        state, version = self._tracker.init(), -1
        while True:
            with self._changed:
                self._changed.wait_for(partial(self._has_work, request))
                if self._over:
                    return
                begins, request = self._request is not request, self._request
                first = request.first if begins and request is not None else None
                picture = first or self._waiting
                self._waiting = self._waiting if first is not None else None
                accepted, self._accepted = self._accepted, None
            if request is None:
                self._protect(None)
                continue
            if begins:
                state, version = self._begun(request), -1
            if accepted is not None:
                state = self._answered(request, state, accepted)
            if picture is not None:
                state, version = self._take(request, state, version, picture)

    def _has_work(self, request: _Request | None) -> bool:
        """Whether there is something to do for the thread, which works for this request."""
        new = self._waiting is not None or self._accepted is not None
        return self._over or self._request is not request or (request is not None and new)

    def _begun(self, request: _Request) -> TrackerState:
        """State before the first picture. The estimator has been at work since the flight began."""
        state = replace(self._tracker.init(), first_s=self._begun_s)
        if request.box is None:
            return state
        width, height = self._tracker.camera.width, self._tracker.camera.height
        left, top, right, bottom = request.box
        box = (left * width - 0.5, top * height - 0.5, right * width - 0.5, bottom * height - 0.5)
        return self._tracker.designate(state, box, width)

    def _answered(self, request: _Request, state: TrackerState, accepted: bool) -> TrackerState:
        """The state after the pilot's answer to a proposal; the region stays until the next picture."""
        if state.target is None or state.target.status != "proposed":
            return state
        state = self._tracker.accept(state) if accepted else self._tracker.refuse(state)
        with self._changed:
            if self._request is request and self._last is not None:
                self._last = _tracked(state.target, self._last.time_s, self._last.trouble)
        return state

    def _take(
        self, request: _Request, state: TrackerState, version: int, picture: SeenPicture
    ) -> tuple[TrackerState, int]:
        """Track one picture; the state after it, and the version of the region that is protected.

        What fails becomes a trouble: the flight goes on with the last region, and the next picture is tried.
        """
        pictures = state.pictures
        try:
            grey = grey_of(picture.image, self._tracker.camera)
            pose = picture.X_WC @ self._X_CM
            state, _ = self._tracker.step(state, grey, picture.time_s, pose, picture.std)
            trouble = state.trouble
            if state.target is not None and state.target.version != version:
                self._protect(state.target)
                version = state.target.version
        except Exception as fault:  # tracking that fails must not end, nor may it disturb the flight
            trouble = f"not tracked, {type(fault).__name__}: {' '.join(str(fault).split())}"[:160]
        with self._changed:
            if self._request is request:
                time_s = picture.time_s if self._last is None or state.pictures > pictures else self._last.time_s
                self._last = _tracked(state.target, time_s, trouble)
        return state, version


def _tracked(target: TargetEstimate | None, time_s: float, trouble: str) -> TrackedTarget:
    status = "assumed" if target is None else target.status
    return TrackedTarget(status=status, target=target, time_s=time_s, trouble=trouble)


def grey_of(image: bytes | Grey, camera: CalibratedCamera) -> Grey:
    """Grey levels in the camera's size, shape (h, w), or in another shape; ValueError of a JPEG that is none."""
    if not isinstance(image, bytes):
        return fitted(image, camera)
    picture = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_GRAYSCALE) if image else None
    if picture is None:
        raise ValueError("no picture in the JPEG")
    return fitted(np.asarray(picture, dtype=np.uint8), camera)


def pose_std(estimate: BodyState) -> tuple[float, float]:
    """Standard deviations of an estimated pose per axis, m and rad."""
    if estimate.covariance is None:
        return STD
    place, turn = np.diag(estimate.covariance)[:6].reshape(2, 3).mean(axis=1)
    return float(np.sqrt(place)), float(np.sqrt(turn))
