"""How much power gentle shares may cost: what it is worth, within a bound that goes with what there is to save.

Sparing a target means load on fewer thrusters, and those need more power for the same wrench, up to 1.7 times. That is
bought where the least thrusts would stir the target's water, and wasted where they would not. So shares must save a
percent of speed for two percent of power (`allocation.power`), and the bound on power over that of the least thrusts
goes with the speed that these would leave at the target, by the wake model and what it is known to be wrong by: `CALM`
up to `CALM_M_S`, `TROUBLE` at `TROUBLE_M_S`, `MOST` from `MOST_M_S` on, straight in between. The first two were set
beforehand: a flight may cost 1.3 times the energy of `dp` where that leaves more than 10 mm/s, 1.05 times where it
leaves less than 5 (docs/research-log/0036). Of what lies above 1, a twentieth stays for what the bound does not see:
pulses, the lag of rotors, corrections between two searches. An instant may cost more than a flight, since what is not
worth it elsewhere pays (docs/research-log/0065).

Shares of power are of the thrusters' own and `STANDING_W`, and so is what trouble may cost beyond calm: a ballasted
vehicle hovers on a watt or two, and a quarter of that is no price (docs/research-log/0078).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.allocation import (
    Allocation,
    Layout,
    PowerLaw,
    Weights,
    best_by_power,
    compile_layout,
    disturbance_of,
    min_wash_allocation,
    power_adjusted_cost,
)
from wakewise.allocation.attainable_set import largest_feasible_share
from wakewise.control.settings import PREVIOUS_SHARE, ControlSettings
from wakewise.core.arrays import Array
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle
from wakewise.wake.influence import InfluenceMatrices

KEPT = 0.95
"""Share of the extra power of a whole flight that the bound of an instant hands out: with a bound of 1.3 two flights
cost 1.307 and 1.299 times the energy of `dp`."""
CALM, TROUBLE = 1.0 + KEPT * 0.05, 1.0 + KEPT * 0.3
"""Most power over that of the least thrusts, where these leave the target's water calm, and where they do not."""
CALM_M_S, TROUBLE_M_S, MOST_M_S = 0.005, 0.010, 0.025
MOST = 1.5
"""The least bound that costs no wash: 1.7, about what the gentlest shares of a heavy vehicle need, left 33 % of `dp`'s
in 18 flights in trouble for 1.28 times its energy, 1.5 leaves 32 for 1.27, 1.4 leaves 34 for 1.25
(docs/research-log/0079)."""
STANDING_W = 2.0
"""Power beside that of the thrusters that shares of power are reckoned with: a watt or two that nobody misses. Well
below what computer, camera and lights draw, since a flight's bar on energy counts thrusters alone."""
TOO_FAST = 2.6
"""How many times too fast the wake model has the target's water under the least thrusts, as it reckons jets to go, the
current's way: twice in the median of 14 flights in trouble (1 to 3.7), 3.2 times in 35 calm ones. With 2.6 all but one
of the first lie above `TROUBLE_M_S` and all but one of the others below (docs/research-log/0078)."""


def allowed(speed_m_s: float) -> float:
    """Most power over that of the least thrusts, if these leave a mean speed at the target."""
    return float(np.interp(speed_m_s, (CALM_M_S, TROUBLE_M_S, MOST_M_S), (CALM, TROUBLE, MOST)))


def power_law(vehicle: Vehicle) -> PowerLaw:
    """Electrical power of a vehicle's thrusters as it is believed; below their least thrusts they run in pulses."""
    one = np.ones(len(vehicle.thrusters))
    forward_N, reverse_N = vehicle.least_thrusts_N
    return PowerLaw(
        forward=electrical_power_W(one, vehicle.disk_areas_m2),
        reverse=electrical_power_W(-one, vehicle.disk_areas_m2),
        least_forward_N=forward_N,
        least_reverse_N=reverse_N,
        standing_W=STANDING_W,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Sharer:
    """Gentle shares of a wrench that are worth their power, within the bound on it, if there is a power law."""

    layout: Layout
    law: PowerLaw | None = None

    def shares(
        self,
        wrench_B: Array,
        seen: InfluenceMatrices,
        weights: Weights,
        total_weight: float,
        previous_N: Array | None = None,
    ) -> Allocation:
        """Thrusts of least cost; arguments as for `min_wash_allocation`, `total_weight` that of the points behind D.

        Shares are chosen by `seen.gram`; the bound asks what the least thrusts do as they are sent.
        """
        found = min_wash_allocation(self.layout, wrench_B, seen.gram, weights, previous_N)
        if self.law is None:
            return found
        least_N, _ = largest_feasible_share(self.layout, self.layout.inverse @ wrench_B)
        speed_m_s = math.sqrt(max(disturbance_of(seen.sent, least_N), 0.0) / total_weight) / TOO_FAST
        share = allowed(speed_m_s)
        most_W = share * float(self.law.power_W(least_N)) + (share - CALM) * self.law.standing_W
        calm = _calm(weights, total_weight)
        return best_by_power(self.layout, found, least_N, self.law, most_W, calm, seen.gram, weights, previous_N)

    def worth(self, cost: float, thrusts_N: Array, weights: Weights, total_weight: float) -> float:
        """What shares of one wrench, shape (n,), are compared by: less is better; the cost alone if no law is known."""
        if self.law is None:
            return cost
        drawn_W = float(self.law.power_W(thrusts_N)) + self.law.standing_W
        return power_adjusted_cost(cost, drawn_W, _calm(weights, total_weight))


def _calm(weights: Weights, total_weight: float) -> float:
    """Cost of the disturbance that counts as calm."""
    return weights.disturbance * total_weight * (TOO_FAST * CALM_M_S) ** 2


def sharer_of(vehicle: Vehicle, settings: ControlSettings) -> Sharer:
    """What shares a vehicle's wrenches out, with an eye on power if that lever is on."""
    layout = compile_layout(vehicle.allocation_matrix, vehicle.thrust_lower_N, vehicle.thrust_upper_N)
    return Sharer(layout=layout, law=power_law(vehicle) if settings.levers.thrift else None)


def weights_of(settings: ControlSettings, total_weight: float) -> Weights:
    """Weights of an allocation; D over the points' total weight, so that their number does not matter."""
    return Weights(
        disturbance=settings.w_disturbance / total_weight,
        effort=settings.w_effort,
        previous=PREVIOUS_SHARE * settings.w_effort,
    )
