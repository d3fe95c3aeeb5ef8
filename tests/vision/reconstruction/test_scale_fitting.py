"""Several bars to one scale: weights, uncertainty, residuals, refusal."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.scale.bars import BarMeasurement, fit_scale


def measured(name, length, found, sigma=1e-4, found_sigma=0.0):
    return BarMeasurement(name=name, length_m=length, sigma_m=sigma, found=found, found_sigma=found_sigma, photos=5)


def test_scale_is_the_weighted_mean_and_as_sure_as_bars_drawn_say():
    """Over many draws the scale is unbiased and its scatter is the uncertainty that is told."""
    rng = np.random.default_rng(1)
    told, got = [], []
    for _ in range(400):
        bars = [
            measured("a", 0.5 + rng.normal(0, 2e-4), 2.0 + rng.normal(0, 1e-3), 2e-4, 1e-3),
            measured("b", 0.25 + rng.normal(0, 1e-4), 1.0 + rng.normal(0, 1e-3), 1e-4, 1e-3),
            measured("c", 1.0 + rng.normal(0, 2e-4), 4.0 + rng.normal(0, 1e-3), 2e-4, 1e-3),
        ]
        fit = fit_scale(bars)
        got.append(fit.scale)
        told.append(fit.uncertainty_pct)
    assert np.mean(got) == pytest.approx(0.25, rel=1e-4)
    spread_pct = 100.0 * np.std(got) / 0.25
    assert spread_pct <= np.mean(told) <= 1.8 * spread_pct


def test_residuals_are_lengths_in_the_scaled_model_less_the_stated():
    """Two equal bars half a percent apart: each is off by a quarter, and by a half from what the other says."""
    fit = fit_scale([measured("a", 1.0, 1.0, 1e-3), measured("b", 1.0, 1.005, 1e-3)])
    assert [one.off_pct for one in fit.bars] == pytest.approx([-0.25, 0.25], abs=2e-3)
    assert [one.check_pct for one in fit.bars] == pytest.approx([-0.5, 0.5], abs=5e-3)
    assert fit.uncertainty_pct > 100e-3 / np.sqrt(2)
    kept = fit_scale([measured("a", 1.0, 1.01, 1e-3)], keep=True)
    assert kept.bars[0].off_mm == pytest.approx(10.0)
    assert kept.bars[0].check_pct is None


def test_the_bar_that_is_wrong_is_named():
    """Of three the one that sticks out; where errors are large enough to explain it, none."""
    good = [measured("a", 0.5, 2.0), measured("b", 0.25, 1.0)]
    with pytest.raises(InputError, match=r"bar c comes out .2\.. %"):
        fit_scale([*good, measured("c", 0.51, 2.0)])
    assert len(fit_scale([*good, measured("c", 0.51, 2.0, sigma=0.01)]).bars) == 3
