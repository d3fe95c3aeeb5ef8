"""Width and strength of the jets from flakes seen twice: maximum likelihood, the depth of each flake unknown.

Of a flake at pixel p the likelihood of its way d is a mixture over its depth z,

    L = sum over z of P(z | blur) [(1 - e) N(d - d0(z) - J(z) v(z) dt; s^2) + e / A],   v = g v_jets(z; slope) + c

with d0 the way of something at rest there (the camera's own motion, from the filter), J the pixels per metre, v_jets
the round jet's water (`wakewise.wake.RoundJet`, all thrusters together) and c the water's own motion, uniform and
steady. s^2 is the noise of pixels and poses and what the jets' own turbulence adds. The current carries a jet's water
along while it is on its way, t = (x^2 + 0.4 L x) / (K sqrt(M)) with L the core's length: a second pass has the jets so
bent by the current that the first one found. P(z | blur) is z^2 times how likely a flake is seen at all there times how
well its disk's radius fits. A share e is taken for mismatched flakes, anywhere within A. Free are slope, g and the
three parts of c, under wide priors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise.vision.imaging.camera import Camera
from wakewise.vision.imaging.particles import FARTHEST_M
from wakewise.wake import RoundJet
from wakewise_paper.flight_fit.flake_tracks import (
    APART_S,
    BLUR_NOISE,
    LEAST_COVER,
    LOST_PX,
    PIXEL_NOISE,
    FlakeTracks,
    blur_radius_px,
    cover,
)

SLOPES = np.array([0.06, 0.075, 0.09, 0.105, 0.12, 0.14, 0.16, 0.18, 0.21, 0.25])
"""Half width slopes at which the jets are computed; in between their water is taken as linear."""
DEPTHS_M = np.linspace(0.06, FARTHEST_M, 28)
POSE_NOISE_PX = 0.3
"""What the filter's error from one frame to the next adds: 0.25 mm at 0.4 m, or 0.6 mrad."""
TURBULENCE = 0.25
"""Fluctuation of each part of the velocity on a jet's axis over the mean there (0.24 to 0.28; Hussein et al. 1994). Off
the axis it falls more slowly than the mean U: 0.25 sqrt(U Uc) is 0.18 Uc where U is half of Uc, as measured there."""
STRAY = 0.05
CURRENT_SPREAD_M_S = 0.2
"""Prior of the current's parts; its vertical one has a twentieth."""
NARROWEST, WIDEST = 0.086, 0.18
"""Slopes of a round jet's and of a propeller's half width that published: the prior, in log, half the range wide."""
_SLOPE_MIDDLE = 0.5 * float(np.log(NARROWEST * WIDEST))
_SLOPE_SPREAD = 0.5 * float(np.log(WIDEST / NARROWEST))
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
        return bool(self.slope_error < (WIDEST - NARROWEST) / np.sqrt(12.0))


@dataclass(frozen=True, eq=False)
class _Table:
    """Per flake and depth: log weights (n, q), rests (n, q, 2), J dt (n, q, 2, 3), jets' water (S, n, q, 3).

    `axis_m_s`, shape (S, n, q), is the greatest speed on a jet's axis at that distance from its disk.
    """

    log_weight: Array
    rest_px: Array
    pixels_per_m_s: Array
    jets_m_s: Array
    axis_m_s: Array


def fit_flight(seen: FlakeTracks, camera: Camera, vehicle: Vehicle, current_m_s: Array | None = None) -> FlightFit:
    """Calibrate the round jet on what was seen.

    Parameters
    ----------
    seen : FlakeTracks
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
    start = np.zeros(3) if current_m_s is None else current_m_s
    straight = _searched(_tabulated(seen, camera, vehicle, np.zeros(3)), start)
    table = _tabulated(seen, camera, vehicle, straight[2:])
    found = _searched(table, straight[2:])
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


def cost(table: _Table, x: Array) -> tuple[float, Array]:
    """Minus log posterior of (log slope, log gain, current), and its gradient, shape (5,)."""
    slope, gain = float(np.exp(x[0])), float(np.exp(x[1]))
    k = int(np.clip(np.searchsorted(SLOPES, slope) - 1, 0, len(SLOPES) - 2))
    width = SLOPES[k + 1] - SLOPES[k]
    share = float(np.clip((slope - SLOPES[k]) / width, 0.0, 1.0))
    wider = table.jets_m_s[k + 1] - table.jets_m_s[k]
    jets = table.jets_m_s[k] + share * wider
    blown = gain * jets
    velocity = blown + x[2:]
    rough = TURBULENCE**2 * 0.5 * np.sum(table.pixels_per_m_s**2, axis=(2, 3))
    wider_axis = table.axis_m_s[k + 1] - table.axis_m_s[k]
    axis = gain * (table.axis_m_s[k] + share * wider_axis)
    speed = np.sqrt(np.sum(blown**2, axis=2) + 1e-12)
    variance = 2.0 * PIXEL_NOISE**2 + POSE_NOISE_PX**2 + rough * speed * axis
    off = table.rest_px - np.einsum("nqij,nqj->nqi", table.pixels_per_m_s, velocity)
    weight = np.exp(table.log_weight)
    square = np.sum(off**2, axis=2)
    normal = (1.0 - STRAY) * np.exp(-0.5 * square / variance) / (2.0 * np.pi * variance)
    density = np.sum(weight * (normal + STRAY / (np.pi * LOST_PX**2)), axis=1)
    share_of = weight * normal / density[:, None]
    by_velocity = -np.einsum("nqi,nqij->nqj", (share_of / variance)[..., None] * off, table.pixels_per_m_s)
    by_variance = share_of * (1.0 - 0.5 * square / variance) / variance
    by_axis = by_variance * rough * speed
    by_blown = by_velocity + (by_variance * rough * axis / speed)[..., None] * blown
    spread = CURRENT_SPREAD_M_S * np.array([1.0, 1.0, _VERTICAL])
    beyond = float(np.log(np.clip(slope, SLOPES[0], SLOPES[-1])) - x[0])
    odd = (x[0] - _SLOPE_MIDDLE) / _SLOPE_SPREAD
    value = 0.5 * (odd**2 + (x[1] / GAIN_SPREAD) ** 2 + float(np.sum((x[2:] / spread) ** 2))) + 1e4 * beyond**2
    inside = 0.0 if beyond else gain * slope / width
    gradient = np.array(
        [
            inside * float(np.sum(by_blown * wider) + np.sum(by_axis * wider_axis))
            + odd / _SLOPE_SPREAD
            - 2e4 * beyond,
            float(np.sum(by_blown * blown) + np.sum(by_axis * axis)) + x[1] / GAIN_SPREAD**2,
            *(by_velocity.sum(axis=(0, 1)) + x[2:] / spread**2),
        ]
    )
    return float(value - np.log(density).sum()), gradient


_SCALE = np.array([0.1, 0.1, 0.01, 0.01, 0.002])
"""Of the search's variables: what changes a likelihood about alike."""


