"""Stereo of two photos: rectification to a common row direction, then semi-global matching.

x of the rectified frame is along the baseline, whatever its direction. H. Hirschmueller, Stereo processing by
semiglobal matching and mutual information, IEEE TPAMI 30(2), 2008, doi 10.1109/TPAMI.2007.1166; OpenCV's StereoSGBM has
block costs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.jit.njit import njit
from wakewise.vision.reconstruction.photos.photo_folder import Image
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest, RegisteredPhoto

DepthImage = NDArray[np.float32]
BLOCK = 5
# OpenCV's own recommendation for its smoothness penalties: 8 and 32 times channels times block area.
PENALTY_SMALL, PENALTY_LARGE = 8 * BLOCK**2, 32 * BLOCK**2
MAX_DISPARITIES = 384
MAX_TURN_DEG = 35.0
MAX_SLOPE = 2.0
"""Of rays in the rectified frame, 63 deg from its axis: what a fisheye sees beyond would be stretched past use."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthMap:
    """Depth of a pinhole view: row direction along a baseline, pixel (i, j) has its centre at (j, i), 0 where unknown.

    `first` and `second` are the views of the pair; `baseline_m` times `focal_px` over depth is the disparity.
    `wanted` marks the pixels that become points; the depths of the others still vote.
    """

    first: int
    second: int
    focal_px: float
    centre_px: Array
    baseline_m: float
    R_CW: Array
    p_WC_m: Array
    depth_m: DepthImage
    wanted: BoolArray
    colours: Image

    def __post_init__(self) -> None:
        freeze(self, centre_px=(2,), R_CW=(3, 3), p_WC_m=(3,))


def rectify_axes(first: RegisteredPhoto, second: RegisteredPhoto, focus_W_m: Array) -> Array:
    """Rotation R_CW, shape (3, 3), that both views are turned to: x along the baseline, z at the focus."""
    x = second.p_WC_m - first.p_WC_m
    x = x / np.linalg.norm(x)
    sight = focus_W_m - 0.5 * (first.p_WC_m + second.p_WC_m)
    z = sight - (sight @ x) * x
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def rectifiable(first: RegisteredPhoto, second: RegisteredPhoto) -> bool:
    """Whether neither view has to be rotated far, which would stretch it, as for forward motion."""
    baseline = second.p_WC_m - first.p_WC_m
    sight = first.focus_W_m - 0.5 * (first.p_WC_m + second.p_WC_m)
    along = abs(float(baseline @ sight))
    if not along < np.sin(np.radians(MAX_TURN_DEG)) * float(np.linalg.norm(baseline) * np.linalg.norm(sight)):
        return False
    R = rectify_axes(first, second, first.focus_W_m)
    return max(_turn_deg(first, R), _turn_deg(second, R)) <= MAX_TURN_DEG


