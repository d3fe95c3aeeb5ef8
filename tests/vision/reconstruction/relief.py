"""A textured relief and photographs of it, computed in closed form: the small world of this room's tests."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from wakewise.core.geometry import Pose, look_at

R_BC = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
WIDTH, HEIGHT, FOCAL = 320, 240, 300.0
CENTRE = np.array([0.0, 0.0, 1.0])
SIZE = 512


def texture(seed=0):
    """Periodic grey noise with detail at many scales, one cell of 0.5 mm."""
    rng = np.random.default_rng(seed)
    total = sum(gaussian_filter(rng.normal(size=(SIZE, SIZE)), s, mode="wrap") * s for s in (1.0, 2.0, 5.0, 12.0))
    return (total - total.min()) / np.ptp(total)


def height(x, y):
    """Depth in m (world z, down) of the relief under a point."""
    return 1.0 + 0.012 * np.sin(40 * x) * np.cos(35 * y)


def photo(X_WC, tex):
    """Image of the relief: each pixel's ray meets the surface by fixed-point iteration (slopes are below 1)."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones_like(u)], -1) @ X_WC.R.T
    z = np.ones_like(u)
    for _ in range(25):
        t = (z - X_WC.p_m[2]) / rays[..., 2]
        x, y = X_WC.p_m[0] + t * rays[..., 0], X_WC.p_m[1] + t * rays[..., 1]
        z = height(x, y)
    grey = map_coordinates(tex, [y / 0.0007, x / 0.0007], order=3, mode="grid-wrap")
    return np.repeat((40 + 180 * np.clip(grey, 0, 1)).astype(np.uint8)[..., None], 3, axis=2), t


def poses(n=6):
    """Cameras on an arc and a second row, 0.4 m from the relief, all looking at its middle."""
    eyes = []
    for k in range(n):
        angle = np.radians(12.0 * (k - (n - 1) / 2))
        side = np.radians(20.0 if k % 2 else 8.0)
        eyes.append(
            CENTRE + 0.4 * np.array([np.sin(angle), np.sin(side) * np.cos(angle), -np.cos(angle) * np.cos(side)])
        )
    return [Pose.from_matrix(look_at(eye, CENTRE) @ R_BC, eye) for eye in eyes]


def take_photos(folder, n=6):
    """Write n photographs; their true poses by name."""
    folder.mkdir(parents=True, exist_ok=True)
    tex = texture()
    out = {}
    for k, X_WC in enumerate(poses(n)):
        name = f"{k:02d}.png"
        cv2.imwrite(str(folder / name), photo(X_WC, tex)[0])
        out[name] = X_WC
    return out
