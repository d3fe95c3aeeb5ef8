"""Width and strength of the jets from flakes seen twice: maximum likelihood, the depth of each flake unknown.

Of a flake at pixel p the likelihood of its way d is a mixture over its depth z,

    L = sum over z of P(z | blur) [(1 - e) N(d - d0(z) - J(z) v(z) dt; s^2) + e / A],   v = g v_jets(z; slope) + c

with d0 the way of something at rest there (the camera's own motion, from the filter), J the pixels per metre, v_jets
the round jet's water (`wakewise.wake.RoundJet`, all thrusters together) and c the water's own motion, uniform and
steady. P(z | blur) is z^2 times how likely a flake is seen at all there times how well its disk's radius fits. A share
e is taken for mismatched flakes, anywhere within A. Free are slope, g and the three parts of c, the last under a prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.imaging.camera import Camera
from wakewise.imaging.particles import FARTHEST_M
from wakewise.studies.flight_fit.sightings import (
    APART_S,
    BLUR_NOISE,
    LEAST_COVER,
    LOST_PX,
    PIXEL_NOISE,
    Sightings,
    blur_radius_px,
    cover,
)
from wakewise.vehicles import Vehicle
from wakewise.wake import RoundJet

SLOPES = np.array([0.06, 0.075, 0.09, 0.105, 0.12, 0.14, 0.16, 0.18, 0.21, 0.25])
"""Half width slopes at which the jets are computed; in between their water is taken as linear."""
DEPTHS_M = np.linspace(0.08, FARTHEST_M, 14)
POSE_NOISE_PX = 0.8
"""What the filter's error from one frame to the next adds: half a millimetre and a third of a milliradian at 0.3 m."""
STRAY = 0.05
CURRENT_SPREAD_M_S = 0.2
"""Prior of the current's parts; its vertical one has a twentieth."""
GAIN_SPREAD = 0.3
"""Prior of the strength about 1, in log: thrusts are known within a third."""
_VERTICAL = 0.05
_SIZES = np.linspace(-2.5, 2.5, 11)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightFit:
    """What was found: slope of the half width, strength, the water's own motion, shape (3,), and standard errors.

    `current_m_s` is what the fit took the current for.
    """

    half_width_slope: float
    gain: float
    current_m_s: Array
    slope_error: float
    gain_error: float
    flakes: int

    @property
    def told(self) -> bool:
        """Whether the slope is known better than that it lies between a round jet's, .086, and a propeller's, .18."""
        return bool(self.slope_error < (0.18 - 0.086) / np.sqrt(12.0))


@dataclass(frozen=True, eq=False)
class _Table:
    """Per flake and depth: log weights (n, q), rests (n, q, 2), J dt (n, q, 2, 3), jets' water (S, n, q, 3)."""

    log_weight: Array
    rest_px: Array
    pixels_per_m_s: Array
    jets_m_s: Array


def fit_flight(seen: Sightings, camera: Camera, vehicle: Vehicle, current_m_s: Array | None = None) -> FlightFit:
    """Calibrate the round jet on what was seen.

    Parameters
    ----------
    seen : Sightings
    camera : Camera
    vehicle : Vehicle
        As it is believed to be.
    current_m_s : ndarray, shape (3,), or None
        Where the search for the water's own motion starts.

    Raises
    ------
    InputError
        If fewer than 50 flakes were seen twice.
    """
    if len(seen) < 50:
        raise InputError(f"flight calibration: {len(seen)} flakes seen twice, needs 50 or more; fly on or nearer")
    table = _tabulated(seen, camera, vehicle)
    start = np.zeros(3) if current_m_s is None else current_m_s
    starts = [np.array([np.log(slope), 0.0, *start]) for slope in (0.08, 0.13, 0.2)]
    found = min((_searched(table, x) for x in starts), key=lambda pair: pair[1])[0]
    errors = _errors(table, found)
    slope = float(np.exp(found[0]))
    gain = float(np.exp(found[1]))
    return FlightFit(
        half_width_slope=slope,
        gain=gain,
        current_m_s=found[2:],
        slope_error=slope * float(errors[0]),
        gain_error=gain * float(errors[1]),
        flakes=len(seen),
    )


def cost(table: _Table, x: Array) -> float:
    """Minus log posterior of (log slope, log gain, current)."""
    variance = 2.0 * PIXEL_NOISE**2 + POSE_NOISE_PX**2
    at = np.interp(np.exp(x[0]), SLOPES, np.arange(len(SLOPES), dtype=np.float64))
    k = min(int(at), len(SLOPES) - 2)
    jets = (k + 1 - at) * table.jets_m_s[k] + (at - k) * table.jets_m_s[k + 1]
    velocity = np.exp(x[1]) * jets + x[2:]
    off = table.rest_px - np.einsum("nqij,nqj->nqi", table.pixels_per_m_s, velocity)
    normal = (1.0 - STRAY) * np.exp(-0.5 * np.sum(off**2, axis=2) / variance) / (2.0 * np.pi * variance)
    density = np.sum(np.exp(table.log_weight) * (normal + STRAY / (np.pi * LOST_PX**2)), axis=1)
    spread = CURRENT_SPREAD_M_S * np.array([1.0, 1.0, _VERTICAL])
    prior = 0.5 * (x[1] / GAIN_SPREAD) ** 2 + 0.5 * float(np.sum((x[2:] / spread) ** 2))
    beyond = max(0.0, float(np.log(SLOPES[0]) - x[0]), float(x[0] - np.log(SLOPES[-1])))
    return float(prior - np.log(density).sum() + 1e4 * beyond**2)


