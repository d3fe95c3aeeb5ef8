"""Offset between a camera's clock and a log's, by the image motion that the log predicts and that pictures show.

Four quantities describe the motion of a picture: shift of its middle to the right and down, rotation, and scale. For a
camera with velocity v and rate w in its own axes (right, down, ahead), before a surface at the distance Z:

    u' = -v_x / Z - w_y,   v' = -v_y / Z + w_x,   rotation' = -w_z,   (log scale)' = v_z / Z

(H. C. Longuet-Higgins and K. Prazdny, Proc. R. Soc. B 208, 1980, doi 10.1098/rspb.1980.0057, at the picture's middle).
Their integrals between the times of two pictures are compared with what is measured, for each offset. The shift is a
complex number, so that neither the focal length nor a turn of the camera about its axis matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import Progress, no_progress
from wakewise.vision.photo_selection.dive_track import DiveTrack, camera_poses, poses_at

GRID_S, COARSE_S, FINE_S = 0.05, 0.25, 0.01
"""Steps of the log's motion, and of the offsets tried first and about the best ones."""
LONGEST_PAIR_S = 10.0
LEAST_PAIRS, LEAST_SHARE = 10, 0.5
"""Measured motions that must lie in the log: at least so many, and so large a share."""
LEAST_CORRELATION, LEAST_SHIFT, HIGHEST_SECOND, LEAST_EVIDENCE = 0.4, 0.3, 0.7, 6.0
"""An offset is ambiguous if no quantity correlates so much, or the shift alone so much, the second peak's
log-likelihood is a larger share of the best one's, or it is not less by so much."""
MOST_DRIFT_S = 0.5
"""An offset is also ambiguous if its standard deviation, or its change from half to half of the dive, is larger."""
LEAST_SIGMA_S = 0.02
"""The standard deviation is not below this, to which the model of the motion was found to be good."""
_BLOCKS, _COARSE_PAIRS, _CELLS = 8, 800, 400_000
_QUANTITIES = ("shift", "rotation", "scale")


@dataclass(frozen=True, kw_only=True)
class ClockOffset:
    """Seconds to add to the camera's clock for the log's, its standard deviation, and how sure it is.

    `correlation`: by quantity (shift, rotation, scale). `second_offset_s` and `second_share`: the next best offset and
    its log-likelihood as a share of the best one's. `focal_widths`: focal length in widths of the picture, as measured
    shift over predicted angle. `ambiguous`: why the offset is not to be trusted, None if it is.
    """

    offset_s: float
    sigma_s: float
    pairs: int
    correlation: dict[str, float]
    second_offset_s: float | None
    second_share: float
    focal_widths: float
    ambiguous: str | None


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedMotion:
    """Integrals on a grid of `GRID_S` from `first_s` of the log, shape (n, 6).

    They are of the four rates, of the number of gaps, and of the part of the scale that changes of the depth make.
    """

    first_s: float
    integral: Array

    @property
    def last_s(self) -> float:
        """Time of the log at the grid's end."""
        return self.first_s + GRID_S * (len(self.integral) - 1)

    def between(self, first_s: Array, last_s: Array) -> tuple[Array, BoolArray]:
        """Motion from one time to another of the log, shape (..., 4), and where it is known."""
        begin, known_begin = self._at(first_s)
        end, known_end = self._at(last_s)
        return end[..., :4] - begin[..., :4], known_begin & known_end & (end[..., 4] - begin[..., 4] < 0.5)

    def climbed(self, first_s: Array, last_s: Array) -> Array:
        """Part of the scale that changes of the depth make, from one time to another of the log."""
        return self._at(last_s)[0][..., 5] - self._at(first_s)[0][..., 5]

    def _at(self, time_s: Array) -> tuple[Array, BoolArray]:
        place = (time_s - self.first_s) / GRID_S
        inside = (place >= 0.0) & (place <= len(self.integral) - 1)
        cell = np.clip(place.astype(np.int64), 0, len(self.integral) - 2)
        share = np.clip(place - cell, 0.0, 1.0)[..., None]
        return (1.0 - share) * self.integral[cell] + share * self.integral[cell + 1], inside


