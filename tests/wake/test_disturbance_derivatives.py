"""Derivatives against finite differences and readable twins.

G, dG        central differences in position (W) and rotation vector (B)      smooth models, sharp cone off its edge
D gradient   s' dG s; differences in thrust; roots at zero                    coherent, incoherent, with a floor
Gauss-Newton 2 J'J with J stacked from differences of weighted velocities
"""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at, quat_from_matrix
from wakewise.wake import (
    ImpingingJet,
    PaperJet,
    PowerJet,
    RoundJet,
    disturbance,
    disturbance_slopes,
    gauss_newton,
    gram,
    gram_with_derivatives,
    smooth_roots,
    split_roots,
    wake_model,
)

BED_M = 1.5
CENTRE = np.array([0.0, 0.0, 1.4])
# Four level thrusters at 45 deg and four upright, on a frame of 450 x 350 mm.
H = np.sqrt(0.5)
POSITIONS = np.array([[x, y, 0.05] for x in (0.17, -0.17) for y in (0.13, -0.13)]
                     + [[x, y, 0.0] for x in (0.225, -0.225) for y in (0.175, -0.175)])  # fmt: skip
AXES = np.array([[H, -H, 0], [H, H, 0], [H, H, 0], [H, -H, 0], *[[0.0, 0.0, 1.0]] * 4])
AREAS = np.full(8, np.pi * 0.03**2)
# Read-only as a vehicle's and a region's are, so that kernels are those that planners use.
for _known in (POSITIONS, AXES, AREAS):
    _known.flags.writeable = False
THRUSTS = np.array([2.0, -1.5, 0.7, -3.0, 1.2, -0.4, 5.0, -2.2])

SMOOTH = PowerJet(label="smooth", edge_width_rad=np.deg2rad(6.0))
WIDE = PowerJet(label="wide", decay_power=0.9, cosine_power=20.0, soft_radius_m=0.03, half_angle_rad=1.2,
                edge_width_rad=np.deg2rad(20.0))  # fmt: skip
MODELS = [
    SMOOTH,
    WIDE,
    wake_model("jet-fitted"),
    RoundJet.of_propeller(),
    ImpingingJet(jet=WIDE, bed_z_m=BED_M),
    ImpingingJet(jet=wake_model("jet-fitted"), bed_z_m=BED_M),
]


def region(n=150, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3))
    points *= 0.09 * rng.random((n, 1)) ** (1 / 3) / np.linalg.norm(points, axis=1)[:, None]
    placed, weights = CENTRE + points, np.exp(-rng.random(n))
    placed.flags.writeable = weights.flags.writeable = False
    return placed, weights


def pose(away=(0.25, 0.15, -0.45)):
    eye = CENTRE + np.array(away)
    return Pose(eye, quat_from_matrix(look_at(eye, CENTRE)))


def exp_quat(theta):
    angle = np.linalg.norm(theta)
    return np.concatenate([[np.cos(angle / 2)], np.sinc(angle / (2 * np.pi)) / 2 * theta])


def moved(X_WB, index, step):
    """The pose after a small step of one of its six variables: position in W, rotation vector on the body's side."""
    delta = np.zeros(3)
    delta[index % 3] = step
    if index < 3:
        return Pose(X_WB.p_m + delta, X_WB.q)
    return X_WB @ Pose(np.zeros(3), exp_quat(delta))


def placed_gram(model, X_WB, superposition="coherent", n=150):
    points, weights = region(n)
    return gram(model, points, weights, X_WB.apply(POSITIONS), AXES @ X_WB.R.T, AREAS, superposition)


def differences(value, X_WB, step=1e-5):
    """Derivatives of a function of the pose by its six variables: fourth-order central differences."""
    return np.stack([
        (8 * (value(moved(X_WB, k, step)) - value(moved(X_WB, k, -step)))
         - (value(moved(X_WB, k, 2 * step)) - value(moved(X_WB, k, -2 * step)))) / (12 * step)
        for k in range(6)
    ])  # fmt: skip


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
def test_the_matrix_changes_with_the_pose_as_differences_say(model, superposition):
    """G is that of `gram`, and all its derivatives, through the moving smooth edge too, agree to 1e-6."""
    X_WB = pose()
    slopes = gram_with_derivatives(model, *region(), X_WB, POSITIONS, AXES, AREAS, superposition)
    expected = placed_gram(model, X_WB, superposition)
    np.testing.assert_allclose(slopes.gram, expected, rtol=1e-11, atol=1e-13 * expected.max())
    numeric = differences(lambda X: placed_gram(model, X, superposition), X_WB)
    assert np.abs(numeric).max() > 0.01 * expected.max()
    np.testing.assert_allclose(slopes.by_pose, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())
    np.testing.assert_array_equal(slopes.by_pose, np.swapaxes(slopes.by_pose, 1, 2))


