"""Light becomes bytes by the sRGB curve, with noise of the stated variance."""

import numpy as np
import pytest

from wakewise.imaging.sensor import expose, srgb_encode


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