def predict_motion(track: DiveTrack, X_BC: Pose, distance_m: float) -> PredictedMotion:
    """Image motion along a dive; `distance_m` is to the surface where the log has no altitude above it."""
    count = max(int((track.time_s[-1] - track.time_s[0]) / GRID_S), 2)
    time_s = track.time_s[0] + GRID_S * np.arange(count + 1)
    poses = poses_at(track, np.minimum(time_s, track.time_s[-1]))
    centre, R_WC = camera_poses(poses, X_BC)
    turn_B = rotvec_from_quat(quat_multiply(quat_conjugate(poses.q_WB[:-1]), poses.q_WB[1:]))
    turn = turn_B @ X_BC.R
    step = np.einsum("nji,nj->ni", R_WC[:-1], np.diff(centre, axis=0))
    down = np.maximum(R_WC[:-1, 2, 2], 0.3)
    depth = np.where(np.isfinite(poses.altitude_m[:-1]), poses.altitude_m[:-1] / down, distance_m)
    depth = np.maximum(depth, 0.1)
    steps = np.column_stack(
        [-step[:, 0] / depth - turn[:, 1], -step[:, 1] / depth + turn[:, 0], -turn[:, 2], step[:, 2] / depth]
    )
    gap = ~(poses.known[:-1] & poses.known[1:])
    climb = R_WC[:-1, 2, 2] * np.diff(poses.position_W_m[:, 2]) / depth
    steps[gap] = climb[gap] = 0.0
    whole = np.cumsum(np.column_stack([steps, gap, climb]), axis=0)
    return PredictedMotion(first_s=float(time_s[0]), integral=np.vstack([np.zeros(6), whole]))


def find_offset(
    predicted: PredictedMotion,
    time_s: Array,
    motion: Array,
    window_s: tuple[float, float] | None,
    progress: Progress = no_progress,
) -> ClockOffset:
    """Offset of the log's clock from the camera's.

    `time_s`, shape (n,), rising: of the pictures, by the camera's clock. `motion`, shape (n - 1, 4): of
    `picture_statistics`. `window_s`: least and greatest offset, None for all with which pictures lie in the log. Raises
    InputError if too few motions were measured, or no allowed offset lays the pictures into the log.
    """
    first_s, last_s = time_s[:-1], time_s[1:]
    good = np.isfinite(motion).all(axis=1) & (last_s > first_s) & (last_s - first_s <= LONGEST_PAIR_S)
    if good.sum() < LEAST_PAIRS:
        raise InputError(
            f"photos: the motion from one to the next is seen {int(good.sum())} times (they must overlap, at most "
            f"{LONGEST_PAIR_S:g} s apart); {LEAST_PAIRS} are needed to find the clock's offset; state it with --offset"
        )
    pairs = _Pairs(first_s[good], last_s[good], _clipped(halfway(motion[good])))
    low, high = predicted.first_s - float(time_s[-1]), predicted.last_s - float(time_s[0])
    if window_s is not None:
        low, high = max(low, window_s[0]), min(high, window_s[1])
    offsets: Array = COARSE_S * np.arange(math.ceil(low / COARSE_S), math.floor(high / COARSE_S) + 1.0)
    thin = pairs.part(np.unique(np.linspace(0, len(pairs.first_s) - 1, _COARSE_PAIRS).astype(int)))
    score = _scores(predicted, thin, offsets, progress)
    if not np.isfinite(score).any():
        raise InputError(
            "photos and log do not overlap in time: with no allowed clock offset are half of the photos within the "
            f"log (photos last {time_s[-1] - time_s[0]:.0f} s, the log {predicted.last_s - predicted.first_s:.0f} s); "
            "state it with --offset, or allow more with --window"
        )
    if not (score > 0.0).any():
        raise InputError("log: holds no motion like that of the photos; is it of this dive, and did the vehicle move?")
    best = _refined(predicted, pairs, float(offsets[np.argmax(score)]), 2.0 * COARSE_S)
    left, known, _ = _residuals(predicted, pairs, best)
    # Those beyond five times the median residual were matched wrongly.
    pairs = pairs.part(known & (np.abs(left) <= 5.0 * np.median(np.abs(left[known])) + 1e-6))
    best = _refined(predicted, pairs, best, COARSE_S)
    correlation = _correlations(predicted, pairs, np.array([best]))[0]
    at = int(np.argmin(np.abs(offsets - best)))
    others = _outside_peak(score, at)
    second = int(np.argmax(np.where(others, score, -np.inf))) if others.any() else None
    share = max(float(score[second] / score[at]), 0.0) if second is not None and score[at] > 0.0 else 0.0
    evidence = (1.0 - share) * float(score[at]) if len(pairs.first_s) >= LEAST_PAIRS else 0.0
    told = {name: float(value) for name, value in zip(_QUANTITIES, correlation[0], strict=True)}
    climb = _climb_correlation(predicted, pairs, best)
    sigma_s = _jackknife(predicted, pairs, best)
    half = pairs.first_s > np.median(pairs.first_s)
    begin, end = (_refined(predicted, pairs.part(side), best, 4.0 * MOST_DRIFT_S) for side in (~half, half))
    drift = f"it goes from {begin:+.1f} s in the first half to {end:+.1f} s in the second (standard deviation "
    drift += f"{sigma_s:.1f} s): --interval or the camera's clock is wrong"
    drifts = max(abs(end - begin), sigma_s) > MOST_DRIFT_S
    return ClockOffset(
        offset_s=best,
        sigma_s=sigma_s,
        pairs=len(pairs.first_s),
        correlation=told,
        second_offset_s=None if second is None else float(offsets[second]),
        second_share=share,
        focal_widths=_residuals(predicted, pairs, best)[2],
        ambiguous=_doubt(told | {"climb": climb}, share, evidence, len(pairs.first_s)) or (drift if drifts else None),
    )


