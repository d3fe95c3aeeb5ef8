"""What a user may say of the sensors' errors, and what the filter takes for granted."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from wakewise.settings import Settings


class FilterSettings(Settings):
    """Noise of the sensors that the filter assumes.

    The defaults are those of a camera pose (2 mm, 0.2 deg), of optical tracking (5 mm), a low-cost inertial unit (JY901
    class: 0.1 deg/s, 5 mg) and a pressure sensor (MS5837 class, 5 mm). What else it assumes: `Priors`.
    """

    position_std_m: float = Field(default=0.002, description="noise of a pose's position, per axis", gt=0.0, le=1.0)
    attitude_std_rad: float = Field(default=0.0035, description="noise of a pose's attitude, per axis", gt=0.0, le=1.0)
    tracking_std_m: float = Field(default=0.005, description="noise of optical tracking, per axis", gt=0.0, le=1.0)
    gyro_std_rad_s: float = Field(default=0.002, description="noise of a gyro sample, per axis", gt=0.0, le=1.0)
    accelerometer_std_m_s2: float = Field(
        default=0.05, description="noise of an accelerometer sample, per axis", gt=0.0, le=10.0
    )
    depth_std_m: float = Field(default=0.005, description="noise of a depth sample", gt=0.0, le=10.0)
    gate: float = Field(
        default=1e-6,
        description="chance at which a right measurement is taken for a wrong one and left out (0 takes all)",
        ge=0.0,
        le=0.1,
    )


@dataclass(frozen=True, kw_only=True)
class Priors:
    """What the filter assumes of vehicle, water and its own start; standard deviations, per axis where there are axes.

    Those of the vehicle are what a careful builder states: gains within 5 %, drag within 30 % and mass with added
    mass within some 10 %, each over the square root of three. They stay what they are through many flights, as a
    tank's current does. The model's noise is for what changes within seconds: gains within 5 % (one sigma 3 %) of 0.2 N
    on 10 kg are 6e-4 m/s2, lasting the 0.1 s of the thruster's lag, as white noise 6e-4 sqrt(2 x 0.1) = 3e-4
    m/s2/sqrt(Hz); with arms of 0.15 m on 0.1 kg m2 about 0.004 rad/s2/sqrt(Hz). When more happens than that, the filter
    notices and lets the noise grow (`error_state`).

    Parameters
    ----------
    gyro_bias_std_rad_s, accelerometer_bias_std_m_s2 : float
        Bias at the start.
    gyro_bias_walk_rad_s2, accelerometer_bias_walk_m_s3 : float
        Random walk of the bias (rad/s/sqrt(s), m/s2/sqrt(s)).
    acceleration_noise_m_s2, turning_noise_rad_s2 : float
        White error of the modelled acceleration and turning (m/s2/sqrt(Hz), rad/s2/sqrt(Hz)).
    gain_std, drag_std, inertia_std : float
        Relative error of each thruster's gain, and per degree of freedom of drag and of mass with added mass.
    current_std_m_s : float
        Steady current.
    lasting_s : float
        Time over which gains, drag, inertia and current may change.
    pose_slow_std_m, pose_slow_std_rad, pose_slow_s : float
        Error of a pose that lasts, 0 for none, and how long it lasts.
    force_std_N, moment_std_N_m : float
        Unmodelled force and moment at the start.
    force_walk_N, moment_walk_N_m : float
        Their random walk (N/sqrt(s), N m/sqrt(s)).
    start_std_m, start_std_rad, start_std_m_s, start_std_rad_s : float
        Error of the first position, attitude, velocity and body rate.
    settle_s : float
        How long measurements are waited for, so that late ones are taken in order.
    gate_patience : int
        Poses left out in a row after which the filter starts over.
    """

    gyro_bias_std_rad_s: float = 0.003
    accelerometer_bias_std_m_s2: float = 0.05
    gyro_bias_walk_rad_s2: float = 1e-05
    accelerometer_bias_walk_m_s3: float = 0.0001
    acceleration_noise_m_s2: float = 0.0003
    turning_noise_rad_s2: float = 0.004
    gain_std: float = 0.03
    drag_std: float = 0.17
    inertia_std: float = 0.07
    current_std_m_s: float = 0.05
    lasting_s: float = 1e5
    pose_slow_std_m: float = 0.0
    pose_slow_std_rad: float = 0.0
    pose_slow_s: float = 10.0
    force_std_N: float = 1.0
    moment_std_N_m: float = 0.1
    force_walk_N: float = 0.004
    moment_walk_N_m: float = 0.001
    start_std_m: float = 0.02
    start_std_rad: float = 0.03
    start_std_m_s: float = 0.02
    start_std_rad_s: float = 0.02
    settle_s: float = 0.035
    gate_patience: int = 15
