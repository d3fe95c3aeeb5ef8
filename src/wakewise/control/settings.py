"""What a user may set of the controllers."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from wakewise.control.levers import LeverSettings
from wakewise.planning.problem import PlanSettings
from wakewise.settings import Settings
from wakewise.wake import WakeSettings

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Radius = Annotated[float, Field(gt=0.0, le=10.0)]


class ControlSettings(Settings):
    """Rate, gains and weights of the controllers.

    Gains. The paper's PID has 150 N/m, 80 N s/m and 20 N/(m s). They are wishes for its vehicle: others get the same
    bandwidth by their mass, moments by their inertia, and each axis is slowed until its loop keeps its margins
    (`stability.stable_gain_scale`). The estimator counts as a delay: 0.08 s for forces, the 35 ms that the filter lives
    behind the present and as much for what it smooths; the whole loop, filter included, then withstands twice the gain
    and 30 deg of delay in flight on two vehicles (tests of `estimation`). Attitude and rate come from a gyro and are at
    most two samples late. Steady loads are fed forward from the estimator; the integral is for what it misses.

    Weights. The first term of the cost is the weighted mean square of the water's speed at the target's points, in
    (m/s)^2, with weight `w_disturbance`. The other two are set beside it by argument, not by trial:

    - *Effort.* A jet that misses the target still stirs the water that the vehicle will fly through. Momentum flux
      is the same through every plane across a jet, integral of u^2 dA = |T| / rho, so within a length L it gives the
      water of the volume L^3 a mean square speed |T| / (rho L^2): about 1e-3 (m/s)^2 per newton for L = 1 m and
      rho = 998 kg/m3, the size of a work site. Made a square so that the cost stays smooth, and equal at 1 N,
      w_effort = 1e-3 (m/s)^2/N^2.
    - *Change.* A thruster cannot follow commands faster than its lag (about 0.1 s), so asking for them only stirs.
      With effort alone the proximal term w_previous |T - T_previous|^2 relaxes thrusts with the time constant
      dt w_previous / w_effort; setting that to the lag at 50 Hz gives w_previous = 5 w_effort.
    """

    rate_hz: float = Field(default=50.0, description="control steps per second (Hz)", ge=5.0, le=500.0)
    kp_N_m: float = Field(default=150.0, description="wished proportional gain of forces (N/m)", ge=0.0, le=2000.0)
    kd_N_s_m: float = Field(default=80.0, description="wished derivative gain of forces (N s/m)", ge=0.0, le=2000.0)
    ki_N_m_s: float = Field(default=20.0, description="wished integral gain of forces (N/(m s))", ge=0.0, le=500.0)
    estimator_lag_s: float = Field(
        default=0.08, description="delay of position and velocity that the margins must allow for (s)", ge=0.0, le=0.5
    )
    gyro_lag_s: float = Field(
        default=0.04, description="delay of attitude and rate that the margins must allow for (s)", ge=0.0, le=0.5
    )
    integral_share: float = Field(
        default=0.25,
        description="most that the integral may ask, as a share of what the thrusters can do",
        ge=0.0,
        le=1.0,
    )
    hold_s: float = Field(
        default=0.5,
        description="time constant with which thrusts fade while there is no usable estimate (s)",
        gt=0.0,
        le=10.0,
    )
    wake: WakeSettings = Field(default=WakeSettings(), description="the wake model that the controller believes in")
    w_disturbance: float = Field(
        default=1.0, description="weight of the mean square water speed at the target (per (m/s)^2)", ge=0.0
    )
    w_effort: float = Field(default=1e-3, description="weight of squared thrust (per N^2)", gt=0.0)
    w_previous: float = Field(default=5e-3, description="weight of squared change of thrust per step (per N^2)", ge=0.0)
    obstacles: tuple[tuple[Coordinate, Coordinate, Coordinate, Radius], ...] = Field(
        default=(),
        max_length=20,
        description="spheres that plans keep clear of besides tank and target: x, y, z in the world (NED), radius (m)",
    )
    plan: PlanSettings = Field(default=PlanSettings(), description="horizon and weights of the methods that plan")
    levers: LeverSettings = Field(default=LeverSettings(), description="what `wake-aware` uses beyond the free jet")
