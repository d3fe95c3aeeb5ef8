"""What a camera tells of moving water: flakes found in one frame and again in the next, pixels with their noise.

A single camera does not know how far a flake is. It sees where it is, how its picture moved, and how blurred it is:
before half a metre a flake's disk grows quickly (`wakewise.vision.imaging.particles`). Frames are told where they were
taken by the vehicle's own filter, never by truth; water and flakes are the tank's.

A vehicle that is held while one bow thruster after the other pushes: the jets one at a time, before its own camera.

Held by hand at the pool's side, in its frame or on the ground, far from what must not be harmed. Free flight cannot
show it: what pushes astern takes both bow thrusters, whose jets cross a hand's breadth ahead and are no two round jets
any more. Water, flakes and current are the tank's; thrusts differ by a tenth from what was asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, FlakeCloud, Goal, Truth
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle
from wakewise.simulation.tank.flakes import Flakes
from wakewise.simulation.water import Water
from wakewise.simulation.water.round_jet_closure import JetSpreading
from wakewise.vision.imaging.camera import Camera
from wakewise.vision.imaging.particles import APERTURE_M, FARTHEST_M, FOCUS_M, LOG_SPREAD, MEDIAN_DIAMETER_M, NEAREST_M
from wakewise_paper.learned_wake.truth import SampledWater

APART_S = 0.04
"""Between the two frames of a pair, video's 25 a second: farther apart the fast ones are lost, and jets look slow."""
EVERY_S = 1.0
"""Between pairs: a video camera gives thirty times as many, which see the same flakes."""
PIXEL_NOISE = 0.3
"""Of a flake's place, px per axis: an estimate for faint spots of a pixel's size (bright ones: 0.05 to 0.1 px; M.
Raffel et al., Particle Image Velocimetry)."""
BLUR_NOISE = 0.25
"""Of a disk's radius, px."""
LEAST_COVER = 0.1
"""Share of the light behind it that a flake must hide to be found."""
LOST_PX = 60.0
"""A flake is not found again where its way differs more than this from that of something that stands still: 1 m/s at
0.3 m, and about the distance between flakes in the picture."""
MOST_PER_PAIR = 30
"""Flakes of a pair of frames that are followed, drawn from those that could be."""
PUSHING_S = 3.0
"""Thrusts are averaged over as long as a jet of 1 N takes to the middle of the view."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlakeTracks:
    """Flakes seen twice, n of them in k pairs of frames.

    Parameters
    ----------
    pair : ndarray, shape (n,)
        Which pair of frames each belongs to, rising.
    first_px, moved_px : ndarray, shape (n, 2)
        Where it was found, and how far from there the second time.
    blur_px : ndarray, shape (n,)
        Radius of its disk.
    times_s : ndarray, shape (k,)
        Of the pairs' first frames.
    X_WC, X_WC_next : tuple of k poses
        As the filter had them.
    X_WB : tuple of k poses
        Of the body, half of the time between the two frames.
    pushes_N : ndarray, shape (k, 2 m)
        Means of commanded T+ and of T-.
    """

    pair: Array
    first_px: Array
    moved_px: Array
    blur_px: Array
    times_s: Array
    X_WC: tuple[Pose, ...]
    X_WC_next: tuple[Pose, ...]
    X_WB: tuple[Pose, ...]
    pushes_N: Array

    def __post_init__(self) -> None:
        n, k = len(self.blur_px), len(self.times_s)
        pair = np.array(self.pair, dtype=np.int64)
        pair.setflags(write=False)
        object.__setattr__(self, "pair", pair)
        freeze(self, first_px=(n, 2), moved_px=(n, 2), blur_px=(n,), times_s=(k,), pushes_N=(k, None))

    def __len__(self) -> int:
        return len(self.blur_px)

    def until(self, time_s: float) -> FlakeTracks:
        """Those of the pairs that began before a time."""
        pairs = int(np.searchsorted(self.times_s, time_s))
        kept = self.pair < pairs
        return FlakeTracks(
            pair=self.pair[kept],
            first_px=self.first_px[kept],
            moved_px=self.moved_px[kept],
            blur_px=self.blur_px[kept],
            times_s=self.times_s[:pairs],
            X_WC=self.X_WC[:pairs],
            X_WC_next=self.X_WC_next[:pairs],
            X_WB=self.X_WB[:pairs],
            pushes_N=self.pushes_N[:pairs],
        )


def blur_radius_px(camera: Camera, depth_m: Array, size: Array) -> Array:
    """Radius of a flake's disk, as photographs draw it: its own, the lens's, and half a pixel; size standard normal."""
    own, lens = (
        _own_radius(camera, depth_m, size),
        0.5 * camera.focal_px * APERTURE_M * np.abs(1 / depth_m - 1 / FOCUS_M),
    )
    return np.asarray(np.sqrt(own**2 + lens**2 + 0.5**2))


def cover(camera: Camera, depth_m: Array, size: Array) -> Array:
    """Share of the light behind a flake that it hides in its disk."""
    own = _own_radius(camera, depth_m, size)
    return np.asarray(np.minimum(0.85, own**2 / blur_radius_px(camera, depth_m, size) ** 2))


def _own_radius(camera: Camera, depth_m: Array, size: Array) -> Array:
    return np.asarray(0.5 * camera.focal_px * MEDIAN_DIAMETER_M * np.exp(LOG_SPREAD * size) / depth_m)


@dataclass
class FlakeObserver:
    """Looks at the flakes through a flight: hand its `watch` to `wakewise.operation.fly`.

    Parameters
    ----------
    camera : Camera
    vehicle : Vehicle
        As it is believed to be.
    rng : numpy Generator
        Of the noise of pixels and of who is followed.
    per_m3 : float
        Visible flakes in the water.
    """

    camera: Camera
    vehicle: Vehicle
    rng: np.random.Generator
    per_m3: float
    _frames: list[Any] = field(default_factory=list)
    _pushes: list[Array] = field(default_factory=list)
    _clock: list[float] = field(default_factory=list)
    _next_s: float = 0.0

    def watch(self, step: Step, truth_provider: object) -> None:
        """Take a frame if it is time for one."""
        thrusts = step.command.thrusts_N
        self._pushes.append(np.concatenate([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)]))
        self._clock.append(step.time_s)
        if step.time_s < self._next_s - 1e-9:
            return
        first = len(self._frames) % 2 == 0
        self._next_s = step.time_s + (APART_S if first else EVERY_S - APART_S)
        look = getattr(truth_provider, "flakes", None)
        if step.truth is None or look is None:
            return
        X_WC = step.truth.state.X_WB @ self.vehicle.X_BC_at(step.truth.tilt_rad)
        guess = step.estimate.X_WB @ self.vehicle.X_BC_at(step.tilt_rad)
        recent = np.array(self._clock) > step.time_s - PUSHING_S
        push = np.mean([p for p, r in zip(self._pushes, recent, strict=True) if r], axis=0)
        self._frames.append((step.time_s, guess, step.estimate.X_WB, push, self._found(look(X_WC), X_WC)))
        drop = int(np.searchsorted(self._clock, step.time_s - PUSHING_S))
        del self._pushes[:drop], self._clock[:drop]

    def _found(self, cloud: FlakeCloud, X_WC: Pose) -> tuple[Array, Array, Array]:
        """Who they are, pixels and radii of the flakes that a frame shows."""
        p_C = X_WC.inverse().apply(cloud.p_W_m)
        near = (p_C[:, 2] > NEAREST_M) & (p_C[:, 2] < FARTHEST_M) & (cloud.looks[:, 0] * cloud.per_m3 < self.per_m3)
        p_C, looks = p_C[near], cloud.looks[near]
        pixels = self.camera.project(p_C)
        inside = np.all((pixels > 0.0) & (pixels < (self.camera.width, self.camera.height)), axis=1)
        inside &= cover(self.camera, p_C[:, 2], looks[:, 1]) > LEAST_COVER
        count = int(inside.sum())
        noisy = pixels[inside] + self.rng.normal(0.0, PIXEL_NOISE, (count, 2))
        radius = blur_radius_px(self.camera, p_C[inside, 2], looks[inside, 1])
        return looks[inside, 0], noisy, radius + self.rng.normal(0.0, BLUR_NOISE, count)

    def sightings(self) -> FlakeTracks:
        """All that was seen twice so far."""
        parts: list[tuple[Array, Array, Array]] = []
        pairs = list(zip(self._frames[:-1:2], self._frames[1::2], strict=True))
        for before, after in pairs:
            parts.append(self._again(before, after))
        counts = [len(part[2]) for part in parts]
        return FlakeTracks(
            pair=np.repeat(np.arange(len(pairs)), counts),
            first_px=np.concatenate([part[0] for part in parts]),
            moved_px=np.concatenate([part[1] for part in parts]),
            blur_px=np.concatenate([part[2] for part in parts]),
            times_s=np.array([before[0] for before, _ in pairs]),
            X_WC=tuple(before[1] for before, _ in pairs),
            X_WC_next=tuple(after[1] for _, after in pairs),
            X_WB=tuple(after[2] for _, after in pairs),
            pushes_N=np.array([before[3] for before, _ in pairs]),
        )

    def _again(self, before: Any, after: Any) -> tuple[Array, Array, Array]:
        """First place, way and radius of those of a frame that are found in the next, at most so many."""
        _, i, j = np.intersect1d(before[4][0], after[4][0], return_indices=True)
        first, second = before[4][1][i], after[4][1][j]
        moved = second - first
        # How something at the middle of the view that stands still would have moved.
        at = before[1].apply(self.camera.unproject(first, np.full(len(first), 0.5 * FARTHEST_M)))
        still = self.camera.project(after[1].inverse().apply(at)) - first
        kept = np.flatnonzero(np.linalg.norm(moved - still, axis=1) < LOST_PX)
        kept = np.sort(self.rng.permutation(kept)[:MOST_PER_PAIR])
        return first[kept], moved[kept], before[4][2][i][kept]


PUSH_S, LEVELS_N = 15.0, (0.3, 0.5, 0.8)
"""How long each push is, and how hard, in turn: harder ones are too fast for the frames, weaker ones bend at once."""
ARRIVED_S = 6.0
"""Into a push: the weakest jet has reached the end of the view, the last one has gone."""
CARRIED_S = 0.3
"""Flakes are carried on that often."""
DEPTH_M, BED_M = 0.75, 1.5
THRUST_ERROR = 0.1
STEP_S = 0.02
TURBULENCE = 0.25


@dataclass(frozen=True)
class _Steady:
    velocity_W_m_s: Array
    steady = True
    uniform = True

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        del time_s
        return np.tile(self.velocity_W_m_s, (len(points_W_m), 1))


@dataclass
class _Held:
    """Who knows the flakes of the held vehicle's water."""

    drifting: Flakes
    water: Water
    time_s: float = 0.0

    def flakes(self, X_WC: Pose) -> FlakeCloud:
        return self.drifting.before(X_WC, self.time_s, self.water)


