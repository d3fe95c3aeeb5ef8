"""The attitude of a body whose camera tilts: leaned as its thrusters like it, under a camera that keeps its pose.

A camera on a joint gives back what a fixed one takes: the mission says where the camera is and where it looks, and the
body may pitch about the joint's hinge as far as the stops allow. That is a redundancy beside that of the thrusters.
Pitched, a heavy vehicle's weight lies partly along its level thrusters, and which way their jets go, and from where,
changes with the angle; what it costs is the moment with which the vehicle rights itself.

A *lean* is the angle by which the joint stands above the mission's. The hinge turns the body the other way:

    X_WB' = X_WB S(-lean),   S(a) the turn by a about the joint's axis through its hinge, in B,

whatever the tilt is, since turns about one axis add up: X_BC(tilt) = S(tilt) X_BC(0). The camera's pose
X_WB' X_BC(tilt + lean) = X_WB X_BC(tilt) is the mission's.

A lean takes seconds to be given back, and the mission goes on meanwhile: it must have room where the mission will be by
then, carried on as it moves now, and not only where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from wakewise.allocation import Layout, PowerLaw, Weights, compile_layout, min_wash_allocation
from wakewise.control import easing
from wakewise.control.thrift import STANDING_W, power_law
from wakewise.control.watch import FULL
from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_rotvec
from wakewise.core.interfaces import Goal
from wakewise.planning import Surroundings
from wakewise.planning.barrier import least_gap
from wakewise.planning.problem import CLEARANCE_M
from wakewise.planning.reference import reference_of
from wakewise.robot.vehicles import RigidBody, TiltJoint, Vehicle, compile_body, restoring_wrench
from wakewise.robot.vehicles.dynamics import coriolis_wrench, damping_wrench

STEP_RAD = float(np.radians(5.0))
"""Distance between the leans that are compared: half a metre on, a jet moves by 4 cm, less than its own width there."""
RESERVE = 0.8
"""Share of the thrusters' limits that holding a posture may take; the rest is the tracker's."""
RATE_RAD_S, ACCELERATION_RAD_S2 = 0.08, 0.04
"""How fast a lean changes, and how fast that. The body's middle goes round a hinge at most a quarter of a metre away:
at 2 cm/s, a third of a mission's speed on its orbits, with 1 cm/s2, a fifth of the acceleration of a mission's legs, so
that a change of posture asks for less than the mission itself does."""

LOOK_S, ROUND_S = 0.1, 2.0
"""Time between two looks at a lean: the planner's own; and what a round of them takes over a joint of 90 deg."""
AHEAD_S = 0.5
"""Time between two places where there must be room: at a mission's fastest, .3 m/s, half a hull."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hinge:
    """A camera's mount at no tilt and the joint that turns it, as a change of posture needs them."""

    X_BC: Pose
    joint: TiltJoint

    def span(self, tilt_rad: float) -> tuple[float, float]:
        """Least and largest lean that the stops allow a camera that the mission tilts so; they hold zero."""
        return min(self.joint.low_rad - tilt_rad, 0.0), max(self.joint.high_rad - tilt_rad, 0.0)

    @property
    def axis(self) -> Array:
        """The joint's axis in B, shape (3,): the camera's own, to its right."""
        return self.X_BC.R[:, 0]

    @property
    def pivot_m(self) -> Array:
        """A point on the joint's axis, shape (3,), from B's origin."""
        return self.X_BC.p_m if self.joint.p_BJ_m is None else self.joint.p_BJ_m

    def posed(self, goal: Goal, lean_rad: float, rate_rad_s: float = 0.0) -> Goal:
        """The goal with another attitude and tilt, the camera's pose and motion as they were.

        Parameters
        ----------
        goal : Goal
        lean_rad, rate_rad_s : float
            By how much the joint stands above the goal's tilt, and how fast that grows.

        Returns
        -------
        Goal
            Its twist is the derivative of its pose: the old one seen from the new frame, and the turn of the body
            about the hinge, against the joint's.
        """
        if lean_rad == 0.0 and rate_rad_s == 0.0:
            return goal
        axis, pivot = self.axis, self.pivot_m
        turn = Pose(np.zeros(3), quat_from_rotvec(-lean_rad * axis))
        R = turn.R
        shift = pivot - R @ pivot
        v, omega = goal.nu_B[:3], goal.nu_B[3:]
        # Of the new origin, still in the old frame; then in the new one, and the turn about the pivot.
        nu = np.concatenate([R.T @ (v + np.cross(omega, shift)), R.T @ omega])
        nu += rate_rad_s * np.concatenate([np.cross(axis, pivot), -axis])
        return replace(goal, X_WB=goal.X_WB @ Pose(shift, turn.q), nu_B=nu, tilt_rad=goal.tilt_rad + lean_rad)


