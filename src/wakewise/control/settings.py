"""What a user may set of the controllers."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from wakewise.core.defaults import DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.settings import Settings
from wakewise.planning.problem import PlanSettings
from wakewise.wake import WakeSettings
from wakewise.wake.disturbance import Superposition

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Radius = Annotated[float, Field(gt=0.0, le=10.0)]
Component = Annotated[float, Field(ge=-1.0, le=1.0)]
Velocity = tuple[Component, Component, Component]


PREVIOUS_SHARE = 5.0
"""Weight of squared change of thrust per step over `w_effort`. A thruster cannot follow commands faster than its lag
(about 0.1 s), so asking for them only stirs. With effort alone the proximal term w_p |T - T_previous|^2 relaxes thrusts
with the time constant dt w_p / w_effort; setting that to the lag at 50 Hz gives 5."""


class AllocationSettings(Settings):
    """What null-space allocation accounts for. Defaults are what reduces wash in the tank (design record 11)."""

    include_bed: bool = Field(default=False, description="also keep the water still on the bed around the target")
    null_space: bool = Field(
        default=True, description="allocate the plan's wrench anew at every step by the exact allocator"
    )
    merging_jets: bool = Field(
        default=True, description="jets that meet merge and run on between them; needs null_space"
    )
    advection: bool = Field(default=True, description="the current bends, stops and carries the jets; needs null_space")
    power_limit: bool = Field(
        default=True,
        description="limit the power of null-space thrust by the wash that it removes and by a bound on the whole",
    )
    power_excess: float = Field(
        default=1.0,
        ge=0.0,
        le=10.0,
        description="factor on the power that this bound allows beyond that of the minimum-norm thrusts; 0 allows none",
    )
    optimize_attitude: bool | None = Field(
        default=None,
        description="choose the hull's attitude where the camera's joint keeps the view (mission.aim: auto); null: "
        "where there is a joint",
    )
    current_m_s: Velocity | None = Field(
        default=None, description="current, north, east, down, if it is stated; null: as the estimator finds it"
    )

    @model_validator(mode="after")
    def _stated_current_can_act(self) -> AllocationSettings:
        if self.current_m_s is not None and not self.advection:
            raise ValueError("current_m_s is stated but advection is off; leave it null, or turn advection on")
        if self.current_m_s is not None and not any(self.current_m_s):
            raise ValueError(
                "current_m_s is no current at all; null takes the estimator's, advection: false does without"
            )
        return self


class ControlSettings(Settings):
    """Rate, gains and weights of the controllers.

    Gains. The paper's PID has 150 N/m, 80 N s/m and 20 N/(m s). They suit its vehicle: others get the same
    bandwidth by their mass, moments by their inertia, and each axis is slowed until its loop keeps its margins
    (`gain_margins.stable_gain_scale`). How late the estimate is, is said in `pid`.

    Weights. The first term of the cost is the weighted mean square of the water's speed at the target's points, in
    (m/s)^2, with weight `w_disturbance`; effort is set beside it. Planner and allocators of one instant share the two.
    Only their ratio moves spare thrusts. By argument alone it would be 1 to 1e-3: momentum flux is the same through
    every plane across a jet, integral of u^2 dA = |T| / rho, so within a length L a jet that misses gives the water of
    the volume L^3 a mean square speed |T| / (rho L^2), 1e-3 (m/s)^2 per newton for a work site of 1 m. But what is
    to be still is the target, a fifth of that size, and not the site: the planner always had 150 times that, and an
    allocator that flies with less gains half as much (docs/research-log/0018). In a plan the pair is per second.
    """

    rate_hz: float = Field(default=50.0, description="control steps per second (Hz)", ge=5.0, le=500.0)
    kp_N_m: float = Field(default=150.0, description="desired proportional gain of forces (N/m)", ge=0.0, le=2000.0)
    kd_N_s_m: float = Field(default=80.0, description="desired derivative gain of forces (N s/m)", ge=0.0, le=2000.0)
    ki_N_m_s: float = Field(default=20.0, description="desired integral gain of forces (N/(m s))", ge=0.0, le=500.0)
    wake: WakeSettings = Field(default=WakeSettings(), description="the wake model that the controller believes in")
    superposition: Superposition = Field(
        default="coherent",
        description="how jets that meet add up: velocities (the paper's), or squares of speed (convex, cannot cancel)",
    )
    w_disturbance: float = Field(
        default=DISTURBANCE_WEIGHT,
        description="weight of the mean square water speed at the target (per (m/s)^2)",
        ge=0.0,
    )
    w_effort: float = Field(default=EFFORT_WEIGHT, description="weight of squared thrust (per N^2)", gt=0.0)
    obstacles: tuple[tuple[Coordinate, Coordinate, Coordinate, Radius], ...] = Field(
        default=(),
        max_length=20,
        description="spheres that plans keep clear of besides tank and target: x, y, z in the world (NED), radius (m)",
    )
    pulse_s: float | None = Field(
        default=None,
        ge=0.0,
        le=5.0,
        description="shortest pulse and pause of a thruster that is asked for less than its least thrust (s), "
        "null for its own lag",
    )
    plan: PlanSettings = Field(default=PlanSettings(), description="horizon and weights of the methods that plan")
    allocation: AllocationSettings = Field(
        default=AllocationSettings(), description="what null-space allocation accounts for beyond the free jet"
    )
    operator_seed: int | None = Field(
        default=None,
        ge=0,
        description="who flies `manual` or `manual-careful`, or is the pilot `human` or `assisted`, by number; "
        "none = the one whom the trial's seed draws",
    )

    def without_attitude_optimization(self) -> ControlSettings:
        """The same where the body's attitude is the mission's."""
        allocation = self.allocation.model_copy(update={"optimize_attitude": False})
        return self.model_copy(update={"allocation": allocation})


def flown_by(settings: ControlSettings, seed: int) -> ControlSettings:
    """The settings with the person whom a seed draws, unless they name one."""
    return settings if settings.operator_seed is not None else settings.model_copy(update={"operator_seed": seed})
