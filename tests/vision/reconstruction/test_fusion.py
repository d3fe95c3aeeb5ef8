"""Stereo against closed-form depth; the fusion kernel against its slow twin; outliers and thinning."""

import numpy as np
import pytest
from relief import CENTRE, FOCAL, HEIGHT, WIDTH, height, photo, poses, texture

from wakewise.core.geometry import Pose, look_at
from wakewise.vision.reconstruction.dense.fusion import facing_normals, fuse, outlier_mask
from wakewise.vision.reconstruction.dense.stereo import DepthMap, pair_depth, rectifiable, rectify_axes
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest, RegisteredPhoto, rank_partners

BALL = RegionOfInterest(centre_W_m=CENTRE, radius_m=0.06)


def view(name, X_WC):
    return RegisteredPhoto(
        name=name,
        width=WIDTH,
        height=HEIGHT,
        focal_px=FOCAL,
        centre_px=np.array([WIDTH / 2, HEIGHT / 2]),
        radial=0.0,
        R_CW=X_WC.R.T,
        p_WC_m=X_WC.p_m,
        near_m=0.3,
        far_m=0.5,
        focus_W_m=CENTRE,
        seen=np.arange(3),
    )


@pytest.fixture(scope="module")
def small_world():
    X = poses(6)
    views = tuple(view(f"{k}", pose) for k, pose in enumerate(X))
    tex = texture()
    return views, [photo(pose, tex)[0] for pose in X]


def test_rectified_rows_hold_both_views(small_world):
    """A point has the same row in both rectified views, and its disparity is focal times baseline over depth."""
    views, _ = small_world
    one, two = views[0], views[1]
    R = rectify_axes(one, two, CENTRE)
    points = CENTRE + np.random.default_rng(0).normal(0, 0.02, (20, 3))
    a, b = (points - one.p_WC_m) @ R.T, (points - two.p_WC_m) @ R.T
    assert np.allclose(R @ R.T, np.eye(3)) and np.isclose(np.linalg.det(R), 1.0)
    assert np.allclose(a[:, 1:], b[:, 1:])
    assert np.allclose(a[:, 0] - b[:, 0], np.linalg.norm(two.p_WC_m - one.p_WC_m))


@pytest.mark.parametrize("pair", [(0, 1), (1, 0), (2, 4), (1, 3)])
def test_stereo_depth_is_the_true_depth(small_world, pair):
    """From either side and whatever the baseline's direction, most depths are within a millimetre of the truth."""
    views, photos = small_world
    found = pair_depth(views, photos, *pair, BALL, 1.0)
    v, u = np.nonzero(found.wanted)
    z = found.depth_m[v, u].astype(float)
    rays = np.stack([(u - found.centre_px[0]) / FOCAL, (v - found.centre_px[1]) / FOCAL, np.ones(len(u))], axis=1)
    points = (rays * z[:, None]) @ found.R_CW + found.p_WC_m
    error = np.abs(points[:, 2] - height(points[:, 0], points[:, 1]))
    # 0.4 m away at 300 px the footprint of a pixel is 1.3 mm and 0.25 px of disparity over 0.1 m is 1.3 mm.
    assert len(z) > 2000
    assert np.median(error) < 0.0013
    assert abs(np.mean(points[:, 2] - height(points[:, 0], points[:, 1]))) < 0.0006


def test_motion_along_the_line_of_sight_is_no_pair():
    """Two views one behind the other cannot be rectified usefully, two side by side can."""
    R_BC = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    X = [Pose.from_matrix(look_at(CENTRE - [0, 0, d], CENTRE) @ R_BC, CENTRE - [0.01 * d, 0, d]) for d in (0.4, 0.6)]
    views = tuple(view(str(k), pose) for k, pose in enumerate(X))
    assert not rectifiable(*views)
    assert rectifiable(*(view(str(k), pose) for k, pose in enumerate(poses(6)[2:4])))


def test_partners_are_near_the_best_angle(small_world):
    """With a region, partners are ranked by how near their angle is to the best; a view is never its own partner."""
    views, _ = small_world
    ranked = rank_partners(views, np.zeros((3, 3)), BALL, most=3)
    assert all(i not in partners and 1 <= len(partners) <= 3 for i, partners in enumerate(ranked))


