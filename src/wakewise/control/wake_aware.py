"""`wake-aware`: model predictive control of the target's water, with the exact allocator behind it.

The planner weighs the disturbance of the region over its horizon; the levers add the water that counts beside the
target's own, and share each plan's wrench out anew. `linear` is the same with the belief in a linear wake model, an
ablation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wakewise.control.levers import Early, levelled, watched
from wakewise.control.receding import planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.control.spare import respared
from wakewise.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import FloorJet, bed_of, free_jet, wake_model


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
    seen = watched(region, levers, bed_of(wake))
    controller: Controller[Any] = planning_controller(
        vehicle,
        seen,
        free_jet(wake) if levers.spare else wake,
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
