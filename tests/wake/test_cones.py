"""The family of cones against its formula, written out one point at a time."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake import PaperJet, PowerJet

AREA = np.pi * 0.03**2


def cone_twin(point, direction, area, gain, p, m, soft, half_angle, width, rho=998.0, r_ref=1.0):
    """Printed: v = G sqrt(1 / (2 pi rho A)) (r_ref / sqrt(r^2 + r_s^2))^p cos^m(theta) s(theta), as it reads."""
    r = np.linalg.norm(point)
    cosine = point @ direction / r
    if cosine <= 0:
        return 0.0
    outer, inner = np.cos(half_angle + width / 2), np.cos(half_angle - width / 2)
    if width == 0:
        edge = 1.0 if np.arccos(min(cosine, 1.0)) <= half_angle else 0.0
    else:
        t = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0)
        edge = 3 * t**2 - 2 * t**3
    return gain * np.sqrt(1 / (2 * np.pi * rho * area)) * (r_ref / np.hypot(r, soft)) ** p * cosine**m * edge


@pytest.mark.parametrize(
    ("gain", "p", "m", "soft", "half_angle", "width"),
    [
        (1.0, 2.0, 4.0, 0.0, np.pi / 4, 0.0),
        (0.036, 2.0, 4.0, 0.0, np.pi / 4, 0.0),
        (0.6, 0.85, 47.0, 0.0, np.pi / 4, 0.0),
        (0.6, 0.85, 47.0, 0.05, np.pi / 4, 0.05),
        (0.5, 1.0, 0.0, 0.0, np.pi / 4, 0.0),
        (1.0, 2.0, 4.0, 0.0, np.pi / 4, np.deg2rad(3)),
        (2.0, 1.3, 7.5, 0.01, 1.2, 0.3),
    ],
)
def test_the_cone_is_its_formula(gain, p, m, soft, half_angle, width):
    """Kernel and formula agree to 1e-12 at random places, in the cone, on its edge and outside."""
    jet = PowerJet(
        label="x",
        gain=gain,
        decay_power=p,
        cosine_power=m,
        soft_radius_m=soft,
        half_angle_rad=half_angle,
        edge_width_rad=width,
    )
    rng = np.random.default_rng(0)
    points = rng.normal(scale=0.3, size=(1000, 3))
    direction = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
    fast = jet.unit_velocity(points, np.zeros((1, 3)), direction[None], np.array([AREA]))[0]
    slow = np.array([cone_twin(x, direction, AREA, gain, p, m, soft, half_angle, width) for x in points])
    assert 50 < np.count_nonzero(slow) < 500
    np.testing.assert_allclose(fast, slow[:, None] * direction, rtol=1e-12, atol=0)


def test_the_papers_numbers_in_the_family_give_the_papers_jet():
    """With no number changed the family is the frozen model, to the last bit."""
    rng = np.random.default_rng(1)
    points = rng.normal(scale=0.3, size=(200, 3))
    place = (points, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([AREA]))
    np.testing.assert_array_equal(PowerJet(label="x").unit_velocity(*place), PaperJet().unit_velocity(*place))


def test_a_smooth_edge_is_a_sharp_one_away_from_it():
    """Inside the inner end nothing changes, outside the outer end there is nothing, in the middle there is half."""
    width = np.deg2rad(3.0)
    sharp, smooth = PowerJet(label="x"), PowerJet(label="x", edge_width_rad=width)
    inside = np.deg2rad([0.0, 30.0, 43.4])
    np.testing.assert_allclose(
        smooth.speed(np.cos(inside), np.sin(inside), 1.0, AREA),
        sharp.speed(np.cos(inside), np.sin(inside), 1.0, AREA),
        rtol=1e-13,
    )
    assert smooth.speed(np.cos(np.deg2rad(46.6)), np.sin(np.deg2rad(46.6)), 1.0, AREA) == 0.0
    middle = np.arccos(0.5 * (np.cos(np.pi / 4 - width / 2) + np.cos(np.pi / 4 + width / 2)))
    whole = cone_twin(np.array([np.sin(middle), 0, np.cos(middle)]), np.array([0, 0, 1]), AREA, 1, 2, 4, 0, 1.5, 0)
    assert smooth.speed(np.cos(middle), np.sin(middle), 1.0, AREA) == pytest.approx(0.5 * whole)


def test_numbers_out_of_range_are_refused():
    """The message names the model, the number and what is allowed."""
    with pytest.raises(InputError, match="wake model x: gain 0, allowed 1e-06 to 1000"):
        PowerJet(label="x", gain=0.0)
    with pytest.raises(InputError, match="cosine_power nan"):
        PowerJet(label="x", cosine_power=np.nan)
    with pytest.raises(InputError, match="the edge must lie between 0 and 90 deg"):
        PowerJet(label="x", half_angle_rad=1.5, edge_width_rad=0.3)
