"""An estimator that localises the vehicle by the map of its camera's pictures, beside its other sensors.

While the map gives poses, those of other sensors are left out: the vehicle is held relative to what it sees. Without
poses of the map for a while (`UNSEEN_S`), the others count again.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Measurement, TargetEstimate
from wakewise.estimation import ErrorStateFilter
from wakewise.estimation.eskf import FilterState
from wakewise.estimation.settings import Priors
from wakewise.operation.finding.camera_frames import without_pose
from wakewise.operation.finding.found_film import FilmFrames, with_region
from wakewise.operation.parts import Parts
from wakewise.operation.scenario.calibration_error import calibration_with_error
from wakewise.perception import CalibratedCamera, PerceptionSettings, TargetTracker, TrackerState, grey_picture
from wakewise.perception.detector import Detector, detect_checked, find_detector
from wakewise.perception.feature_tracks import Grey, fitted
from wakewise.perception.target_tracker import POSE_STD
from wakewise.robot.vehicles import Vehicle
from wakewise.vision.imaging import calibrate

UNSEEN_S = 0.5
"""Least time without a pose by the map after which those of other sensors count again."""
REMEMBERED_S = 2.0
"""How long estimates are kept, for the poses of late pictures."""
SETTLE_MARGIN_S = 0.03
FORCE_WALK_N, ACCELERATION_NOISE_M_S2 = 0.04, 0.002
"""Process noise as in `wakewise.estimation.settings.Priors`, larger: the vehicle's own wash comes back from bed and
target and pushes it. With poses at 62 Hz the filter finds its noise too small within a second; with 5 pictures a second
it does not, lags, and in still water the hover went round a cycle of 6 mm and 4 s."""
PATIENCE = 3
"""Poses by the map that are rejected in a row before the filter doubts itself: they come at 5 Hz, not at 62."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentEstimate:
    """Pose of the vehicle, the same without the map, and angle of the camera's joint at a time."""

    time_s: float
    X_WB: Pose
    without_map: Pose
    tilt_rad: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraEstimatorState:
    """State of the filter and of the tracker.

    `other` is the filter's state without any pose by the map: it holds the map's frame where the other sensors have it.
    `recent` holds the last estimates; `posed_s` is the time of the last pose by the map, and `std` are the standard
    deviations of the filter without the map, m and rad.
    """

    filter: FilterState
    other: FilterState
    tracker: TrackerState
    time_s: float
    recent: tuple[RecentEstimate, ...] = ()
    tilt_rad: float = 0.0
    std: tuple[float, float] = (0.02, 0.03)
    posed_s: float = -math.inf


