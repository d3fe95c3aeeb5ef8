"""`pseudo-inverse`: the motion of `wake-aware`, wrench for wrench, made with the least thrusts; an ablation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from wakewise.allocation import Layout, min_norm_allocation
from wakewise.control.loop import vehicle_layout
from wakewise.control.settings import ControlSettings
from wakewise.control.wake_aware import planned
from wakewise.core.interfaces import BodyState, Command, Controller, Goal, WakeModel
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastThrusts:
    """The wrench of another controller, made with the least thrusts; implements
    `wakewise.core.interfaces.Controller`.
    """

    name: str
    inner: Controller[Any]
    layout: Layout
    view: InfluenceModel

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide the thrusts for the next `dt_s` seconds; what the one within falls back on is flown as it is."""
        state, command = self.inner.step(state, dt_s, estimate, goal)
        if command.fallback is not None:
            return state, command
        found = min_norm_allocation(self.layout, command.wrench_B, self.view.gram(estimate.X_WB))
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
        view=InfluenceModel.of(vehicle, region, wake, settings.superposition),
    )
