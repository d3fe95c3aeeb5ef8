"""From light to bytes: exposure, white balance, shot and read noise, sRGB encoding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from wakewise.arrays import Array
from wakewise.imaging.renderer import Image

_TABLE_SIZE = 4096


def srgb_encode(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Encode linear values in 0..1 as IEC 61966-2-1 (sRGB) has it, to 0..1."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


# The table is entered by the square root, along which the curve is nearly straight.
_ENCODED = (255.0 * srgb_encode(np.linspace(0.0, 1.0, _TABLE_SIZE + 1) ** 2)).astype(np.float32)


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
    noise = rng.standard_normal(radiance.shape, dtype=np.float32)
    out = np.empty(radiance.shape, np.uint8)
    _encode(
        out, radiance, noise, gains, 1.0 / electrons_at_saturation, read_noise_e / electrons_at_saturation, _ENCODED
    )
    return out


@njit(cache=True, parallel=True, error_model="numpy")
def _encode(out: Any, radiance: Any, noise: Any, gains: Any, per_electron: float, read: float, table: Any) -> None:
    h, w, _ = radiance.shape
    for y in prange(h):
        for x in range(w):
            for c in range(3):
                signal = max(radiance[y, x, c] * gains[c], 0.0)
                # Shot noise of a full well at most: charge does not grow beyond saturation.
                value = signal + noise[y, x, c] * np.sqrt(min(signal, 1.0) * per_electron + read * read)
                place = np.sqrt(min(max(value, 0.0), 1.0)) * (table.shape[0] - 1)
                out[y, x, c] = int(table[int(place + 0.5)] + 0.5)
