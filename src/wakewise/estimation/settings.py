"""Settings of the Kalman filter: sensor noise (`FilterSettings`) and prior standard deviations (`Priors`)."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from wakewise.core.settings import Settings


class FilterSettings(Settings):
    """Noise of the sensors that the filter assumes.

    The defaults are what a user would state of a camera pose (3 mm, 0.25 deg), of optical tracking (6 mm), a low-cost
    inertial unit (JY901 class: 0.2 deg/s, 5 to 10 mg) and a pressure sensor (MS5837 class, 1 cm of water): rounded up,
    not what a simulated sensor draws from. What else it assumes: `Priors`.
    """

    position_std_m: float = Field(default=0.003, description="noise of a pose's position, per axis", gt=0.0, le=1.0)
    attitude_std_rad: float = Field(default=0.0045, description="noise of a pose's attitude, per axis", gt=0.0, le=1.0)
    tracking_std_m: float = Field(default=0.006, description="noise of optical tracking, per axis", gt=0.0, le=1.0)
    gyro_std_rad_s: float = Field(default=0.003, description="noise of a gyro sample, per axis", gt=0.0, le=1.0)
    accelerometer_std_m_s2: float = Field(
        default=0.07, description="noise of an accelerometer sample, per axis", gt=0.0, le=10.0
    )
    depth_std_m: float = Field(default=0.01, description="noise of a depth sample", gt=0.0, le=10.0)
    gate: float = Field(
        default=1e-6,
        description="chance at which a right measurement is taken for a wrong one and left out (0 takes all)",
        ge=0.0,
        le=0.1,
    )


@dataclass(frozen=True, kw_only=True)
class Priors:
    """What the filter assumes of vehicle, water and its own start; standard deviations, per axis where there are axes.

    Those of the vehicle are what a careful builder states, rounded: gains to 4 %, drag to 20 % and mass with added
    mass to 10 %, one sigma each. They stay what they are through many flights, as a
    tank's current does. The model's noise is for what changes within seconds: gains within 5 % (one sigma 3 %) of 0.2 N
    on 10 kg are 6e-4 m/s2, lasting the 0.1 s of the thruster's lag, as white noise 6e-4 sqrt(2 x 0.1) = 3e-4
    m/s2/sqrt(Hz); with arms of 0.15 m on 0.1 kg m2 about 0.004 rad/s2/sqrt(Hz). When more happens than that, the filter
    notices and lets the noise grow (`eskf`).
    """

    # gyro_bias_std_rad_s, accelerometer_bias_std_m_s2: bias at the start.
    gyro_bias_std_rad_s: float = 0.005
    accelerometer_bias_std_m_s2: float = 0.1
    # gyro_bias_walk_rad_s2, accelerometer_bias_walk_m_s3: random walk of the bias (rad/s/sqrt(s), m/s2/sqrt(s)).
    gyro_bias_walk_rad_s2: float = 1e-4
    accelerometer_bias_walk_m_s3: float = 1e-3
    # acceleration_noise_m_s2, turning_noise_rad_s2: white error of the modelled acceleration and turning
    # (m/s2/sqrt(Hz), rad/s2/sqrt(Hz)).
    acceleration_noise_m_s2: float = 0.0003
    turning_noise_rad_s2: float = 0.004
    # gain_std, drag_std, inertia_std: relative error of each thruster's gain, and per degree of freedom of drag and of
    # mass with added mass.
    gain_std: float = 0.04
    drag_std: float = 0.2
    inertia_std: float = 0.1
    current_std_m_s: float = 0.05  # steady current
    lasting_s: float = 1e5  # time over which gains, drag, inertia and current may change
    # pose_slow_std_m, pose_slow_std_rad, tracking_slow_std_m, slow_s: error of a pose and of a tracked place that
    # lasts, 0 for none, and how long it lasts: 4 mm and 0.15 deg for half a minute, what refraction, calibration and
    # map leave at a metre (an estimate).
    pose_slow_std_m: float = 0.004
    pose_slow_std_rad: float = 0.0026
    tracking_slow_std_m: float = 0.004
    slow_s: float = 30.0
    # Constant error of the depth, 0 for none: 3 cm after it was set to zero at the surface.
    depth_bias_std_m: float = 0.03
    # force_std_N, moment_std_N_m: unmodelled force and moment at the start.
    force_std_N: float = 1.0
    moment_std_N_m: float = 0.1
    # force_walk_N, moment_walk_N_m: their random walk at rest in still water (N/sqrt(s), N m/sqrt(s)).
    force_walk_N: float = 0.01
    moment_walk_N_m: float = 0.001
    # turbulence_rate, turbulence_arm_m: what a current adds to the walk, as a share of the horizontal load per sqrt(s),
    # and the arm of its moment. Drag goes with the square of the speed, so eddies of intensity I shake it by 2 I; they
    # last T, and a walk of 2 I sqrt(2 / T) has the same variance over that time. I is 0.1 (I. Nezu and H. Nakagawa,
    # Turbulence in Open-Channel Flows, 1993); T is 8 s, of eddies as long as 1.5 m of water is deep, at 0.2 m/s. The
    # arm is a tenth of a small vehicle's height (an estimate). Before, nothing of the current was in the walk: in the
    # stream of 0.3 m/s dp stood 16 mm off and now 8 (docs/research-log/0083).
    turbulence_rate: float = 0.1
    turbulence_arm_m: float = 0.03
    # start_std_m, start_std_rad, start_std_m_s, start_std_rad_s: error of the first position, attitude, velocity and
    # body rate.
    start_std_m: float = 0.03
    start_std_rad: float = 0.05
    start_std_m_s: float = 0.03
    start_std_rad_s: float = 0.02
    settle_s: float = 0.035  # how long measurements are waited for, so that late ones are taken in order
    gate_patience: int = 15  # poses left out in a row after which the filter starts over
