"""Sensor: exposure, white balance, shot and read noise, sRGB encoding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.renderer import BAND_ROWS, Image, in_threads

_TABLE_SIZE = 4096


def srgb_encode(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Encode linear values in 0..1 as IEC 61966-2-1 (sRGB) has it, to 0..1."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


# The table is entered by the square root, along which the curve is nearly straight.
_ENCODED = (255.0 * srgb_encode(np.linspace(0.0, 1.0, _TABLE_SIZE + 1) ** 2) + 0.5).astype(np.uint8)


def expose(
    radiance: Image,
    gains: Array,
    electrons_at_saturation: float,
    read_noise_e: float,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """Photograph, shape (h, w, 3) of bytes, of linear radiance times `gains` (3,), where 1 saturates.

    The noise of a pixel with N electrons is Gaussian with variance N + read_noise^2: Poisson's law for the many
    electrons of a daylight exposure.
    """
    h, w, _ = radiance.shape
    out = np.empty((h, w, 3), np.uint8)
    radiance = np.ascontiguousarray(radiance)
    row_gains = np.tile(gains, w).astype(np.float32)
    shot, read = np.float32(1.0 / electrons_at_saturation), np.float32((read_noise_e / electrons_at_saturation) ** 2)
    # Each band draws from its own stream: the bytes do not depend on who draws first.
    seeds = rng.integers(0, 2**63, -(-h // BAND_ROWS))

    def band(k: int) -> None:
        rows = slice(k * BAND_ROWS, (k + 1) * BAND_ROWS)
        stream = np.random.Generator(np.random.SFC64(int(seeds[k])))
        noise = stream.standard_normal(radiance[rows].shape, dtype=np.float32)
        _encode(
            out[rows].reshape(-1, 3 * w),
            radiance[rows].reshape(-1, 3 * w),
            noise.reshape(-1, 3 * w),
            row_gains,
            shot,
            read,
            _ENCODED,
        )

    in_threads(band, range(len(seeds)))
    return out


@njit(nogil=True)
def _encode(out: Any, radiance: Any, noise: Any, gains: Any, shot: Any, read: Any, table: Any) -> None:
    """Rows of interleaved channels, shape (h, 3 w), in single precision throughout; `read` is a variance."""
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    last = np.float32(table.shape[0] - 1)
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            signal = max(radiance[y, x] * gains[x], zero)
            # Shot noise of a full well at most: charge does not grow beyond saturation.
            value = signal + noise[y, x] * np.sqrt(min(signal, one) * shot + read)
            out[y, x] = table[np.uint32(np.sqrt(min(max(value, zero), one)) * last + half)]
