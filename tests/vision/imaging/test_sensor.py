"""Light becomes bytes by the sRGB curve, with noise of the stated variance."""

import numba
import numpy as np
import pytest

from wakewise.vision.imaging.sensor import BAND_ROWS, expose, srgb_encode


def test_encoding_is_srgb():
    """Without noise, bytes are 255 times the sRGB curve within one level; gains scale before saturation."""
    linear = np.linspace(0, 1.2, 1000, dtype=np.float32)
    image = np.repeat(linear[None, :, None], 3, axis=2)
    gains = np.array([1.0, 0.5, 2.0])
    out = expose(image, gains, 1e15, 0.0, np.random.default_rng(0))
    expected = 255 * srgb_encode(linear[:, None].astype(float) * gains)
    assert np.abs(out[0].astype(float) - expected).max() <= 1.0
    assert srgb_encode(np.array([0.0, 0.0031308, 0.214041, 1.0])) == pytest.approx([0, 0.04045, 0.5, 1.0], abs=1e-4)


def test_noise_has_the_variance_of_its_electrons():
    """In linear light the variance is (N + read^2) / N_saturation^2, in shade and in light."""
    for level, read in ((0.05, 30.0), (0.4, 4.0)):
        image = np.full((200, 200, 3), level, np.float32)
        encoded = expose(image, np.ones(3), 2000.0, read, np.random.default_rng(1)) / 255.0
        linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        assert linear.mean() == pytest.approx(level, rel=0.01)
        assert linear.std() == pytest.approx(np.sqrt(2000 * level + read**2) / 2000, rel=0.05)


def exposed_twin(radiance, gains, saturation, read, rng):
    """The sensor, step by step, in double precision: light, noise of each band's own stream, curve, rounding."""
    h = len(radiance)
    streams = [np.random.Generator(np.random.SFC64(int(s))) for s in rng.integers(0, 2**63, -(-h // BAND_ROWS))]
    parts = [radiance[k * BAND_ROWS : (k + 1) * BAND_ROWS].shape for k in range(len(streams))]
    noise = np.concatenate([g.standard_normal(p, dtype=np.float32) for g, p in zip(streams, parts, strict=True)])
    signal = np.maximum(radiance.astype(float) * gains, 0.0)
    value = signal + noise * np.sqrt(np.minimum(signal, 1.0) / saturation + (read / saturation) ** 2)
    return np.floor(255.0 * srgb_encode(value) + 0.5).astype(np.uint8)


def test_exposure_agrees_with_its_twin_on_any_number_of_threads():
    """Bytes are the readable sensor's, at most one level off where the table rounds, and the same on one thread."""
    radiance = np.random.default_rng(3).uniform(-0.1, 1.3, (71, 53, 3)).astype(np.float32)
    gains, threads = np.array([0.9, 0.7, 1.4]), numba.get_num_threads()
    found = expose(radiance, gains, 12000.0, 4.0, np.random.default_rng(2))
    expected = exposed_twin(radiance, gains, 12000.0, 4.0, np.random.default_rng(2))
    assert np.abs(found.astype(int) - expected).max() <= 1
    assert (found == expected).mean() > 0.97
    numba.set_num_threads(1)
    try:
        single = expose(radiance, gains, 12000.0, 4.0, np.random.default_rng(2))
    finally:
        numba.set_num_threads(threads)
    assert found.tobytes() == single.tobytes()


def test_noise_is_gaussian_and_no_row_repeats_another():
    """Over a grey image the noise has mean 0, kurtosis 3, and no correlation between neighbours or bands."""
    image = np.full((320, 300, 3), 0.3, np.float32)
    noise = expose(image, np.ones(3), 300.0, 0.0, np.random.default_rng(5)).astype(float)
    noise = (noise - noise.mean()) / noise.std()
    assert np.mean(noise**4) == pytest.approx(3.0, abs=0.1)
    for a, b in ((noise[1:], noise[:-1]), (noise[:, 1:], noise[:, :-1]), (noise[BAND_ROWS:], noise[:-BAND_ROWS])):
        assert abs(np.mean(a * b)) < 0.01