def _searched(table: _Table, start: Array) -> Array:
    """The likeliest (log slope, log gain, current), from the likeliest of the tabulated slopes on."""
    starts = [np.array([np.log(slope), 0.0, *start]) for slope in SLOPES]
    begin = min(starts, key=lambda x: cost(table, x)[0])

    def scaled(y: Array) -> tuple[float, Array]:
        value, gradient = cost(table, begin + _SCALE * y)
        return value, _SCALE * gradient

    ended = minimize(scaled, np.zeros(5), jac=True, method="L-BFGS-B")
    return np.asarray(begin + _SCALE * np.asarray(ended.x))


def _errors(table: _Table, at: Array) -> Array:
    """Standard errors, shape (5,), from the curvature at the solution; infinite where it is none."""
    H = np.empty((5, 5))
    for i, step in enumerate(0.3 * _SCALE):
        ahead, behind = at.copy(), at.copy()
        ahead[i] += step
        behind[i] -= step
        H[i] = (cost(table, ahead)[1] - cost(table, behind)[1]) / (2.0 * step)
    try:
        inverse = np.linalg.inv(0.5 * (H + H.T))
    except np.linalg.LinAlgError:
        return np.full(5, np.inf)
    found = np.diag(inverse)
    return np.asarray(np.where(found > 0.0, np.sqrt(np.maximum(found, 0.0)), np.inf))


def _tabulated(seen: FlakeTracks, camera: Camera, vehicle: Vehicle, current_m_s: Array) -> _Table:
    n, q = len(seen), len(DEPTHS_M)
    rest, slopes = np.empty((n, q, 2)), np.empty((n, q, 2, 3))
    jets = np.zeros((len(SLOPES), n, q, 4))
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
        jets[:, rows] = _jets(models, seen, k, vehicle, at, current_m_s).reshape(len(SLOPES), count, q, 4)
    log_weight = _log_weights(camera, seen.blur_px)
    return _Table(log_weight, rest, APART_S * slopes, jets[..., :3], jets[..., 3])


def _jets(
    models: list[RoundJet], seen: FlakeTracks, k: int, vehicle: Vehicle, points_W_m: Array, current_m_s: Array
) -> Array:
    """Water of all jets, bent by a current, and the greatest speed on an axis there, at points, (models, n, 4)."""
    X_WB, m = seen.X_WB[k], len(vehicle.thrusters)
    origins = X_WB.apply(vehicle.thruster_positions_B_m)
    axes = np.ascontiguousarray(vehicle.thruster_axes_B @ X_WB.R.T)
    out = np.zeros((len(models), len(points_W_m), 4))
    for j in np.flatnonzero(seen.pushes_N[k] > 0.0):
        i, sign = int(j) % m, -1.0 if j < m else 1.0
        direction, area, thrust = sign * axes[i], vehicle.disk_areas_m2[i : i + 1], float(seen.pushes_N[k, j])
        along = np.maximum((points_W_m - origins[i]) @ direction, 0.0)
        for row, model in enumerate(models):
            core = model.decay * np.sqrt(area[0])
            travel_s = along * (along + 0.4 * core) / (model.decay * np.sqrt(thrust / model.water_density_kg_m3))
            straight = points_W_m - travel_s[:, None] * current_m_s
            speed = model.split_speed(straight, origins[i : i + 1], -direction[None], area)[:, 0]
            out[row, :, :3] += np.sqrt(thrust) * speed[:, None] * direction
            out[row, :, 3] = np.maximum(out[row, :, 3], model.speed(along, 0.0, thrust, area[0]))
    return out


def _log_weights(camera: Camera, blur_px: Array) -> Array:
    """Log of P(z | blur) at the depths, shape (n, q): space, visibility and the disk's radius."""
    depth, size = np.meshgrid(DEPTHS_M, _SIZES, indexing="ij")
    share = np.exp(-0.5 * _SIZES**2) * (cover(camera, depth.ravel(), size.ravel()) > LEAST_COVER).reshape(depth.shape)
    radius = blur_radius_px(camera, depth.ravel(), size.ravel()).reshape(depth.shape)
    fits = np.exp(-0.5 * ((blur_px[:, None, None] - radius) / BLUR_NOISE) ** 2)
    weight = np.log(np.maximum(np.sum(share * fits, axis=2), 1e-300)) + 2.0 * np.log(DEPTHS_M)
    return np.asarray(weight - logsumexp(weight, axis=1, keepdims=True))