def test_the_sharp_edge_has_exact_derivatives_between_crossings():
    """With every point 5e-3 rad or more off the sharp edge, derivatives agree to 1e-6: no point crosses."""
    X_WB, (points, weights) = pose() @ Pose(np.zeros(3), exp_quat(np.array([0.0, 0.0, 0.25]))), region()
    offset = points[:, None, :] - X_WB.apply(POSITIONS)
    cosine = np.abs(np.einsum("nmx,mx->nm", offset, AXES @ X_WB.R.T)) / np.linalg.norm(offset, axis=2)
    away = np.all(np.abs(np.arccos(cosine) - np.pi / 4) > 5e-3, axis=1)
    assert 50 < np.count_nonzero(away) < len(points)
    points, weights = points[away], weights[away]

    def value(X):
        return gram(PaperJet(), points, weights, X.apply(POSITIONS), AXES @ X.R.T, AREAS)

    analytic = gram_with_derivatives(PaperJet(), points, weights, X_WB, POSITIONS, AXES, AREAS).by_pose
    numeric = differences(value, X_WB)
    np.testing.assert_allclose(analytic, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())


def test_the_smooth_edge_knows_the_flux_that_the_sharp_edge_forgets():
    """Over a centimetre's shift of a dense region, the smooth edge's derivative predicts D; the sharp one's does not.

    A plate of 40,000 points stands half in the cone of one jet, whose speed is the same everywhere within. As the
    vehicle moves across, points enter and D grows; at no point that is inside or outside does anything change.
    """
    sharp, smooth = (
        PowerJet(label="top hat", decay_power=0.0, cosine_power=0.0, edge_width_rad=np.deg2rad(width))
        for width in (0, 6)
    )
    y, z = np.meshgrid(np.linspace(0.05, 0.35, 200), np.linspace(-0.1, 0.1, 200))
    points = np.stack([np.full(y.size, 0.2), y.ravel(), z.ravel()], axis=1)
    weights = np.full(y.size, 1.0 / y.size)
    jet = (np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]]), AREAS[:1])

    def D(model, shift):
        return disturbance_slopes(model, points, weights, Pose([0.0, shift, 0.0]), *jet, [1.0])

    true = (D(sharp, 0.01).value - D(sharp, -0.01).value) / 0.02
    assert true > 0.0
    assert D(smooth, 0.0).by_pose[1] == pytest.approx(true, rel=0.03)
    assert D(sharp, 0.0).by_pose[1] == 0.0