def slow_votes(own, others, tolerance_px):
    """Readable twin of the kernel: who agrees with each pixel, who looks through it, and the mean depth."""
    h, w = own.depth_m.shape
    mean, votes, against = np.zeros((h, w)), np.zeros((h, w), int), np.zeros((h, w), int)
    for v, u in np.argwhere(own.wanted):
        z = float(own.depth_m[v, u])
        ray = np.array([(u - own.centre_px[0]) / own.focal_px, (v - own.centre_px[1]) / own.focal_px, 1.0])
        X = own.R_CW.T @ (ray * z) + own.p_WC_m
        depths, weights = [z], [(own.focal_px * own.baseline_m / z**2) ** 2]
        for other in others:
            Y = other.R_CW @ (X - other.p_WC_m)
            if Y[2] <= 0:
                continue
            col, row = np.floor(other.focal_px * Y[:2] / Y[2] + other.centre_px + 0.5).astype(int)
            if not (0 <= row < other.depth_m.shape[0] and 0 <= col < other.depth_m.shape[1]):
                continue
            seen = float(other.depth_m[row, col])
            if seen <= 0:
                continue
            P = np.array([*((np.array([col, row]) - other.centre_px) / other.focal_px), 1.0]) * seen
            back = own.R_CW @ (other.R_CW.T @ P + other.p_WC_m - own.p_WC_m)
            if back[2] <= 0:
                continue
            gap = own.focal_px * own.baseline_m * (1 / back[2] - 1 / z)
            pixel = own.focal_px * back[:2] / back[2] + own.centre_px
            if abs(gap) < tolerance_px and ((pixel - [u, v]) ** 2).sum() < 4:
                votes[v, u] += 1
                depths.append(back[2])
                weights.append((other.focal_px * other.baseline_m / seen**2) ** 2)
            elif other.focal_px * other.baseline_m * (1 / Y[2] - 1 / seen) > 3 * tolerance_px:
                against[v, u] += 1
        mean[v, u] = np.average(depths, weights=weights)
    return mean, votes, against


def random_map(k, rng):
    """A small noisy depth map with holes."""
    X = poses(6)[k]
    depth = (0.4 + rng.normal(0, 0.01, (14, 18))).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = 0.0
    return DepthMap(
        first=k,
        second=(k + 1) % 6,
        focal_px=60.0,
        centre_px=np.array([9.0, 7.0]),
        baseline_m=0.1,
        R_CW=X.R.T,
        p_WC_m=X.p_m,
        depth_m=depth,
        wanted=(depth > 0) & (rng.random(depth.shape) < 0.9),
        colours=np.zeros((14, 18, 3), np.uint8),
    )


def test_kernel_equals_its_twin():
    """Points kept by the kernel are those of the twin, at the same places."""
    rng = np.random.default_rng(0)
    maps = [random_map(k, rng) for k in range(5)]
    mean, votes, against = slow_votes(maps[2], [maps[k] for k in (0, 1, 3, 4)], 0.4)
    assert against.sum() > 0 and votes.max() >= 2
    rows = fuse(maps, 2, [0, 1, 3, 4], 2, 0.4)
    points, towards = rows[:, :3], rows[:, 6:]
    keep = maps[2].wanted & (votes >= 2) & (against <= votes)
    v, u = np.nonzero(keep)
    rays = np.stack([(u - 9.0) / 60, (v - 7.0) / 60, np.ones(len(u))], axis=1)
    assert len(points) == keep.sum() > 20
    assert np.allclose(points, (rays * mean[keep][:, None]) @ maps[2].R_CW + maps[2].p_WC_m, atol=1e-9)
    assert np.allclose(np.linalg.norm(towards, axis=1), 1.0)


def test_no_voters_no_points():
    """A map that nobody can confirm gives nothing."""
    assert len(fuse([random_map(0, np.random.default_rng(0))], 0, [], 2, 1.0)) == 0


def test_lonely_points_are_found():
    """A stray point is lonely, points of an even sheet are not."""
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    sheet = np.stack([x.ravel(), y.ravel(), np.zeros(900)], axis=1)
    flags = outlier_mask(np.concatenate([sheet, [[15.0, 15.0, 40.0]]]))
    assert flags[-1] and flags[:-1].mean() < 0.05


def test_normals_face_the_cameras_on_any_number_of_threads():
    """Normals of a sheet stand on it, on the side told, the same bytes from one thread and from three."""
    rng = np.random.default_rng(3)
    sheet = np.column_stack([rng.random((500, 2)), np.zeros(500)])
    towards = np.tile([0.0, 0.6, -0.8], (500, 1))
    normals = facing_normals(sheet, towards)
    assert np.allclose(normals, [0, 0, -1], atol=1e-6)
    assert np.array_equal(normals, facing_normals(sheet, towards, threads=3))
