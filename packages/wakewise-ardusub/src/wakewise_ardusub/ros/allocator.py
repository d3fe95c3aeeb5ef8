"""Thruster allocation of the ROS 2 node: within limits always, and with least wash if target and pose are known.

It replaces the pseudo-inverse of ROS 2's `thruster_allocation_matrix_controller` and adds thrust limits, failed
thrusters and a protected target.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wakewise.allocation import Layout, Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.core.arrays import Array, freeze
from wakewise.core.defaults import BUDGET, DISTURBANCE_WEIGHT
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel

MOST_POINTS = 400
"""Points of a target that are used; of more, every n-th is taken with n times its weight."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ProtectedPoints:
    """Points to spare, shape (n, 3), and their weights, shape (n,): in NED, or in FRD of the body they are fixed to."""

    points_m: Array
    weights: Array
    on_body: bool = False

    def __post_init__(self) -> None:
        n = len(self.points_m)
        freeze(self, points_m=(n, 3), weights=(n,))
        if not np.isfinite(self.points_m).all():
            raise InputError("target: a point is not finite")
        if np.any(self.weights < 0.0):
            raise InputError("target: a weight is negative")

    @property
    def is_empty(self) -> bool:
        """Whether nothing is to be spared."""
        return not np.sum(self.weights) > 0.0


NO_TARGET = ProtectedPoints(points_m=np.zeros((0, 3)), weights=np.zeros(0))


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeAllocation:
    """Thrusts (n,) for a wrench, what they make (6,) in FRD, and what they do.

    `disturbance` and `least_disturbance` are D of these and of the least thrusts in (m/s)^2, None where there is no
    target or no pose; `way` says in words how the thrusts were found.
    """

    thrusts_N: Array
    wrench_B: Array
    requested_B: Array
    scale: float
    disturbance: float | None
    least_disturbance: float | None
    way: str

    @property
    def saved_pct(self) -> float | None:
        """How much less D is than with the least thrusts; None where there is nothing to spare."""
        if self.disturbance is None or not self.least_disturbance:
            return None
        return 100.0 * (1.0 - self.disturbance / self.least_disturbance)


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustAllocator:
    """Allocates for one vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    wake : WakeModel
    weights : Weights
        Of the mean square speed, D over the sum of the target's weights, of squared thrusts and of their change.
    priority : str or None
        Axes in the order in which limits give them up last, such as "ZKMN,XY"; None keeps the wrench's direction.
    share : float
        Of each thruster's limits that may be used, more than 0 to 1.
    failed : tuple of int
        Thrusters that give nothing, from 0.
    budget : int
        Most boxes of branch and bound.

    Raises
    ------
    InputError
        If the share is out of range.
    """

    vehicle: Vehicle
    wake: WakeModel
    weights: Weights = field(default_factory=lambda: Weights(disturbance=DISTURBANCE_WEIGHT))
    priority: str | None = None
    share: float = 1.0
    failed: tuple[int, ...] = ()
    budget: int = BUDGET

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            raise InputError(f"limit_share: {self.share:g}, must be more than 0 and at most 1")

    @cached_property
    def layout(self) -> Layout:
        """Geometry with the limits as they are now."""
        lower, upper = self.share * self.vehicle.thrust_lower_N, self.share * self.vehicle.thrust_upper_N
        dead = list(self.failed)
        lower[dead] = upper[dead] = 0.0
        return compile_layout(self.vehicle.allocation_matrix, lower, upper)

    def __call__(
        self,
        wrench_B: Array,
        target: ProtectedPoints = NO_TARGET,
        X_WB: Pose | None = None,
        previous_N: Array | None = None,
    ) -> NodeAllocation:
        """Thrusts for a wrench, shape (6,), in FRD."""
        gram, total_weight, way = self._gram(target, X_WB)
        least = min_norm_allocation(self.layout, wrench_B, gram, self.priority)
        chosen = least
        if gram is not None:
            weights = replace(self.weights, disturbance=self.weights.disturbance / total_weight)
            chosen = min_wash_allocation(self.layout, wrench_B, gram, weights, previous_N, self.priority, self.budget)
        return NodeAllocation(
            thrusts_N=chosen.thrusts_N,
            wrench_B=chosen.wrench_B,
            requested_B=wrench_B,
            scale=chosen.scale,
            disturbance=chosen.disturbance if gram is not None else None,
            least_disturbance=least.disturbance if gram is not None else None,
            way=way,
        )

    def _gram(self, target: ProtectedPoints, X_WB: Pose | None) -> tuple[Array | None, float, str]:
        if target.is_empty:
            return None, 1.0, "least thrusts: no target"
        if X_WB is None and not target.on_body:
            return None, 1.0, "least thrusts: the target is fixed to the world and there is no fresh pose"
        placed = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])) if target.on_body or X_WB is None else X_WB
        inside = np.all(np.abs(placed.inverse().apply(target.points_m)) < 0.5 * self.vehicle.size_m, axis=1)
        points, weights = target.points_m[~inside], target.weights[~inside]
        every = -(-len(points) // MOST_POINTS) or 1
        points, weights = points[::every], every * weights[::every]
        if not np.sum(weights) > 0.0:
            return None, 1.0, "least thrusts: all points of the target lie within the vehicle"
        region = Region(points_W_m=points, weights=weights, distance_m=np.zeros(len(points)))
        view = InfluenceModel.of(self.vehicle, region, self.wake)
        return view.gram(placed), view.total_weight, "gentle"


def failed_thrusters(told: object, names: tuple[str, ...]) -> tuple[int, ...]:
    """Thrusters, from 0, that a parameter or a text names; nothing, an empty text or an empty list for none.

    Parameters
    ----------
    told : object
        Names or numbers from 1: one, a list of them, or a text in which commas part them.
    names : tuple of str
        The vehicle's thrusters.

    Raises
    ------
    InputError
        If there is no such thruster.
    """
    if told is None or isinstance(told, str):
        parts: list[object] = [*(told or "").strip().removeprefix("[").removesuffix("]").split(",")]
    else:
        # rclpy gives lists of numbers as arrays.
        parts = list(told) if isinstance(told, Iterable) else [told]
    found = set()
    for part in parts:
        word = part.strip() if isinstance(part, str) else f"{part}"
        if not word:
            continue
        if word in names:
            found.add(names.index(word))
        elif word.isdecimal() and 1 <= int(word) <= len(names):
            found.add(int(word) - 1)
        else:
            raise InputError(f"failed: no thruster '{word}', allowed: 1 to {len(names)}, {', '.join(names)}")
    return tuple(sorted(found))