@pytest.mark.parametrize("model", [*MODELS, PaperJet(), RoundJet()], ids=lambda m: m.name)
@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
def test_the_gradient_of_the_disturbance_is_that_of_the_form(model, superposition):
    """D = s' G s; by pose s' dG s; by thrust 2 s_i' (G s)_i, both signs. One pass gives the same three."""
    X_WB = pose()
    place = (*region(), X_WB, POSITIONS, AXES, AREAS)
    form = gram_with_derivatives(model, *place, superposition)
    direct = disturbance_slopes(model, *place, THRUSTS, superposition=superposition)
    s = split_roots(THRUSTS)
    assert direct.value == pytest.approx(disturbance(form.gram, THRUSTS), rel=1e-10)
    by_pose = np.einsum("i,rij,j->r", s, form.by_pose, s)
    np.testing.assert_allclose(direct.by_pose, by_pose, rtol=0, atol=1e-10 * np.abs(by_pose).max())
    by_split = (form.gram @ s) / np.where(s > 0, s, np.inf)
    np.testing.assert_allclose(direct.by_thrust, by_split[:8] - by_split[8:], rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("model", [WIDE, RoundJet(), ImpingingJet(jet=WIDE, bed_z_m=BED_M)], ids=lambda m: m.name)
@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
@pytest.mark.parametrize("smooth_N", [0.0, 0.5])
def test_the_disturbance_changes_with_thrust_as_differences_say(model, superposition, smooth_N):
    """Derivatives by thrust agree with differences to 1e-6, with exact roots and with roots rounded off near zero."""
    place = (*region(), pose(), POSITIONS, AXES, AREAS)
    thrusts = THRUSTS if smooth_N == 0.0 else THRUSTS * [1, 1, 1, 1, 1, 0, 1, 0.01]

    def D(T):
        return disturbance_slopes(model, *place, T, smooth_N=smooth_N, superposition=superposition)

    numeric = [(D(thrusts + 1e-4 * e).value - D(thrusts - 1e-4 * e).value) / 2e-4 for e in np.eye(8)]
    analytic = D(thrusts).by_thrust
    np.testing.assert_allclose(analytic, numeric, rtol=0, atol=1e-6 * np.abs(analytic).max())


def test_a_thrust_of_exactly_zero_has_no_slope_with_exact_roots():
    """What the text says of T = 0: the slope is 0 there, and finite and right with rounded roots."""
    place = (*region(), pose(), POSITIONS, AXES, AREAS)
    idle = THRUSTS * (np.arange(8) != 6)
    assert disturbance_slopes(WIDE, *place, idle).by_thrust[6] == 0.0
    assert np.all(np.isfinite(disturbance_slopes(WIDE, *place, np.zeros(8), smooth_N=0.5).by_thrust))


def test_smooth_roots_are_roots_away_from_zero():
    """Within 1 % of sqrt(T) beyond 4.4 e, sqrt(e) / 4 at zero, sqrt(T) exactly for e = 0; the kernel uses the same."""
    e = 0.5
    far = np.linspace(4.4, 60, 50) * e
    np.testing.assert_allclose(smooth_roots(far, e)[:50], np.sqrt(far), rtol=0.01)
    np.testing.assert_allclose(smooth_roots([0.0], e), np.sqrt(e) / 4)
    np.testing.assert_array_equal(smooth_roots(THRUSTS, 0.0), split_roots(THRUSTS))
    place = (*region(), pose(), POSITIONS, AXES, AREAS)
    s = smooth_roots(THRUSTS, e)
    by_form = s @ gram_with_derivatives(WIDE, *place).gram @ s
    assert disturbance_slopes(WIDE, *place, THRUSTS, smooth_N=e).value == pytest.approx(by_form, rel=1e-10)


def residuals(model, X_WB, thrusts, superposition, e):
    """Weighted velocities stacked, as the definition of `GaussNewton` reads."""
    points, weights = region(60)
    axes, jets = AXES @ X_WB.R.T, np.concatenate([-AXES, AXES]) @ X_WB.R.T
    assert axes.shape == (8, 3)
    velocity = model.unit_velocity(points, np.tile(X_WB.apply(POSITIONS), (2, 1)), jets, np.tile(AREAS, 2))
    velocity = np.sqrt(weights)[:, None] * smooth_roots(thrusts, e)[:, None, None] * velocity
    if not isinstance(model, ImpingingJet):
        velocity = velocity @ X_WB.R
    return (velocity.sum(axis=0) if superposition == "coherent" else velocity).ravel()


@pytest.mark.parametrize("model", [WIDE, wake_model("jet-fitted"), ImpingingJet(jet=WIDE, bed_z_m=BED_M)])
@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
def test_the_gauss_newton_matrix_is_that_of_the_stacked_velocities(model, superposition):
    """D = r'r, gradient 2 J'r, matrix 2 J'J with J from differences of the stacked residuals."""
    X_WB, e = pose(), 0.5
    blocks = gauss_newton(model, *region(60), X_WB, POSITIONS, AXES, AREAS, THRUSTS, superposition=superposition)
    r = residuals(model, X_WB, THRUSTS, superposition, e)
    by_pose = differences(lambda X: residuals(model, X, THRUSTS, superposition, e), X_WB)
    by_thrust = [
        (residuals(model, X_WB, THRUSTS + 1e-4 * u, superposition, e)
         - residuals(model, X_WB, THRUSTS - 1e-4 * u, superposition, e)) / 2e-4
        for u in np.eye(8)
    ]  # fmt: skip
    J = np.concatenate([by_pose, by_thrust]).T
    scale = np.sqrt(np.diag(2 * J.T @ J))
    # Thrusters that all but miss have residuals too small for differences of the sum.
    scale = np.maximum(scale, 1e-2 * scale.max())
    assert blocks.value == pytest.approx(r @ r, rel=1e-10)
    np.testing.assert_allclose(blocks.gradient / scale, 2 * J.T @ r / scale, rtol=0, atol=1e-6 * np.sqrt(r @ r))
    np.testing.assert_allclose(blocks.hessian / np.outer(scale, scale), 2 * J.T @ J / np.outer(scale, scale), atol=1e-6)
    np.testing.assert_array_equal(blocks.hessian, blocks.hessian.T)


def test_what_has_no_derivatives_at_all_is_refused():
    """Thrusts of another number, NaN thrusts and a negative rounding are named."""
    place = (*region(10), pose(), POSITIONS, AXES, AREAS)
    with pytest.raises(InputError, match=r"thrusts_N: shape \(3,\), allowed \(8,\)"):
        disturbance_slopes(WIDE, *place, np.zeros(3))
    with pytest.raises(InputError, match="thrusts_N: holds NaN"):
        disturbance_slopes(WIDE, *place, THRUSTS * np.nan)
    with pytest.raises(InputError, match="smooth_N -1"):
        disturbance_slopes(WIDE, *place, THRUSTS, smooth_N=-1.0)
    points, weights = region(10)
    with pytest.raises(InputError, match="region's weights: -1, a weight must not be negative"):
        gauss_newton(WIDE, points, weights - weights - 1.0, *place[2:], THRUSTS)
