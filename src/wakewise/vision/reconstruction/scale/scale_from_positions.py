"""A model's scale, and which way is down, from fixes; how sure that is, or why it cannot be told.

Depths alone tell both: they are a linear function of the cameras' places, whose slope is metres down per unit of the
model. With north and east the model comes to lie in their frame. Errors of fixes are taken for independent: one that
all photos share does no harm, one that grows along the way is not seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes

MOST_UNSURE_PCT = 20.0
"""A scale less sure than this is told and not used."""
LEAST_FIXES = 4
FAR_SIGMAS = 4.0
_BEND = 2.0  # sigmas from which residuals count linearly


@dataclass(frozen=True, kw_only=True, eq=False)
class Georeference:
    """Similarity from the model to north, east, down in m: scale, R (3, 3), t (3,); and how well the fixes fit.

    uncertainty_pct: standard deviation of the scale, inf where it is open; off_m: of each photo with a fix, its fix
    less its place, shape (3,), NaN where the fix says nothing; far: photos whose fix is far off by its own uncertainty;
    turned: whether north is known.
    """

    scale: float
    R: Array
    t: Array
    uncertainty_pct: float
    off_m: Mapping[str, Array]
    far: tuple[str, ...]
    turned: bool

    def __post_init__(self) -> None:
        freeze(self, R=(3, 3), t=(3,))

    def rms_m(self, axes: slice) -> float | None:
        """Rms difference along some axes; None without fixes there."""
        off = np.array([one[axes] for one in self.off_m.values()])
        known = off[np.isfinite(off)]
        return float(np.sqrt((known**2).mean())) if known.size else None


def place_by_fixes(centres: Mapping[str, Array], fixes: PositionFixes) -> Georeference:
    """Fit cameras' places in a model, shape (3,) by photo, to fixes.

    Raises
    ------
    InputError
        If too few of the photos have a fix.
    """
    found = {name: fix for name in sorted(centres) if (fix := fixes.of(name)) is not None}
    names = [name for name, fix in found.items() if np.isfinite(fix.place_W_m[2])]
    if len(names) < LEAST_FIXES:
        raise InputError(
            f"fixes: {len(names)} of {len(centres)} registered photos have one with a depth or height, at least "
            f"{LEAST_FIXES} must; the names must be the photos' names"
        )
    points = np.array([centres[name] for name in names])
    places = np.array([found[name].place_W_m for name in names])
    sigmas = np.array([found[name].sigma_m for name in names])
    whole = np.isfinite(places).all(axis=1)
    turned = int(whole.sum()) >= LEAST_FIXES
    scale, R, t, share = _similar(points, places, sigmas) if turned else _sloping(points, places[:, 2], sigmas[:, 2])
    off = places - (scale * points @ R.T + t)
    if not turned:
        off[:, :2] = np.nan
    far = np.nanmax(np.abs(off) / sigmas, axis=1) > FAR_SIGMAS
    return Georeference(
        scale=scale,
        R=R,
        t=t,
        uncertainty_pct=100.0 * share,
        off_m=dict(zip(names, off, strict=True)),
        far=tuple(name for name, one in zip(names, far, strict=True) if one),
        turned=turned,
    )


def why_unused(placed: Georeference) -> str | None:
    """Why the scale is not used; None where it can be."""
    if placed.uncertainty_pct <= MOST_UNSURE_PCT:
        return None
    how = f"{placed.uncertainty_pct:.0f} %" if placed.uncertainty_pct < 1e3 else "more than tenfold"
    what = "differ by more than their uncertainty" if placed.turned else "differ in depth, and not all along one line"
    return f"the scale would be uncertain by {how}, {MOST_UNSURE_PCT:g} % is the most; photos must {what}"


def figures(placed: Georeference, fixes: PositionFixes, used: bool, checks: bool) -> dict[str, Any]:
    """Plain values for JSON."""
    return {
        "used": used,
        "why": why_unused(placed),
        "photos": len(placed.off_m),
        "uncertainty_pct": placed.uncertainty_pct if np.isfinite(placed.uncertainty_pct) else None,
        "model_off_pct": 100.0 * (1.0 / placed.scale - 1.0) if checks else None,
        "horizontal_rms_m": placed.rms_m(slice(0, 2)),
        "depth_rms_m": placed.rms_m(slice(2, 3)),
        "far": list(placed.far),
        "north_known": placed.turned,
        "origin_deg": list(fixes.origin) if fixes.origin is not None and placed.turned else None,
    }


def _sloping(points: Array, depths: Array, sigmas: Array) -> tuple[float, Array, Array, float]:
    """Scale, rotation, shift and relative standard deviation of the scale from depths alone."""
    middle = points.mean(axis=0)
    spread = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    A = np.hstack([(points - middle) / spread, np.ones((len(points), 1))])

    def misfit(x: Array) -> Array:
        return np.asarray((A @ x - depths) / sigmas)

    start = np.linalg.lstsq(A / sigmas[:, None], depths / sigmas, rcond=None)[0]
    fit = least_squares(misfit, start, loss="soft_l1", f_scale=_BEND)
    slope = fit.x[:3]
    size = float(np.linalg.norm(slope))
    covariance = _covariance(fit, len(depths))
    if size == 0.0 or covariance is None:
        return 1.0, np.eye(3), np.zeros(3), float("inf")
    down = slope / size
    share = float(np.sqrt(down @ covariance[:3, :3] @ down)) / size
    R = Rotation.align_vectors([[0.0, 0.0, 1.0]], [down])[0].as_matrix()
    scale = size / spread
    t = -scale * R @ middle
    t[2] += fit.x[3]
    return scale, R, t, share


def _similar(points: Array, places: Array, sigmas: Array) -> tuple[float, Array, Array, float]:
    """Scale, rotation, shift and relative standard deviation of the scale from north, east and down."""
    known = np.isfinite(places)
    whole = known.all(axis=1)
    try:
        first = umeyama(points[whole], places[whole])
    except InputError:  # on one line: the turn about it is open, so is what depths say of the scale
        return 1.0, np.eye(3), np.zeros(3), float("inf")
    middle = points.mean(axis=0)
    spread = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    flat = (points - middle) / spread
    turn = Rotation.from_matrix(first.R_AB)
    begun = first.scale * spread

    def placed(x: Array) -> Array:
        return np.asarray(begun * np.exp(x[0]) * (Rotation.from_rotvec(x[1:4]) * turn).apply(flat) + begun * x[4:])

    def misfit(x: Array) -> Array:
        return np.asarray(((placed(x) - places) / sigmas)[known])

    start = np.concatenate([np.zeros(4), first.apply(middle[None])[0] / begun])
    fit = least_squares(misfit, start, loss="soft_l1", f_scale=_BEND, x_scale="jac")
    covariance = _covariance(fit, int(known.sum()))
    R = (Rotation.from_rotvec(fit.x[1:4]) * turn).as_matrix()
    scale = float(begun * np.exp(fit.x[0]) / spread)
    t = begun * fit.x[4:] - scale * R @ middle
    return scale, R, t, float("inf") if covariance is None else float(np.sqrt(covariance[0, 0]))


def _covariance(fit: Any, count: int) -> Array | None:
    """Covariance of a fit's numbers, larger where fixes scatter more than they say; None where one of them is open.

    The scatter is that of the middle of the residuals, which a few wrong fixes do not move: the median of |r| is .6745
    sigma of a normal one.
    """
    J = fit.jac
    _, sizes, axes = np.linalg.svd(J, full_matrices=False)
    if sizes[-1] <= 1e-9 * sizes[0]:
        return None
    freedom = max(1.0 - len(fit.x) / count, 1.0 / count)
    scatter = float(np.median(np.abs(fit.fun)) / 0.6745) ** 2 / freedom
    return np.asarray((axes.T / sizes**2) @ axes * max(scatter, 1.0))
