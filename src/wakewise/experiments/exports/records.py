"""What exports are made from: plain arrays in NED/FRD, on the clock of the flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Where something was: times (n,), positions (n, 3) and unit quaternions (w, x, y, z), shape (n, 4), in NED."""

    times_s: Array
    p_W_m: Array
    q: Array

    def __post_init__(self) -> None:
        q = np.asarray(self.q, dtype=np.float64)
        norm = np.linalg.norm(q, axis=-1, keepdims=True)
        if not (norm > 1e-6).all():
            raise InputError("track: a quaternion of length 0, or one that is no number; each must be of length 1")
        object.__setattr__(self, "q", q / norm)
        n = len(self.times_s)
        freeze(self, times_s=(n,), p_W_m=(n, 3), q=(n, 4))


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustRecord:
    """Thrusts (n, m), of m thrusters, and wrenches (n, 6), force and moment in FRD, at times (n,)."""

    times_s: Array
    thrusts_N: Array
    wrenches_B: Array

    def __post_init__(self) -> None:
        n = len(self.times_s)
        freeze(self, times_s=(n,), thrusts_N=(n, None), wrenches_B=(n, 6))


@dataclass(frozen=True, kw_only=True, eq=False)
class Photographs:
    """Photographs, where they are, and the camera that took them.

    Parameters
    ----------
    files : tuple of Path
        One per pose of `track`; names differ.
    track : Trajectory
        Of the camera C with OpenCV axes: `q` is q_WC.
    width, height : int
        In pixels.
    params : ndarray, shape (8,)
        fx, fy, cx, cy in pixels (centres at +0.5), k1, k2, p1, p2 of OpenCV's distortion.
    """

    files: tuple[Path, ...]
    track: Trajectory
    width: int
    height: int
    params: Array

    def __post_init__(self) -> None:
        freeze(self, params=(8,))
        if len(self.files) != len(self.track.times_s) or not self.files:
            raise InputError(f"photographs: {len(self.files)} files with {len(self.track.times_s)} poses, one each")
        if len({path.name for path in self.files}) != len(self.files):
            raise InputError("photographs: two of one name, all must differ")


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsePoints:
    """Points (n, 3) in NED, their colours (n, 3) as RGB bytes, and mean reprojection errors in pixels, shape (n,).

    `seen` says, by a photograph's name, at which pixels, shape (k, 2), which points, shape (k,), were observed in it.
    """

    points_W_m: Array
    colours: NDArray[np.uint8]
    errors_px: Array
    seen: Mapping[str, tuple[Array, IntArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), errors_px=(n,))
