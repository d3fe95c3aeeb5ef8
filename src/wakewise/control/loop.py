"""The step that every controller shares: estimate and goal to wrench, wrench to thrusts, and what to do in trouble."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation import Allocation, Layout, compile_layout
from wakewise.control.carried import Carried
from wakewise.control.tracker import Tracker, TrackerState
from wakewise.control.watch import APART_S, EVERY_S, FULL, JUMP_EVERY_S, Watch
from wakewise.core.arrays import Array, freeze
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import Vehicle
from wakewise.wake.influence import InfluenceMatrices, InfluenceModel

Allocate = Callable[[Array, Array | None, Array], Allocation]
"""`(wrench_B, gram or None, thrusts before) -> Allocation`; the Gram matrix is None if the wake model gave nonsense."""


def vehicle_layout(vehicle: Vehicle) -> Layout:
    """Allocation matrix and limits of a vehicle, ready for use."""
    return compile_layout(vehicle.allocation_matrix, vehicle.thrust_lower_N, vehicle.thrust_upper_N)


HOLD_S = 0.5
"""Time constant with which thrusts fade while there is no usable estimate: some filter updates may be missed, a
vehicle that is lost must not go on pushing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControllerState:
    """What a controller remembers between steps.

    The tracker's integral, the thrusts last asked for, shape (n,), and the share of the last wrench that they made;
    with a `watch`, what it has seen, how old that is, and how long ago a jump was looked for.
    """

    tracker: TrackerState
    thrusts_N: Array
    share: float = 1.0
    seen: InfluenceMatrices | None = None
    age_s: float = np.inf
    since_s: float = np.inf

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,))


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackingController:
    """A tracker and a way to allocate; implements `wakewise.core.interfaces.Controller`.

    An estimate or goal that is not finite gives the last thrusts, fading with `HOLD_S`, and says so in `fallback`.
    Where there is a `watch`, the estimate's current carries the jets; where that takes them is looked up `EVERY_S`.
    """

    name: str
    tracker: Tracker
    view: InfluenceModel
    allocate: Allocate
    watch: Watch | None = None

    def init(self) -> ControllerState:
        """State before the first step."""
        return ControllerState(tracker=self.tracker.init(), thrusts_N=np.zeros(len(self.view.positions_B_m)))

    def carried(self, state: ControllerState) -> Carried:
        """What another method can go on with."""
        return Carried(tracker=state.tracker, thrusts_N=state.thrusts_N)

    def resumed(self, carried: Carried) -> ControllerState:
        """State before the first step after another method's."""
        return ControllerState(tracker=carried.tracker, thrusts_N=carried.thrusts_N)

    def step(
        self, state: ControllerState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[ControllerState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        for what, X_WB, nu_B in (("estimate", estimate.X_WB, estimate.nu_B), ("goal", goal.X_WB, goal.nu_B)):
            # A sum is finite only if each of its parts is.
            if not np.isfinite(X_WB.p_m.sum() + X_WB.q.sum() + nu_B.sum()):
                return self._hold(state, dt_s, f"{what} not finite: holding the last thrusts, fading")
        tracker_state, wrench = self.tracker.wrench(state.tracker, dt_s, estimate, goal, saturated=state.share < FULL)
        if not np.isfinite(wrench.sum()):
            return self._hold(state, dt_s, "wrench not finite: holding the last thrusts, fading")
        seen, age_s, since_s, found = state.seen, state.age_s + dt_s, state.since_s + dt_s, None
        if self.watch is None:
            seen = self.view.seen(estimate.X_WB)
        elif seen is not None and age_s + 1e-6 < EVERY_S:
            moved = self.watch.moved(wrench, state.thrusts_N)
            if since_s >= JUMP_EVERY_S and age_s + 1e-6 >= APART_S and self.watch.allowed(moved):
                # Such a step has no time to share the change out, too.
                since_s, anew = 0.0, self.watch.jump(wrench, estimate, moved, seen)
                found, seen = (self.watch.as_found(wrench, seen, moved), seen) if anew is None else anew
            else:
                found = self.watch.follow(wrench, seen, state.thrusts_N)
        else:
            shared = self.watch.share_out(wrench, estimate, state.thrusts_N)
            found, seen = (None, None) if shared is None else shared
            age_s = 0.0
        usable = seen is not None and bool(np.isfinite(seen.gram).all())
        fallback = None if usable else "wake model not finite: least thrusts"
        if found is None:
            found = self.allocate(wrench, seen.gram if seen is not None and usable else None, state.thrusts_N)
        if found.scale < FULL and fallback is None:
            fallback = f"thrusters saturated: {100.0 * found.scale:.0f} % of the wrench"
        command = Command(thrusts_N=found.thrusts_N, wrench_B=wrench, disturbance=found.disturbance, fallback=fallback)
        kept = seen if self.watch is not None and usable else None
        after = ControllerState(
            tracker=tracker_state, thrusts_N=found.thrusts_N, share=found.scale, seen=kept, age_s=age_s, since_s=since_s
        )
        return after, command

    def _hold(self, state: ControllerState, dt_s: float, why: str) -> tuple[ControllerState, Command]:
        thrusts = state.thrusts_N * np.exp(-dt_s / HOLD_S)
        return replace(state, thrusts_N=thrusts), Command(thrusts_N=thrusts, wrench_B=np.zeros(6), fallback=why)