def eased(lean_rad: float, rate_rad_s: float, wished_rad: float, dt_s: float) -> tuple[float, float]:
    """Lean and its rate a step later on the way to a wished lean at rest, within `RATE_RAD_S` and its own change."""
    return easing.eased(lean_rad, rate_rad_s, wished_rad, dt_s, RATE_RAD_S, ACCELERATION_RAD_S2)


@lru_cache(maxsize=512)
def given_back(lean_rad: float, held_s: float = 0.0) -> tuple[float, ...]:
    """Leans every `AHEAD_S` from now on, if one is held for a while and then given back."""
    lean, rate, leans = lean_rad, 0.0, [lean_rad] * (1 + round(held_s / AHEAD_S))
    while lean != 0.0:
        for _ in range(round(AHEAD_S / LOOK_S)):
            lean, rate = eased(lean, rate, 0.0, LOOK_S)
        leans.append(lean)
    return tuple(leans)


Gram = Callable[[Pose, Array], Array]
"""`(X_WB, thrusts_N) -> G`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hold:
    """What is to be held: a goal, and the load on the vehicle there.

    `force_W_N`, shape (3,), keeps its direction in the world (trim, current, cable), `moment_B_Nm`, shape (3,), in the
    body. `gram` gives the matrix of D, shape (2 n, 2 n), of a body's pose and of thrusts about which it is to hold,
    shape (n,); `total_weight` is that of the water it counts.
    """

    goal: Goal
    force_W_N: Array
    moment_B_Nm: Array
    gram: Gram
    total_weight: float

    def __post_init__(self) -> None:
        freeze(self, force_W_N=(3,), moment_B_Nm=(3,))


@dataclass(frozen=True, kw_only=True)
class Price:
    """What holding a posture costs: the allocators' own cost, and the power that the thrusters take for it.

    Both are infinite where it is not to be had.
    """

    cost: float
    power_W: float


NOT_TO_BE_HAD = Price(cost=np.inf, power_W=np.inf)
NEAR = 4.0
"""Postures that cost at most this many times the least are as good as the least: no wake model of ours knows the speeds
of the water within a factor of two (docs/research-log/0014), and cost goes with their square."""
MOST_POWER = 2.0
"""A posture may take this many times the power of the mission's own. Where wash is carried off by a current or has
nothing to disturb, wake models still find it, and a vehicle that hovers for nearly nothing would lean for it."""
WORTH = 0.1
"""Share of the power, or of the bound on the cost, by which another posture must be better than the present one.

