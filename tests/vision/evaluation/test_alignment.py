"""Laws of alignment: it undoes what was done, ignores what is wrong, and refuses what it cannot know."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from wakewise.core.errors import InputError, StageError
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise.vision.evaluation import refine_icp, robust_similarity, umeyama
from wakewise.vision.evaluation.alignment import nearest_m, neighbour_tree


def rotation(*rotvec):
    return matrix_from_quat(quat_from_rotvec(np.array(rotvec)))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.01, 100.0), st.integers(3, 40))
def test_umeyama_undoes_any_similarity(seed, scale, n):
    """The similarity that was applied comes back, whatever it was."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, 3))
    R, t = rotation(*rng.normal(size=3)), rng.normal(size=3)
    found = umeyama(B, scale * B @ R.T + t)
    assert np.isclose(found.scale, scale, rtol=1e-6)
    assert np.allclose(found.R_AB, R, atol=1e-5)
    assert np.allclose(found.t_A_m, t, atol=1e-5 * (1 + scale))


def test_umeyama_never_mirrors():
    """A mirrored set gets a proper rotation, not the reflection that would fit exactly."""
    B = np.random.default_rng(0).normal(size=(20, 3))
    found = umeyama(B, B * [1, 1, -1])
    assert np.isclose(np.linalg.det(found.R_AB), 1.0)


def test_umeyama_without_scale_keeps_size():
    """A rigid fit has scale 1 even where the sets differ in size."""
    B = np.random.default_rng(0).normal(size=(20, 3))
    assert umeyama(B, 2 * B, with_scale=False).scale == 1.0


def test_points_on_a_line_are_refused():
    """The turn about a line is open, so no answer is given."""
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="one line"):
        umeyama(line, line)
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        umeyama(line, line[:4])


def test_a_third_of_wrong_pairs_changes_nothing():
    """With wrong pairs the fit is that of the right ones alone."""
    rng = np.random.default_rng(3)
    B = rng.normal(size=(48, 3))
    A = 0.4 * B @ rotation(0.3, -1.0, 0.5).T + [1, 2, 3] + rng.normal(0, 0.003, (48, 3))
    bad = rng.choice(48, 16, replace=False)
    A[bad] += rng.normal(0, 0.5, (16, 3)) + 0.3
    good = np.setdiff1d(np.arange(48), bad)
    found, inliers = robust_similarity(B, A, rng)
    right = umeyama(B[good], A[good])
    assert not inliers[bad].any()
    assert inliers[good].sum() >= 30
    assert np.allclose(found.apply(B), right.apply(B), atol=0.002)


