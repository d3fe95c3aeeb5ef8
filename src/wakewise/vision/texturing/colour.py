"""Colour correction of underwater photographs, for display.

With ranges, the water is fitted and removed after Sea-thru (Akkaynak and Treibitz, CVPR 2019, doi
10.1109/CVPR.2019.00178): I = J exp(-beta_D r) + B (1 - exp(-beta_B r)) per colour band. The darkest pixels of each
range give the veil; the remaining brightness falls by exp(-beta_D r). beta_D is one number per band and set of
photographs here.

Without ranges, red is compensated by green, the mean is made grey (Ancuti et al. 2018, doi 10.1109/TIP.2017.2759252),
and local contrast is stretched within limits (CLAHE, Zuiderveld 1994). That is no physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.vision.imaging.sensor import srgb_encode

Photo8 = NDArray[np.uint8]
MOST_GAIN = 4.0
"""Light is put back up to this factor: what is fainter is noise."""
_TRUST = 0.6  # share of the darkest pixels' light that is taken for veil: the darkest things there are not black
_BINS = 12
_DARKEST = 0.004
_LEAST = 2000  # pixels with a range, without which nothing is fitted
_MOST_PER_M = 6.0
_NORM = 6  # of shades of grey (Finlayson and Trezzi, CIC 2004): between grey world (1) and the brightest pixel (inf)
_WHITE = 0.95
_KEPT = 0.3  # share of a pixel's light that is never taken for veil
_MIDDLE = 0.32  # linear, of the median pixel after restoring, as people expose sand
_SAMPLES = 60_000


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterFit:
    """The water of a set of photographs in their own linear units, each (3,) in red, green, blue.

    `veil` is B, `veil_per_m` beta_B, `signal_per_m` beta_D; `gains` make the restored picture's greys grey and its
    white white; `reach_m` is the farthest range that was fitted.
    """

    veil: Array
    veil_per_m: Array
    signal_per_m: Array
    gains: Array
    reach_m: float

    def __post_init__(self) -> None:
        freeze(self, veil=(3,), veil_per_m=(3,), signal_per_m=(3,), gains=(3,))


def srgb_decode(image: Photo8) -> NDArray[np.float32]:
    """Linear values from 0 to 1 of an sRGB picture of bytes, same shape (IEC 61966-2-1)."""
    x = np.arange(256) / 255.0
    table = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4).astype(np.float32)
    linear: NDArray[np.float32] = table[image]
    return linear


def fit_water(photos: Sequence[tuple[Photo8, NDArray[np.float32]]]) -> WaterFit:
    """Fit the water between camera and scene to photographs of one place.

    `photos`: RGB, shape (h, w, 3), and the range along each pixel's ray in m, shape (h, w); NaN or infinite where
    unknown. Raises InputError if shapes differ or too few pixels have a range.
    """
    colours, ranges = [], []
    for image, range_m in photos:
        if image.shape[:2] != range_m.shape:
            raise InputError(f"colour: image of {image.shape[:2]} and ranges of {range_m.shape}, must be alike")
        known = np.flatnonzero(np.isfinite(range_m.ravel()) & (range_m.ravel() > 0.0))
        known = known[:: max(1, len(known) * len(photos) // (_SAMPLES * 8))]
        colours.append(srgb_decode(image).reshape(-1, 3)[known])
        ranges.append(range_m.ravel()[known])
    colour = np.concatenate(colours).astype(np.float64) if colours else np.zeros((0, 3))
    range_ = np.concatenate(ranges).astype(np.float64) if ranges else np.zeros(0)
    if len(range_) < _LEAST:
        raise InputError(f"colour: {len(range_)} pixels with a range, at least {_LEAST} are needed")
    reach = float(np.quantile(range_, 0.98))
    edges = np.quantile(range_, np.linspace(0.0, 1.0, _BINS + 1))
    part = np.clip(np.searchsorted(edges, range_, side="right") - 1, 0, _BINS - 1)
    veil, veil_rate = _veil(colour, range_, part)
    direct = np.maximum(colour - veil * (1.0 - np.exp(-range_[:, None] * veil_rate)), 1e-4)
    signal_rate = _signal_rate(direct, range_, part)
    restored = direct * np.minimum(np.exp(signal_rate * np.minimum(range_, reach)[:, None]), MOST_GAIN)
    return WaterFit(veil=veil, veil_per_m=veil_rate, signal_per_m=signal_rate, gains=_gains(restored), reach_m=reach)


def _veil(colour: Array, range_m: Array, part: NDArray[np.int64]) -> tuple[Array, Array]:
    """B and beta_B from the darkest pixels of each range: B (1 - exp(-beta_B r)) and a rest that fades."""
    chosen = []
    for k in range(_BINS):
        here = np.flatnonzero(part == k)
        if len(here):
            count = max(3, int(_DARKEST * len(here)))
            chosen.append(here[np.argsort(colour[here].sum(axis=1))[:count]])
    dark = np.concatenate(chosen)
    r = range_m[dark]
    veil, rate = np.zeros(3), np.zeros(3)
    for band in range(3):
        seen = colour[dark, band]
        top = max(float(seen.max()), 1e-3)
        best = None
        for start in (0.2, 1.0, 3.0):

            def error(x: Array, seen: Array = seen, top: float = top) -> Array:
                return np.asarray((x[0] * -np.expm1(-x[1] * r) + x[2] * np.exp(-x[3] * r) - seen) / top)

            answer = least_squares(
                error, [0.5 * top, start, 0.2 * top, start], loss="soft_l1", f_scale=0.1,
                bounds=([0.0, 0.01, 0.0, 0.0], [1.0, _MOST_PER_M, 1.0, _MOST_PER_M]),
            )  # fmt: skip
            if best is None or answer.cost < best.cost - 1e-12:
                best = answer
        if best is not None:
            veil[band], rate[band] = best.x[0], best.x[1]
        # Never more veil than the darkest pixels show at any range.
        floor = np.array([_TRUST * np.median(seen[part[dark] == k]) for k in np.unique(part[dark])])
        middle = np.array([np.median(r[part[dark] == k]) for k in np.unique(part[dark])])
        shown = veil[band] * -np.expm1(-rate[band] * middle)
        veil[band] *= float(np.clip(np.min(floor / np.maximum(shown, 1e-9)), 0.0, 1.0))
    return veil, rate


def _signal_rate(direct: Array, range_m: Array, part: NDArray[np.int64]) -> Array:
    """beta_D from how the typical brightness falls with the range, by a robust straight line through its logarithm."""
    present = np.unique(part)
    r = np.array([np.median(range_m[part == k]) for k in present])
    level = np.log(np.stack([np.median(direct[part == k], axis=0) for k in present]))
    span = float(np.ptp(r))
    if span < 0.05:
        return np.zeros(3)
    # Theil and Sen: the median of the slopes between all pairs of ranges that are apart.
    i, j = np.triu_indices(len(r), 1)
    apart = np.abs(r[j] - r[i]) > 0.1 * span
    slopes = (level[j] - level[i])[apart] / (r[j] - r[i])[apart, None]
    return np.clip(-np.median(slopes, axis=0), 0.0, _MOST_PER_M)


def _gains(linear: Array) -> Array:
    """Gains, shape (3,), by shades of grey; the median becomes middle grey unless that burns out 1 of 200 pixels.

    Half of the cast is taken away: sand and rock have a warm colour of their own.
    """
    norm = np.mean(np.maximum(linear, 0.0) ** _NORM, axis=0) ** (1.0 / _NORM)
    gains = np.sqrt(norm.mean() / np.maximum(norm, 1e-6))
    brightest = (linear * gains).max(axis=1)
    middle, high = np.quantile(brightest, [0.5, 0.995])
    return np.asarray(gains * min(_MIDDLE / max(float(middle), 1e-6), _WHITE / max(float(high), 1e-6)))


def remove_water(image: Photo8, range_m: NDArray[np.float32], fit: WaterFit) -> Photo8:
    """The photograph as it would be without the water between.

    `image` has shape (h, w, 3). `range_m`, shape (h, w): range along each pixel's ray; where it is unknown, or beyond
    `fit.reach_m`, that is taken. Returns ndarray of uint8, shape (h, w, 3).
    """
    if image.shape[:2] != range_m.shape:
        raise InputError(f"colour: image of {image.shape[:2]} and ranges of {range_m.shape}, must be alike")
    r = np.where(np.isfinite(range_m) & (range_m > 0.0), np.minimum(range_m, fit.reach_m), fit.reach_m)[..., None]
    seen = srgb_decode(image)
    # Where veil is nearly all there is, such as in open water, some is left: its hue is right, that of noise is not.
    direct = np.maximum(seen - fit.veil * -np.expm1(-r * fit.veil_per_m), _KEPT * seen)
    linear = direct * np.minimum(np.exp(r * fit.signal_per_m), MOST_GAIN) * fit.gains
    return srgb_bytes(srgb_encode(linear))


def white_balanced(image: Photo8) -> Photo8:
    """A photograph without ranges, its colour cast taken away and its contrast stretched; same shape."""
    linear = srgb_decode(image).astype(np.float64)
    mean = linear.reshape(-1, 3).mean(axis=0)
    # Red, which water takes first, is helped where green is bright, as far as it lags behind.
    linear[..., 0] += max(float(mean[1] - mean[0]), 0.0) * (1.0 - linear[..., 0]) * linear[..., 1]
    flat = linear.reshape(-1, 3)
    grey = flat.mean(axis=0)
    flat = flat * np.clip(grey.mean() / np.maximum(grey, 1e-6), 0.25, 4.0)
    flat *= np.clip(_WHITE / max(float(np.quantile(flat.max(axis=1), 0.99)), 1e-6), 0.5, 4.0)
    lab = cv2.cvtColor(srgb_bytes(srgb_encode(flat.reshape(linear.shape))), cv2.COLOR_RGB2LAB)
    lab[..., 0] = cv2.createCLAHE(clipLimit=1.6, tileGridSize=(8, 8)).apply(np.ascontiguousarray(lab[..., 0]))
    return np.asarray(cv2.cvtColor(lab, cv2.COLOR_LAB2RGB), np.uint8)


def srgb_bytes(values: NDArray[np.float64]) -> Photo8:
    """Encoded values, 0 to 1, as bytes."""
    return np.round(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)
