"""A cloud against a cloud: distances known in closed form, in units of the object's size."""

import numpy as np
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.vision.evaluation import CLOUD_DEFINITIONS, compare_clouds

RNG = np.random.default_rng(0)


def grid(side_m, step_m, z_m=0.0):
    """A bumpy sheet, whose shape holds it in place under ICP."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(0, side_m, step_m), np.arange(0, side_m, step_m)))
    w = 2 * np.pi / side_m
    return np.stack([x, y, z_m + 0.1 * side_m * np.sin(2 * w * x) * np.cos(3 * w * y)], axis=1)


@pytest.mark.parametrize("side", [0.036, 0.3, 15.0])
def test_a_shift_is_measured_whatever_the_size(side):
    """One percent of the side off in z: a distance of that, none of it within a half of it, all within two."""
    truth = grid(side, side / 150)
    off = 1e3 * 0.01 * side
    found = compare_clouds(truth + np.array([0, 0, 0.01 * side]), truth, (0.4 * off, 2.0 * off), icp=False)
    assert set(CLOUD_DEFINITIONS) == {*vars(found.score), "shares"}
    assert 0.7 * off < found.score.accuracy_median_mm <= 1.01 * off
    assert found.shares[0].accuracy_pct < 5.0 and found.shares[1].f_score > 99.0
    assert found.score.reference_spacing_mm == pytest.approx(1e3 * side / 150, rel=0.2)


def test_icp_takes_a_small_shift_out_and_half_a_model_covers_half():
    """Moved by a fiftieth it comes back; the half that is there is accurate, the rest is missing."""
    truth = grid(0.036, 0.036 / 150)
    half = truth[truth[:, 0] < 0.018] + [0.0004, 0.0003, 0.0007]
    found = compare_clouds(half, truth, (0.5,))
    assert found.score.icp_displacement_mm == pytest.approx(0.86, abs=0.2)
    assert found.shares[0].accuracy_pct > 99.0
    assert found.shares[0].completeness_pct == pytest.approx(50.0, abs=3.0)


def test_what_is_no_model_of_the_reference_is_a_failure():
    """Elsewhere, of another scale, or buried in the bed."""
    truth = grid(0.3, 0.003)
    with pytest.raises(StageError, match="0 of its"):
        compare_clouds(truth + np.array([2.0, 0, 0]), truth, (1.0,))
    with pytest.raises(StageError, match="suspicious scale"):
        compare_clouds(1000.0 * truth, truth, (1.0,))
    with pytest.raises(InputError, match="reference cloud: 0"):
        compare_clouds(truth, truth, (1.0,), bed_z_m=-1.0)
