"""One photograph: the scene through silty water, over the exposure, on a noisy sensor; automatic exposure.

Automatic exposure is libcamera's rpi.agc with its tuning for Sony's IMX290 (src/ipa/rpi/vc4/data/imx290.json): the
centre-weighted mean is led to 0.16 of saturation by a fifth of the difference in each frame of 1/30 s, first by
exposure, then by gain. It is computed from small views before the photograph, so a photograph depends on its own record
only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import FlakeCloud, ScalarGrid
from wakewise.vision.imaging.blur import motion_blur, pose_at
from wakewise.vision.imaging.camera import Camera
from wakewise.vision.imaging.optics import SiltOptics, attenuate, haze_between
from wakewise.vision.imaging.particles import draw_flakes, flakes_before
from wakewise.vision.imaging.renderer import Image, Render, render
from wakewise.vision.imaging.scene import Scene
from wakewise.vision.imaging.sensor import expose
from wakewise.vision.imaging.settings import (
    ELECTRONS_PER_S,
    FLAKES_PER_KG,
    LONGEST_S,
    METERED_EVERY_S,
    READ_NOISE_E,
    ImagingSettings,
)

TARGET = 0.16
"""Share of saturation that the mean is led to."""
SPEED, FRAMES_PER_S = 0.2, 30.0
"""Share of the way that is made in a frame."""
WIDTH_PX = 48
"""Width of the small pictures."""
MIDDLE = 3.0
"""Weight of the middle third, across and down, over the rest; estimate: that tuning falls from 3 to 1 and 0."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear red, green and blue (ITU-R BT.709)."""
SHORTEST_S, MOST_AMPLIFIED = 1e-5, 8.0
"""Shortest exposure and most amplification of that tuning."""


@dataclass(frozen=True, kw_only=True)
class ExposureSetting:
    """How long the shutter is open, the signal of a white card in unit light, and the amplification in it."""

    exposure_s: float
    gain: float
    amplification: float