@dataclass(kw_only=True, eq=False)
class SeenTarget:
    """What is kept of a flight for its report: the last estimate, and the picture in which the target was accepted."""

    target: TargetEstimate | None = None
    picture: Grey | None = None
    X_WC: Pose | None = None
    shown: TargetEstimate | None = None
    film: FilmFrames = field(default_factory=FilmFrames)
    picture_s: list[float] = field(default_factory=list)
    age_s: list[float] = field(default_factory=list)

    def clear(self) -> None:
        """Forget an earlier flight."""
        self.target = self.picture = self.X_WC = self.shown = None
        self.picture_s, self.age_s = [], []
        self.film.clear()

    def drawn(self, camera: CalibratedCamera) -> NDArray[np.uint8]:
        """The picture with the protected surface and its middle drawn over it, BGR, shape (h, w, 3)."""
        assert self.picture is not None
        return with_region(self.picture, camera, self.X_WC, self.shown)


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraEstimator:
    """`wakewise.core.interfaces.Estimator` of a filter and a tracker.

    `ahead_m` is how far the calibrated camera's projection centre lies before the lens's. `seen` collects what a report
    shows, the thread time of each picture and the time from a picture to its use. `answer`, the operator's, is asked
    at each picture while a target is proposed: True accepts it, False refuses it, None leaves it proposed.
    """

    vehicle: Vehicle
    inner: ErrorStateFilter
    tracker: TargetTracker
    ahead_m: float = 0.0
    detector: Detector | None = None
    answer: Callable[[TargetEstimate], bool | None] | None = None
    seen: SeenTarget = field(default_factory=SeenTarget)

    def init(self, start: BodyState) -> CameraEstimatorState:
        """State at the start."""
        self.seen.clear()
        begun = self.inner.init(start)
        first = RecentEstimate(time_s=0.0, X_WB=start.X_WB, without_map=start.X_WB, tilt_rad=0.0)
        return CameraEstimatorState(filter=begun, other=begun, tracker=self.tracker.init(), time_s=0.0, recent=(first,))

    def step(
        self, state: CameraEstimatorState, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[CameraEstimatorState, BodyState]:
        """As the filter; pictures become poses by the map, and the target is part of the estimate."""
        now_s = state.time_s + dt_s
        taken: list[Measurement] = []
        for measured in measurements:
            if measured.tilt_rad is not None:
                state = replace(state, tilt_rad=measured.tilt_rad)
            if measured.image is None:
                taken.append(measured)
                continue
            state, pose = self._seen(state, measured, now_s)
            if pose is not None:
                taken.append(pose)
        blind = tuple(m for m in taken if m.pose_std is None)
        other, without_map = self.inner.step(state.other, dt_s, blind, thrusts_N)
        if now_s - state.posed_s < self._unseen_s():
            taken = [m if m.pose_std is not None else without_pose(m) for m in taken]
        filtered, estimate = self.inner.step(state.filter, dt_s, tuple(taken), thrusts_N)
        spread = without_map.covariance
        now = RecentEstimate(time_s=now_s, X_WB=estimate.X_WB, without_map=without_map.X_WB, tilt_rad=state.tilt_rad)
        state = replace(
            state,
            filter=filtered,
            other=other,
            time_s=now_s,
            recent=(*(r for r in state.recent if now_s - r.time_s <= REMEMBERED_S), now),
            std=state.std if spread is None else (_per_axis(spread[:3, :3]), _per_axis(spread[3:6, 3:6])),
        )
        return state, replace(estimate, target=state.tracker.target)

    def _unseen_s(self) -> float:
        """Time without a pose by the map after which others count: two pictures and their latency at least."""
        settings = self.tracker.settings
        return max(UNSEEN_S, settings.latency_s + 2.5 / settings.rate_hz)

    def _detected(self, state: CameraEstimatorState, image: NDArray[np.uint8]) -> CameraEstimatorState:
        """The state with the best detection of a picture as designated, where there is a detector and no target yet."""
        tracker = state.tracker
        if self.detector is None or tracker.designation is not None or image.ndim != 3:
            return state
        found = detect_checked(self.detector, image)
        if not found:
            return state
        return replace(state, tracker=self.tracker.designate(tracker, found[0].box, image.shape[1], accepted=False))

    def _seen(
        self, state: CameraEstimatorState, measured: Measurement, now_s: float
    ) -> tuple[CameraEstimatorState, Measurement | None]:
        """Take in a picture; the pose of the vehicle that it gives."""
        began = time.thread_time()
        at = min(state.recent, key=lambda r: abs(r.time_s - measured.time_s))
        X_WB = at.X_WB
        X_BM = self.vehicle.X_BC_at(at.tilt_rad) @ Pose(np.array([0.0, 0.0, self.ahead_m]))
        assert measured.image is not None
        state = self._detected(state, measured.image)
        picture = fitted(grey_picture(measured.image), self.tracker.camera)
        tracker, found = self.tracker.step(
            state.tracker, picture, measured.time_s, X_WB @ X_BM, state.std, at.without_map @ X_BM
        )
        if self.answer is not None and tracker.target is not None and tracker.target.status == "proposed":
            said = self.answer(tracker.target)
            if said is not None:
                tracker = self.tracker.accept(tracker) if said else self.tracker.refuse(tracker)
        self.seen.picture_s.append(time.thread_time() - began)
        self.seen.age_s.append(now_s - measured.time_s)
        self.seen.target = tracker.target
        X_WC = X_WB @ X_BM if found is None else found.X_WC
        self.seen.film.add(picture, tracker.camera, X_WC, tracker.target, measured.time_s)
        if self.seen.picture is None and tracker.target is not None and tracker.target.status == "tracked":
            self.seen.picture, self.seen.X_WC, self.seen.shown = picture, X_WC, tracker.target
        state = replace(state, tracker=tracker)
        if found is None:
            return state, None
        spread = found.covariance
        std = (
            math.hypot(POSE_STD[0], _per_axis(spread[:3, :3])),
            math.hypot(POSE_STD[1], _per_axis(spread[3:, 3:])),
        )
        pose = Measurement(time_s=measured.time_s, X_WB=found.X_WC @ X_BM.inverse(), pose_std=std)
        return replace(state, posed_s=measured.time_s), pose


def _per_axis(covariance: Array) -> float:
    """Standard deviation per axis of three errors."""
    return math.sqrt(float(np.trace(covariance)) / 3.0)


def known_camera(parts: Parts, settings: PerceptionSettings) -> tuple[CalibratedCamera, float]:
    """The scenario's camera as the crew has calibrated it, for pictures of the perception's width; its `ahead_m`."""
    known = calibration_with_error(calibrate(parts.camera), parts.scenario.calibration_error, parts.seeds.survey()[1])
    fx, fy, cx, cy, k1, k2, p1, p2 = known.params.tolist()
    camera = CalibratedCamera(
        width=known.width,
        height=known.height,
        fx=fx,
        fy=fy,
        cx=cx - 0.5,
        cy=cy - 0.5,
        distortion=(k1, k2, p1, p2),
        readout_s=parts.scenario.imaging.readout_s,
    )
    return camera.scaled(settings.width_px), known.ahead_m


def camera_estimator(parts: Parts) -> CameraEstimator:
    """Estimator of the parts of a flight."""
    settings = parts.scenario.perception
    camera, ahead_m = known_camera(parts, settings)
    priors = Priors(
        settle_s=max(Priors().settle_s, settings.latency_s + SETTLE_MARGIN_S),
        force_walk_N=FORCE_WALK_N,
        acceleration_noise_m_s2=ACCELERATION_NOISE_M_S2,
        gate_patience=PATIENCE,
    )
    inner = ErrorStateFilter(parts.vehicle, parts.scenario.estimation, priors=priors)
    tracker = TargetTracker(camera=camera, settings=settings, seed=parts.scenario.seed)
    detector = None if settings.detector is None else find_detector(settings.detector)
    return CameraEstimator(vehicle=parts.vehicle, inner=inner, tracker=tracker, ahead_m=ahead_m, detector=detector)