def _doubt(correlation: dict[str, float], share: float, evidence: float, count: int) -> str | None:
    best = max(correlation[name] for name in _QUANTITIES)
    up = "z_m must rise with depth"
    for quantity, wrong in (("rotation", "heading must rise clockwise"), ("scale", up), ("climb", up)):
        if correlation[quantity] < -max(LEAST_CORRELATION, 4.0 / math.sqrt(max(count, 1))):  # four sigmas of chance
            return (
                f"the {quantity} of the photos is against the log's (correlation {correlation[quantity]:.2f}); {wrong}"
            )
    if best < LEAST_CORRELATION:
        return f"the motion in the photos is not that of the log (correlation {best:.2f} at best)"
    if share > HIGHEST_SECOND:
        return f"another offset fits nearly as well ({100 * share:.0f} % of the best one's log-likelihood)"
    if correlation["shift"] < LEAST_SHIFT:
        return f"the photos turn as the log says, and do not shift as it says (correlation {correlation['shift']:.2f})"
    return "too little motion was seen to tell offsets apart" if evidence < LEAST_EVIDENCE else None


@dataclass(frozen=True, eq=False)
class _Pairs:
    first_s: Array
    last_s: Array
    motion: Array

    def part(self, which: Any) -> _Pairs:
        return _Pairs(self.first_s[which], self.last_s[which], self.motion[which])


def halfway(motion: Array) -> Array:
    """Motions, shape (k, 4), with the shift in the camera's axes half way between two pictures, along the arc.

    At constant rates a picture that turns by the angle a shifts by exp(i a / 2) sin(a / 2) / (a / 2) times the integral
    of the rate of its shift.
    """
    half = 0.5 * motion[:, 2]
    shift = (motion[:, 0] + 1j * motion[:, 1]) * np.exp(-1j * half) / np.sinc(half / np.pi)
    return np.column_stack([shift.real, shift.imag, motion[:, 2:]])


def _clipped(motion: Array) -> Array:
    """Motions within three times the 90th percentile of their distance from the median: wrong matches weigh less."""
    middle = np.median(motion, axis=0)
    reach = 3.0 * np.quantile(np.abs(motion - middle), 0.9, axis=0) + 1e-9
    return np.asarray(middle + np.clip(motion - middle, -reach, reach))


def _correlations(predicted: PredictedMotion, pairs: _Pairs, offsets: Array) -> tuple[Array, Array]:
    """Correlation of shift, rotation and scale at offsets, shape (m, 3), and how many pairs each has, (m,)."""
    expected, known = predicted.between(offsets[:, None] + pairs.first_s, offsets[:, None] + pairs.last_s)
    weight = known.astype(np.float64)
    count = weight.sum(axis=1)
    seen = pairs.motion
    columns = []
    for a, b in (
        (expected[..., 0] + 1j * expected[..., 1], seen[:, 0] + 1j * seen[:, 1]),
        (expected[..., 2], seen[:, 2]),
        (expected[..., 3], seen[:, 3]),
    ):
        n = np.maximum(count, 1.0)
        mean_a, mean_b = (weight * a).sum(axis=1) / n, (weight @ b) / n
        product = (weight * a.conj() * b).sum(axis=1) / n - mean_a.conj() * mean_b
        spread_a = (weight * np.abs(a) ** 2).sum(axis=1) / n - np.abs(mean_a) ** 2
        spread_b = (weight @ np.abs(b) ** 2) / n - np.abs(mean_b) ** 2
        size = np.abs(product) if np.iscomplexobj(product) else product
        # Below a thousandth of a width or of a radian nothing moved.
        moved = (spread_a > 1e-8) & (spread_b > 1e-8)
        columns.append(np.where(moved, size / np.sqrt(np.where(moved, spread_a * spread_b, 1.0)), 0.0))
    return np.clip(np.column_stack(columns), -0.9999, 0.9999), count


