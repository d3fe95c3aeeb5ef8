"""A plant whose measurements have pictures of the camera, rendered from the simulated world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Measurement, Plant, Truth, TruthProvider, World
from wakewise.operation.parts import Parts
from wakewise.operation.photography import posed_scene
from wakewise.operation.recorder import moved
from wakewise.perception import PerceptionSettings
from wakewise.vision.imaging import ImagingSettings, Scene, photograph

_TICK_S = 1e-9
SHOWN_M = 0.0007
"""A target whose tips moved by less is shown as it was: half a pixel at half a metre."""


class CameraFrames:
    """A `Plant` round another one that also takes pictures and hands them over `latency_s` later.

    `truth_provider` knows the true pose, the silt and how a soft target stands: what the light meets. `lost_s`: spans
    (from, to) in which the camera gives no picture, for tests.
    """

    def __init__(
        self,
        plant: Plant,
        truth_provider: TruthProvider,
        parts: Parts,
        settings: PerceptionSettings,
        lost_s: tuple[tuple[float, float], ...] = (),
    ) -> None:
        self._plant, self._truth_provider, self._parts, self._perception = plant, truth_provider, parts, settings
        self._lost_s = lost_s
        self._imaging = picture_settings(parts, settings)
        self._camera = self._imaging.camera()
        self._rng = np.random.default_rng([parts.scenario.seed, 41])
        self._time_s, self._taken = 0.0, 0
        self._under_way: list[tuple[float, Measurement]] = []
        self._posed: tuple[Array, Scene] | None = None

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """As the plant; a picture that is due is taken at the end of the step."""
        measurements = self._plant.step(thrusts_N, dt_s)
        self._time_s += dt_s
        if self._time_s + _TICK_S >= self._taken / self._perception.rate_hz:
            self._taken += 1
            if not any(begin <= self._time_s < end for begin, end in self._lost_s):
                image = self._picture(self._truth_provider.observe())
                # The shutter opens now; the picture is that of the middle of its exposure and readout.
                middle_s = self._time_s + 0.5 * self._imaging.window_s
                arrives_s = max(middle_s + self._perception.latency_s, self._time_s + self._imaging.window_s)
                self._under_way.append((arrives_s, Measurement(time_s=middle_s, image=image)))
        due = tuple(m for arrives_s, m in self._under_way if arrives_s <= self._time_s + _TICK_S)
        self._under_way = self._under_way[len(due) :]
        return measurements + due

    def aim(self, tilt_rad: float) -> None:
        """Command an angle of the camera's joint."""
        if (aim := getattr(self._plant, "aim", None)) is not None:
            aim(tilt_rad)

    def push(self, wrench_B: Array) -> None:
        """A wrench from outside the water; see `wakewise.core.interfaces.Plant`."""
        if (push := getattr(self._plant, "push", None)) is not None:
            push(wrench_B)

    def _picture(self, truth: Truth) -> NDArray[np.uint8]:
        mount = self._parts.vehicle.X_BC_at(truth.tilt_rad)
        window_s = self._imaging.window_s
        poses = [moved(truth.state, after_s) @ mount for after_s in np.linspace(0.0, window_s, 3)]
        silt = self._truth_provider.silt()
        flakes = getattr(self._truth_provider, "flakes", None)
        photo = photograph(
            self._scene(),
            self._camera,
            poses,
            silt if silt.largest > 0.0 else None,
            self._imaging,
            self._rng,
            self._parts.grains,
            drifting=None if flakes is None else flakes(poses[1]),
        )
        return photo.image

    def _scene(self) -> Scene:
        posture = getattr(self._truth_provider, "posture", None)
        stands = None if posture is None else posture()
        if stands is None:
            return self._parts.scene
        now = np.concatenate([stands.tips_m.ravel(), stands.shift_m])
        if self._posed is None or np.abs(now - self._posed[0]).max() > SHOWN_M:
            self._posed = now, posed_scene(self._parts, stands.tips_m, stands.shift_m)
        return self._posed[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraWorld:
    """A `World` whose plant also takes pictures."""

    inner: World
    parts: Parts
    settings: PerceptionSettings

    @property
    def name(self) -> str:
        """Name of the world."""
        return self.inner.name

    def begin(self) -> tuple[Plant, TruthProvider | None]:
        """As the world; raises InputError of one without truth, which pictures are rendered from."""
        plant, truth_provider = self.inner.begin()
        if truth_provider is None:
            raise InputError(f"world {self.name}: has no truth to render pictures from, take pilot route")
        return CameraFrames(plant, truth_provider, self.parts, self.settings), truth_provider


def picture_settings(parts: Parts, settings: PerceptionSettings) -> ImagingSettings:
    """Settings of the scenario's camera for pictures of the perception's width, one ray a pixel."""
    given = parts.scenario.imaging
    height = max(16, round(settings.width_px * given.height / given.width))
    return given.model_copy(update={"width": settings.width_px, "height": height, "samples": 1})


def without_pose(measurement: Measurement) -> Measurement:
    """The measurement without poses and positions from outside the vehicle."""
    return replace(measurement, X_WB=None, p_WB_m=None)