def pair_depth(
    views: tuple[RegisteredPhoto, ...],
    photos: list[Image],
    i: int,
    j: int,
    region: RegionOfInterest | None,
    scale: float,
    paths: int = 8,
) -> DepthMap | None:
    """Depth map of view i from the pair (i, j), which must be rectifiable; None if too little of it can be seen.

    `scale`: rectified pixels per pixel of the photo; less is taken where the range of disparities would be too wide.
    `paths`: directions of the smoothness term, 3 or 8.
    """
    one, two = views[i], views[j]
    focus = one.focus_W_m
    R = rectify_axes(one, two, focus)
    focal = one.focal_px * scale
    baseline = float(np.linalg.norm(two.p_WC_m - one.p_WC_m))
    centre = R @ (focus - one.p_WC_m)
    near, far = _depth_limits(one, float(centre[2]), region)
    if centre[2] <= 0.0 or near <= 0.0:
        return None
    zero = focal * baseline / centre[2]
    lowest = int(np.floor(focal * baseline / far - zero)) - 1
    count = int(np.ceil((focal * baseline / near - zero - lowest + 2) / 16)) * 16
    if count > MAX_DISPARITIES:
        smaller = 0.95 * scale * MAX_DISPARITIES / count
        return pair_depth(views, photos, i, j, region, smaller, paths) if smaller > 0.3 * scale else None
    left, top, width, height = _window(one, R, focal, region)
    # SGBM gives nothing within the disparity range of the borders: the window grows by it, onto real pixels.
    pad_left, pad_right = max(0, lowest + count), max(0, -lowest)
    left, width = left - pad_left, width + pad_left + pad_right
    if width < 16 or height < 16:
        return None
    c_one = np.array([-left, -top], dtype=np.float64)
    c_two = c_one + np.array([zero, 0.0])
    a = resample(photos[i], one, R, focal, c_one, (width, height))
    b = resample(photos[j], two, R, focal, c_two, (width, height))
    matcher = cv2.StereoSGBM.create(
        lowest,
        count,
        BLOCK,
        PENALTY_SMALL,
        PENALTY_LARGE,
        disp12MaxDiff=1,
        preFilterCap=0,
        uniquenessRatio=10,
        speckleWindowSize=60,
        speckleRange=1,
        mode=cv2.STEREO_SGBM_MODE_HH if paths == 8 else cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = matcher.compute(cv2.cvtColor(a, cv2.COLOR_BGR2GRAY), cv2.cvtColor(b, cv2.COLOR_BGR2GRAY))
    d = disparity.astype(np.float32) / 16.0
    total = d + np.float32(zero)
    found = (d > lowest - 0.5) & (total > 0.0)
    if one.fisheye:
        # Much of the window lies outside of its photo: black there matches any black.
        white = np.full(photos[i].shape[:2], 255, np.uint8)
        found &= resample(white, one, R, focal, c_one, (width, height)) == 255
    depth = np.where(found, np.float32(focal * baseline) / np.where(found, total, 1.0), 0.0).astype(np.float32)
    keep = slice(pad_left, width - pad_right)
    c_one -= [pad_left, 0.0]
    depth = np.ascontiguousarray(depth[:, keep])
    wanted = depth > 0 if region is None else _in_ball(depth, float(focal), c_one, centre, float(region.radius_m))
    return DepthMap(
        first=i,
        second=j,
        focal_px=focal,
        centre_px=c_one,
        baseline_m=baseline,
        R_CW=R,
        p_WC_m=one.p_WC_m,
        depth_m=depth,
        wanted=wanted,
        colours=np.ascontiguousarray(a[:, keep]),
    )


@njit(nogil=True)
def _in_ball(depth_m: DepthImage, focal: float, centre_px: Array, middle_C_m: Array, radius_m: float) -> BoolArray:
    """Which pixels have a depth whose point lies in a ball of the camera's frame."""
    height, width = depth_m.shape
    inside = np.zeros((height, width), np.bool_)
    for v in range(height):
        for u in range(width):
            z = float(depth_m[v, u])
            if z > 0.0:
                x = (u - centre_px[0]) / focal * z - middle_C_m[0]
                y = (v - centre_px[1]) / focal * z - middle_C_m[1]
                inside[v, u] = x * x + y * y + (z - middle_C_m[2]) ** 2 <= radius_m * radius_m
    return inside


def _turn_deg(view: RegisteredPhoto, R_CW: Array) -> float:
    """Angle between the view's optical axis and the rectified one."""
    return float(np.degrees(np.arccos(np.clip(view.R_CW[2] @ R_CW[2], -1.0, 1.0))))


def _depth_limits(view: RegisteredPhoto, middle_m: float, region: RegionOfInterest | None) -> tuple[float, float]:
    """Nearest and farthest depth in the rectified frame that counts."""
    if region is None:
        return view.near_m, view.far_m
    return max(middle_m - 1.1 * region.radius_m, 0.3 * middle_m), middle_m + 1.1 * region.radius_m


def _window(
    view: RegisteredPhoto, R_CW: Array, focal: float, region: RegionOfInterest | None
) -> tuple[int, int, int, int]:
    """Left, top, width and height in rectified pixels (principal point at 0) of what is worth matching."""
    corners = view.rays(np.array([[0.0, 0.0], [view.width, 0.0], [0.0, view.height], [view.width, view.height]]))
    rays = corners @ view.R_CW @ R_CW.T
    uv = focal * np.clip(rays[:, :2] / np.maximum(rays[:, 2:], 1e-3), -MAX_SLOPE, MAX_SLOPE)
    low, high = uv.min(axis=0), uv.max(axis=0)
    if region is not None:
        c = R_CW @ (region.centre_W_m - view.p_WC_m)
        distance = max(c[2], 1e-9)
        reach = 1.1 * focal * region.radius_m / np.sqrt(max(distance**2 - region.radius_m**2, 0.04 * distance**2))
        middle = focal * c[:2] / distance
        low, high = np.maximum(low, middle - reach), np.minimum(high, middle + reach)
    left, top = (int(v) for v in np.floor(low))
    width, height = (int(v) for v in np.ceil(high) - np.floor(low))
    return left, top, width, height


def resample(
    photo: Image, view: RegisteredPhoto, R_CW: Array, focal: float, centre_px: Array, size: tuple[int, int]
) -> Image:
    """The photo as a pinhole camera of the same centre turned to R_CW would have taken it."""
    # COLMAP has pixel centres at +0.5, OpenCV at 0.
    K = np.array(
        [
            [view.focal_px, 0.0, view.centre_px[0] - 0.5],
            [0.0, view.focal_px * view.stretch, view.centre_px[1] - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )
    new_K = np.array([[focal, 0.0, centre_px[0]], [0.0, focal, centre_px[1]], [0.0, 0.0, 1.0]])
    turn = R_CW @ view.R_CW.T
    params = np.array([view.radial, *view.bend])
    turned = cv2.fisheye.initUndistortRectifyMap if view.fisheye else cv2.initUndistortRectifyMap
    map_x, map_y = turned(K, params, turn, new_K, size, cv2.CV_32FC1)
    shrink = view.focal_px / focal
    if shrink > 1.5:
        # Blur before thinning out pixels, else fine texture folds into noise.
        photo = cv2.GaussianBlur(photo, (0, 0), 0.4 * shrink)
    out: Image = cv2.remap(photo, map_x, map_y, cv2.INTER_CUBIC if shrink < 1.0 else cv2.INTER_LINEAR)
    return out


def masked(depth_map: DepthMap, view: RegisteredPhoto, mask: BoolArray | None) -> DepthMap:
    """A depth map without what the mask of its photo hides: no depth there, neither to become points nor to vote."""
    if mask is None:
        return depth_map
    height, width = depth_map.depth_m.shape
    small = cv2.resize(mask.astype(np.float32), (view.width, view.height), interpolation=cv2.INTER_AREA)
    seen = resample(small, view, depth_map.R_CW, depth_map.focal_px, depth_map.centre_px, (width, height))
    kept = np.asarray(seen) > 0.5  # most of what the pixel came from
    return replace(
        depth_map,
        depth_m=np.where(kept, depth_map.depth_m, np.float32(0.0)).astype(np.float32),
        wanted=depth_map.wanted & kept,
    )