def bow_jets(vehicle: Vehicle) -> list[tuple[int, float]]:
    """Thrusters, and the sign of their thrust, whose jet goes forward and level before the camera's plane."""
    X_BC = vehicle.X_BC_at(0.0)
    found = []
    for i, (place, axis) in enumerate(zip(vehicle.thruster_positions_B_m, vehicle.thruster_axes_B, strict=True)):
        for sign in (1.0, -1.0):
            middle = X_BC.inverse().apply((place - sign * 0.35 * axis)[None])[0]
            ahead = middle[2] > 0.0 and np.hypot(*middle[:2]) < middle[2]
            if ahead and place[0] > 0.0:
                found.append((i, sign))
    return found


def held_sightings(
    vehicle: Vehicle,
    camera: Camera,
    drawn: SampledWater,
    current_m_s: Array,
    rng: np.random.Generator,
    *,
    minutes: float,
    per_m3: float,
) -> FlakeTracks:
    """What the camera sees of so many minutes of pushes; pairs of frames count once a push has gone on for a while."""
    X_WB = Pose(np.array([0.0, 0.0, DEPTH_M]))
    X_WC = X_WB @ vehicle.X_BC_at(0.0)
    ambient = _Steady(np.asarray(current_m_s, dtype=np.float64))
    water = Water(
        vehicle.disk_areas_m2,
        density_kg_m3=FRESH_WATER_KG_M3,
        bed_z_m=BED_M,
        rng=rng.spawn(1)[0],
        ambient=ambient,
        turbulence=TURBULENCE,
        spreading=JetSpreading.of_width(drawn.half_width_growth),
        wake_life=drawn.wake_life,
    )
    middle = X_WC.apply(np.array([[0.0, 0.0, 0.35]]))[0]
    held = _Held(Flakes(middle, BED_M, ambient, rng.spawn(1)[0]), water)
    watcher = FlakeObserver(camera=camera, vehicle=vehicle, rng=rng.spawn(1)[0], per_m3=per_m3)
    origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    n = len(vehicle.thrusters)
    true_share = rng.uniform(1.0 - THRUST_ERROR, 1.0 + THRUST_ERROR, n)
    jets = bow_jets(vehicle)
    state = BodyState(X_WB=X_WB)
    for k in range(math.ceil(60.0 * minutes / STEP_S)):
        now = k * STEP_S
        turn = int(now / PUSH_S)
        i, sign = jets[turn % len(jets)]
        asked = np.zeros(n)
        asked[i] = sign * LEVELS_N[(turn // len(jets)) % len(LEVELS_N)]
        held.time_s = now
        if k % round(CARRIED_S / STEP_S) == 0:
            held.drifting.move(now, water)
        if now - turn * PUSH_S >= ARRIVED_S:
            watcher.watch(_step(now, state, asked), held)
        pushed = STEP_S * asked * true_share
        water.step(
            STEP_S, origins, origins, axes, np.stack([np.maximum(pushed, 0.0), np.maximum(-pushed, 0.0)], axis=1)
        )
    return watcher.sightings()


def _step(now: float, state: BodyState, thrusts_N: Array) -> Step:
    return Step(
        time_s=now,
        goal=Goal(X_WB=state.X_WB),
        estimate=state,
        command=Command(thrusts_N=thrusts_N, wrench_B=np.zeros(6)),
        truth=Truth(state=state, thrusts_N=thrusts_N, power_W=0.0, collision=False),
        solve_s=0.0,
    )
