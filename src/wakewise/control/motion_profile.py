"""Bang-bang motion profiles: ways to a value at rest within bounds of its rate and of the change of that."""

from __future__ import annotations

import math


def profile_step(
    value: float, rate: float, target: float, dt_s: float, max_rate: float, max_change: float
) -> tuple[float, float]:
    """Value and its rate a step later on the way to a target value at rest.

    The rate aimed at is the one from which the rest of the way just suffices to stop.

    `max_rate` is the largest rate, `max_change` the largest change of it per second; values are in any unit.
    """
    left = target - value
    most = max_change * dt_s
    if abs(left) <= most * dt_s and abs(rate) <= most:
        return target, 0.0
    # Half a step's change is lost to steps being steps.
    stops = math.sqrt(0.25 * most**2 + 2.0 * max_change * abs(left)) - 0.5 * most
    aimed = min(max_rate, stops, abs(left) / dt_s)
    new = rate + min(max(math.copysign(aimed, left) - rate, -most), most)
    return value + 0.5 * (rate + new) * dt_s, new


def profile_step_moving(
    value: float, rate: float, target: float, target_rate: float, dt_s: float, max_rate: float, max_change: float
) -> tuple[float, float]:
    """The same after a target value that moves itself: bounds are those of the rate against it.

    `target` is of the end of the step, `value` of its beginning; once caught up with, it is followed exactly.
    """
    behind, closing = profile_step(
        value - (target - target_rate * dt_s), rate - target_rate, 0.0, dt_s, max_rate, max_change
    )
    return target + behind, target_rate + closing


def limit_slew(rate: float, target: float, dt_s: float, max_change: float) -> float:
    """Rate after a step towards a target one, changing by at most `max_change` per second."""
    return rate + min(max(target - rate, -max_change * dt_s), max_change * dt_s)


def unwrap_near(angle_rad: float, other_rad: float) -> float:
    """The angle, but for whole turns, that is nearest to another one."""
    return other_rad + math.remainder(angle_rad - other_rad, 2.0 * math.pi)
