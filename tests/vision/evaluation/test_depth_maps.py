"""A cloud against depth maps, on a slanted plane seen by two cameras: every figure in closed form."""

import dataclasses

import numpy as np
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.vision.evaluation import DEPTH_DEFINITIONS, DepthScore, DepthView, compare_depths, read_depth_views

K = np.array([[100.0, 0, 39.5], [0, 100.0, 29.5], [0, 0, 1.0]])
NORMAL, OFFSET = np.array([0.3, 0.0, -1.0]) / np.hypot(0.3, 1.0), -2.0


def view(x):
    """Depth of the plane n.p = offset from a camera at (x, 0, 0) that looks along z."""
    v, u = np.indices((60, 80))
    rays = np.stack([(u - K[0, 2]) / 100, (v - K[1, 2]) / 100, np.ones(u.shape)], axis=-1)
    centre = np.array([x, 0.0, 0.0])
    return DepthView(depth_m=(OFFSET - NORMAL @ centre) / (rays @ NORMAL), K=K, R_WC=np.eye(3), p_WC_m=centre)


def plane(shift_m, n=60_000):
    """Points on the plane, moved along its normal."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.5, 0.8, n), rng.uniform(-0.5, 0.5, n)
    z = (OFFSET - NORMAL[0] * x) / NORMAL[2]
    return np.stack([x, y, z], axis=1) + shift_m * NORMAL


def test_a_shifted_plane_has_that_error():
    """Distances go along the normal, so that the spacing of the truth does not add to them."""
    score = compare_depths(plane(0.004), [view(0.0), view(0.2)])
    assert score.accuracy_median_mm == pytest.approx(4.0, abs=0.3)
    assert score.accuracy_rmse_mm == pytest.approx(4.0, abs=0.5)
    assert score.compared_pct > 95.0
    assert score.completeness_50mm_pct > score.completeness_10mm_pct


def test_what_is_not_covered_counts_as_missing():
    """Half of the plane gone, about half of the truth is without a point."""
    cloud = plane(0.0)
    full, half = (compare_depths(c, [view(0.0)]) for c in (cloud, cloud[cloud[:, 1] > 0]))
    assert half.completeness_50mm_pct < 0.65 * full.completeness_50mm_pct


def test_edges_are_no_surface():
    """Where depth jumps there is no plane to measure against."""
    one = view(0.0)
    depth = one.depth_m.copy()
    depth[:, 40:] += 1.0
    from wakewise.vision.evaluation.depth_maps import true_points

    points, normals = true_points(dataclasses.replace(one, depth_m=depth))
    assert len(points) == 58 * 76
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_far_from_the_truth_and_without_truth_are_told():
    """Millimetres for metres is a failure with the distance; empty depth maps are bad input."""
    with pytest.raises(StageError, match="in metres"):
        compare_depths(1000 * plane(0.0), [view(0.0)])
    with pytest.raises(InputError, match="hold 0 points"):
        compare_depths(plane(0.0), [dataclasses.replace(view(0.0), depth_m=np.zeros((60, 80)))])


def test_files_give_the_views_and_faults_are_told(tmp_path):
    """An .npz of every second pixel with .camera files gives K in the grid's pixels; what is not so is named."""
    depth = view(0.0).depth_m
    np.savez(tmp_path / "d.npz", depth=depth[None])
    full = "200 0 80\n0 200 60\n0 0 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0.5 0 0\n160 120\n"
    (tmp_path / "a.jpg.camera").write_text(full)
    (found,) = read_depth_views(tmp_path / "d.npz", tmp_path)
    assert np.allclose(found.K, [[100, 0, 39.5], [0, 100, 29.5], [0, 0, 1]])
    assert found.p_WC_m.tolist() == [0.5, 0, 0] and np.allclose(found.depth_m, depth)
    (tmp_path / "b.jpg.camera").write_text(full)
    with pytest.raises(InputError, match=r"2 \.camera files"):
        read_depth_views(tmp_path / "d.npz", tmp_path)
    (tmp_path / "b.jpg.camera").unlink()
    (tmp_path / "a.jpg.camera").write_text("no camera")
    with pytest.raises(InputError, match=r"a\.jpg\.camera"):
        read_depth_views(tmp_path / "d.npz", tmp_path)
    (tmp_path / "d.npz").write_bytes(b"nothing")
    for path, words in ((tmp_path / "d.npz", "is no .npz"), (tmp_path / "e.npz", "does not exist")):
        with pytest.raises(InputError, match=words):
            read_depth_views(path, tmp_path)


def test_every_figure_is_defined():
    """Each field of a score has a unit and a definition."""
    assert set(DEPTH_DEFINITIONS) == set(DepthScore.__dataclass_fields__)
