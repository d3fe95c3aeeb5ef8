"""Finds, maps and tracks the target in the camera's pictures: one picture in, pose and protected region out.

    picture -> features tracked -> pose from mapped points -> rays added to the map
            -> keyframes: map and lens adjusted, planes swept through the target for its surface
            -> bed and bodies on it (every `SHAPE_EVERY_S`) -> the target among them -> protected region

The target is the body that the operator designated by a box, else the one nearest to the middle of the picture. Before
its points are mapped, a ball at a stated distance is protected. A target that sways is followed by the mean shift of
its points in the picture. One that is no longer seen is reported as lost, and its last region stays.

The module is long because the steps of a picture share one state; what needs no state is in modules of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.geometry import Pose, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import TargetEstimate
from wakewise.perception.bed_plane import fit_bed, near_bed
from wakewise.perception.bundle_adjustment import LENS, Keyframe, after_round, begin_adjustment, load_kernel
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.common_shift import common_shift
from wakewise.perception.designation import Designation, RefusedPlace, assumed_ball, choose_body, same_ball
from wakewise.perception.feature_tracks import FeatureTracks, Grey, replenish, shows_nothing, track
from wakewise.perception.map_initialization import (
    FIRST_ROUNDS,
    LEAST_STD,
    LOCAL_KEYFRAMES,
    well_crossed,
    with_keyframe,
)
from wakewise.perception.point_map import add_rays, dropped, empty_map, mapped_rows, ray_directions
from wakewise.perception.resection import Resection, resection
from wakewise.perception.settings import PerceptionSettings
from wakewise.perception.surface_map import (
    CELL_M,
    SurfaceMap,
    empty_surface,
)
from wakewise.perception.target_shape import (
    ABOVE_BED_M,
    TALLEST_M,
    VOXEL_M,
    TargetShape,
    averaged,
    best_known,
    bodies,
    in_company,
    protected_region,
    seen_round_rad,
    shape_of,
    thinned,
)
from wakewise.perception.tracker_state import TrackerState, with_adjustment, with_sweep_step

SHAPE_EVERY_S = 0.5
"""How often bed, bodies and region are computed anew."""
MOST_TURN_RAD = 0.4
"""A feature seen from so far round looks different: it ends, and is found anew."""
APART = 45.0
"""Features over the whole picture are its width over this apart; those about the target a third of that."""
LEAST_MAPPED = 60
"""Mapped points from which on the pose is measured by them."""
CONVERGES_S = 1.0
"""Pictures of so long after the first are tracked, but make no map."""
MOST_JUMP_M, MOST_JUMP_RAD = 0.15, 0.2
"""A measured pose farther from the expected one is wrong."""
LOST_AFTER_S = 0.4
"""A target of whose points fewer than `LEAST_SEEN` were seen for this time is lost."""
LEAST_SEEN = 4
KEEP_S, MOST_POINTS = 120.0, 6000
CAMERA_STEP_M = 0.03
"""The places of the camera are noted this far apart."""
SWAY_STD_M, SWAY_SMOOTHED = 0.02, 0.5
"""Prior of a target's shift, and the share of its last value that is kept from picture to picture."""
LEAST_MOVED_M = 0.002
"""A region that moved by less is the same one."""
LEAST_MEMBERS = 25
"""Fewer points, and a target is not accepted by time alone."""
LEAST_ROUND_RAD, AMPLE_ROUND_RAD = math.radians(15.0), math.radians(55.0)
"""A target seen from places less far apart is not accepted by time; one between them after `PATIENT` times as long: the
depth of what was seen from one side is a guess."""
PATIENT = 8.0
DETECTED_S = 5.0
"""A detector's box in which no body is mapped for so long is dropped, and the detector asked again."""
BED_REACH_M = 0.35
"""The bed under a target is that of the points within this of it."""
ABOUT_M, LEAST_AWAY_M = 0.06, 0.05
"""Before there is a target, features are sought closely within this of what stands above the bed, if it is so far away
at least."""
STRONG = 0.1
"""Cornerness over the best of strong corners."""
AMPLE = 2.0
"""Factor on the estimator's standard deviations: rays are judged by theirs (`point_map.MOST_MISS`)."""
POSE_STD = (0.0005, 0.001)
"""Least noise of a measured pose, m and rad: calibration, and what the map's own errors leave."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetTracker:
    """The tracker of one camera; pure functions of its state."""

    camera: CalibratedCamera
    settings: PerceptionSettings
    seed: int = 0

    def init(self) -> TrackerState:
        """State before the first picture."""
        load_kernel()
        return TrackerState(
            camera=self.camera,
            lens=np.zeros(LENS),
            points=empty_map(),
            surface=empty_surface(),
            cameras_W_m=np.zeros((0, 3)),
            members=np.zeros(0, np.int64),
            shift_W_m=np.zeros(3),
        )

    def designate(
        self, state: TrackerState, box: tuple[float, float, float, float], width: int, *, accepted: bool = True
    ) -> TrackerState:
        """Take what lies in a box of the next picture, in px of a picture of that width, as the target.

        A box of a detector is not `accepted`: an operator does so, or time. An operator's box ends all refusals.
        """
        left, top, right, bottom = box
        ordered = (min(left, right), min(top, bottom), max(left, right), max(top, bottom))
        return replace(
            _without_target(state),
            designation=Designation(box=ordered, width=width),
            refused=() if accepted else state.refused,
            accepted=accepted,
        )

    def accept(self, state: TrackerState) -> TrackerState:
        """Accept the proposed target now."""
        return replace(state, accepted=True)

    def refuse(self, state: TrackerState) -> TrackerState:
        """Drop the proposed target, whose place is not proposed again until the operator designates a box."""
        shape = state.shape
        if shape is None or not shape.seen:
            return state
        place = RefusedPlace(centre_W_m=shape.centre_W_m, radius_m=shape.radius_m)
        return replace(
            _without_target(state),
            designation=None,
            refused=(*state.refused, place),
            members=np.zeros(0, np.int64),
            shift_W_m=np.zeros(3),
            accepted=False,
            seen_s=-math.inf,
        )

    def step(
        self,
        state: TrackerState,
        picture: Grey,
        time_s: float,
        guess: Pose,
        std: tuple[float, float],
        prior: Pose | None = None,
    ) -> tuple[TrackerState, Resection | None]:
        """Take in one picture.

        - `picture`, shape (h, w): of the camera's size.
        - `guess`: camera pose X_WC as the estimator has it.
        - `prior`: the same by other sensors than the camera, `guess` if not given: it holds the map's frame and scale.
          `std`: its standard deviations per axis, m and rad.

        Returns the next state, and the camera's pose by the map; None where the map does not give one.
        """
        before_s = state.last_s if state.pictures else math.inf
        trouble = self._trouble(state, picture, time_s)
        if trouble:
            return self._without(state, time_s, trouble), None
        tracks = track(state.tracks, picture, time_s - state.tracked_s, self._expected(state, guess))
        found = self._pose(state, tracks, guess)
        X_WC = guess if found is None else found.X_WC
        std_m, std_rad = (AMPLE * max(given, least) for given, least in zip(std, POSE_STD, strict=True))
        if found is not None:
            std_m, std_rad = POSE_STD[0], 0.0
        if state.designation is not None and state.designation.X_WC is None:
            state = replace(state, designation=replace(state.designation, X_WC=X_WC, since_s=time_s))
        tracks = tracks.kept(self._turned(state, tracks, X_WC) < MOST_TURN_RAD)
        tracks = self._replenished(state, tracks, picture, X_WC)
        if self._waits(state, time_s):
            first_s = time_s if state.first_s is None else state.first_s
            waiting = replace(
                state,
                tracks=tracks,
                tracked_s=time_s,
                pictures=state.pictures + 1,
                first_s=first_s,
                last_s=time_s,
                trouble="",
            )
            return (waiting if state.target is not None else self._assumed(waiting, X_WC, time_s)), None
        points = add_rays(
            state.points,
            tracks.ids,
            state.camera.slopes(tracks.at_middle(state.camera)),
            X_WC,
            time_s,
            state.camera.focal_px,
            self.settings.assumed_distance_m,
            self._ray_std(state, tracks.ids, std_m),
            std_rad,
        )
        points = dropped(points, tracks.ids, time_s, KEEP_S, MOST_POINTS)
        state = replace(
            state,
            tracks=tracks,
            tracked_s=time_s,
            points=points,
            cameras_W_m=_noted(state.cameras_W_m, X_WC.p_m),
            pictures=state.pictures + 1,
            last_s=time_s,
            trouble="" if len(tracks) >= LEAST_MAPPED // 2 else "few features",
        )
        state = self._kept(state, X_WC, time_s, prior or guess, std)
        # In a picture either the map is adjusted or the region computed from it: both would take too long. The region
        # is not computed in two pictures running. A sweep can only begin at a keyframe: it may do so beside the region.
        shaped = time_s - state.shaped_s >= SHAPE_EVERY_S - 1e-6 and state.shaped_s < before_s
        if not shaped:
            state = self._adjusted(state)
        if found is not None and not (shaped and state.sweep is not None):
            in_view = self.settings.protect == "view"
            state = with_sweep_step(state, time_s, self.settings.view_distance_m if in_view else None)
        state = self._followed(state, X_WC, time_s)
        return (self._reshaped(state, X_WC, time_s) if shaped else state), found

    def _waits(self, state: TrackerState, time_s: float) -> bool:
        """Whether the estimator has only just begun: its first poses jump."""
        return state.first_s is None or time_s - state.first_s < CONVERGES_S

    def _trouble(self, state: TrackerState, picture: Grey, time_s: float) -> str:
        if picture.shape != (self.camera.height, self.camera.width):
            wanted = f"{self.camera.width} x {self.camera.height}"
            return f"picture of {picture.shape[1]} x {picture.shape[0]} px, must be {wanted}"
        if time_s <= state.last_s:
            return f"late picture: of {time_s:.2f} s after one of {state.last_s:.2f} s"
        last = state.tracks.picture
        if last is not None and np.array_equal(last, picture):
            return "frozen camera: the same picture twice"
        if shows_nothing(picture):
            return "uniform picture: nothing to track"
        return ""

    def _without(self, state: TrackerState, time_s: float, trouble: str) -> TrackerState:
        """The state after a picture that shows nothing: the last region stays."""
        time_s = max(time_s, state.last_s)
        state = replace(state, trouble=trouble, last_s=time_s)
        return self._reported(state, time_s)

    def _expected(self, state: TrackerState, X_WC: Pose) -> Array | None:
        """Where features are expected, shape (n, 2), NaN of those that are not mapped."""
        rows, mapped = mapped_rows(state.points, state.tracks.ids)
        if not mapped.any():
            return None
        guess = np.full((len(rows), 2), np.nan)
        guess[mapped] = state.camera.pixels((state.points.points_W_m[rows[mapped]] - X_WC.p_m) @ X_WC.R)
        before = state.tracks.pixels
        near = np.linalg.norm(np.nan_to_num(guess - before, nan=np.inf), axis=1) < 0.1 * self.camera.width
        guess[~near] = np.nan
        # Features without a place move as those with one do, in the middle.
        if near.any():
            guess[~near] = before[~near] + np.median((guess - before)[near], axis=0)
        return guess

    def _pose(self, state: TrackerState, tracks: FeatureTracks, guess: Pose) -> Resection | None:
        rows, mapped = mapped_rows(state.points, tracks.ids)
        if int(mapped.sum()) < LEAST_MAPPED or not state.initialized:
            return None
        on_bed = mapped & ~np.isin(tracks.ids, state.members)
        # What stands on the bed may sway: it counts only where the bed shows too little.
        used = on_bed if int(on_bed.sum()) >= LEAST_MAPPED else mapped
        rows = rows[used]
        found = resection(
            state.points.points_W_m[rows],
            state.points.std_m[rows],
            tracks.at_middle(state.camera)[used],
            state.camera,
            guess,
        )
        if found is None:
            return None
        jump = found.X_WC.p_m - guess.p_m
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(guess.q), found.X_WC.q))
        near = np.linalg.norm(jump) < MOST_JUMP_M and np.linalg.norm(turn) < MOST_JUMP_RAD
        return found if near else None

    def _kept(
        self, state: TrackerState, X_WC: Pose, time_s: float, prior: Pose, std: tuple[float, float]
    ) -> TrackerState:
        """The state with another keyframe, where the camera has moved."""
        tracks = state.tracks
        seen = Keyframe(
            time_s=time_s,
            X_WC=X_WC,
            prior=prior,
            std=(max(AMPLE * std[0], LEAST_STD[0]), max(AMPLE * std[1], LEAST_STD[1])),
            ids=tracks.ids,
            pixels=tracks.at_middle(state.camera),
            picture=tracks.picture,
            speed_px_s=np.median(tracks.speeds, axis=0) if len(tracks) else np.zeros(2),
        )
        return replace(state, keyframes=with_keyframe(state.keyframes, seen))

    def _adjusted(self, state: TrackerState) -> TrackerState:
        """The state with the map initialised, or adjusted by one round at a new keyframe."""
        if state.initialized:
            frames, rounds, before = state.keyframes[-LOCAL_KEYFRAMES:], 1, state.points
            if frames[-1].time_s <= state.adjusted_s:
                return state
        elif well_crossed(state.points, state.tracks.ids, LEAST_MAPPED):
            frames, rounds, before = state.keyframes, FIRST_ROUNDS, empty_map()
        else:
            return state
        adjustment = begin_adjustment(frames, *state.points.known_places(), self.camera, state.lens)
        if adjustment is None:
            return state
        for _ in range(rounds):
            adjustment = after_round(adjustment)
        return replace(with_adjustment(state, adjustment, before), initialized=True)

    def _turned(self, state: TrackerState, tracks: FeatureTracks, X_WC: Pose) -> Array:
        """Angle between the first and the present ray of each feature, shape (n,)."""
        points = state.points
        rows = points.rows(tracks.ids)
        known = rows >= 0
        angle = np.zeros(len(rows))
        d = ray_directions(state.camera.slopes(tracks.at_middle(state.camera)[known]), X_WC)
        angle[known] = np.arccos(np.clip(np.einsum("ni,ni->n", points.first_W[rows[known]], d), -1.0, 1.0))
        return angle

    def _replenished(self, state: TrackerState, tracks: FeatureTracks, picture: Grey, X_WC: Pose) -> FeatureTracks:
        apart = self.camera.width / APART
        box = self._window(state, X_WC)
        if box is None:  # strong corners anywhere: what stands on the bed has more of them than sand
            tracks = replenish(tracks, picture, self.settings.features, apart)
            most = self.settings.features + self.settings.target_features
            stands = self._above_bed(state, picture.shape, X_WC)
            if stands is not None:
                tracks = replenish(tracks, picture, most, max(apart / 3.0, 3.0), stands)
            return replenish(tracks, picture, most, apart / 2.5, quality=STRONG)
        left, top, right, bottom = box
        u, v = tracks.pixels.T
        inside = int(np.sum((u >= left) & (u < right) & (v >= top) & (v < bottom)))
        window = np.full(picture.shape, 255, np.uint8)
        window[top:bottom, left:right] = 0
        tracks = replenish(tracks, picture, self.settings.features + inside, apart, window)
        most = len(tracks) + self.settings.target_features - inside
        return replenish(tracks, picture, most, max(apart / 3.0, 3.0), 255 - window)

    def _above_bed(self, state: TrackerState, size: tuple[int, ...], X_WC: Pose) -> NDArray[np.uint8] | None:
        """Mask, shape `size`, of the picture about mapped points that stand above the bed; None if there are none."""
        if state.bed is None:
            return None
        places = state.points.points_W_m[state.points.mature]
        height = state.bed.height_m(places)
        p_C = (places[(height > ABOVE_BED_M) & (height < TALLEST_M)] - X_WC.p_m) @ X_WC.R
        p_C = p_C[p_C[:, 2] > LEAST_AWAY_M]
        pixels = state.camera.pixels(p_C)
        seen = state.camera.inside(pixels)
        if not seen.any():
            return None
        mask = np.zeros(size, np.uint8)
        for (u, v), away_m in zip(np.round(pixels[seen]).astype(int), p_C[seen, 2], strict=True):
            cv2.circle(mask, (int(u), int(v)), round(ABOUT_M * self.camera.focal_px / away_m), 255, -1)
        return mask

    def _window(self, state: TrackerState, X_WC: Pose) -> tuple[int, int, int, int] | None:
        """Box of the picture where the target is expected: its own, or the designated one; None if nowhere."""
        width, height = self.camera.width, self.camera.height
        if state.shape is not None and state.shape.seen:
            p_C = (state.shape.centre_W_m - X_WC.p_m) @ X_WC.R
            if p_C[2] > 0.05:
                u, v = state.camera.pixels(p_C[None])[0]
                half = 1.3 * state.camera.focal_px * state.shape.radius_m / p_C[2]
                if math.isfinite(u + v):  # beyond the lens's fold there is no pixel
                    return _box(u - half, v - half, u + half, v + half, width, height)
            return None
        if state.designation is not None:
            return _box(*state.designation.scaled(width), width, height)
        return None

    def _ray_std(self, state: TrackerState, ids: IntArray, std_m: float) -> Array:
        """Standard deviation of each ray's place, shape (n,): of members with the sway, of others the camera's own."""
        sway = float(np.linalg.norm(state.shift_W_m))
        return np.where(np.isin(ids, state.members), math.hypot(std_m, sway), std_m)

    def _followed(self, state: TrackerState, X_WC: Pose, time_s: float) -> TrackerState:
        """The state with the target's shift in this picture, and whether it was seen."""
        if state.shape is None:
            return self._reported(state, time_s)
        at = np.isin(state.tracks.ids, state.members)
        rows, mapped = mapped_rows(state.points, state.tracks.ids)
        at &= mapped
        shift = SWAY_SMOOTHED * state.shift_W_m
        if int(at.sum()) >= LEAST_SEEN:
            found = common_shift(
                state.points.points_W_m[rows[at]],
                state.tracks.at_middle(state.camera)[at],
                state.camera,
                X_WC,
                SWAY_STD_M,
            )
            shift = shift + (1.0 - SWAY_SMOOTHED) * found
        near = self._near(state, X_WC)
        seen = int(at.sum()) >= LEAST_SEEN or int(near.sum()) >= LEAST_SEEN
        state = replace(state, shift_W_m=shift, seen_s=time_s if seen else state.seen_s)
        return self._reported(state, time_s)

    def _near(self, state: TrackerState, X_WC: Pose) -> BoolArray:
        """Which features lie in the picture of the target, shape (n,); none if its middle is out of the picture."""
        assert state.shape is not None
        box = self._window(state, X_WC)
        p_C = (state.shape.centre_W_m - X_WC.p_m) @ X_WC.R
        if box is None or p_C[2] < 0.05 or not state.camera.inside(state.camera.pixels(p_C[None]))[0]:
            return np.zeros(len(state.tracks), np.bool_)
        left, top, right, bottom = box
        u, v = state.tracks.pixels.T
        fresh = np.isin(state.tracks.ids, state.points.ids[state.points.views >= 2])
        return np.asarray((u > left) & (u < right) & (v > top) & (v < bottom) & fresh)

    def _reshaped(self, state: TrackerState, X_WC: Pose, time_s: float) -> TrackerState:
        """The state with bed, target and region computed from the map."""
        points = state.points
        which = np.flatnonzero(points.mature)
        rng = np.random.default_rng([self.seed, state.pictures])
        bed = fit_bed(points.points_W_m[which[-1500:]], rng) or state.bed
        state = replace(state, bed=bed, shaped_s=time_s)
        if self.settings.protect == "view":
            return self._protect_view(state, X_WC, time_s)
        if state.shape is not None and state.shape.seen and time_s - state.seen_s > LOST_AFTER_S:
            return state  # what is lost stays where it was
        surface = state.surface.chosen(state.surface.confirmed)
        places_W_m = np.concatenate([points.points_W_m[which], surface.points_W_m])
        std_m = np.concatenate([points.std_m[which], np.full(len(surface), CELL_M)])
        chosen = None
        if bed is not None:
            best_first = np.argsort(std_m, kind="stable")
            few = best_first[thinned(places_W_m[best_first])]
            groups = [few[group] for group in bodies(places_W_m[few], bed, std_m[few])]
            chosen = choose_body(
                places_W_m, groups, state.shape, state.designation, state.camera, X_WC, LEAST_SEEN, state.refused
            )
        if chosen is None:
            box = state.designation
            if box is not None and not state.accepted and time_s - box.since_s > DETECTED_S:
                state = replace(state, designation=None)
            return self._assumed(state, X_WC, time_s) if state.shape is None or state.shape.seen == 0 else state
        assert bed is not None
        chosen = chosen[best_known(std_m[chosen])]
        places = places_W_m[chosen]
        under = near_bed(bed, points.points_W_m[which], places.mean(axis=0), BED_REACH_M)
        shape = averaged(state.shape, shape_of(places, under, state.cameras_W_m[-400:], POSE_STD[0]))
        kept = places[in_company(places)]
        near = np.asarray(KDTree(kept).query(points.points_W_m[which], distance_upper_bound=VOXEL_M)[0]) < np.inf
        members = points.ids[which[near]]
        proposed_s = min(state.proposed_s, time_s)
        round_rad = seen_round_rad(state.cameras_W_m, shape.centre_W_m)
        enough = len(members) >= LEAST_MEMBERS and round_rad >= LEAST_ROUND_RAD
        wait_s = self.settings.accept_s * (1.0 if round_rad >= AMPLE_ROUND_RAD else PATIENT)
        accepted = state.accepted or (enough and time_s - proposed_s >= wait_s)
        state = replace(
            state,
            shape=shape,
            members=members,
            proposed_s=proposed_s,
            accepted=accepted,
            seen_s=time_s if state.seen_s == -math.inf else state.seen_s,
        )
        own = np.asarray(KDTree(kept).query(surface.points_W_m, distance_upper_bound=VOXEL_M)[0]) < np.inf
        return self._protected(state, time_s, surface.chosen(own))

    def _assumed(self, state: TrackerState, X_WC: Pose, time_s: float) -> TrackerState:
        """The state with a ball at the stated distance, or where the ray meets the bed, as target."""
        shape, before = assumed_ball(state.camera, self.settings, state.designation, state.bed, X_WC), state.shape
        if before is not None and state.target is not None and same_ball(before, shape):
            return self._reported(state, time_s)
        fresh = replace(state, shape=shape, members=np.zeros(0, np.int64), shift_W_m=np.zeros(3))
        return self._protected(fresh, time_s)

    def _protect_view(self, state: TrackerState, X_WC: Pose, time_s: float) -> TrackerState:
        """The state with everything mapped in view within a distance as protected."""
        places = state.points.points_W_m[state.points.mature]
        p_C = (places - X_WC.p_m) @ X_WC.R
        near = (np.linalg.norm(p_C, axis=1) < self.settings.view_distance_m) & state.camera.inside(
            state.camera.pixels(p_C)
        )
        if int(near.sum()) < LEAST_MAPPED:
            return self._assumed(state, X_WC, time_s)
        seen = places[near][thinned(places[near], 0.02)]
        middle = seen.mean(axis=0)
        radius = float(np.quantile(np.linalg.norm(seen - middle, axis=1), 0.95))
        shape = TargetShape(
            centre_W_m=middle, covariance=1e-4 * np.eye(3), radius_m=radius, surface_W_m=seen, seen=len(seen)
        )
        state = replace(state, shape=shape, accepted=True, seen_s=time_s)
        return self._protected(state, time_s, state.surface.chosen(state.surface.confirmed))

    def _protected(self, state: TrackerState, time_s: float, surface: SurfaceMap | None = None) -> TrackerState:
        """The state with the region of its shape; `surface`: what is mapped of it."""
        assert state.shape is not None
        region = protected_region(state.shape.surface_W_m, state.bed, self.settings.points)
        target = TargetEstimate(
            time_s=time_s,
            status="assumed",
            centre_W_m=state.shape.centre_W_m,
            covariance=state.shape.covariance,
            radius_m=state.shape.radius_m,
            points_W_m=region.points_W_m,
            weights=region.weights,
            distance_m=region.distance_m,
            version=state.versions,
            surface_W_m=None if surface is None else surface.points_W_m,
            towards_W=None if surface is None else surface.towards_W,
        )
        return self._reported(replace(state, target=target, versions=state.versions + 1), time_s)

    def _reported(self, state: TrackerState, time_s: float) -> TrackerState:
        """The state with the target's status, and its place moved by the shift."""
        target, shape = state.target, state.shape
        if target is None or shape is None:
            return state
        status: Literal["assumed", "proposed", "tracked", "lost"] = "assumed"
        if shape.seen:
            status = "tracked" if state.accepted else "proposed"
            if state.accepted and time_s - state.seen_s > LOST_AFTER_S:
                status = "lost"
        centre = shape.centre_W_m + state.shift_W_m
        way = centre - target.centre_W_m
        if status == "lost" or np.linalg.norm(way) < LEAST_MOVED_M:
            return replace(state, target=replace(target, status=status, time_s=time_s))
        return replace(
            state,
            versions=state.versions + 1,
            target=replace(
                target,
                status=status,
                time_s=time_s,
                centre_W_m=centre,
                points_W_m=target.points_W_m + way,
                version=state.versions,
            ),
        )


def _without_target(state: TrackerState) -> TrackerState:
    """The state with what was mapped of a target forgotten."""
    return replace(
        state,
        shape=None,
        surface=empty_surface(),
        sweep=None,
        swept_from_W_m=None,
        target=None,
        proposed_s=math.inf,
    )


def _noted(cameras_W_m: Array, place_W_m: Array) -> Array:
    """Places of the camera with one more, where it is far enough from the last."""
    if len(cameras_W_m) and np.linalg.norm(cameras_W_m[-1] - place_W_m) < CAMERA_STEP_M:
        return cameras_W_m
    return np.vstack([cameras_W_m, place_W_m])


def _box(left: float, top: float, right: float, bottom: float, width: int, height: int) -> tuple[int, int, int, int]:
    """Whole pixels of a box within the picture, one at least."""
    a, b = min(max(int(left), 0), width - 1), min(max(int(top), 0), height - 1)
    return a, b, min(max(int(right) + 1, a + 1), width), min(max(int(bottom) + 1, b + 1), height)
