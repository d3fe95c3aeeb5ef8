"""All pixels to learn from, as one long table of rays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from wakewise.vision.reconstruction.registered_photos import RegionOfInterest
from wakewise_nerf.field.posed import PosedPhoto


class RayTable:
    """Rays of photos and their colours, in radii of the region about its centre, on one device.

    Pixels that the camera model gives no ray to are left out.
    """

    def __init__(self, photos: Sequence[PosedPhoto], region: RegionOfInterest, device: Any) -> None:
        directions = [photo.directions_W.reshape(-1, 3) for photo in photos]
        whole = [np.isfinite(d).all(axis=1) for d in directions]
        colours = [photo.colours.reshape(-1, 3)[keep] for photo, keep in zip(photos, whole, strict=True)]
        which = [np.full(int(keep.sum()), k, dtype=np.int32) for k, keep in enumerate(whole)]
        kept = [d[keep] for d, keep in zip(directions, whole, strict=True)]
        self.directions = torch.from_numpy(np.concatenate(kept)).to(device)
        self.colours = torch.from_numpy(np.concatenate(colours)).to(device)
        self.photo = torch.from_numpy(np.concatenate(which)).to(device)
        self.origins = torch.from_numpy(np.stack([origin_in(photo, region) for photo in photos])).to(device)

    def __len__(self) -> int:
        return len(self.photo)

    def batch(self, rows: Any) -> tuple[Any, Any, Any]:
        """Origins, unit directions and colours, 0 to 1, of some rays; each of shape (n, 3)."""
        return self.origins[self.photo[rows].long()], self.directions[rows], self.colours[rows].float() / 255.0


def origin_in(photo: PosedPhoto, region: RegionOfInterest) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Camera centre in radii of the region about its centre, shape (3,)."""
    return ((photo.p_WC_m - region.centre_W_m) / region.radius_m).astype(np.float32)
