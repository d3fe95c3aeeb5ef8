"""What a user may say of the sensors' and the model's errors."""

from __future__ import annotations

from pydantic import Field

from wakewise.settings import Settings


class FilterSettings(Settings):
    """Noise that the filter assumes.

    The defaults of the sensors are those of a camera pose (2 mm, 0.2 deg), of optical tracking (5 mm), a low-cost
    inertial unit (JY901 class: 0.1 deg/s, 5 mg) and a pressure sensor (MS5837 class, 5 mm). Those of the vehicle are
    the standard deviations of what a careful builder states: gains within 5 %, drag within 30 % and mass with added
    mass within some 10 %, each over the square root of three. They stay what they are through many flights, as a
    tank's current does. The model's noise is for what changes within seconds: gains within 5 % (one sigma 3 %) of 0.2 N
    on 10 kg are 6e-4 m/s2, lasting the 0.1 s of the thruster's lag, as white noise 6e-4 sqrt(2 x 0.1) = 3e-4
    m/s2/sqrt(Hz); with arms of 0.15 m on 0.1 kg m2 about 0.004 rad/s2/sqrt(Hz). When more happens than that, the filter
    notices and lets the noise grow (`error_state`).
    """

    position_std_m: float = Field(default=0.002, description="noise of a pose's position, per axis", gt=0.0, le=1.0)
    attitude_std_rad: float = Field(default=0.0035, description="noise of a pose's attitude, per axis", gt=0.0, le=1.0)
    tracking_std_m: float = Field(default=0.005, description="noise of optical tracking, per axis", gt=0.0, le=1.0)
    gyro_std_rad_s: float = Field(default=0.002, description="noise of a gyro sample, per axis", gt=0.0, le=1.0)
    accelerometer_std_m_s2: float = Field(
        default=0.05, description="noise of an accelerometer sample, per axis", gt=0.0, le=10.0
    )
    depth_std_m: float = Field(default=0.005, description="noise of a depth sample", gt=0.0, le=10.0)
    gyro_bias_std_rad_s: float = Field(default=0.003, description="bias of the gyro at the start", gt=0.0, le=1.0)
    gyro_bias_walk_rad_s2: float = Field(
        default=1e-05, description="random walk of the gyro's bias (rad/s/sqrt(s))", gt=0.0, le=0.1
    )
    accelerometer_bias_std_m_s2: float = Field(
        default=0.05, description="bias of the accelerometer at the start", gt=0.0, le=10.0
    )
    accelerometer_bias_walk_m_s3: float = Field(
        default=0.0001, description="random walk of the accelerometer's bias (m/s2/sqrt(s))", gt=0.0, le=1.0
    )
    acceleration_noise_m_s2: float = Field(
        default=0.0003, description="white error of the modelled acceleration (m/s2/sqrt(Hz))", gt=0.0, le=10.0
    )
    turning_noise_rad_s2: float = Field(
        default=0.004,
        description="white error of the modelled turning (rad/s2/sqrt(Hz))",
        gt=0.0,
        le=100.0,
    )
    gain_std: float = Field(default=0.03, description="relative error of each thruster's gain", ge=0.0, le=1.0)
    drag_std: float = Field(default=0.17, description="relative error of drag, per degree of freedom", ge=0.0, le=1.0)
    inertia_std: float = Field(
        default=0.07, description="relative error of mass with added mass, per degree of freedom", ge=0.0, le=1.0
    )
    current_std_m_s: float = Field(default=0.05, description="steady current, per axis", ge=0.0, le=2.0)
    lasting_s: float = Field(
        default=1e5, description="time over which gains, drag, inertia and current may change", gt=0.0, le=1e6
    )
    pose_slow_std_m: float = Field(
        default=0.0, description="error of a pose's position that lasts, per axis; 0 for none", ge=0.0, le=1.0
    )
    pose_slow_std_rad: float = Field(
        default=0.0, description="error of a pose's attitude that lasts, per axis; 0 for none", ge=0.0, le=1.0
    )
    pose_slow_s: float = Field(default=10.0, description="how long such an error lasts", gt=0.0, le=1e6)
    force_std_N: float = Field(default=1.0, description="unmodelled force at the start, per axis", gt=0.0, le=1000.0)
    force_walk_N: float = Field(
        default=0.004, description="random walk of the unmodelled force (N/sqrt(s))", gt=0.0, le=1000.0
    )
    moment_std_N_m: float = Field(
        default=0.1, description="unmodelled moment at the start, per axis", gt=0.0, le=1000.0
    )
    moment_walk_N_m: float = Field(
        default=0.001, description="random walk of the unmodelled moment (N m/sqrt(s))", gt=0.0, le=1000.0
    )
    start_std_m: float = Field(default=0.02, description="error of the first position, per axis", gt=0.0, le=10.0)
    start_std_rad: float = Field(default=0.03, description="error of the first attitude, per axis", gt=0.0, le=1.0)
    start_std_m_s: float = Field(default=0.02, description="error of the first velocity, per axis", gt=0.0, le=10.0)
    start_std_rad_s: float = Field(default=0.02, description="error of the first body rate, per axis", gt=0.0, le=10.0)
    settle_s: float = Field(
        default=0.035,
        description="how long measurements are waited for, so that late ones are taken in order",
        ge=0.0,
        le=1.0,
    )
    gate: float = Field(
        default=1e-6,
        description="chance at which a right measurement is taken for a wrong one and left out (0 takes all)",
        ge=0.0,
        le=0.1,
    )
    gate_patience: int = Field(
        default=15, description="poses left out in a row after which the filter starts over", ge=1, le=10000
    )
