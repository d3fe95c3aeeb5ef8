"""Methods by name, each a pipeline; ours or one from outside.

Two makers. `tracking` methods control one step at a time: a PID and an allocator. `mpc` methods plan and follow the
plan. The rest of a method is its settings:

| method | motion | allocation | difference |
|---|---|---|---|
| `dp` | PID | least thrusts | dynamic positioning, the baseline |
| `no-forward-jets` | PID | least thrusts | level thrusters at the bow never blow ahead |
| `weighted-pseudo-inverse` | PID | weighted least squares | a price on jets at the target, no wake model |
| `allocation-only` | PID | null space, gentle | weights and wake terms of `wake-aware` |
| `mpc` | MPC | the plan's own | no disturbance term |
| `mpc-smooth` | MPC | the plan's own | the same with a price on change of thrust |
| `wake-aware` | MPC | null space, gentle | the product |
| `linear` | MPC | null space, gentle | believes in the `linear` wake model (an ablation) |
| `pseudo-inverse` | MPC | least thrusts | the wrenches of `wake-aware` (an ablation) |
| `manual` | person and autopilot | least thrusts | see `manual.py` |
| `manual-careful` | the same | the same | the pilot gain of survey pilots, 20 to 30 % |
| `ardusub` | ArduSub's loops | ArduSub's mixer | see `ardusub.py` |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

from wakewise.allocation import Layout
from wakewise.control.ardusub import ardusub
from wakewise.control.attitude_optimizer import attitude_optimizer
from wakewise.control.bed_points import with_bed_points
from wakewise.control.forward_jet_exclusion import bow_layout
from wakewise.control.manual import manual
from wakewise.control.mpc_controller import mpc_pipeline
from wakewise.control.null_space_allocation import (
    SEARCH_S,
    STAGGER_S,
    Allocator,
    allocation_context,
    least_thrust_allocator,
    vehicle_layout,
)
from wakewise.control.operator_population import CAREFUL
from wakewise.control.pid import make_pid
from wakewise.control.pipeline import Pipeline, TrackingStage
from wakewise.control.settings import ControlSettings
from wakewise.control.weighted_allocation import weighted_allocator
from wakewise.core.checks import protocol_part
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.core.plugins import make
from wakewise.planning import Surroundings
from wakewise.planning.obstacles import around_target
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import bed_of, free_jet, wake_model

FILTER_S = 0.77
"""Time over which `mpc-smooth` filters its thrusts: of those flown the longest whose position error is within a tenth
of that of `mpc` (docs/research-log/0036)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlTask:
    """What a controller is made for; a method from outside is made by a callable that takes this alone."""

    vehicle: Vehicle  # as it is believed to be
    region: Region  # the water to spare
    wake: WakeModel  # what is believed of the jets
    settings: ControlSettings
    surroundings: Surroundings | None = None  # what to keep clear of


def tracking(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
    *,
    name: str,
    layout: Callable[[Vehicle], Layout] = vehicle_layout,
    gentle: bool = False,
) -> Pipeline:
    """PID, and the least or the gentlest thrusts of a layout, which may allow thrusters less than the vehicle's does.

    Without `gentle` the wake model is only asked what D the thrusts cause.
    """
    own = layout(vehicle)
    stage = TrackingStage(pid=make_pid(vehicle, settings))
    if not gentle:
        allocator = least_thrust_allocator(own, vehicle, region, wake, settings)
        return Pipeline(name=name, layout=vehicle_layout(vehicle), motion=stage, allocator=allocator)
    context = allocation_context(vehicle, with_bed_points(region, settings.allocation, bed_of(wake)), wake, settings)
    return Pipeline(
        name=name,
        layout=own,
        motion=stage,
        attitude=attitude_optimizer(context, vehicle, settings, around or around_target(region)),
        allocator=Allocator(layout=own, context=context),
    )


