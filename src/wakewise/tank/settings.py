"""What a user may say about the simulated tank."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from wakewise.settings import Settings

Length = Annotated[float, Field(gt=0.3, le=100.0)]
Speed = Annotated[float, Field(ge=-1.0, le=1.0)]


class TankSettings(Settings):
    """The world of a trial: water, silt, sensors, and how far the plant is from what its controller believes.

    Defaults with a source: a load of 0.1 kg/m2 lies just below the mean of all sediment on mid-shelf reefs (0.127;
    inner shelf 0.864 kg/m2; Tebbett, Goatley and Bellwood 2017, doi 10.1371/journal.pone.0170854), of which part is
    as fine as the silt here: a silty bed, not an average one. A jet's turbulence of 0.25 is
    that of round jets on the axis (0.24 to 0.28; Hussein, Capp and George 1994, doi 10.1017/S002211209400323X).
    Sensor figures are typical of small vehicles' parts and of a camera-based pose at one metre, not of one product.
    """

    size_m: tuple[Length, Length, Length] = Field((6.0, 5.0, 1.5), description="length, width and depth of the water")
    density_kg_m3: float = Field(1000.0, gt=900.0, lt=1100.0, description="of the water; vehicles are trimmed in 1000")
    current_m_s: tuple[Speed, Speed, Speed] = Field((0.03, 0.02, 0.0), description="steady current: north, east, down")
    turbulence: float = Field(0.25, ge=0.0, le=0.5, description="fluctuation on a jet's axis over its mean speed")
    flow_step_s: float = Field(0.05, ge=0.005, le=0.1, description="time step of the water")
    max_parcels: int = Field(
        4096, ge=256, le=65536, description="above this the jets are made coarser, and it is logged"
    )

    silt: float = Field(0.1, ge=0.0, le=20.0, description="kg/m2 of loose fine silt on the bed, 0 for a clean bed")
    grain_m: float = Field(20e-6, ge=1e-6, le=1e-3, description="grain diameter of the silt")
    grain_density_kg_m3: float = Field(2710.0, gt=1150.0, le=8000.0, description="density of the grains (calcite 2710)")
    erosion_kg_m2_s: float = Field(5e-5, ge=0.0, le=1e-2, description="Partheniades' erosion rate M")
    erosion_threshold_Pa: float | None = Field(None, gt=0.0, le=10.0, description="None: Soulsby's, from the grain")
    max_silt_particles: int = Field(4000, ge=100, le=100000, description="above this, pairs of particles become one")

    trim_N: float | None = Field(None, ge=-50.0, le=50.0, description="buoyancy beyond the believed one; None draws it")
    trim_range_N: float = Field(1.0, ge=0.0, le=50.0, description="a drawn trim lies between minus and plus this")
    mass_pct: float = Field(5.0, ge=0.0, le=90.0, description="plant's mass differs by up to this")
    damping_pct: float = Field(30.0, ge=0.0, le=90.0, description="plant's drag differs by up to this")
    added_mass_pct: float = Field(20.0, ge=0.0, le=90.0, description="plant's added mass differs by up to this")
    thrust_pct: float = Field(5.0, ge=0.0, le=90.0, description="each thruster's gain differs by up to this")
    plant_step_s: float = Field(0.005, ge=0.0005, le=0.02, description="longest time step of the vehicle")

    pose_rate_hz: float = Field(62.0, gt=0.0, le=500.0, description="rate of the camera-based pose")
    pose_noise_m: float = Field(0.002, ge=0.0, le=1.0, description="its position noise, one sigma per axis")
    pose_noise_rad: float = Field(0.0035, ge=0.0, le=1.0, description="its attitude noise, one sigma per axis")
    pose_latency_s: float = Field(0.03, ge=0.0, le=1.0, description="from the instant it shows to its arrival")
    gyro_rate_hz: float = Field(50.0, gt=0.0, le=2000.0, description="rate of the gyro")
    gyro_noise_rad_s: float = Field(0.002, ge=0.0, le=1.0, description="its white noise per sample, one sigma")
    gyro_bias_rad_s: float = Field(
        0.003, ge=0.0, le=1.0, description="its constant bias, drawn once, one sigma per axis"
    )
    depth_rate_hz: float = Field(20.0, gt=0.0, le=500.0, description="rate of the pressure sensor")
    depth_noise_m: float = Field(0.005, ge=0.0, le=1.0, description="its noise, one sigma")
