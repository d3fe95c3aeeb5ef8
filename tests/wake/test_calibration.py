"""Calibration: a model's own data give back its numbers, held-out data are held out, and what cannot be told is said.

- truth in, truth out, for every model that can be fitted;
- errors shrink with noise, intervals hold the truth;
- one thrust, points on the axis, one distance, too few rows, no free numbers: a warning or a refusal each.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.operation import read_scenario
from wakewise.wake.calibration import (
    FAMILIES,
    calibrate,
    family,
    fit_figures,
    split_samples,
    write_fit,
)
from wakewise.wake.samples import JetSamples, score, score_speeds

TRUTH = {
    "paper-calibrated": [0.05],
    "fitted": [0.5, 0.95, 40.0, 0.05],
    "jet": [0.14],
    "jet-fitted": [4.2, 2.5, 0.45, 0.12],
}


def _jet(name, thrusts=(0.5, 1.0, 2.0, 4.0), noise=0.0, seed=0, points=250, widest=0.6, nearest=0.08, farthest=0.6):
    rng = np.random.default_rng(seed)
    distance, angle = rng.uniform(nearest, farthest, points), rng.uniform(0.0, widest, points)
    x, r = np.tile(distance * np.cos(angle), len(thrusts)), np.tile(distance * np.sin(angle), len(thrusts))
    thrust = np.repeat(thrusts, points)
    area = 0.25 * math.pi * 0.06**2
    speed = family(name).model(np.array(TRUTH[name])).speed(x, r, thrust, area)
    speed = speed + noise * np.sqrt(thrust) * rng.standard_normal(len(x))
    return JetSamples(x_m=x, r_m=r, thrust_N=thrust, speed_m_s=speed, across_m_s=np.zeros_like(x), disk_diameter_m=0.06)


@pytest.mark.parametrize("name", sorted(TRUTH))
def test_a_models_own_data_give_back_its_numbers(name):
    """Without noise the fit finds the numbers that made the data, and R2 of the held-out rows is one."""
    fit = calibrate(family(name), _jet(name), np.random.default_rng(1), bootstrap=0)
    np.testing.assert_allclose(fit.values, TRUTH[name], rtol=2e-3)
    assert fit.test.r2 == pytest.approx(1.0, abs=1e-6)
    assert fit.test.r2_core == pytest.approx(1.0, abs=1e-6)
    assert fit.test.bias_far_pct == pytest.approx(0.0, abs=0.1)


def test_errors_tell_how_far_off_the_numbers_are():
    """Standard errors grow with noise, estimates stay within four of them, and resamples hold the estimate."""
    errors = []
    for noise in (0.01, 0.04):
        fit = calibrate(family("fitted"), _jet("fitted", noise=noise), np.random.default_rng(1), bootstrap=40)
        assert np.all(np.abs(fit.values - TRUTH["fitted"]) < 4.0 * fit.standard_errors)
        assert np.all((fit.lows <= fit.values) & (fit.values <= fit.highs))
        errors.append(fit.standard_errors)
    np.testing.assert_allclose(errors[1] / errors[0], 4.0, rtol=0.5)


def test_tested_rows_share_neither_thrust_nor_place_with_the_fit():
    """A row of the test has a thrust and a cell that no row of the training part has."""
    samples = _jet("fitted")
    split = split_samples(samples, np.random.default_rng(4), test_thrusts_N=(1.0,))
    train, test = samples.take(split.train), samples.take(split.test)
    assert set(test.thrust_N) == {1.0}
    assert 1.0 not in train.thrust_N

    def cells(part):
        return {(math.floor(x / 0.01), math.floor(r / 0.01)) for x, r in zip(part.x_m, part.r_m, strict=True)}

    assert len(test) > 20
    assert not cells(train) & cells(test)
    again = split_samples(samples, np.random.default_rng(4), test_thrusts_N=(1.0,))
    assert np.array_equal(again.test, split.test)


def test_one_thrust_is_fitted_with_a_warning():
    """The thrust law is then an assumption, and the fit says so."""
    fit = calibrate(family("fitted"), _jet("fitted", thrusts=(1.0,)), np.random.default_rng(0), bootstrap=0)
    assert any("one thrust only" in warning for warning in fit.warnings)
    assert "one thrust" in fit.split


def test_points_on_the_axis_leave_the_angle_at_its_start_and_say_so():
    """Nothing off the axis: cosine_power is held, has no error, and the warning names it."""
    fit = calibrate(family("fitted"), _jet("fitted", widest=0.01), np.random.default_rng(0), bootstrap=4)
    assert fit.held == ("cosine_power",)
    assert fit.parameters["cosine_power"] == 47.0
    assert math.isnan(fit.standard_errors[2])
    assert any("cosine_power held" in warning for warning in fit.warnings)


def test_a_model_without_an_angle_of_its_own_warns_on_axis_data():
    """Nothing off the axis: `jet` can be fitted by its decay, but its width is untested, and the fit says so."""
    fit = calibrate(family("jet"), _jet("jet", widest=0.01), np.random.default_rng(0), bootstrap=0)
    assert fit.held == ()
    assert any("off the axis" in warning for warning in fit.warnings)


def test_points_at_one_distance_leave_the_decay_at_its_start_and_say_so():
    """Nothing at another distance: how speed falls with distance cannot be told."""
    samples = _jet("fitted", nearest=0.295, farthest=0.305)
    fit = calibrate(family("fitted"), samples, np.random.default_rng(0), bootstrap=0)
    assert fit.held == ("decay_power", "soft_radius_m")
    assert any("decay_power, soft_radius_m held" in warning for warning in fit.warnings)


def test_what_cannot_be_fitted_is_refused():
    """Too few rows, a model that is never fitted, an unknown model, thrusts that are not there."""
    with pytest.raises(InputError, match="needs 12 or more"):
        calibrate(family("fitted"), _jet("fitted", points=5, thrusts=(1.0, 2.0)), np.random.default_rng(0))
    for name, words in (("paper", "no free parameters"), ("spline", "unknown")):
        with pytest.raises(InputError, match=words):
            family(name)
    with pytest.raises(InputError, match="held out"):
        split_samples(_jet("jet"), np.random.default_rng(0), test_thrusts_N=(9.0,))
    with pytest.raises(InputError, match="no free parameters"):
        calibrate(FAMILIES["linear"], _jet("jet"), np.random.default_rng(0))


def test_r2_is_nil_for_the_mean_and_negative_beyond():
    """R2 of each thrust's own mean is 0, whatever the thrusts; of twice the speed it is far below."""
    samples = _jet("jet")
    mean = np.empty(len(samples))
    for thrust in samples.thrusts_N:
        rows = samples.thrust_N == thrust
        mean[rows] = samples.speed_m_s[rows].mean()
    assert score_speeds(mean, samples).r2 == pytest.approx(0.0, abs=1e-12)
    assert score_speeds(2.0 * samples.speed_m_s, samples).r2 < 0.0
    assert score_speeds(1.1 * samples.speed_m_s, samples).bias_far_pct == pytest.approx(10.0)


def test_regions_without_points_have_no_score_but_a_reason():
    """No point beyond 0.4 m: the bias there is None, and `why` says how many points there were."""
    near = _jet("jet", farthest=0.35)
    scores = score(family("jet").model(np.array([0.14])), near)
    assert scores.bias_far_pct is None
    assert "0 test points" in scores.why["bias_far_pct"]


def test_a_written_fit_is_read_back_as_settings(tmp_path):
    """The file of a fit holds the settings of the model that was found."""
    fit = calibrate(family("jet-fitted"), _jet("jet-fitted"), np.random.default_rng(1), bootstrap=4)
    write_fit(tmp_path / "wake.yaml", fit, "data.csv", 0.06)
    settings = read_scenario(tmp_path / "wake.yaml").control.wake
    assert settings.model == "jet-fitted"
    assert settings.decay == pytest.approx(fit.parameters["decay"], rel=1e-5)
    assert fit_figures(fit)["parameters"]["decay"]["held"] is False
    (tmp_path / "bad.yaml").write_text("control:\n  wake:\n    model: fitted\n    decay: 3\n", encoding="utf-8")
    with pytest.raises(InputError, match="has no decay"):
        read_scenario(tmp_path / "bad.yaml")
