"""Ways to a place at rest within bounds of rate and of its change: turns of a body, leans, what an assist follows."""

from __future__ import annotations

import math


def eased(value: float, rate: float, wished: float, dt_s: float, fastest: float, hardest: float) -> tuple[float, float]:
    """Value and its rate a step later on the way to a wished value at rest.

    The rate aimed at is the one from which the rest of the way just suffices to stop.

    Parameters
    ----------
    value, rate, wished : float
        In any unit, and per second.
    dt_s : float
    fastest, hardest : float
        Largest rate, and the largest change of it per second.
    """
    left = wished - value
    most = hardest * dt_s
    if abs(left) <= most * dt_s and abs(rate) <= most:
        return wished, 0.0
    # Half a step's change is lost to steps being steps.
    stops = math.sqrt(0.25 * most**2 + 2.0 * hardest * abs(left)) - 0.5 * most
    aimed = min(fastest, stops, abs(left) / dt_s)
    new = rate + min(max(math.copysign(aimed, left) - rate, -most), most)
    return value + 0.5 * (rate + new) * dt_s, new


def eased_after(
    value: float, rate: float, wished: float, wished_rate: float, dt_s: float, fastest: float, hardest: float
) -> tuple[float, float]:
    """The same after a wished value that moves itself: bounds are those of the rate against it.

    `wished` is of the end of the step, `value` of its beginning; once caught up with, it is followed exactly.
    """
    behind, closing = eased(value - (wished - wished_rate * dt_s), rate - wished_rate, 0.0, dt_s, fastest, hardest)
    return wished + behind, wished_rate + closing


def slewed_rate(rate: float, wished: float, dt_s: float, hardest: float) -> float:
    """Rate after a step towards a wished one, changing by at most `hardest` per second."""
    return rate + min(max(wished - rate, -hardest * dt_s), hardest * dt_s)


def near_turn(angle_rad: float, other_rad: float) -> float:
    """The angle, but for whole turns, that is nearest to another one."""
    return other_rad + math.remainder(angle_rad - other_rad, 2.0 * math.pi)