_SCALE = np.array([0.1, 0.1, 0.01, 0.01, 0.002])
"""Of the search's first steps."""


def _searched(table: _Table, start: Array) -> tuple[Array, float]:
    def scaled(y: Array) -> float:
        return cost(table, start + _SCALE * y)

    found = minimize(scaled, np.zeros(5), method="Powell", tol=1e-6)
    return start + _SCALE * np.asarray(found.x), float(found.fun)


def _errors(table: _Table, at: Array) -> Array:
    """Standard errors, shape (5,), from the curvature at the solution; infinite where it is none."""
    step = 0.3 * _SCALE
    H = np.empty((5, 5))
    for i in range(5):
        for j in range(i, 5):
            total = 0.0
            for a in (1.0, -1.0):
                for b in (1.0, -1.0):
                    x = at.copy()
                    x[i] += a * step[i]
                    x[j] += b * step[j]
                    total += a * b * cost(table, x)
            H[i, j] = H[j, i] = total / (4.0 * step[i] * step[j])
    try:
        inverse = np.linalg.inv(H)
    except np.linalg.LinAlgError:
        return np.full(5, np.inf)
    found = np.diag(inverse)
    return np.asarray(np.where(found > 0.0, np.sqrt(np.maximum(found, 0.0)), np.inf))


def _tabulated(seen: Sightings, camera: Camera, vehicle: Vehicle) -> _Table:
    n, q = len(seen), len(DEPTHS_M)
    rest, slopes = np.empty((n, q, 2)), np.empty((n, q, 2, 3))
    jets = np.zeros((len(SLOPES), n, q, 3))
    models = [RoundJet(half_width_slope=float(s)) for s in SLOPES]
    bounds = np.searchsorted(seen.pair, np.arange(len(seen.times_s) + 1))
    for k in range(len(seen.times_s)):
        rows = slice(int(bounds[k]), int(bounds[k + 1]))
        count = rows.stop - rows.start
        if count == 0:
            continue
        first = np.repeat(seen.first_px[rows], q, axis=0)
        at = seen.X_WC[k].apply(camera.unproject(first, np.tile(DEPTHS_M, count)))
        after = seen.X_WC_next[k].inverse()
        still = camera.project(after.apply(at))
        rest[rows] = seen.moved_px[rows][:, None] - (still - first).reshape(count, q, 2)
        for axis in range(3):
            shifted = at.copy()
            shifted[:, axis] += 1e-4
            slopes[rows, :, :, axis] = (camera.project(after.apply(shifted)) - still).reshape(count, q, 2) / 1e-4
        jets[:, rows] = _jets(models, seen, k, vehicle, at).reshape(len(SLOPES), count, q, 3)
    log_weight = _log_weights(camera, seen.blur_px)
    return _Table(log_weight, rest, APART_S * slopes, jets)


def _jets(models: list[RoundJet], seen: Sightings, k: int, vehicle: Vehicle, points_W_m: Array) -> Array:
    """Water of all jets at points, shape (models, n, 3)."""
    X_WB = seen.X_WB[k]
    origins = X_WB.apply(vehicle.thruster_positions_B_m)
    axes = np.ascontiguousarray(vehicle.thruster_axes_B @ X_WB.R.T)
    along = np.concatenate([-axes, axes])
    roots = np.sqrt(seen.pushes_N[k])
    return np.stack(
        [(model.split_speed(points_W_m, origins, axes, vehicle.disk_areas_m2) * roots) @ along for model in models]
    )


def _log_weights(camera: Camera, blur_px: Array) -> Array:
    """Log of P(z | blur) at the depths, shape (n, q): space, visibility and the disk's radius."""
    depth, size = np.meshgrid(DEPTHS_M, _SIZES, indexing="ij")
    share = np.exp(-0.5 * _SIZES**2) * (cover(camera, depth.ravel(), size.ravel()) > LEAST_COVER).reshape(depth.shape)
    radius = blur_radius_px(camera, depth.ravel(), size.ravel()).reshape(depth.shape)
    fits = np.exp(-0.5 * ((blur_px[:, None, None] - radius) / BLUR_NOISE) ** 2)
    weight = np.log(np.maximum(np.sum(share * fits, axis=2), 1e-300)) + 2.0 * np.log(DEPTHS_M)
    return np.asarray(weight - logsumexp(weight, axis=1, keepdims=True))
