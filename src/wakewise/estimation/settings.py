"""What a user may say of the sensors' and the model's errors."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wakewise.settings import Settings


class FilterSettings(Settings):
    """Noise that the filter assumes; its gains follow from these numbers (steady-state Kalman filter).

    The defaults of the sensors are those of a camera pose (2 mm, 0.2 deg, 62 Hz), a low-cost gyro (JY901 class,
    0.1 deg/s) and a pressure sensor (MS5837 class, 1 cm). The defaults of the model: commanded thrust of a few newtons
    wrong by 10 % on 10 kg is 0.03 to 0.05 m/s2, lasting about 0.1 s: as white noise 0.05 sqrt(2 x 0.1) = 0.02
    m/s2/sqrt(Hz); a trim or drag error of 1 N on 10 kg is 0.1 m/s2 and comes and goes within about 5 s: a random walk
    of 0.1 / sqrt(5) = 0.045 m/s2/sqrt(s). Without a model the vehicle's own manoeuvres, 0.1 to 0.5 m/s2 for some tenths
    of a second, are noise as well.
    """

    motion_model: Literal["vehicle", "constant-velocity"] = Field(
        default="vehicle",
        description="what moves the estimate between poses: the vehicle's equations, or its last velocity",
    )
    pose_rate_hz: float = Field(default=62.0, description="poses per second (Hz)", gt=0.0, le=1000.0)
    position_std_m: float = Field(default=0.002, description="noise of a pose's position, per axis (m)", gt=0.0, le=1.0)
    attitude_std_rad: float = Field(
        default=0.0035, description="noise of a pose's attitude, per axis (rad)", gt=0.0, le=1.0
    )
    gyro_rate_hz: float = Field(default=50.0, description="gyro samples per second (Hz)", gt=0.0, le=10000.0)
    gyro_std_rad_s: float = Field(default=0.002, description="noise of a gyro sample, per axis (rad/s)", gt=0.0, le=1.0)
    gyro_bias_walk_rad_s2: float = Field(
        default=1e-4, description="random walk of the gyro's bias (rad/s/sqrt(s))", gt=0.0, le=0.1
    )
    depth_std_m: float = Field(default=0.01, description="noise of a depth sample (m)", gt=0.0, le=10.0)
    acceleration_noise_m_s2: float = Field(
        default=0.02, description="white error of the modelled acceleration (m/s2/sqrt(Hz))", gt=0.0, le=10.0
    )
    disturbance_walk_m_s2: float = Field(
        default=0.045, description="random walk of the unmodelled steady acceleration (m/s2/sqrt(s))", gt=0.0, le=10.0
    )
    manoeuvre_noise_m_s2: float = Field(
        default=0.2,
        description="white acceleration taken for manoeuvres without a model (m/s2/sqrt(Hz))",
        gt=0.0,
        le=100.0,
    )
    turning_noise_rad_s2: float = Field(
        default=0.2, description="white error of the modelled angular acceleration (rad/s2/sqrt(Hz))", gt=0.0, le=100.0
    )
    oldest_s: float = Field(default=0.25, description="measurements older than this are left out (s)", gt=0.0, le=2.0)
