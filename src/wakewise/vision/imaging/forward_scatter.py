"""Forward scattering by silt: light that grains diffract by small angles is blurred, not lost.

Grains much larger than a wavelength have an extinction of twice their cross-section. Half of it is diffraction into the
lobe of a hole of their size (Babinet; van de Hulst 1957, Light Scattering by Small Particles, chapter 8). Direct
signal, forward scatter and backscatter are those of McGlamery 1980 (Proc. SPIE 208, 221) and Jaffe 1990 (doi
10.1109/48.50695).

A ray scattered at a share s of its way from the camera is seen aside by (1 - s) times its turn. The number of turns has
a Poisson distribution, and their variances add. Of light with an optical depth tau, half of it diffraction, exp(-tau)
arrives straight and exp(-tau) (exp(tau / 2) - 1) blurred. The lobe is a Gaussian as wide as the Airy pattern; the
blurred light of a pixel is one Gaussian with its mean variance.
"""

from __future__ import annotations

import math
from typing import Any, cast

import cv2
import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.renderer import BAND_ROWS, Image, in_threads

FORWARD_SHARE = 0.5
"""Diffraction's share of what a large grain takes from a beam."""
WAVELENGTH_M = 0.54e-6 / 1.34
"""Of green light in water; red and blue lobes are 15 % wider and narrower."""
LOBE = 0.45
"""Standard deviation per axis of the Gaussian nearest to Airy's pattern, in wavelengths over the diameter.

That is 0.225 wavelengths over the numerical aperture (Zhang, Zerubia, Olivo-Marin 2007, doi 10.1364/AO.46.001819).
"""
_SHARP_PX2 = 0.02  # a blur of so small a variance is none
_FAINT = 0.002  # half a grey level of 255: blurring less than this of the light shows nowhere
_STEPS = np.array([0.0, 1 / 16, 1 / 4, 1.0])  # variances of the blurs that are made, over the largest


def lobe_rad(diameter_m: float) -> float:
    """Standard deviation per axis of the angle by which a grain diffracts light in water."""
    return LOBE * WAVELENGTH_M / diameter_m


def mean_square_lever(ranges_m: Array, silt_tau: Image, length_m: Image) -> Image:
    """Mean of (1 - s)^2 over the grains on rays of lengths (h', w'), s their share of the way; 1/3 if they are even.

    `ranges_m` has shape (k,). `silt_tau`, shape (h' + 1, w' + 1, k): optical depth from the camera up to each range.
    `length_m` has shape (h', w').
    """
    tau = silt_tau[: length_m.shape[0], : length_m.shape[1]].astype(np.float64)
    steps = np.diff(ranges_m)

    def sums(values: Array) -> Array:
        """Running integral along each ray by the trapezium rule."""
        areas = np.cumsum(0.5 * (values[..., 1:] + values[..., :-1]) * steps, axis=-1)
        return np.concatenate([np.zeros((*values.shape[:-1], 1)), areas], axis=-1)

    # By parts: the integral of c (1 - l / R)^2 is 2 / R times that of tau (1 - l / R).
    first, second = sums(tau), sums(tau * ranges_m)
    reach = np.maximum(ranges_m, 1e-9)
    lever = 2.0 / reach * (first - second / reach) / np.maximum(tau, 1e-12)
    place = np.clip(np.searchsorted(ranges_m, length_m), 1, len(ranges_m) - 1)[..., None]
    found = np.take_along_axis(lever, place, axis=-1)[..., 0]
    known = np.take_along_axis(tau, place, axis=-1)[..., 0] > 1e-9
    return cast(Image, np.where(known, np.clip(found, 0.0, 1.0), 1 / 3).astype(np.float32))


