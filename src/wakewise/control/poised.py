"""A controller round a controller: it chooses the body's attitude, and the inner one flies it.

The choice is slow: the leans between the camera's stops are weighed one after the other (`LOOK_S`), for one instant's
goal, load and water, and at the end of a round one is chosen (`posture.chosen`). The way there is slow, too
(`posture.eased`), and is given up at once where there would be no room left to give it back. The goal that the inner
controller sees moves along it with the twist that belongs to it, so that feed-forward and horizon are right and the
camera stays where the mission wants it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.control.posture import LOOK_S, Hold, Price, Scale, chosen, eased
from wakewise.control.settings import ControlSettings
from wakewise.control.watch import Watch
from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Command, Controller, Goal
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle

LOAD_S = 2.0
"""Time constant over which the load is averaged: a round. A posture is for what stays."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Round:
    """What a round of looks is made for, the leans to look at, the first being the present wish, and the prices."""

    hold: Hold
    leans: tuple[float, ...]
    prices: tuple[Price, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class PoisedState:
    """The inner controller's state, the lean, its rate, the lean to go for, and what the next one hangs on.

    `force_W_N` and `moment_B_Nm`, shape (3,) each, are the mean load; None before the first estimate.
    """

    inner: Any
    lean_rad: float = 0.0
    rate_rad_s: float = 0.0
    wished_rad: float = 0.0
    force_W_N: Array | None = None
    moment_B_Nm: Array | None = None
    round: Round | None = None
    age_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("force_W_N", "moment_B_Nm"):
            if getattr(self, name) is not None:
                freeze(self, **{name: (3,)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Poised:
    """Any controller, under a body attitude of this one's choice; implements `wakewise.core.interfaces.Controller`.

    `watch` is the water that counts. What the camera's joint must do for it is told in `Command.goal`.
    """

    inner: Controller[Any]
    scale: Scale
    watch: Watch

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.inner.name

    def init(self) -> PoisedState:
        """State before the first step."""
        return PoisedState(inner=self.inner.init())

    def step(self, state: PoisedState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PoisedState, Command]:
        """Decide posture and thrusts for the next `dt_s` seconds."""
        if not np.isfinite(goal.X_WB.p_m.sum() + goal.X_WB.q.sum() + goal.nu_B.sum() + goal.tilt_rad):
            inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
            return replace(state, inner=inner, rate_rad_s=0.0, round=None), command
        if np.isfinite(estimate.X_WB.p_m.sum() + estimate.X_WB.q.sum() + estimate.load_B.sum()):
            state = self._look(self._loaded(state, dt_s, estimate), dt_s, estimate, goal)
        low, high = self.scale.hinge.span(goal.tilt_rad)
        lean, rate = eased(state.lean_rad, state.rate_rad_s, min(max(state.wished_rad, low), high), dt_s)
        moves = rate
        if not low <= lean <= high:
            # The mission's own tilt goes on towards a stop, maybe faster than a lean may change: the lean gives way.
            lean, rate = min(max(lean, low), high), 0.0
            moves = (lean - state.lean_rad) / dt_s
        posed = self.scale.hinge.posed(goal, lean, moves)
        inner, command = self.inner.step(state.inner, dt_s, estimate, posed)
        return replace(state, inner=inner, lean_rad=lean, rate_rad_s=rate), replace(command, goal=posed)

    def _loaded(self, state: PoisedState, dt_s: float, estimate: BodyState) -> PoisedState:
        force_W, moment_B = estimate.X_WB.R @ estimate.load_B[:3], estimate.load_B[3:]
        if state.force_W_N is not None and state.moment_B_Nm is not None:
            share = min(dt_s / LOAD_S, 1.0)
            force_W = (1.0 - share) * state.force_W_N + share * force_W
            moment_B = (1.0 - share) * state.moment_B_Nm + share * moment_B
        return replace(state, force_W_N=force_W, moment_B_Nm=moment_B)

    def _look(self, state: PoisedState, dt_s: float, estimate: BodyState, goal: Goal) -> PoisedState:
        """Weigh one lean if it is time; after the last, choose. A wish without room left is given up."""
        if state.age_s + dt_s < LOOK_S - 1e-6 or state.force_W_N is None or state.moment_B_Nm is None:
            return replace(state, age_s=state.age_s + dt_s)
        now, wished = state.round, state.wished_rad
        if not self.scale.has_room(goal, wished):
            now, wished = None, 0.0
        if now is None:
            watch, now_is = self.watch, estimate
            hold = Hold(
                goal=goal,
                force_W_N=state.force_W_N,
                moment_B_Nm=state.moment_B_Nm,
                gram=lambda X_WB, thrusts_N: watch.seen(replace(now_is, X_WB=X_WB), thrusts_N).gram,
                total_weight=watch.view.total_weight,
            )
            low, high = self.scale.hinge.span(goal.tilt_rad)
            present = min(max(wished, low), high)
            leans = (present, *(lean for lean in self.scale.leans(goal) if lean != present))
            now = Round(hold=hold, leans=leans)
        now = replace(now, prices=(*now.prices, self.scale.price(now.hold, now.leans[len(now.prices)])))
        if len(now.prices) < len(now.leans):
            return replace(state, round=now, age_s=0.0, wished_rad=wished)
        return replace(state, round=None, age_s=0.0, wished_rad=now.leans[chosen(now.prices, now.leans.index(0.0), 0)])


def poised(
    controller: Controller[Any],
    watch: Watch,
    vehicle: Vehicle,
    settings: ControlSettings,
    around: Surroundings,
) -> Controller[Any]:
    """The controller with the attitude of its choice where the settings want that and the camera tilts.

    Raises
    ------
    InputError
        If it is asked for by name and the vehicle's camera is fixed.
    """
    wanted, joint = settings.levers.posture, vehicle.tilt
    if wanted and joint is None:
        raise InputError(
            f"control.levers.posture: true, the camera of {vehicle.name} has no joint, so the body's attitude follows "
            "from the camera's: leave it null, or take a vehicle with camera_tilt"
        )
    if joint is None or wanted is False:
        return controller
    weights = settings.w_disturbance, settings.w_effort
    return Poised(inner=controller, scale=Scale.of(vehicle, joint, around, weights), watch=watch)