def brightness(
    scene: Scene,
    X_WC: Pose,
    silt: ScalarGrid | None,
    settings: ImagingSettings,
    grains: SiltOptics,
    balance: Array,
) -> float:
    """Weighted mean luminance of one view through its water, at gain 1; `balance`, shape (3,), is the white balance."""
    height = max(16, round(WIDTH_PX * settings.height / settings.width))
    camera = settings.model_copy(update={"width": WIDTH_PX, "height": height}).camera()
    lights, water = settings.lights(), settings.water()
    view = render(scene, camera, X_WC, lights, samples=1)
    haze = haze_between(camera, X_WC, water, grains, silt, lights)
    radiance, _ = attenuate(view, camera, haze, water, lights.from_above)
    weights = np.ones((height, WIDTH_PX))
    weights[height // 3 : height - height // 3, WIDTH_PX // 3 : WIDTH_PX - WIDTH_PX // 3] = MIDDLE
    return float(np.average(radiance @ (LUMINANCE * balance), weights=weights))


def converged_gain(seen: Sequence[float]) -> float:
    """Gain after views of this brightness at gain 1, oldest first, METERED_EVERY_S apart; settled on the first."""
    desired = [math.log(TARGET / max(value, 1e-6)) for value in seen]
    stays = (1.0 - SPEED) ** (FRAMES_PER_S * METERED_EVERY_S)
    log_gain = desired[0]
    for value in desired[1:]:
        log_gain = value + stays * (log_gain - value)
    return math.exp(log_gain)


def split_gain(gain: float, settings: ImagingSettings) -> ExposureSetting:
    """A gain made of exposure first, then of amplification, as far as they go.

    `settings.gain` at `settings.exposure_s` is the sensor unamplified.
    """
    desired_s = settings.exposure_s * gain / settings.gain
    exposure_s = min(max(desired_s, SHORTEST_S), LONGEST_S)
    amplification = min(max(desired_s / exposure_s, 1.0), MOST_AMPLIFIED)
    return ExposureSetting(
        exposure_s=exposure_s,
        gain=settings.gain * amplification * exposure_s / settings.exposure_s,
        amplification=amplification,
    )


def automatic_exposure(
    scene: Scene,
    before: Sequence[Pose],
    silt: ScalarGrid | None,
    settings: ImagingSettings,
    grains: SiltOptics,
    balance: Array,
) -> ExposureSetting:
    """What automatic exposure has come to after these views, oldest first, at least one; see `brightness`.

    The silt is that of the photograph: what hangs in the water does not change in a second.
    """
    return split_gain(converged_gain([brightness(scene, X, silt, settings, grains, balance) for X in before]), settings)


BALANCE_M = 0.25
"""White balance: a grey card at this range in clear water comes out grey, so that farther things turn bluish."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderedPhoto:
    """A photograph and what is known about it.

    `image` (h, w, 3) uint8 RGB; `sharpness` see `sharpness`, None if the target is not in view; `turbidity_per_m` mean
    attenuation by silt along the rays to the target, or over the whole image if the target is not in view; `exposure_s`
    and `gain`, the signal of a white card in unit light, as they were set or chosen.
    """

    image: NDArray[np.uint8]
    sharpness: float | None
    turbidity_per_m: float
    exposure_s: float
    gain: float


def photograph(
    scene: Scene | Sequence[Scene],
    camera: Camera,
    poses: Sequence[Pose],
    silt: ScalarGrid | None,
    settings: ImagingSettings,
    rng: np.random.Generator,
    grains: SiltOptics | None = None,
    before: Sequence[Pose] = (),
    drifting: FlakeCloud | None = None,
) -> RenderedPhoto:
    """Take one photograph.

    `scene`: several show a target that moves: how it stands at instants evenly spaced over the exposure, an odd number.
    `camera`: `settings.camera()`, or another one. `poses`: true X_WC at instants evenly spaced over
    `settings.window_s`, the exposure and the readout, the first and last at its ends; one means no motion. `silt`:
    concentration in kg/m3. `rng`: draws flakes and noise, nothing else. `grains`: what the silt is made of; pale 20 um
    carbonate mud if not given. `before`: true X_WC before, `METERED_EVERY_S` apart, oldest first, for automatic
    exposure; without them it goes by the photograph's own view. `drifting`: flakes that other photographs show too,
    where the water has brought them; all are drawn here if not given. Raises InputError if there is no pose, or the
    silt is negative somewhere.
    """
    scenes = [scene] if isinstance(scene, Scene) else list(scene)
    views = [render(each, camera, pose_at(poses, 0.5), settings.lights(), settings.samples) for each in scenes]
    view = views[0] if len(views) == 1 else mean_view(views)
    chosen = None
    if settings.auto_exposure:
        balance = white_balance(settings)
        metered = before or (pose_at(poses, 0.5),)
        chosen = automatic_exposure(scenes[0], metered, silt, settings, grains or SiltOptics(), balance)
    return photograph_of(view, camera, poses, silt, settings, rng, grains, chosen, drifting)


def white_balance(settings: ImagingSettings) -> Array:
    """Factors of red, green and blue, shape (3,)."""
    return np.asarray(np.exp(settings.water().signal_per_m * BALANCE_M))


def photograph_of(
    view: Render,
    camera: Camera,
    poses: Sequence[Pose],
    silt: ScalarGrid | None,
    settings: ImagingSettings,
    rng: np.random.Generator,
    grains: SiltOptics | None = None,
    chosen: ExposureSetting | None = None,
    drifting: FlakeCloud | None = None,
) -> RenderedPhoto:
    """As `photograph`, from a render of the middle of the exposure that is there already.

    Exposure and gain are those `chosen`, or those of the settings.
    """
    taken = chosen or ExposureSetting(exposure_s=settings.exposure_s, gain=settings.gain, amplification=1.0)
    shutter = settings.shutter(taken.exposure_s)
    if silt is not None and silt.values.size and float(silt.values.min()) < 0.0:
        raise InputError(f"silt: concentration {float(silt.values.min()):g} kg/m3, must not be negative")
    middle = pose_at(poses, 0.5)
    lights, water = settings.lights(), settings.water()
    grains = grains or SiltOptics()
    haze = haze_between(camera, middle, water, grains, silt, lights)
    radiance, silt_per_m = attenuate(view, camera, haze, water, lights.from_above, grains)
    radiance = motion_blur(radiance, view.depth_m, camera, poses, shutter)
    flakes = flakes_before(camera, middle, silt, settings.flakes_per_m3, FLAKES_PER_KG, rng, drifting)
    radiance = draw_flakes(radiance, view.depth_m, camera, poses, flakes, settings.window_s, water, lights, shutter)
    # Unamplified, a full well is a saturated signal; amplified, a part of it.
    well_e = ELECTRONS_PER_S * settings.exposure_s / taken.amplification
    image = expose(radiance, taken.gain * white_balance(settings), well_e, READ_NOISE_E, rng)
    on_target = view.target_fraction >= 0.5
    return RenderedPhoto(
        image=image,
        sharpness=sharpness(image, view.target_fraction),
        turbidity_per_m=float(np.mean(silt_per_m[on_target] if on_target.any() else silt_per_m)),
        exposure_s=taken.exposure_s,
        gain=taken.gain,
    )


def mean_view(views: Sequence[Render]) -> Render:
    """Light of views of a moving scene from one place, in the mean; depth is that of the middle one."""
    return Render(
        radiance=np.mean([view.radiance for view in views], axis=0, dtype=np.float32),
        lamp_radiance=np.mean([view.lamp_radiance for view in views], axis=0, dtype=np.float32),
        depth_m=views[len(views) // 2].depth_m,
        target_fraction=np.mean([view.target_fraction for view in views], axis=0, dtype=np.float32),
    )


def sharpness(image: NDArray[np.uint8], target_fraction: Image) -> float | None:
    """Variance of the Laplacian over the target, in grey levels squared; None if no pixel is half filled by it.

    The grey image (0-255) is smoothed first with a Gaussian of 1 px, so that sensor noise counts for little.
    """
    rows, columns = np.nonzero(target_fraction >= 0.5)
    if len(rows) == 0:
        return None
    pad = 6
    box = np.s_[max(0, rows.min() - pad) : rows.max() + pad + 1, max(0, columns.min() - pad) : columns.max() + pad + 1]
    grey = cv2.cvtColor(image[box], cv2.COLOR_RGB2GRAY).astype(np.float32)
    edges = cv2.Laplacian(cv2.GaussianBlur(grey, (0, 0), 1.0), cv2.CV_32F)
    return float(np.var(edges[target_fraction[box] >= 0.5]))
