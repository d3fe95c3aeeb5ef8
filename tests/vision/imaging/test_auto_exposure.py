"""Automatic exposure: led to its target by what was seen before, exposure first, within its bounds."""

import math

import numpy as np
import pytest
from imaging_helpers import coral_scene, view

from wakewise.vision.imaging import ImagingSettings, SiltOptics, photograph
from wakewise.vision.imaging.photograph import (
    LUMINANCE,
    MOST_AMPLIFIED,
    TARGET,
    automatic_exposure,
    brightness,
    converged_gain,
    split_gain,
)
from wakewise.vision.imaging.settings import LONGEST_S

AUTO = ImagingSettings(auto_exposure=True, width=240, height=180)
DIM = AUTO.model_copy(update={"ambient": 0.02, "panels": 0.03, "lamp": 0.02})


def place(elevation=40.0):
    return view(elevation, centre=coral_scene()[1].centre_W_m)


def take(settings, before=(), seed=0):
    scene, _ = coral_scene()
    rng = np.random.default_rng(seed)
    return photograph(scene, settings.camera(), [place()], None, settings, rng, None, before)


def linear_mean(image):
    """Weighted mean luminance of a photograph, the middle third three times, decoded from sRGB."""
    x = image / 255.0
    y = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4) @ LUMINANCE
    h, w = y.shape
    weights = np.ones((h, w))
    weights[h // 3 : h - h // 3, w // 3 : w - w // 3] = 3.0
    return float(np.average(y, weights=weights))


def test_a_settled_camera_meets_its_target():
    """The photograph has the brightness asked for, in the light of the tank and in a twentieth of it."""
    for settings in (AUTO, DIM):
        assert linear_mean(take(settings).image) == pytest.approx(TARGET, rel=0.1)


def test_dim_water_makes_long_exposures():
    """The shutter is opened for longer first, and no longer than allowed; then the signal is amplified."""
    bright, dim = take(AUTO), take(DIM)
    assert bright.exposure_s < dim.exposure_s <= LONGEST_S
    dark = AUTO.model_copy(update={"ambient": 0.0, "panels": 0.0, "lamp": 0.01})
    chosen = split_gain(
        converged_gain([brightness(coral_scene()[0], place(), None, dark, SiltOptics(), np.ones(3))]), dark
    )
    assert chosen.exposure_s == LONGEST_S and chosen.amplification > 1.0


@pytest.mark.parametrize("gain", [0.01, 0.3, 0.75, 3.0, 30.0, 3000.0])
def test_gain_is_exposure_times_amplification(gain):
    """What is chosen multiplies up to the gain asked for, unless it is beyond both bounds."""
    chosen = split_gain(gain, AUTO)
    most = AUTO.gain * LONGEST_S / AUTO.exposure_s * MOST_AMPLIFIED
    assert chosen.gain == pytest.approx(min(gain, most))
    assert 1.0 <= chosen.amplification <= MOST_AMPLIFIED
    assert chosen.amplification == 1.0 or chosen.exposure_s == LONGEST_S


def test_exposure_lags_behind_what_is_seen():
    """After a step of light the gain goes half of the way in the three frames of a tenth of a second."""
    before, after = 0.1, 0.4
    gains = [converged_gain([before] * 3 + [after] * k) for k in range(4)]
    assert gains[0] == pytest.approx(TARGET / before)
    way = [math.log(gain * before / TARGET) / math.log(before / after) for gain in gains]
    np.testing.assert_allclose(way, [1.0 - 0.8 ** (3 * k) for k in range(4)])


def test_what_was_seen_before_decides_the_exposure():
    """The same view gets another exposure after another view; the last view counts most, the order matters."""
    scene, _ = coral_scene()
    up, down = place(75.0), place(8.0)

    def gain(*before):
        return automatic_exposure(scene, before, None, AUTO, SiltOptics(), np.ones(3)).gain

    assert gain(up, up) != pytest.approx(gain(down, down), rel=0.01)
    low, high = sorted((gain(up, up), gain(down, down)))
    assert low < gain(up, down) < high
    assert gain(up, down) != pytest.approx(gain(down, up), rel=1e-3)


def test_the_same_exposure_makes_the_same_bytes():
    """A photograph hangs on its own views alone: made again, with or without others before it, it is the same."""
    before = [place(40.0 + k) for k in range(4)]
    first = take(DIM, before)
    take(AUTO)
    assert first.image.tobytes() == take(DIM, before).image.tobytes()


def test_amplified_signals_are_noisier():
    """With the shutter as long as it may be, half of the light has noise larger by the root of two."""
    lit = AUTO.model_copy(update={"ambient": 0.0, "panels": 0.04, "lamp": 0.0, "flakes_per_m3": 0.0})
    less = lit.model_copy(update={"panels": 0.02})
    noise = []
    for settings in (lit, less):
        a, b = (take(settings, seed=seed).image.astype(float) for seed in (1, 2))
        noise.append(float(np.std(a - b)))
    assert noise[1] == pytest.approx(math.sqrt(2.0) * noise[0], rel=0.15)


def test_without_it_nothing_is_chosen():
    """A fixed exposure stays what it was set to, whatever was seen."""
    fixed = ImagingSettings(width=240, height=180)
    photo = take(fixed, [place()])
    assert (photo.exposure_s, photo.gain) == (fixed.exposure_s, fixed.gain)
    assert photo.image.tobytes() == take(fixed).image.tobytes()
