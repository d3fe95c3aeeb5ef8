"""The camera's pose from mapped points: exact, robust, with the covariance that its pixels bring; or none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_cases import CAMERA, disturbed, looking, slopes_of, turn_between

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.resection import LEAST_POINTS, Resection, pixel_jacobian, resection

TRUE = looking(np.array([0.0, 0.1, 1.0]), np.array([0.8, 0.0, 1.5]))
GUESS = disturbed(TRUE, np.array([0.03, -0.02, 0.02]), np.array([0.02, 0.01, -0.03]))
CERTAIN = np.zeros(80)


def points_in_view(rng: np.random.Generator, n: int = 80) -> Array:
    """Points 0.8 to 1.4 m before the true camera, spread over its picture."""
    return TRUE.apply(rng.uniform([-0.45, -0.33, 0.8], [0.45, 0.33, 1.4], (n, 3)))


def pixels_of(points_W_m: Array, camera: CalibratedCamera = CAMERA) -> Array:
    """Pixels of points seen from the true pose."""
    return camera.pixels((points_W_m - TRUE.p_m) @ TRUE.R)


def error(found: Resection) -> Array:
    """Error of position in W and of the rotation vector in C, shape (6,)."""
    return np.concatenate([found.X_WC.p_m - TRUE.p_m, turn_between(TRUE, found.X_WC)])


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.floats(-0.05, 0.05)] * 3).map(np.array),
    st.tuples(*[st.floats(-0.08, 0.08)] * 3).map(np.array),
)
@settings(max_examples=40, deadline=None)
def test_perfect_pixels_give_the_pose(seed: int, way_m: Array, turn_rad: Array) -> None:
    """From any guess within 5 cm and 5 degrees per axis the pose is found to a micrometre, and all points fit."""
    points = points_in_view(np.random.default_rng(seed))
    found = resection(points, CERTAIN, pixels_of(points), CAMERA, disturbed(TRUE, way_m, turn_rad))
    assert found is not None
    np.testing.assert_allclose(error(found), 0.0, atol=1e-6)
    assert found.fits.all()
    assert found.residual_px < 1e-3


def test_the_lens_is_taken_into_account() -> None:
    """Pixels of a camera with distortion give the same pose."""
    points = points_in_view(np.random.default_rng(1))
    camera = CalibratedCamera(
        width=640, height=480, fx=490.0, fy=510.0, cx=310.0, cy=245.0, distortion=(-0.05, 0.01, 0.001, -0.001)
    )
    found = resection(points, CERTAIN, pixels_of(points, camera), camera, GUESS)
    assert found is not None
    np.testing.assert_allclose(error(found), 0.0, atol=2e-5)


@pytest.mark.parametrize("seed", range(5))
def test_gross_outliers_do_not_move_the_pose(seed: int) -> None:
    """With 30 % of the pixels anywhere the pose is found to a millimetre, and they are told from the others."""
    rng = np.random.default_rng(seed)
    points = points_in_view(rng)
    pixels = pixels_of(points)
    pixels[:24] = rng.uniform([0.0, 0.0], [639.0, 479.0], (24, 2))
    found = resection(points, CERTAIN, pixels, CAMERA, GUESS)
    assert found is not None
    np.testing.assert_allclose(error(found), 0.0, atol=1e-3)
    far = np.linalg.norm(pixels - pixels_of(points), axis=1) > 5.0
    assert found.fits[24:].all()
    assert not found.fits[far].any()


@pytest.mark.parametrize("noise_px", [0.3, 0.8])
def test_the_covariance_is_that_of_many_repetitions(noise_px: float) -> None:
    """Stated standard deviations are those of the scatter, per axis, or up to twice as large."""
    rng = np.random.default_rng(3)
    points = points_in_view(rng)
    errors, covariances = [], []
    for _ in range(100):
        found = resection(points, CERTAIN, pixels_of(points) + noise_px * rng.normal(size=(80, 2)), CAMERA, TRUE)
        assert found is not None
        errors.append(error(found))
        covariances.append(found.covariance)
        assert found.residual_px == pytest.approx(np.sqrt(2.0) * noise_px, rel=0.35)
    ratio = np.sqrt(np.diag(np.mean(covariances, axis=0))) / np.std(errors, axis=0)
    assert (ratio > 0.8).all() and (ratio < 2.2).all()


def test_less_certain_points_count_less() -> None:
    """Points off by 1 cm that are stated to be so do not move the pose; stated as certain they do."""
    rng = np.random.default_rng(4)
    points = points_in_view(rng)
    pixels = pixels_of(points)
    off = points.copy()
    off[:30] += TRUE.R @ [0.01, 0.0, 0.0]
    std = np.where(np.arange(80) < 30, 0.01, 0.0)
    apart = []
    for stated in (std, CERTAIN):
        found = resection(off, stated, pixels, CAMERA, GUESS)
        assert found is not None
        apart.append(np.linalg.norm(found.X_WC.p_m - TRUE.p_m))
    assert apart[0] < 0.5 * apart[1]


def test_too_few_points_give_no_pose() -> None:
    """`LEAST_POINTS` give one; one fewer, or one fewer before the camera, gives None."""
    points = points_in_view(np.random.default_rng(5), LEAST_POINTS)
    pixels, certain = pixels_of(points), np.zeros(LEAST_POINTS)
    assert resection(points, certain, pixels, CAMERA, GUESS) is not None
    assert resection(points[1:], certain[1:], pixels[1:], CAMERA, GUESS) is None
    assert resection(points[:0], certain[:0], pixels[:0], CAMERA, GUESS) is None
    points[0] = TRUE.apply([0.1, 0.1, -1.0])
    assert resection(points, certain, pixels, CAMERA, GUESS) is None


def test_pixels_that_nothing_explains_give_no_pose() -> None:
    """Pixels at random, and points that all lie behind the camera, give None."""
    rng = np.random.default_rng(6)
    points = points_in_view(rng)
    assert resection(points, CERTAIN, rng.uniform([0.0, 0.0], [639.0, 479.0], (80, 2)), CAMERA, GUESS) is None
    behind = TRUE.apply((points - TRUE.p_m) @ TRUE.R * [1.0, 1.0, -1.0])
    assert resection(behind, CERTAIN, pixels_of(points), CAMERA, GUESS) is None


def test_thepixel_jacobian_is_that_of_finite_differences() -> None:
    """Pixels change with position in W and rotation vector in C as the derivative says."""
    points, focal = points_in_view(np.random.default_rng(7), 9), CAMERA.focal_px
    p_C = (points - TRUE.p_m) @ TRUE.R
    x, y = (p_C[:, :2] / p_C[:, 2:]).T
    J = pixel_jacobian(x, y, 1.0 / p_C[:, 2], focal, TRUE.R)

    def moved(k: int, step: float) -> Pose:
        error = np.zeros(6)
        error[k] = step
        return disturbed(TRUE, error[:3], error[3:])

    for k in range(6):
        change = slopes_of(points, moved(k, 1e-6)) - slopes_of(points, moved(k, -1e-6))
        np.testing.assert_allclose(J[:, :, k], focal * change / 2e-6, rtol=1e-6, atol=1e-4)
