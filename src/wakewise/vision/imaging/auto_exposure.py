"""Automatic exposure: how long the shutter is open, and how much the signal is amplified, by what was seen before.

The law is that of libcamera's rpi.agc with its tuning for Sony's IMX290, a low-light 1080p sensor
(src/ipa/rpi/vc4/data/imx290.json): the mean of the picture, its middle counting more, is led to 0.16 of saturation, a
fifth of the way in each frame of 1/30 s; the shutter is opened for longer first, then the signal amplified. It goes by
views before the photograph, drawn small, so that what a photograph gets depends on its own exposure's record alone:
neither on other photographs nor on when it is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.vision.imaging.optics import SiltOptics, attenuate, haze_between
from wakewise.vision.imaging.renderer import render
from wakewise.vision.imaging.scene import Scene
from wakewise.vision.imaging.settings import LONGEST_S, METERED_EVERY_S, ImagingSettings

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
    wished = [math.log(TARGET / max(value, 1e-6)) for value in seen]
    stays = (1.0 - SPEED) ** (FRAMES_PER_S * METERED_EVERY_S)
    log_gain = wished[0]
    for wish in wished[1:]:
        log_gain = wish + stays * (log_gain - wish)
    return math.exp(log_gain)


def split_gain(gain: float, settings: ImagingSettings) -> ExposureSetting:
    """A gain made of exposure first, then of amplification, as far as they go.

    `settings.gain` at `settings.exposure_s` is the sensor unamplified.
    """
    wished_s = settings.exposure_s * gain / settings.gain
    exposure_s = min(max(wished_s, SHORTEST_S), LONGEST_S)
    amplification = min(max(wished_s / exposure_s, 1.0), MOST_AMPLIFIED)
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
