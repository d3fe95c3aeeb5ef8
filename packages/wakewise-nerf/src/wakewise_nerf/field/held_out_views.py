"""Views that the field never saw: rendered, compared with the photos, and laid beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from wakewise.core.arrays import Array
from wakewise.core.files import write_bytes
from wakewise.core.interfaces import Progress
from wakewise.vision.evaluation.rendered_views import psnr_db, ssim
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.posed import PosedPhoto
from wakewise_nerf.field.rendering import origin_in, render
from wakewise_nerf.field.training import TrainingState

# Points that one pass may ask about at most, which bounds memory.
PASS_POINTS = 2**21


def split(photos: tuple[PosedPhoto, ...], every: int) -> tuple[tuple[PosedPhoto, ...], tuple[PosedPhoto, ...]]:
    """Photos to learn from and photos to judge by: every so many in order of name, from the first, as is custom.

    B. Mildenhall et al., Local light field fusion, ACM TOG 38(4), 2019, doi 10.1145/3306346.3322980, keep every 8th.
    """
    kept = tuple(photo for k, photo in enumerate(photos) if k % every)
    return kept, photos[::every]


def draw(training: TrainingState, origin: Any, directions: Any) -> tuple[Array, Array, Array]:
    """Colours (h, w, 3), distance in radii and opacity (h, w) of rays from one place, shape (h, w, 3).

    A ray that is no number is drawn black and without distance.
    """
    flat, parts, start = _passes(training, origin, directions)
    colour, distance, opacity = torch.zeros((len(flat), 3)), torch.zeros(len(flat)), torch.zeros(len(flat))
    with torch.no_grad():
        for part in parts:
            rays = flat[part].to(training.device)
            seen = render(
                training.field,
                training.occupancy,
                start.expand(len(part), 3),
                rays,
                samples=training.settings.samples,
            )
            colour[part], opacity[part] = seen.colour.cpu(), seen.opacity.cpu()
            distance[part] = seen.depth.cpu()
    shape = directions.shape[:2]
    return (
        colour.reshape(*shape, 3).double().numpy(),
        distance.reshape(shape).double().numpy(),
        opacity.reshape(shape).double().numpy(),
    )


def draw_surface(training: TrainingState, origin: Any, directions: Any) -> tuple[Array, Array]:
    """Colour of the surface that each ray meets, (h, w, 3), and distance in radii, (h, w), 0 where it meets none.

    Half the work of `draw`: the colour network is asked once a ray, where half the light is stopped.
    """
    flat, parts, start = _passes(training, origin, directions)
    colour, distance = torch.zeros((len(flat), 3)), torch.zeros(len(flat))
    with torch.no_grad():
        for part in parts:
            rays = flat[part].to(training.device)
            seen = render(
                training.field,
                training.occupancy,
                start.expand(len(part), 3),
                rays,
                samples=training.settings.samples,
                colours=False,
            )
            met = (seen.depth > 0.0).nonzero()[:, 0]
            _, shown = training.field(start + rays[met] * seen.depth[met, None], rays[met])
            colour[part[met.cpu()]] = shown.cpu()
            distance[part] = seen.depth.cpu()
    shape = directions.shape[:2]
    return colour.reshape(*shape, 3).double().numpy(), distance.reshape(shape).double().numpy()


def _passes(training: TrainingState, origin: Any, directions: Any) -> tuple[Any, Any, Any]:
    """Rays in one row, shape (n, 3); numbers of those that are rays, in parts that fit into memory; their origin."""
    flat = torch.from_numpy(np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32))
    rows = torch.isfinite(flat).all(dim=1).nonzero()[:, 0]
    start = torch.from_numpy(np.asarray(origin, dtype=np.float32)).to(training.device)
    return flat, rows.split(max(PASS_POINTS // (2 * training.settings.samples), 1)), start


def judge(
    training: TrainingState, photos: tuple[PosedPhoto, ...], region: RegionOfInterest, folder: Path, progress: Progress
) -> dict[str, Any]:
    """Compare each held-out photo with its render; leave `<name>.png` with the photo left and the render right.

    Returns psnr_db and ssim, means over the photos, each on the rectangle about the region; psnr_min_db; views, by
    name.
    """
    views: dict[str, dict[str, float | None]] = {}
    scores: list[tuple[float, float | None]] = []
    for done, photo in enumerate(photos):
        progress(done, len(photos), photo.name)
        truth = photo.colours.astype(np.float64) / 255.0
        image = np.clip(draw(training, origin_in(photo, region), photo.directions_W)[0], 0.0, 1.0)
        scores.append((psnr_db(image, truth), ssim(image, truth)))
        views[photo.name] = {"psnr_db": scores[-1][0], "ssim": scores[-1][1]}
        pair = np.concatenate([photo.colours, np.rint(255.0 * image).astype(np.uint8)], axis=1)
        write_bytes(folder / f"{Path(photo.name).stem}.png", cv2.imencode(".png", pair[:, :, ::-1])[1].tobytes())
    progress(len(photos), len(photos), "views")
    all_psnr = [one for one, _ in scores]
    all_ssim = [one for _, one in scores if one is not None]
    return {
        "psnr_db": float(np.mean(all_psnr)),
        "psnr_min_db": float(np.min(all_psnr)),
        "ssim": float(np.mean(all_ssim)) if all_ssim else None,
        "views": views,
    }
