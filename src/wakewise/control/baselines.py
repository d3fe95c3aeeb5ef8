"""The methods that differ in what they care for: least thrusts, smooth motion, still water now, still water soon.

`dp` and `instant` fly by the tracker alone at the rate of the loop. The others plan two seconds ahead and share solver,
tracker and guard; what they weigh is all that differs, so what they do to the water can be told apart:

- `unaware`: no disturbance term.
- `smooth`: no disturbance term, but a price on change of thrust.
- `pseudo-inverse`: the motion of `wake-aware`, wrench for wrench, made with the least thrusts.
- `wake-aware`: the disturbance of the region over the horizon, and the levers that are switched on.
- `linear`: `wake-aware` that believes in the `linear` wake model, an ablation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.control.allocation import Allocation, Layout, least_thrusts
from wakewise.control.levers import Early, levelled, watched
from wakewise.control.loop import TrackingController
from wakewise.control.receding import planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.control.spare import meeting_view, respared
from wakewise.control.surroundings import Surroundings
from wakewise.control.tracker import make_tracker
from wakewise.control.view import WakeView
from wakewise.control.wake_aware import vehicle_layout, wake_aware
from wakewise.interfaces import BodyState, Command, Controller, Goal, WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import FloorJet, wake_model

W_CHANGE_PER_N2 = 0.05
"""Price of change of thrust of `smooth`, per N^2 and stage. The planner's effort costs w_effort h = 1e-4 per N^2 and
stage; filtering over the horizon of 2 s asks for w_change / (w_effort h) = (2 s / 0.1 s)^2 = 400, rounded up to 500."""


def dynamic_positioning(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,  # noqa: ARG001
) -> TrackingController:
    """`dp`: the tracker with the least thrusts; the wake model is only asked what D they cause."""
    layout = vehicle_layout(vehicle)

    def allocate(wrench_B: Array, gram: Array | None, _: Array) -> Allocation:
        return least_thrusts(layout, wrench_B, gram)

    return TrackingController(
        name="dp",
        tracker=make_tracker(vehicle, settings),
        view=WakeView.of(vehicle, region, wake, settings.wake.sum),
        allocate=allocate,
        hold_s=settings.hold_s,
    )


def instant(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,  # noqa: ARG001
) -> Controller[Any]:
    """`instant`: the tracker, and the gentlest thrusts for its wrench, one instant at a time."""
    levers = settings.levers
    chosen = settings
    if levers.incoherent:
        chosen = settings.model_copy(update={"wake": settings.wake.model_copy(update={"sum": "incoherent"})})
    controller = wake_aware(vehicle, watched(region, levers, _bed_of(wake)), wake, chosen)
    view = meeting_view(controller.view, vehicle_layout(vehicle)) if levers.meet else controller.view
    return levelled(replace(controller, name="instant", view=view), levers)


def planned(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`wake-aware`: the receding-horizon planner with the levers of the settings."""
    return _planned("wake-aware", vehicle, region, wake, settings, around)


def linear(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,  # noqa: ARG001
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`linear`: as `wake-aware`, believing in the `linear` wake model, whatever the settings say."""
    return _planned("linear", vehicle, region, wake_model("linear"), settings, around)


def unaware(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`unaware`: the planner without a disturbance term."""
    plan = settings.plan.model_copy(update={"w_disturbance": 0.0})
    return planning_controller(vehicle, region, _free(wake), settings, plan, name="unaware", surroundings=around)


def smooth(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`smooth`: the planner without a disturbance term and with a price on change of thrust."""
    change = max(settings.plan.w_change, W_CHANGE_PER_N2)
    plan = settings.plan.model_copy(update={"w_disturbance": 0.0, "w_change": change})
    return planning_controller(vehicle, region, _free(wake), settings, plan, name="smooth", surroundings=around)


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastThrusts:
    """The wrench of another controller, made with the least thrusts; implements `wakewise.interfaces.Controller`."""

    name: str
    inner: Controller[Any]
    layout: Layout
    view: WakeView

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide the thrusts for the next `dt_s` seconds; what the one within falls back on is flown as it is."""
        state, command = self.inner.step(state, dt_s, estimate, goal)
        if command.fallback is not None:
            return state, command
        found = least_thrusts(self.layout, command.wrench_B, self.view.gram(estimate.X_WB))
        return state, replace(command, thrusts_N=found.thrusts_N, disturbance=found.disturbance)


def planned_pseudo_inverse(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`pseudo-inverse`: the wrenches of `wake-aware`, levers included, made with the least thrusts."""
    return LeastThrusts(
        name="pseudo-inverse",
        inner=planned(vehicle, region, wake, settings, around),
        layout=vehicle_layout(vehicle),
        view=WakeView.of(vehicle, region, wake, settings.wake.sum),
    )


def _planned(
    name: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None,
) -> Controller[Any]:
    levers, plan = settings.levers, settings.plan
    changes: dict[str, Any] = {}
    # Wall jets that cancel on paper give the coherent sum many minima within 3 % of one another, and plans jump between
    # them (docs/decisions/0014); the sum of squares is convex, and plans stay.
    floor_in_plan = isinstance(wake, FloorJet) and not levers.spare
    if levers.incoherent or settings.wake.sum == "incoherent" or floor_in_plan:
        changes["superposition"] = "incoherent"
    if levers.tilt_deg > 0.0:
        changes["attitude_tolerance_rad"] = float(np.radians(levers.tilt_deg))
    if levers.quiet:
        changes |= {"quiet_gain": levers.quiet_gain, "exposure_s": plan.exposure_s + levers.quiet_lead_s}
    seen = watched(region, levers, _bed_of(wake))
    controller: Controller[Any] = planning_controller(
        vehicle,
        seen,
        _free(wake) if levers.spare else wake,
        settings,
        plan.model_copy(update=changes),
        name=name,
        surroundings=around,
    )
    if levers.quiet:
        controller = Early(inner=controller, lead_s=levers.quiet_lead_s)
    if levers.spare:
        controller = respared(controller, vehicle, seen, wake, settings)
    return levelled(controller, levers)


def _bed_of(wake: WakeModel) -> float | None:
    return wake.bed_z_m if isinstance(wake, FloorJet) else None


def _free(wake: WakeModel) -> WakeModel:
    """The free jet of a model: a planner that does not weigh disturbance needs no floor."""
    return wake.jet if isinstance(wake, FloorJet) else wake
