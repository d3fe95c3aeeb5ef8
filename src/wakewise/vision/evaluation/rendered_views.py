"""Rendered held-out views against the photographs: PSNR, SSIM and, where the package lpips is installed, LPIPS.

SSIM: Z. Wang et al., Image quality assessment, IEEE TIP 13(4), 2004, doi 10.1109/TIP.2003.819861. LPIPS: R. Zhang et
al., The unreasonable effectiveness of deep features as a perceptual metric, CVPR 2018, doi 10.1109/CVPR.2018.00068.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from skimage.metrics import structural_similarity

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.vision.image_decoding import AS_STORED, read_picture

LEAST_ERROR = 1e-12
"""Mean squared error of equal pictures: their PSNR is 120 dB."""
LEAST_SIDE_PX = 11
"""Side of SSIM's window."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
VIEW_DEFINITIONS: dict[str, tuple[str, str]] = {
    "views": ("", "rendered views that were compared with their photographs"),
    "psnr_db": ("dB", "peak signal-to-noise ratio, mean over the views; 120 at most, for equal pictures"),
    "psnr_min_db": ("dB", "the least over the views"),
    "ssim": ("", "structural similarity in Gaussian windows of 1.5 px over all three colours, mean over the views "
             "(Wang et al. 2004, doi 10.1109/TIP.2003.819861); 1 for equal pictures"),
    "lpips": ("", "learned perceptual distance by AlexNet, mean over the views (Zhang et al. 2018, doi "
              "10.1109/CVPR.2018.00068); 0 for equal pictures"),
    "per_view": ("", "psnr_db, ssim and lpips of each view by the name of its photograph"),
}  # fmt: skip
Distance = Callable[[Array, Array], float]


@dataclass(frozen=True, kw_only=True)
class ViewScore:
    """One rendered view; ssim and lpips are None where they cannot be computed."""

    psnr_db: float
    ssim: float | None
    lpips: float | None


@dataclass(frozen=True, kw_only=True)
class ViewScores:
    """All views by the name of their photograph; `why` says why a figure is None."""

    per_view: dict[str, ViewScore]
    why: dict[str, str]

    def figures(self) -> dict[str, Any]:
        """Plain values for JSON by the keys of `VIEW_DEFINITIONS`."""
        scores = list(self.per_view.values())
        return {
            "views": len(scores),
            "psnr_db": float(np.mean([one.psnr_db for one in scores])),
            "psnr_min_db": min(one.psnr_db for one in scores),
            "ssim": _mean([one.ssim for one in scores]),
            "lpips": _mean([one.lpips for one in scores]),
            "per_view": {name: vars(one) for name, one in self.per_view.items()},
        }


def psnr_db(image: Array, truth: Array) -> float:
    """Peak signal-to-noise ratio of an image with values from 0 to 1."""
    return float(-10.0 * np.log10(max(float(np.mean((np.asarray(image) - truth) ** 2)), LEAST_ERROR)))


def ssim(image: Array, truth: Array) -> float | None:
    """Structural similarity of images, shape (h, w, 3), from 0 to 1; None where one side is below 11 px."""
    if min(image.shape[:2]) < LEAST_SIDE_PX:
        return None
    value = structural_similarity(
        image, truth, channel_axis=2, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    return float(value)


def lpips_distance() -> tuple[Distance | None, str | None]:
    """LPIPS of RGB images, shape (h, w, 3), from 0 to 1; None and the reason where the package cannot compute it."""
    try:
        package: Any = import_module("lpips")
        network = package.LPIPS(net="alex", verbose=False)
    except ImportError:
        return None, "the package lpips is not installed; it is no dependency of Wakewise"
    except (OSError, RuntimeError) as fault:  # its weights are downloaded when it is first used
        return None, f"lpips cannot load its network: {' '.join(str(fault).split())[:120]}"

    def distance(image: Array, truth: Array) -> float:
        one, two = (package.im2tensor(np.rint(255.0 * picture).astype(np.uint8)) for picture in (image, truth))
        return float(network(one, two).item())

    return distance, None


def read_split(path: Path) -> tuple[str, ...]:
    """Names of the held-out photographs that an `export.json` lists.

    Raises InputError if the file is none of an export, or holds no photograph out.
    """
    try:
        names = json.loads(path.read_text(encoding="utf-8"))["split"]["held_out"]
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: is no export.json of `wakewise export`, which lists split.held_out") from None
    if not isinstance(names, list) or not names:
        raise InputError(f"{path}: holds no photograph out; export with --held-out 8, for example")
    return tuple(str(name) for name in names)


def score_views(renders: Path, photos: Path, names: Sequence[str] | None = None) -> ViewScores:
    """Compare rendered views with photographs of the same names, suffixes aside.

    `names` are the photographs that must have a view, such as the held-out ones; all that have one if not given.

    Raises InputError if a folder or a view is missing, a picture cannot be read, or a view has another size than its
    photograph.
    """
    views, pictures = _pictures(renders), _pictures(photos)
    wanted = sorted(views.keys() & pictures.keys()) if names is None else [Path(name).stem for name in names]
    if not wanted:
        raise InputError(f"{renders}: none of its {len(views)} pictures is named like one of {photos}")
    for stem in wanted:
        for folder, found in ((renders, views), (photos, pictures)):
            if stem not in found:
                raise InputError(f"{folder}: holds no picture {stem}; each held-out photograph needs its view")
    distance, why_not = lpips_distance()
    per_view = {}
    for stem in wanted:
        image, truth = _read(views[stem]), _read(pictures[stem])
        if image.shape != truth.shape:
            raise InputError(
                f"{views[stem]}: is {image.shape[1]} x {image.shape[0]} px, {pictures[stem].name} is "
                f"{truth.shape[1]} x {truth.shape[0]}; a view must have its photograph's size"
            )
        per_view[pictures[stem].name] = ViewScore(
            psnr_db=psnr_db(image, truth),
            ssim=ssim(image, truth),
            lpips=None if distance is None else distance(image, truth),
        )
    why = {} if why_not is None else {"lpips": why_not}
    if all(one.ssim is None for one in per_view.values()):
        why["ssim"] = f"the pictures are less than {LEAST_SIDE_PX} px across or down"
    return ViewScores(per_view=per_view, why=why)


def _pictures(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of pictures")
    return {path.stem: path for path in sorted(folder.iterdir()) if path.suffix.lower() in SUFFIXES}


def _read(path: Path) -> Array:
    picture = read_picture(path, AS_STORED)
    if picture is None:
        raise InputError(f"{path}: is no picture that can be read")
    return np.asarray(picture[..., ::-1] / 255.0, dtype=np.float64)


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
