"""How sure a fit of a wake says it is: standard errors of theory, and resamples that know of bad thrusts."""

from __future__ import annotations

import numpy as np

from wakewise.wake.calibration import _bootstrap, _standard_errors, family
from wakewise.wake.samples import JetSamples


def test_standard_errors_are_those_of_least_squares() -> None:
    """Residual sum of squares over the degrees of freedom left, n - p, times the inverse of J'J."""
    rng = np.random.default_rng(0)
    jacobian, residual = rng.normal(size=(7, 3)), rng.normal(size=7)
    free = np.array([True, False, True, True])
    right = np.sqrt(residual @ residual / (7 - 3) * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    found = _standard_errors(jacobian, residual, free)
    np.testing.assert_allclose(found[free], right, rtol=1e-9)
    assert np.isnan(found[1])


def test_resamples_draw_whole_thrusts() -> None:
    """Where each thrust's rows are off alike, the interval is that of few thrusts, not of many rows."""
    rng = np.random.default_rng(0)
    x, thrusts = np.meshgrid(np.linspace(0.1, 0.6, 60), np.arange(1.0, 7.0))
    n = x.size
    made = family("fitted")
    samples = JetSamples(
        x_m=x.ravel(),
        r_m=np.zeros(n),
        thrust_N=thrusts.ravel(),
        speed_m_s=np.ones(n),
        across_m_s=np.zeros(n),
        disk_diameter_m=0.07,
        title="made",
    )
    free = np.zeros(len(made.parameters), dtype=np.bool_)
    free[0] = True
    parameter = made.parameters[0]
    values = made.start.copy()
    values[0] = 0.5 * (parameter.low + parameter.high)
    size = 0.01 * (parameter.high - parameter.low)
    off = np.repeat(rng.normal(size=6), 60)
    off -= off.mean()
    alike, apart = (
        _bootstrap(samples, made, values, np.ones((n, 1)), size * row, free, np.random.default_rng(1), 400)
        for row in (off, rng.permutation(off))
    )
    widths = [float((high - low)[0]) for low, high in (alike, apart)]
    assert widths[0] > 3.0 * widths[1]
    spread = size * off.std()
    assert widths[0] > 2.0 * 1.96 * 0.7 * spread / np.sqrt(6)
