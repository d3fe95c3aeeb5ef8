"""Laws of the colours for people: water put on a known scene is found and taken off again, and nothing is invented."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.imaging.sensor import srgb_encode
from wakewise.vision.texturing.colour import fit_water, remove_water, srgb_decode, white_balanced

SIGNAL, RATE, VEIL = np.array([0.9, 0.5, 0.4]), np.array([0.8, 0.7, 0.6]), np.array([0.02, 0.06, 0.09])


def _scene(seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Grey patches with some black ones on a plane from 0.4 to 2 m: photograph, range (h, w) and true reflectance."""
    rng = np.random.default_rng(seed)
    range_m = np.repeat(np.linspace(0.4, 2.0, 120)[:, None], 160, axis=1)
    grey = np.kron(rng.uniform(0.1, 0.5, (30, 40)), np.ones((4, 4)))
    grey[np.kron(rng.random((30, 40)) < 0.03, np.ones((4, 4), bool))] = 0.002
    truth = np.repeat(grey[..., None], 3, axis=2)
    r = range_m[..., None]
    seen = truth * np.exp(-SIGNAL * r) + VEIL * (1 - np.exp(-RATE * r))
    return np.round(255 * srgb_encode(seen)).astype(np.uint8), range_m.astype(np.float32), truth


def test_decoding_undoes_encoding() -> None:
    """Every byte comes back."""
    image = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(np.round(255 * srgb_encode(srgb_decode(image).astype(float))), image)


def test_the_water_is_found() -> None:
    """Attenuation within 15 % or 0.1 /m; the veil within a half, since the darkest things are not taken for black."""
    image, range_m, _ = _scene()
    fit = fit_water([(image, range_m)])
    assert np.all(np.abs(fit.signal_per_m - SIGNAL) < np.maximum(0.15 * SIGNAL, 0.1))
    shown, true = fit.veil * -np.expm1(-2.0 * fit.veil_per_m), VEIL * -np.expm1(-2.0 * RATE)
    assert np.all((shown > 0.4 * true) & (shown < 1.1 * true))


def test_the_scene_comes_back() -> None:
    """Up to one factor and a third of the cast, far patches get the brightness and the grey that near ones have."""
    image, range_m, truth = _scene()
    restored = srgb_decode(remove_water(image, range_m, fit_water([(image, range_m)])))
    before = srgb_decode(image)
    bright = truth[..., 0] > 0.15

    def unevenness(picture: np.ndarray) -> float:
        ratio = np.log(picture[bright] / truth[bright])
        return float(ratio.std())

    def cast(picture: np.ndarray, rows: slice) -> float:
        mean = picture[rows][bright[rows]].mean(axis=0)
        return float(np.ptp(mean) / mean.mean())

    assert unevenness(restored) < 0.4 * unevenness(before)
    far = slice(80, 120)
    assert cast(restored, far) < 0.5 * cast(before, far)


def test_unknown_ranges_are_taken_for_far() -> None:
    """A pixel without a range is treated as one at the farthest that was fitted; nothing turns NaN."""
    image, range_m, _ = _scene()
    fit = fit_water([(image, range_m)])
    holes = range_m.copy()
    holes[:10] = np.inf
    holes[10:20] = np.nan
    filled = np.where(np.isfinite(holes), np.minimum(holes, fit.reach_m), np.float32(fit.reach_m)).astype(np.float32)
    assert np.array_equal(remove_water(image, holes, fit), remove_water(image, filled, fit))


def test_too_little_is_refused() -> None:
    """No ranges, or ranges of another shape, give one line."""
    image, range_m, _ = _scene()
    with pytest.raises(InputError, match="pixels with a range"):
        fit_water([(image, np.full_like(range_m, np.nan))])
    with pytest.raises(InputError, match="alike"):
        fit_water([(image, range_m[:-1])])
    with pytest.raises(InputError, match="alike"):
        remove_water(image, range_m[:-1], fit_water([(image, range_m)]))


def test_balance_takes_the_cast_away() -> None:
    """A grey scene in blue-green light comes out with half of its cast or less, and a black picture stays dark."""
    rng = np.random.default_rng(0)
    grey = rng.uniform(0.05, 0.6, (90, 120))[..., None] * np.array([0.25, 0.7, 0.8])
    image = np.round(255 * srgb_encode(grey)).astype(np.uint8)
    before, after = srgb_decode(image).mean(axis=(0, 1)), srgb_decode(white_balanced(image)).mean(axis=(0, 1))
    assert np.ptp(after) / after.mean() < 0.5 * np.ptp(before) / before.mean()
    assert white_balanced(np.zeros((40, 40, 3), np.uint8)).max() < 40