def _climb_correlation(predicted: PredictedMotion, pairs: _Pairs, offset_s: float) -> float:
    """Partial correlation of the measured scale with the log's climb, given the rest of the predicted scale.

    The rest is speed times pitch. With both of a size, that of the whole scale is near 0 in a log whose z is up.
    """
    first_s, last_s = offset_s + pairs.first_s, offset_s + pairs.last_s
    expected, known = predicted.between(first_s, last_s)
    climb = predicted.climbed(first_s, last_s)
    rest = np.column_stack([np.ones(len(climb)), expected[:, 3] - climb])[known]
    left = np.column_stack([climb, pairs.motion[:, 3]])[known]
    left = left - rest @ np.linalg.lstsq(rest, left, rcond=None)[0]
    spread = np.sqrt((left**2).mean(axis=0))
    # Below a thousandth nothing climbed.
    return float((left[:, 0] * left[:, 1]).mean() / (spread[0] * spread[1])) if spread.min() > 1e-3 else 0.0


def _scores(predicted: PredictedMotion, pairs: _Pairs, offsets: Array, progress: Progress = no_progress) -> Array:
    """Log-likelihood of offsets, shape (m,): Gaussian errors of unknown size in each quantity; -inf off the log."""
    size = max(1, _CELLS // max(len(pairs.first_s), 1))
    needed = max(0.5 * LEAST_PAIRS, LEAST_SHARE * len(pairs.first_s))
    out = np.full(len(offsets), -np.inf)
    for start in range(0, len(offsets), size):
        progress(start, len(offsets), "offset")
        correlation, count = _correlations(predicted, pairs, offsets[start : start + size])
        gain = -0.5 * count * (np.log1p(-(np.maximum(correlation, 0.0) ** 2)) @ np.array([2.0, 1.0, 1.0]))
        out[start : start + size] = np.where(count >= needed, gain, -np.inf)
    return out


def _refined(predicted: PredictedMotion, pairs: _Pairs, about_s: float, reach_s: float) -> float:
    """Best offset near one, on a fine grid, then at the top of the parabola through the best three."""
    steps: Array = FINE_S * np.arange(-math.ceil(reach_s / FINE_S), math.ceil(reach_s / FINE_S) + 1.0)
    score = _scores(predicted, pairs, about_s + steps)
    k = int(np.argmax(score))
    if not 0 < k < len(score) - 1 or not np.isfinite(score[k - 1 : k + 2]).all():
        return about_s + float(steps[k])
    before, top, after = score[k - 1 : k + 2]
    bend = before - 2.0 * top + after
    return about_s + float(steps[k]) + (0.5 * FINE_S * float((before - after) / bend) if bend < 0.0 else 0.0)


def _residuals(predicted: PredictedMotion, pairs: _Pairs, offset_s: float) -> tuple[Any, BoolArray, float]:
    """Measured shift less a multiple of the predicted one, complex, shape (k,); which are known; the multiple."""
    expected, known = predicted.between(offset_s + pairs.first_s, offset_s + pairs.last_s)
    a, b = expected[:, 0] + 1j * expected[:, 1], pairs.motion[:, 0] + 1j * pairs.motion[:, 1]
    a, b = a - a[known].mean(), b - b[known].mean()
    factor = np.vdot(a[known], b[known]) / max(float(np.vdot(a[known], a[known]).real), 1e-12)
    return b - factor * a, known, float(abs(factor))


def _outside_peak(score: Array, at: int) -> BoolArray:
    """Offsets beyond the peak: from where the score first falls below half on either side, and two seconds further."""
    number, margin = np.arange(len(score)), 2.0 / COARSE_S
    low = number[(score < 0.5 * score[at]) & (number < at)].max(initial=0)
    high = number[(score < 0.5 * score[at]) & (number > at)].min(initial=len(score))
    return np.asarray(((number < low - margin) | (number > high + margin)) & np.isfinite(score))


def _jackknife(predicted: PredictedMotion, pairs: _Pairs, offset_s: float) -> float:
    """Standard deviation of the offset in s, from blocks of pairs left out in turn; at least `LEAST_SIGMA_S`."""
    block = np.arange(len(pairs.first_s)) * _BLOCKS // len(pairs.first_s)
    found = np.array([_refined(predicted, pairs.part(block != k), offset_s, 2 * COARSE_S) for k in range(_BLOCKS)])
    return max(math.sqrt((_BLOCKS - 1) * float(np.mean((found - found.mean()) ** 2))), LEAST_SIGMA_S)
