"""Colour correction of a folder of photographs, with the ranges of its model if there is one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import cv2
import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import QhullError

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import no_progress
from wakewise.core.size_limits import picture_depth
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction import read_photos
from wakewise.vision.reconstruction.outputs.clouds import read_surface
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto, read_views
from wakewise.vision.texturing.colour import WaterFit, fit_water, remove_water, white_balanced

FIT_PHOTOS = 16
"""Photographs, spread over the set, that the water is fitted to."""
_FARTHER = 1.5
_COARSE = 8  # pixels between ranges that are interpolated from the sparse points
_QUALITY = 93


@dataclass(frozen=True, kw_only=True)
class CorrectionResult:
    """What was done: photographs with the water undone by physics, others balanced, and the water, in 1/m.

    deep, clear: photographs of more than 8 bits and with transparency, which the copies have not; renamed: copies that
    are called after the photograph's whole name, as two would have met.
    """

    physical: int
    balanced: int
    water: WaterFit | None
    why_not: str | None
    deep: int
    clear: int
    renamed: int

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        fit = self.water
        rates = None if fit is None else [round(float(v), 4) for v in fit.signal_per_m]
        veil = None if fit is None else [round(float(v), 4) for v in fit.veil]
        why = {} if self.why_not is None else {"signal_per_m": self.why_not, "veil": self.why_not}
        return {
            "photos": self.physical + self.balanced,
            "physical": self.physical,
            "balanced": self.balanced,
            "deep": self.deep,
            "clear": self.clear,
            "renamed": self.renamed,
            "signal_per_m": rates,
            "veil": veil,
            "why": why,
        }

    def words(self) -> list[str]:
        """Lines for a person."""
        lines = []
        if self.water is not None:
            red, green, blue = self.water.signal_per_m
            lines.append(
                f"{self.physical} photographs with the water undone: attenuation {red:.2f}, {green:.2f}, {blue:.2f} /m "
                "in red, green, blue"
            )
        if self.balanced:
            reason = "" if self.why_not is None else f" ({self.why_not})"
            lines.append(f"{self.balanced} photographs balanced without depths{reason}")
        lost = [(self.deep, "have more than 8 bits"), (self.clear, "have transparency")]
        said = [f"{count} photographs {what}" for count, what in lost if count]
        if said:
            lines.append(f"{' and '.join(said)}, which the copies (JPEG, 8 bits) have not")
        if self.renamed:
            lines.append(f"{self.renamed} copies are named after the whole name (a.png.jpg), as two would have met")
        return lines


def correct_photos(
    photos: Path, out: Path, *, model: Path | None = None, progress: Callable[..., None] = no_progress
) -> CorrectionResult:
    """Write colour-corrected copies of the photographs of a folder, JPEG, each whole; those that are there stay.

    `photos`: folder of photographs. `out`: folder to write to; must not be `photos`. `model`: folder with sparse/ and
    maybe mesh.ply, reconstructed from the same photographs. Raises InputError if there are no photographs, or `out` is
    where they are.
    """
    if out.resolve() == photos.resolve():
        raise InputError(f"--out {out}: is the folder of the photographs, must be another")
    found = read_photos(photos)
    names = [photo.name for photo in found]
    targets = copy_names(names)
    depths, why_not = _depths(model, names)
    fit: WaterFit | None = None
    if depths is not None:
        fit, why_not = _fitted(photos, names, depths, progress)
    physical = deep = clear = 0
    for k, name in enumerate(names):
        progress(k, len(names), name)
        image = _read(photos / name)
        path = out / targets[name]
        bits, alpha = picture_depth((photos / name).read_bytes())
        deep, clear = deep + (bits > 8), clear + alpha
        known = fit is not None and depths is not None and depths.knows(name, image.shape[:2])
        physical += known
        if path.exists():
            continue
        if fit is not None and depths is not None and known:
            shown = remove_water(image, depths.ranges_m(name, image.shape[:2]), fit)
        else:
            shown = white_balanced(image)
        with whole_file(path) as temporary:
            jpeg = cv2.imencode(".jpg", np.ascontiguousarray(shown[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
            temporary.write_bytes(jpeg[1].tobytes())
    progress(len(names), len(names), "")
    return CorrectionResult(
        physical=physical,
        balanced=len(names) - physical,
        water=fit,
        why_not=why_not,
        deep=deep,
        clear=clear,
        renamed=sum(copy == f"{name}.jpg" for name, copy in targets.items()),
    )


def estimate_water(photos: Path, names: Sequence[str], model: Path) -> tuple[WaterFit | None, str | None]:
    """Optics of the water, fitted to photographs and the ranges of their model; None with the reason.

    Raises InputError if a photograph cannot be read.
    """
    depths, why_not = _depths(model, list(names))
    return (None, why_not) if depths is None else _fitted(photos, names, depths, no_progress)


def _fitted(
    photos: Path, names: Sequence[str], depths: RangeMaps, progress: Callable[..., None]
) -> tuple[WaterFit | None, str | None]:
    """`fit_water` of up to `FIT_PHOTOS` registered photographs, spread over the set."""
    have = [name for name in names if name in depths.views]
    some = have[:: max(1, len(have) // FIT_PHOTOS)][:FIT_PHOTOS]
    pairs = []
    for k, name in enumerate(some):
        progress(k, len(some) + len(names), "fitting the water")
        image = _read(photos / name)
        if depths.knows(name, image.shape[:2]):
            pairs.append((image, depths.ranges_m(name, image.shape[:2])))
    try:
        return fit_water(pairs), None
    except InputError as fault:
        return None, str(fault)


def copy_names(names: Sequence[str]) -> dict[str, str]:
    """Name of each photograph's copy, a JPEG: its own with that ending, or its whole name and that where two meet.

    Two meet if they differ in upper and lower case only.
    """
    plain = {name: str(PurePosixPath(name).with_suffix(".jpg")) for name in names}
    often = Counter(copy.lower() for copy in plain.values())
    copies = {name: copy if often[copy.lower()] == 1 else f"{name}.jpg" for name, copy in plain.items()}
    if len({copy.lower() for copy in copies.values()}) < len(copies):
        raise InputError("photographs: some differ in nothing but large and small letters; rename them")
    return copies


@dataclass(frozen=True, kw_only=True, eq=False)
class RangeMaps:
    """Ranges of a reconstruction as its photographs see them: its mesh, and between its sparse points elsewhere."""

    views: dict[str, RegisteredPhoto]
    points_m: Array
    mesh: Any | None
    corners_m: Array

    @classmethod
    def read(cls, model: Path) -> RangeMaps:
        """Read sparse/ and mesh.ply of a model."""
        views, points = read_views(model / "sparse", None)
        mesh, corners = None, np.zeros((0, 3))
        with suppress(StageError):  # without a surface there are the sparse points
            vertices, faces = read_surface(model / "mesh.ply")
            mesh = EmbreeScene()
            TriangleMesh(mesh, vertices.astype(np.float32), faces.astype(np.int32))
            corners = trimesh.bounds.corners([vertices.min(axis=0), vertices.max(axis=0)])
        return cls(views={view.name: view for view in views}, points_m=points, mesh=mesh, corners_m=corners)

    def knows(self, name: str, shape: tuple[int, int]) -> bool:
        """Whether a photograph of this shape (h, w) is one of the model's, and not turned since."""
        view = self.views.get(name)
        if view is None:
            return False
        return abs(shape[1] * view.height - shape[0] * view.width) <= 0.01 * shape[1] * view.height

    def ranges_m(self, name: str, shape: tuple[int, int]) -> NDArray[np.float32]:
        """Range along the ray of every pixel of a photograph, shape (h, w); infinite where it is unknown."""
        view = self.views[name]
        h, w = shape
        scale = np.array([w / view.width, h / view.height])
        pixels, z = view.project(self.points_m[view.seen])
        grid = _coarse_grid(h, w)
        inverse = _between(pixels * scale, 1.0 / np.maximum(z, 1e-6), grid)
        # Far beyond all observed points there may be open water: unknown.
        farthest = _FARTHER * float(np.quantile(z, 0.99))
        depth = 1.0 / np.maximum(_fine(inverse, h, w), 1e-6)
        depth[depth > farthest] = np.inf
        length = _fine(np.linalg.norm(view.rays(grid / scale), axis=1), h, w)
        if self.mesh is not None:
            corners, _ = view.project(self.corners_m)
            low = np.clip(np.floor(corners.min(axis=0) * scale).astype(int) - 1, 0, [w, h])
            high = np.clip(np.ceil(corners.max(axis=0) * scale).astype(int) + 1, 0, [w, h])
            if np.all(high > low):
                part = np.s_[low[1] : high[1], low[0] : high[0]]
                rows, columns = np.mgrid[part]
                ways_C = view.rays((np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) / scale)
                ways = np.ascontiguousarray((ways_C @ view.R_CW).astype(np.float32))
                start = np.ascontiguousarray(np.broadcast_to(view.p_WC_m.astype(np.float32), ways.shape))
                hit = self.mesh.run(start, ways, output=True)
                struck = (np.asarray(hit["primID"]) >= 0).reshape(rows.shape)
                depth[part] = np.where(struck, np.asarray(hit["tfar"]).reshape(rows.shape), depth[part])
        return np.asarray(depth * length, np.float32)


