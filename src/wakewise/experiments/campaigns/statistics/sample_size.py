"""How many trials a question needs, and how small a difference a number of them can show."""

from __future__ import annotations

from math import isnan, sqrt

from scipy import optimize, stats

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics.intervals import wilson

MOST = 100_000


def power_of_pairs(d_z: float, n: int, alpha: float = 0.05) -> float:
    """Chance that n pairs show a true effect d_z by a two-sided paired t-test (noncentral t).

    Raises
    ------
    InputError
        With fewer than 2 pairs, or alpha not between 0 and 1.
    """
    if n < 2 or not 0.0 < alpha < 1.0:
        raise InputError(f"power: {n} pairs at alpha {alpha}, needs 2 or more and 0 to 1")
    limit = float(stats.t.ppf(1.0 - 0.5 * alpha, n - 1))
    shift = abs(d_z) * sqrt(n)
    above, below = stats.nct.cdf(-limit, n - 1, -shift), stats.nct.cdf(-limit, n - 1, shift)
    # Far out in a tail SciPy gives up; there it is nothing, and the other one everything.
    return float((1.0 if isnan(above) else above) + (0.0 if isnan(below) else below))


def pairs_needed(d_z: float, power: float = 0.8, alpha: float = 0.05) -> int | None:
    """Fewest pairs with which an effect d_z is shown with that chance; None beyond a hundred thousand."""
    low, high = 1, 2
    while power_of_pairs(d_z, high, alpha) < power:
        low, high = high, 2 * high
        if high > MOST:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_of_pairs(d_z, middle, alpha) >= power else (middle, high)
    return high


def smallest_effect(n: int, power: float = 0.8, alpha: float = 0.05) -> float | None:
    """Smallest d_z that n pairs show with that chance; None of fewer than 2."""
    if n < 2:
        return None
    return float(optimize.brentq(lambda d: power_of_pairs(d, n, alpha) - power, 1e-6, 100.0))


def trials_for_rate(rate: float, half_width: float = 0.05) -> int:
    """Fewest trials after which Wilson's 95 % interval of a share about `rate` is no wider than twice this.

    Raises
    ------
    InputError
        If either is not within 0 and 1.
    """
    if not 0.0 <= rate <= 1.0 or not 0.0 < half_width < 1.0:
        raise InputError(f"rate {rate}, half width {half_width}: must be within 0 and 1")

    def width(n: int) -> float:
        low, high = wilson(round(rate * n), n)
        return high - low

    n = 1
    while width(n) > 2.0 * half_width:
        n += max(1, n // 50)  # a few per cent are near enough for a plan
    return n
