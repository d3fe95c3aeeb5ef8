"""From densities along rays to colour and depth: intervals, weights, and the render of a batch of rays.

All pixels to learn from, as one long table of rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.posed import PosedPhoto

# Nothing nearer to a camera is drawn, in radii: a field likes to hide what it cannot explain before the lens.
NEAREST = 0.05
# How far behind the region the last interval ends, in radii.
FARTHEST = 20.0
# A point that less light than this comes from is not worth a gradient (Mueller et al. stop rays alike, appendix E.1).
DARKEST = 1e-3


@dataclass(frozen=True, kw_only=True)
class RenderedRays:
    """What rays see. colour (n, 3); opacity (n,); depth (n,): where half the light is stopped, along the unit ray in
    radii, 0 where less than half is; points: how many the networks were asked about, of `intervals` that there are.
    """

    colour: Any
    opacity: Any
    depth: Any
    points: int
    intervals: int


def interval_edges(origins: Any, directions: Any, samples: int) -> Any:
    """Distances along each ray, rising, that part it into intervals; m = samples * 11 / 8 of them, so shape (n, m + 1).

    Evenly across the unit ball; before and behind it they widen as `contract` shrinks space, so that an interval is
    about as long in shrunk space as in the ball. A ray that passes the ball by has intervals of length 0 there.

    `origins`, `directions`, shape (n, 3): in radii about the region's centre; unit directions.
    """
    middle = -(origins * directions).sum(dim=1, keepdim=True)
    gap = (origins * origins).sum(dim=1, keepdim=True) - middle**2
    inner = (1.0 - gap).clamp(min=0.0).sqrt()
    outer = (4.0 - gap).clamp(min=0.0).sqrt()
    enter, leave = (middle - inner).clamp(min=NEAREST), (middle + inner).clamp(min=NEAREST)
    first = torch.minimum((middle - outer).clamp(min=NEAREST), enter)
    n_before, n_behind = max(samples // 8, 1), max(samples // 4, 1)
    device, kind = origins.device, origins.dtype
    share = torch.linspace(0.0, 1.0, n_before + 1, device=device, dtype=kind)[:-1]
    # Distance 1 / (1 - s) - 1 at share s, the same law before the region and behind it.
    reach = (enter - first) / (1.0 + enter - first)
    back = reach * (1.0 - share)
    before = enter - back / (1.0 - back)
    across = enter + (leave - enter) * torch.linspace(0.0, 1.0, samples + 1, device=device, dtype=kind)
    on = torch.linspace(0.0, 1.0, n_behind + 1, device=device, dtype=kind)[1:] * (FARTHEST / (1.0 + FARTHEST))
    behind = leave + on / (1.0 - on)
    return torch.cat([before, across, behind], dim=1)


def weights_of(density: Any, lengths: Any) -> tuple[Any, Any]:
    """Share of light that each interval sends, and what has come through to its near end; both shape (n, m).

    N. Max, Optical models for direct volume rendering, IEEE TVCG 1(2), 1995, doi 10.1109/2945.468400: exact where
    density is constant within each interval.
    """
    thickness = density * lengths
    through = torch.exp(-(torch.cumsum(thickness, dim=1) - thickness))
    return through * -torch.expm1(-thickness), through


def median_depth(density: Any, edges: Any) -> Any:
    """Distance at which half the light is stopped, shape (n,), exact for constant density; 0 where less is stopped."""
    thickness = torch.cumsum(density * (edges[:, 1:] - edges[:, :-1]), dim=1)
    half = torch.log(torch.tensor(2.0, dtype=density.dtype, device=density.device))
    found = thickness[:, -1] >= half
    at = (thickness < half).sum(dim=1).clamp(max=density.shape[1] - 1)[:, None]
    before = torch.where(at > 0, thickness.gather(1, (at - 1).clamp(min=0)), torch.zeros_like(half))
    step = (half - before) / density.gather(1, at).clamp(min=1e-12)
    return torch.where(found, (edges.gather(1, at) + step)[:, 0], torch.zeros_like(step[:, 0]))


def render(
    field: Any, occupancy: Any, origins: Any, directions: Any, *, samples: int, jitter: Any = None, colours: bool = True
) -> RenderedRays:
    """Colour, opacity and depth of rays.

    `occupancy`: which points may hold something; None asks the field about all. `origins`, `directions` have shape (n,
    3). `samples`: intervals across the unit ball. `jitter`, shape (n, 1): where in its interval each ray's points lie,
    0 to 1; the middle if not given. `colours`: depth alone needs no colours.
    """
    edges = interval_edges(origins, directions, samples)
    lengths = edges[:, 1:] - edges[:, :-1]
    at = edges[:, :-1] + lengths * (0.5 if jitter is None else jitter)
    rays, columns = _asked(occupancy, origins, directions, at, lengths)
    known = torch.zeros_like(lengths)
    points = origins[rays] + directions[rays] * at[rays, columns, None]
    with torch.no_grad():
        found, _ = field.density(points)
        known[rays, columns] = found
        _, through = weights_of(known, lengths)
        bright = through[rays, columns] > DARKEST
    if not colours:
        opacity = 1.0 - torch.exp(-(known * lengths).sum(dim=1))
        return RenderedRays(
            colour=None,
            opacity=opacity,
            depth=median_depth(known, edges),
            points=len(points),
            intervals=lengths.numel(),
        )
    rays, columns, points = rays[bright], columns[bright], points[bright]
    density_there, colour_there = field(points, directions[rays])
    density = torch.zeros_like(lengths).index_put((rays, columns), density_there)
    weights, _ = weights_of(density, lengths)
    lit = weights[rays, columns, None] * colour_there
    opacity = weights.sum(dim=1)
    colour = torch.zeros_like(origins).index_add(0, rays, lit) + (1.0 - opacity)[:, None] * field.background()
    return RenderedRays(
        colour=colour,
        opacity=opacity,
        depth=median_depth(density.detach(), edges),
        points=len(points),
        intervals=lengths.numel(),
    )


def _asked(occupancy: Any, origins: Any, directions: Any, at: Any, lengths: Any) -> tuple[Any, Any]:
    """Rows and columns of the points that may hold something."""
    worth = lengths > 0.0
    if occupancy is not None:
        points = origins[:, None] + directions[:, None] * at[..., None]
        worth = worth & occupancy.holds(points.reshape(-1, 3)).reshape(worth.shape)
    rays, columns = worth.nonzero(as_tuple=True)
    return rays, columns


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