def _coarse_grid(h: int, w: int) -> Array:
    """Middles of the pixels of a coarse image that `_fine` enlarges, one more on each side, shape (n, 2)."""
    rows, columns = np.mgrid[-1 : -(-h // _COARSE) + 1, -1 : -(-w // _COARSE) + 1]
    return (np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) * _COARSE


def _fine(values: Array, h: int, w: int) -> NDArray[np.float32]:
    """Values on the coarse grid, enlarged to shape (h, w)."""
    rows, columns = -(-h // _COARSE) + 2, -(-w // _COARSE) + 2
    coarse = values.reshape(rows, columns).astype(np.float32)
    large = cv2.resize(coarse, (columns * _COARSE, rows * _COARSE), interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(large[_COARSE : _COARSE + h, _COARSE : _COARSE + w], np.float32)


def _between(pixels: Array, inverse: Array, grid: Array) -> Array:
    """Inverse depths between scattered pixels; outside of their hull those of the plane that fits them best.

    The inverse depth of a plane, such as a bed, is a straight function of the pixel.
    """
    design = np.column_stack([pixels, np.ones(len(pixels))])
    weights: Array = np.ones(len(pixels))
    plane: Array = np.zeros(3)
    for _ in range(8):
        plane = np.asarray(np.linalg.lstsq(design * weights[:, None], inverse * weights, rcond=None)[0])
        off = np.abs(design @ plane - inverse)
        weights = 1.0 / np.sqrt(1.0 + (off / max(1.5 * float(np.median(off)), 1e-6)) ** 2)
    out = np.column_stack([grid, np.ones(len(grid))]) @ plane
    if len(pixels) >= 4:
        with suppress(QhullError):
            inside = LinearNDInterpolator(pixels, inverse)(grid)
            out = np.where(np.isnan(inside), out, inside)
    return np.asarray(out)


def _depths(model: Path | None, names: list[str]) -> tuple[RangeMaps | None, str | None]:
    if model is None:
        return None, "no model was given"
    if not (model / "sparse" / "images.bin").is_file():
        return None, f"{model} holds no reconstruction"
    try:
        depths = RangeMaps.read(model)
    except StageError as fault:
        return None, str(fault)
    if not set(names) & set(depths.views):
        return None, f"{model} was made from other photographs"
    return depths, None


def _read(path: Path) -> NDArray[np.uint8]:
    image = read_picture(path)
    if image is None:
        raise InputError(f"{path}: cannot be read as a photograph")
    return np.ascontiguousarray(image[..., ::-1])