def forward_scattered(signal: Image, tau: Image, lever: Image, lobe_px: float) -> Image:
    """What diffraction adds to a signal that has come through grains.

    `signal`, shape (h, w, 3): what arrives straight, attenuated by exp(-tau). `tau`, shape (h, w): the grains' optical
    depth of each pixel's ray. `lever`, shape (h', w'): see `mean_square_lever`; stretched over the image. `lobe_px`:
    standard deviation of one turn near the camera, in pixels. Returns shape (h, w, 3): its sum is that of
    signal times (exp(tau / 2) - 1): what leaves one pixel arrives at others.
    """
    h, w = tau.shape
    # No pixel's light is spread wider than the thickest water before the lens would.
    thickest = FORWARD_SHARE * float(tau.max(initial=0.0))
    largest = lobe_px**2 * float(lever.max(initial=0.0)) * _mean_turns(thickest)
    if largest < _SHARP_PX2 or thickest < _FAINT:
        return cast(Image, signal * np.expm1(np.float32(FORWARD_SHARE) * tau)[..., None])
    wide = cv2.resize(lever, (w, h), interpolation=cv2.INTER_LINEAR)
    parts = np.empty((len(_STEPS), h, w, 3), np.float32)

    def band(first: int) -> None:
        _part(first, min(first + BAND_ROWS, h), signal, tau, wide, lobe_px**2 / max(largest, 1e-12), _STEPS, parts)

    in_threads(band, range(0, h, BAND_ROWS))
    out = parts[0]
    for k in range(1, len(_STEPS)):
        out += blurred(parts[k], _STEPS[k] * largest)
    return out


@njit
def _mean_turns(turns: float) -> float:
    """Mean number of turns of light that was turned at all, t exp(t) / (exp(t) - 1) of Poisson's law."""
    return turns / (1.0 - math.exp(-turns)) if turns > 1e-4 else 1.0


@njit(nogil=True)
def _part(first: int, last: int, signal: Any, tau: Any, lever: Any, scale: float, steps: Any, parts: Any) -> None:
    """Share what each pixel scatters, in rows first..last-1, among the two blurs whose variances lie round its own."""
    highest = steps.shape[0] - 2
    for y in range(first, last):
        for x in range(tau.shape[1]):
            turns = FORWARD_SHARE * tau[y, x]
            share = math.exp(turns) - 1.0
            place = min(scale * lever[y, x] * _mean_turns(turns), 1.0)
            k = 0
            while k < highest and place > steps[k + 1]:
                k += 1
            upper = (place - steps[k]) / (steps[k + 1] - steps[k])
            for n in range(steps.shape[0]):
                weight = share * (1.0 - upper) if n == k else (share * upper if n == k + 1 else 0.0)
                for c in range(3):
                    parts[n, y, x, c] = weight * signal[y, x, c]


def blurred(image: Image, variance_px2: float) -> Image:
    """A Gaussian blur that keeps the sum, made on a smaller image where it is wide; borders reflect."""
    if variance_px2 < _SHARP_PX2:
        return image
    h, w = image.shape[:2]
    by = int(np.clip(math.sqrt(variance_px2) / 1.5, 1, min(h, w)))
    if by == 1:
        return cast(Image, cv2.GaussianBlur(image, (0, 0), math.sqrt(variance_px2), borderType=cv2.BORDER_REFLECT))
    padded = cv2.copyMakeBorder(image, 0, -h % by, 0, -w % by, cv2.BORDER_REFLECT)
    size = padded.shape[1] // by, padded.shape[0] // by
    small = cv2.resize(padded, size, interpolation=cv2.INTER_AREA)
    # Means over squares and straight lines between them blur as well: by^2 / 12 and by^2 / 6.
    left = (variance_px2 - by**2 / 4) / by**2
    small = cv2.GaussianBlur(small, (0, 0), math.sqrt(left), borderType=cv2.BORDER_REFLECT)
    large = cv2.resize(small, (padded.shape[1], padded.shape[0]), interpolation=cv2.INTER_LINEAR)
    return cast(Image, large[:h, :w])