Of the power it must save `STANDING_W`, too: what a vehicle rights itself with is known to a few tenths of a newton
metre, and in nearly perfect trim one leaned to and fro by 5 deg for half a watt that it never found there.
"""


def chosen(prices: Sequence[Price], own: int, present: int) -> int:
    """Which of some postures to take: of those that cost about the least, the one of least power.

    Thrusts are known, what they do to the water is known roughly: so what seems to be twice as gentle decides, and
    below that the battery does. The present one stays while it is about as good by both.

    Parameters
    ----------
    prices : sequence of Price
    own, present : int
        Numbers of the mission's own posture and of the present one.
    """
    most = MOST_POWER * prices[own].power_W
    usable = [k for k, price in enumerate(prices) if price.power_W <= most and np.isfinite(price.cost)]
    if not usable:
        return own
    least = NEAR * min(prices[k].cost for k in usable)
    best = min((k for k in usable if prices[k].cost <= least), key=lambda k: prices[k].power_W)
    cost, power, enough = prices[present].cost, prices[present].power_W, prices[best].power_W + STANDING_W
    stays = cost <= (1.0 + WORTH) * least and (1.0 - WORTH) * power <= min(enough, most)
    return present if stays else best


@dataclass(frozen=True, kw_only=True, eq=False)
class Scale:
    """What a posture is weighed by: the nominal vehicle, what it may not touch, and the allocators' own weights.

    `half_m`, shape (3,), is half the hull's size; `layout` has the thrusters' limits less the tracker's reserve.
    """

    hinge: Hinge
    body: RigidBody
    layout: Layout
    law: PowerLaw
    half_m: Array
    around: Surroundings
    w_disturbance: float
    w_effort: float

    @classmethod
    def of(cls, vehicle: Vehicle, joint: TiltJoint, around: Surroundings, weights: tuple[float, float]) -> Scale:
        """For a vehicle with this joint, and weights of disturbance (of its weighted mean) and effort."""
        lower, upper = RESERVE * vehicle.thrust_lower_N, RESERVE * vehicle.thrust_upper_N
        return cls(
            hinge=Hinge(X_BC=vehicle.X_BC, joint=joint),
            body=compile_body(vehicle),
            layout=compile_layout(vehicle.allocation_matrix, lower, upper),
            law=power_law(vehicle),
            half_m=0.5 * np.asarray(vehicle.size_m),
            around=around,
            w_disturbance=weights[0],
            w_effort=weights[1],
        )

    def leans(self, goal: Goal) -> tuple[float, ...]:
        """Leans to compare: whole steps between the stops, and the stops."""
        low, high = self.hinge.span(goal.tilt_rad)
        steps = STEP_RAD * np.arange(np.ceil(low / STEP_RAD), np.floor(high / STEP_RAD) + 1.0)
        return tuple(float(lean) for lean in np.unique(np.concatenate([[low], steps, [0.0], [high]]).round(9)))

    def price(self, hold: Hold, lean_rad: float) -> Price:
        """What the gentlest thrusts that hold a posture cost; `NOT_TO_BE_HAD` where there are none.

        That is: where there is no room (`has_room`), or the thrusters' limits do not suffice. The wrench is the
        tracker's feed-forward: against weight, buoyancy and the moment that rights the vehicle, against the drag of the
        goal's own motion and the load.
        """
        goal = self.hinge.posed(hold.goal, lean_rad)
        if lean_rad != 0.0 and not self.has_room(hold.goal, lean_rad, ROUND_S):
            return NOT_TO_BE_HAD
        nu = np.array(goal.nu_B)
        wrench = -restoring_wrench(self.body, goal.X_WB.q) - damping_wrench(self.body, nu)
        wrench -= coriolis_wrench(self.body, nu)
        wrench[:3] -= goal.X_WB.R.T @ hold.force_W_N
        wrench[3:] -= hold.moment_B_Nm
        if not np.isfinite(wrench).all():
            return NOT_TO_BE_HAD
        G = hold.gram(goal.X_WB, self.layout.inverse @ wrench)
        if not np.isfinite(G).all():
            return NOT_TO_BE_HAD
        weights = Weights(disturbance=self.w_disturbance / hold.total_weight, effort=self.w_effort)
        found = min_wash_allocation(self.layout, wrench, G, weights)
        if found.scale < FULL or found.disturbance is None:
            return NOT_TO_BE_HAD
        T = found.thrusts_N
        return Price(
            cost=weights.disturbance * found.disturbance + weights.effort * float(T @ T),
            power_W=float(self.law.power_W(T)),
        )

    def has_room(self, goal: Goal, lean_rad: float, held_s: float = 0.0) -> bool:
        """Whether a lean that is held for a while keeps the hull clear until it is given back, the goal going on.

        Clear is: no nearer to anything than `CLEARANCE_M`, or than the mission's own attitude there.
        """
        leans = np.array(given_back(lean_rad, held_s))
        way = reference_of(goal, len(leans) - 1, AHEAD_S)
        turns = matrix_from_quat(quat_from_rotvec(np.multiply.outer(-leans, self.hinge.axis)))
        R_own = matrix_from_quat(way[:, 3:7])
        p_own, pivot = way[:, :3].copy(), self.hinge.pivot_m
        # As `Hinge.posed` has it, for all places at once.
        p_posed = p_own + np.squeeze(R_own @ (pivot - turns @ pivot)[..., None], -1)
        both = zip(p_own, R_own, p_posed, R_own @ turns, strict=True)
        return all(self.gap_m(p, R) >= min(CLEARANCE_M, self.gap_m(p0, R0)) for p0, R0, p, R in both)

    def gap_m(self, p_m: Array, R: Array) -> float:
        """Least distance of a hull from what it may not touch: its middle, shape (3,), and its attitude, (3, 3)."""
        return float(least_gap(p_m, R, self.half_m, self.around.planes, self.around.spheres))