def weighted(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Pipeline:
    """`weighted-pseudo-inverse`: PID, and a price on thrusters that blow at the target."""
    del around
    return Pipeline(
        name="weighted-pseudo-inverse",
        layout=vehicle_layout(vehicle),
        motion=TrackingStage(pid=make_pid(vehicle, settings)),
        allocator=weighted_allocator(vehicle, region, wake, settings),
    )


def mpc(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
    *,
    name: str,
    least: bool = False,
) -> Pipeline:
    """The planner with a disturbance term, and null-space allocation of its wrench where the settings say so.

    With `least` thrusts sent are the least ones of the same wrench.
    """
    effects, solid = settings.allocation, around or around_target(region)
    seen = with_bed_points(region, effects, bed_of(wake))
    if effects.null_space:
        # The motion spares the target alone: points beside it, and the bed, move only spare thrusts. A plan that is
        # told of them leaves its path for water that nobody photographs.
        planned = mpc_pipeline(vehicle, region, free_jet(wake), settings, name=name, surroundings=solid)
        context = allocation_context(vehicle, seen, wake, settings)
        allocator = Allocator(layout=context.layout, context=context, first_age_s=SEARCH_S - STAGGER_S)
    else:
        planned = mpc_pipeline(vehicle, seen, wake, settings, name=name, surroundings=solid)
        context, allocator = allocation_context(vehicle, seen, wake, settings), None
    sent_by = least_thrust_allocator(vehicle_layout(vehicle), vehicle, region, wake, settings) if least else None
    attitude = attitude_optimizer(context, vehicle, settings, solid)
    return replace(planned, attitude=attitude, allocator=allocator, sent_by=sent_by)


def linear(
    vehicle: Vehicle,
    region: Region,
    _: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Pipeline:
    """`linear`: as `wake-aware`, believing in the `linear` wake model, whatever the settings say."""
    return mpc(vehicle, region, wake_model("linear"), settings, around, name="linear")


def unaware(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
    *,
    name: str = "mpc",
) -> Pipeline:
    """`mpc`: the planner without a disturbance term."""
    careless = settings.model_copy(update={"w_disturbance": 0.0})
    return mpc_pipeline(vehicle, region, free_jet(wake), careless, name=name, surroundings=around)


def smooth(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Pipeline:
    """`mpc-smooth`: the planner without a disturbance term and with a price on change of thrust."""
    change = max(settings.plan.w_change, price_of_change(settings))
    plan = settings.plan.model_copy(update={"w_change": change})
    return unaware(vehicle, region, wake, settings.model_copy(update={"plan": plan}), around, name="mpc-smooth")


def price_of_change(settings: ControlSettings) -> float:
    """Price of squared change of thrust from stage to stage, per N^2.

    Thrusts that cost w_effort h T^2 in a stage of h seconds and w_change (dT)^2 from stage to stage relax over the
    time h sqrt(w_change / (w_effort h)), so the price follows effort and stage where these are set otherwise.
    """
    stage_s = settings.plan.stage_s
    return (FILTER_S / stage_s) ** 2 * settings.w_effort * stage_s


Maker = Callable[[Vehicle, Region, WakeModel, ControlSettings, Surroundings | None], Pipeline]

MAKERS: dict[str, Maker] = {
    "dp": partial(tracking, name="dp"),
    "no-forward-jets": partial(tracking, name="no-forward-jets", layout=bow_layout),
    "weighted-pseudo-inverse": weighted,
    "manual": manual,
    "manual-careful": partial(manual, name="manual-careful", people=CAREFUL),
    "ardusub": ardusub,
    "pseudo-inverse": partial(mpc, name="pseudo-inverse", least=True),
    "mpc": unaware,
    "mpc-smooth": smooth,
    "linear": linear,
    "allocation-only": partial(tracking, name="allocation-only", gentle=True),
    "wake-aware": partial(mpc, name="wake-aware"),
}

METHODS: tuple[str, ...] = tuple(MAKERS)
"""Names of our own methods; the first is the baseline."""


def make_controller(
    method: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings | None = None,
    surroundings: Surroundings | None = None,
) -> Controller[Any]:
    """Controller of that name for a nominal vehicle, a region to spare and a wake model.

    `method` is one of `METHODS`, a name that an installed package offers (entry points `wakewise.controllers`), or
    ``package.module:make``; those from outside are made by a callable of one `ControlTask`.
    The methods that plan keep clear of `surroundings`; without them, of the sphere round the region's surface alone.

    Raises
    ------
    InputError
        If there is no such method, or the gains have no stable bandwidth on this vehicle.
    """
    chosen = settings or ControlSettings()
    if method in MAKERS:
        return MAKERS[method](vehicle, region, wake, chosen, surroundings)
    task = ControlTask(vehicle=vehicle, region=region, wake=wake, settings=chosen, surroundings=surroundings)
    made = make("method", method, MAKERS, task, checked=lambda made: protocol_part(made, "controller"))
    return cast("Controller[Any]", made)