@pytest.mark.parametrize("seed", range(6))
def test_nearly_half_of_wrong_pairs_change_nothing(seed):
    """Wrong pairs that are scattered to one side draw least squares off: the median of random triples does not."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(40, 3))
    A = B @ rotation(0.2, 0.4, -0.3).T + rng.normal(0, 0.002, B.shape)
    bad = np.arange(40) < 18
    A[bad] += rng.normal(0.0, 3.0, (18, 3)) + 3.0
    _, inliers = robust_similarity(B, A, np.random.default_rng(0))
    assert not inliers[bad].any()
    assert inliers[~bad].sum() >= 20


def test_pairs_that_fit_exactly_all_count():
    """Where the right ones fit but for rounding, none is rejected for having more of it than those in the middle."""
    rng = np.random.default_rng(2)
    B = rng.normal(size=(60, 3))
    B[:30] *= 1e-7
    A = 3.7 * B @ rotation(1.0, -0.4, 0.3).T
    bad = np.arange(60) >= 50
    A[bad] += rng.normal(0.0, 3.0, (10, 3))
    _, inliers = robust_similarity(B, A, rng)
    np.testing.assert_array_equal(inliers, ~bad)


def test_without_wrong_pairs_least_squares_stands():
    """Noise alone rejects no pair: the robust fit is the least-squares one."""
    rng = np.random.default_rng(5)
    B = rng.normal(size=(11, 3))
    A = B + rng.normal(0, 0.006, B.shape)
    found, inliers = robust_similarity(B, A, rng)
    assert inliers.all()
    assert np.allclose(found.apply(B), umeyama(B, A).apply(B))


def bumpy(n, rng):
    """Samples and normals of an ellipsoid, which fixes all six degrees of freedom."""
    axes = np.array([0.05, 0.07, 0.09])
    u = rng.normal(size=(n, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    normals = u / axes
    return u * axes, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_icp_takes_out_a_small_motion():
    """A cloud that was moved by 2 mm and a degree lies on the surface again, and its size is left alone."""
    rng = np.random.default_rng(0)
    surface, normals = bumpy(40_000, rng)
    cloud = bumpy(20_000, rng)[0] @ rotation(0.01, 0.01, -0.01).T + [0.001, -0.001, 0.0015]
    found = refine_icp(cloud, surface, normals)
    axes = np.array([0.05, 0.07, 0.09])
    level = np.linalg.norm(found.apply(cloud) / axes, axis=1)
    assert np.abs(level - 1).max() < 0.01
    assert 1.0 < found.displacement_mm < 4.0
    assert found.residual_mm < 0.3
    assert found.matched_pct > 99.0


def test_icp_refuses_a_cloud_elsewhere():
    """Far from the surface nothing matches, and that is said."""
    rng = np.random.default_rng(0)
    surface, normals = bumpy(5_000, rng)
    with pytest.raises(StageError, match="ICP"):
        refine_icp(surface + 0.5, surface, normals)


@pytest.mark.parametrize(("shift_m", "refused"), [(0.012, False), (0.028, True)])
def test_icp_refuses_to_move_a_cloud_far(shift_m, refused):
    """More than 20 mm is no refinement, though the cloud would fit: the alignment before it was wrong."""
    rng = np.random.default_rng(0)
    surface, normals = bumpy(20_000, rng)
    cloud = bumpy(10_000, rng)[0] + np.array([shift_m, 0.0, 0.0])
    wide = (0.08, 0.02, 0.004)
    if refused:
        with pytest.raises(StageError, match="at most 20 mm is allowed"):
            refine_icp(cloud, surface, normals, distances_m=wide)
        wide_limit = refine_icp(cloud, surface, normals, distances_m=wide, limit_m=0.2)
        assert wide_limit.displacement_mm == pytest.approx(1e3 * shift_m, abs=4.0)
    else:
        found = refine_icp(cloud, surface, normals, distances_m=wide)
        assert found.displacement_mm == pytest.approx(1e3 * shift_m, abs=2.0)


@pytest.mark.parametrize(("back", "accepted"), [(-1.0, True), (1.0, False)])
def test_icp_that_fits_no_better_moves_nothing(monkeypatch, back, accepted):
    """A registration that takes the cloud farther from the surface is not taken: the cloud stays where it was."""
    import small_gicp

    rng = np.random.default_rng(0)
    surface, normals = bumpy(20_000, rng)
    shift = np.array([0.001, 0.0, 0.0])
    T = np.eye(4)
    T[:3, 3] = back * shift
    answer = SimpleNamespace(num_inliers=1000, T_target_source=T)
    monkeypatch.setattr(small_gicp, "align", lambda *_, **__: answer)
    cloud = bumpy(10_000, rng)[0] + shift
    found = refine_icp(cloud, surface, normals)
    assert found.accepted is accepted
    np.testing.assert_allclose(found.apply(cloud), cloud + (back * shift if accepted else 0.0), atol=1e-12)
    assert found.displacement_mm == pytest.approx(1.0 if accepted else 0.0)


def test_one_tree_gives_exact_distances_and_normals_for_the_residual():
    """Distances are SciPy's bit by bit, and without normals the residual is that along the plane through neighbours."""
    rng = np.random.default_rng(0)
    surface, normals = bumpy(4000, rng)
    cloud = bumpy(2000, rng)[0] + np.array([0.001, 0.0, 0.0])
    tree = neighbour_tree(surface)
    np.testing.assert_array_equal(nearest_m(tree, surface, cloud), cKDTree(surface).query(cloud)[0])
    known, without = (refine_icp(cloud, surface, given, tree=tree) for given in (normals, None))
    assert without.residual_mm == pytest.approx(known.residual_mm, rel=0.2, abs=0.05)
    np.testing.assert_array_equal(known.R, without.R)
