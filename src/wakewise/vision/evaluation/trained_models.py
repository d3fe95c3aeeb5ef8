"""Geometry of models that other trainers made: 3D Gaussian splats, and the frame that nerfstudio trains in.

A splat file is the PLY of B. Kerbl et al., 3D Gaussian splatting, ACM TOG 42(4), 2023, doi 10.1145/3592433: centre x,
y, z; opacity before the logistic function; logarithms of the standard deviations scale_0 to scale_2 (two of a 2D
Gaussian); quaternion rot_0 to rot_3 (w, x, y, z).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise.core.size_limits import broken_ply
from wakewise.vision.evaluation.alignment import Similarity

OPACITY = 0.5
"""Least opacity of a Gaussian that counts as surface: half of the light is stopped at its centre."""
MOST_POINTS = 3_000_000
SPLAT_DEFINITIONS: dict[str, tuple[str, str]] = {
    "splats": ("", "Gaussians in the file"),
    "splats_opaque_pct": ("%", "share of them with at least splats_opacity"),
    "splats_opacity": ("", "least opacity of a Gaussian that counts as surface (--opacity)"),
    "splats_sigma_median_mm": ("mm", "median of the largest standard deviation of those that count"),
    "splats_spacing_mm": ("mm", "distance of the points that stand for a Gaussian: its centre, and a square lattice on "
                          "the ellipse of one standard deviation along its two longest axes"),
}  # fmt: skip
_Z_UP = np.diag([1.0, -1.0, -1.0])  # x north, y west, z up to north, east, down, and back


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussianSplats:
    """Centres (n, 3) in m, opacities (n,) from 0 to 1, standard deviations (n, 3) in m along the columns of `axes`.

    `axes` has shape (n, 3, 3).
    """

    centres_m: Array
    opacity: Array
    sigmas_m: Array
    axes: Array

    def __post_init__(self) -> None:
        n = len(self.centres_m)
        freeze(self, centres_m=(n, 3), opacity=(n,), sigmas_m=(n, 3), axes=(n, 3, 3))

    def moved(self, similarity: Similarity) -> GaussianSplats:
        """The same splats in another frame and scale."""
        return GaussianSplats(
            centres_m=similarity.apply(self.centres_m),
            opacity=self.opacity,
            sigmas_m=similarity.scale * self.sigmas_m,
            axes=similarity.R_AB @ self.axes,
        )

    def surface(
        self, least_opacity: float, spacing_m: float, low_m: Array, high_m: Array
    ) -> tuple[Array, dict[str, float]]:
        """Points, shape (m, 3), of the opaque Gaussians whose centre lies between two corners, and figures.

        A Gaussian gives its centre and a square lattice of `spacing_m` on the ellipse of one standard deviation along
        its two longest axes. The lattice is coarser where that would be more than 3 million points. The figures are
        those of `SPLAT_DEFINITIONS`.
        """
        opaque = self.opacity >= least_opacity
        inside = opaque & ((self.centres_m >= low_m) & (self.centres_m <= high_m)).all(axis=1)
        order = np.argsort(-self.sigmas_m[inside], axis=1, kind="stable")[:, :2]
        # No disc is larger than what is looked at.
        sigmas = np.take_along_axis(self.sigmas_m[inside], order, axis=1)
        sigmas = np.minimum(sigmas, float(np.linalg.norm(high_m - low_m)))
        while np.pi * (sigmas.prod(axis=1) / spacing_m**2).sum() > MOST_POINTS:
            spacing_m *= np.sqrt(2.0)
        reach = np.floor(sigmas / spacing_m).astype(np.int64)
        directions = np.take_along_axis(self.axes[inside], order[:, None, :], axis=2)
        parts = []
        for one, two in np.unique(reach, axis=0):
            mine = (reach == (one, two)).all(axis=1)
            u, v = (k.ravel() * spacing_m for k in np.mgrid[-one : one + 1, -two : two + 1])
            at = np.stack([u, v], axis=1)
            within = ((at / np.maximum(sigmas[mine][:, None], 1e-300)) ** 2).sum(axis=2) <= 1.0
            within[:, len(u) // 2] = True  # the centre, of the smallest too
            points = self.centres_m[inside][mine][:, None] + np.einsum("nij,kj->nki", directions[mine], at)
            parts.append(points[within])
        figures = {
            "splats": len(self.opacity),
            "splats_opaque_pct": 100.0 * float(opaque.mean()),
            "splats_opacity": least_opacity,
            "splats_sigma_median_mm": 1e3 * float(np.median(sigmas[:, 0])) if len(sigmas) else 0.0,
            "splats_spacing_mm": 1e3 * float(spacing_m),
        }
        return np.concatenate(parts) if parts else np.zeros((0, 3)), figures


def read_splats(path: Path) -> GaussianSplats | None:
    """Gaussian splats of a PLY file; None if it is another file, such as a cloud or a mesh.

    Raises InputError if it holds splats that are damaged.
    """
    if path.suffix.lower() != ".ply" or not path.is_file() or broken_ply(path) is not None:
        return None
    head = path.read_bytes()[:4096].split(b"end_header")[0]
    if b" opacity" not in head or b" scale_0" not in head:
        return None
    try:
        loaded = trimesh.load(path, process=False)
        table = loaded.metadata["_ply_raw"]["vertex"]["data"]
        columns = {name: np.asarray(table[name], dtype=np.float64).reshape(-1) for name in table.dtype.names}
        centres = np.stack([columns[axis] for axis in "xyz"], axis=1)
        logit = columns["opacity"]
        scales = [columns[name] for name in ("scale_0", "scale_1", "scale_2") if name in columns]
        turns = np.stack([columns[f"rot_{k}"] for k in range(4)], axis=1)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OSError):
        raise InputError(f"{path}: holds splats that cannot be read (x, opacity, scale_0, rot_0, ...)") from None
    sigmas = np.zeros((len(centres), 3))
    sigmas[:, : len(scales)] = np.exp(np.minimum(np.stack(scales, axis=1), 50.0))
    sound = np.isfinite(centres).all(axis=1) & np.isfinite(logit) & np.isfinite(sigmas).all(axis=1)
    sound &= np.isfinite(turns).all(axis=1) & (np.linalg.norm(turns, axis=1) > 0.0)
    if not sound.any():
        raise InputError(f"{path}: none of its {len(centres)} splats is made of finite numbers")
    return GaussianSplats(
        centres_m=centres[sound],
        opacity=1.0 / (1.0 + np.exp(-np.clip(logit[sound], -700.0, 700.0))),
        sigmas_m=sigmas[sound],
        axes=matrix_from_quat(turns[sound]),
    )


def nerfstudio_frame(dataparser: Path | None) -> Similarity:
    """From the frame of a model that nerfstudio trained on an export to north, east, down in m.

    nerfstudio turns, moves and scales the world before training, x' = s (T x + t), and writes s and (T, t) into the
    run's dataparser_transforms.json. Without that file the model is taken to be in the axes of the export.

    Raises InputError if the file is none of nerfstudio's.
    """
    if dataparser is None:
        return Similarity(scale=1.0, R_AB=_Z_UP, t_A_m=np.zeros(3))
    try:
        values = json.loads(dataparser.read_text(encoding="utf-8"))
        matrix, scale = np.array(values["transform"], dtype=np.float64)[:3], float(values["scale"])
        T, t = matrix[:, :3], matrix[:, 3]
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        raise InputError(f"{dataparser}: is no dataparser_transforms.json of nerfstudio (transform, scale)") from None
    if T.shape != (3, 3) or not scale > 0.0 or not np.allclose(T.T @ T, np.eye(3), atol=1e-3):
        raise InputError(f"{dataparser}: transform must be a rotation with a shift, 3 x 4, and scale above 0")
    return Similarity(scale=1.0 / scale, R_AB=_Z_UP @ T.T, t_A_m=-_Z_UP @ T.T @ t)
