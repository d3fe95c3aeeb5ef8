"""Settings of the simulated tank, and beds by name with the ranges from which a world may draw their parameters.

- `silt`: a thin layer of loose 20 um carbonate grains without cohesion.
- `fresh-mud`: harbour mud that settled hours to days ago. Threshold 0.037 to 0.305 Pa at 1050 to 1250 kg/m3 (Witt,
  Patzke, Nehlsen and Froehle 2024, Front. Mar. Sci. 11, doi 10.3389/fmars.2024.1386081), geometric mean. Load:
  estimate, 2 cm at 250 kg/m3 dry, more than any flight lifts.
- `fluff`: recent deposits on firmer mud, threshold 0.025 to 0.05 Pa, about ten times that below (Schaaff, Boyer, El
  Ganaoui, Amielh and Anselmet 2007, J. Hydraul. Eng. 133, 1087). Load: estimate, 2 mm (1 to 5) at 50 kg/m3 dry (30 to
  60).
- `sand`: carbonate sand; threshold, settling and pickup follow from its grain (Soulsby 1997; van Rijn 1984). Grains:
  estimate, fine to medium sand.

Mud's grains: estimate, 8 um (5 to 15) quartz and clay, 0.14 m2 of beam attenuation per gram. They settle as aggregates,
six times as fast as single particles (Christiansen et al. 2002, J. Marine Syst. 35, 133); the range reaches from single
grains, since jets break aggregates, to 1 mm/s (estimate). Partheniades' M of mud: estimate, within the 1e-5 to 1e-4
kg/m2/s usual for silts, up to five times that for the softest.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from wakewise.core.settings import Settings

_PLAIN: dict[str, float | None] = {
    "load_kg_m2": 0.0,
    "suspended_mg_l": 0.0,
    "consolidated_load_kg_m2": 0.0,
    "threshold_Pa": None,
    "settling_m_s": None,
    "erosion_kg_m2_s": 5e-5,
}
_MUD: dict[str, float | None] = {
    "grain_m": 8e-6,
    "grain_density_kg_m3": 2650.0,
    "settling_m_s": 3e-4,
    "erosion_kg_m2_s": 1e-4,
}
SILTS: dict[str, dict[str, float | None]] = {
    "clear": _PLAIN,
    "silt": _PLAIN | {"load_kg_m2": 0.1, "grain_m": 20e-6, "grain_density_kg_m3": 2710.0},
    # 50 mg/L of ground calcite with a median grain of 0.3 mm. It is sand: it sinks 4 cm/s, the water of a tank 1.5 m
    # deep is clear after 35 s, and no thruster keeps it up. What it tests is sand on the bed, not turbid water.
    "caco3-50mg": _PLAIN | {"suspended_mg_l": 50.0, "grain_m": 3e-4, "grain_density_kg_m3": 2710.0},
    "fresh-mud": _PLAIN | _MUD | {"load_kg_m2": 5.0, "threshold_Pa": 0.106},
    "fluff": _PLAIN | _MUD | {"load_kg_m2": 1.1, "threshold_Pa": 0.035, "consolidated_load_kg_m2": 1.0},
    "sand": _PLAIN | {"load_kg_m2": 20.0, "grain_m": 2.5e-4, "grain_density_kg_m3": 2710.0},
}
"""Fields that a kind of silt sets, unless they are given as well."""


Length = Annotated[float, Field(gt=0.3, le=100.0)]
Speed = Annotated[float, Field(ge=-3.0, le=3.0)]  # beyond what most vehicles hold, which is said with the margin
Place = tuple[float, float, float]
Nonnegative = Annotated[float, Field(ge=0.0, le=1000.0)]
Span = tuple[Nonnegative, Nonnegative]

PLANT_STEP_S = 0.005
"""Longest time step of the vehicle: a twentieth of a thruster's lag."""
EDDY_M = 0.2
"""Length of the energetic eddies of turbulence that no thruster made: near half a vehicle."""
MAX_PARCELS = 4096
"""Above this the jets are made coarser, and it is logged: what two cores step as fast as a flight lasts."""
MAX_SILT_PARTICLES = 4000
"""Above this, pairs of particles become one."""


class ThrusterFailure(Settings):
    """One thruster that fails at one time and stays so."""

    thruster: int = Field(..., ge=1, le=64, description="its number, from 1")
    at_s: float = Field(0.0, ge=0.0, description="when, after the start")
    kind: Literal["dead", "stuck", "half"] = Field("dead", description="no thrust, a constant one, or a share of it")
    value: float | None = Field(
        None, description="stuck: the thrust in N, null for what it then has; half: the share left, null for 0.5"
    )

    @model_validator(mode="after")
    def _value_fits(self) -> ThrusterFailure:
        if self.kind == "dead" and self.value is not None:
            raise ValueError("value: a dead thruster has none")
        if self.kind == "half" and self.value is not None and not 0.0 <= self.value <= 1.0:
            raise ValueError("value: the share left must be between 0 and 1")
        return self


class CurrentSettings(Settings):
    """The water's own motion: a steady current or a measured series, and turbulence that no thruster made."""

    velocity_m_s: tuple[Speed, Speed, Speed] = Field((0.03, 0.02, 0.0), description="steady current: north, east, down")
    file: str | None = Field(
        None,
        min_length=1,
        description="in place of velocity_m_s: a series (CSV time_s,u,v[,w], m/s; NOAA's JSON) or package.module:make",
    )
    from_s: float = Field(0.0, ge=0.0, description="where in the series the trial starts")
    to_s: float | None = Field(None, gt=0.0, description="where the part used ends, null for all")
    gain: float = Field(1.0, ge=-10.0, le=10.0, description="multiplies the series")
    gap_s: float | None = Field(
        None, gt=0.0, description="longest pause allowed in the part used, null for three median steps"
    )
    turbulence_m_s: float = Field(
        0.0, ge=0.0, le=0.3, description="rms per axis of turbulence that no thruster made, 0 for none"
    )


class WaveSettings(Settings):
    """A linear wave on the surface."""

    amplitude_m: float = Field(0.0, ge=0.0, le=0.5, description="its amplitude, 0 for none")
    period_s: float = Field(3.0, gt=1.0, le=60.0, description="its period: waves below 1 Hz")
    heading_deg: float = Field(0.0, ge=-360.0, le=360.0, description="where it runs to, from north through east")


class PumpSettings(Settings):
    """A pump's fixed jet.

    0.5 m/s from an outlet of 0.3 m at 1.2 m depth makes 0.3 m/s at a target in the middle of the tank; the same speed
    in all the water, as of a recirculating channel, is a `current`.
    """

    speed_m_s: float = Field(0.0, ge=0.0, le=5.0, description="its exit speed, 0 for none")
    diameter_m: float = Field(0.05, ge=0.005, le=0.5, description="diameter of its outlet")
    at_m: Place = Field((-2.9, 0.0, 0.8), description="place of its outlet")
    towards: Place = Field((1.0, 0.0, 0.0), description="where it blows")


class JetSettings(Settings):
    """What the thrusters' jets are like.

    A turbulence of 0.25 is that of round jets on the axis (0.24 to 0.28; Hussein, Capp and George 1994, doi
    10.1017/S002211209400323X). A half width grows by 0.086 (Wygnanski and Fiedler 1969) to 0.096 of the distance
    without swirl, 0.094 in Hussein's, and by up to 0.177 to 0.18 behind a propeller (Fuehrer and Roemisch 1977, Blaauw
    and van de Kaa 1978): where a thruster with its duct lies between them is not known, so a world may draw it. What a
    jet leaves in the water when it stops lives 1.2 (its speed's integral) to 1.7 times (its energy) as long in the
    lattice.
    """

    turbulence: float = Field(0.25, ge=0.0, le=0.5, description="fluctuation on a jet's axis over its mean speed")
    half_width_growth: float = Field(
        0.094, ge=0.086, le=0.18, description="growth of a jet's half width per distance; 0.094 is a round jet's"
    )
    swirl: bool = Field(False, description="jets twice as wide, as a propeller's swirl makes them: a growth of 0.177")
    wake_life: float = Field(
        1.0, ge=1.0, le=1.7, description="how much longer what a jet leaves lives, once it is no longer fed"
    )
    inflow_loss: bool = Field(False, description="thrust falls where water already runs through the disk")

    @model_validator(mode="after")
    def _one_width(self) -> JetSettings:
        if self.swirl and self.half_width_growth != JetSettings.model_fields["half_width_growth"].default:
            raise ValueError(
                f"half_width_growth: {self.half_width_growth:g} and swirl both say how wide jets are, give one of them"
            )
        return self


class SiltSettings(Settings):
    """Fine silt on the bed and in the water.

    A load of 0.1 kg/m2 lies just below the mean of all sediment on mid-shelf reefs (0.127; inner shelf 0.864 kg/m2;
    Tebbett, Goatley and Bellwood 2017, doi 10.1371/journal.pone.0170854), of which part is as fine as the silt here: a
    silty bed, not an average one. Other beds by name, with sources: `wakewise.simulation.tank.settings`.
    """

    kind: Literal["clear", "silt", "caco3-50mg", "fresh-mud", "fluff", "sand"] = Field(
        "silt",
        description="sets what lies on the bed and in the water, its grains and thresholds, unless they are given too; "
        "caco3-50mg clears in 35 s",
    )
    load_kg_m2: float = Field(0.1, ge=0.0, le=20.0, description="loose fine silt on the bed, 0 for a clean bed")
    consolidated_load_kg_m2: float = Field(
        0.0,
        ge=0.0,
        le=20.0,
        description="of load_kg_m2, what lies lowest and has ten times the threshold; what settles lies on it",
    )
    grain_m: float = Field(20e-6, ge=1e-6, le=1e-3, description="grain diameter of the silt")
    grain_density_kg_m3: float = Field(2710.0, gt=1150.0, le=8000.0, description="density of the grains (calcite 2710)")
    suspended_mg_l: float = Field(0.0, ge=0.0, le=5000.0, description="evenly in the water at the start")
    erosion_law: Literal["auto", "partheniades", "van-rijn"] = Field(
        "auto", description="law of erosion; auto takes van Rijn's for sand, from 62.5 um on"
    )
    erosion_kg_m2_s: float = Field(5e-5, ge=0.0, le=1e-2, description="Partheniades' erosion rate M")
    threshold_Pa: float | None = Field(
        None, gt=0.0, le=10.0, description="stress from which it erodes, null for Soulsby's, from the grain"
    )
    settling_m_s: float | None = Field(
        None,
        gt=0.0,
        le=0.5,
        description="speed at which it sinks, null for Soulsby's, from the grain; aggregates sink faster",
    )

    @model_validator(mode="after")
    def _firm_part_fits(self) -> SiltSettings:
        if self.consolidated_load_kg_m2 > self.load_kg_m2:
            raise ValueError(
                f"consolidated_load_kg_m2: {self.consolidated_load_kg_m2:g}, is a part of load_kg_m2 and so at "
                f"most {self.load_kg_m2:g}"
            )
        return self

    @model_validator(mode="before")
    @classmethod
    def _as_its_kind_has_it(cls, given: Any) -> Any:
        """Fill in what the kind says and the user does not."""
        if isinstance(given, dict) and isinstance(given.get("kind"), str):
            return SILTS.get(given["kind"], {}) | given
        return given


class TetherSettings(Settings):
    """A cable to the vehicle."""

    diameter_m: float = Field(0.0, ge=0.0, le=0.05, description="its diameter, 0 for none")
    length_m: float = Field(5.0, gt=0.0, le=500.0, description="paid out; the vehicle goes no farther")
    from_m: Place = Field((-2.5, 0.0, 0.0), description="where the cable comes from: a winch, the surface")
    at_B_m: Place = Field((0.0, 0.0, 0.0), description="where it holds the vehicle, in the body frame")


class SensorSettings(Settings):
    """What the vehicle senses.

    Figures are typical of small vehicles' parts and of a camera-based pose at one metre, not of one product. Those of
    the tilt are estimates: a servo's dead band of 1 to 2 us is 0.1 to 0.2 deg, its mount is aligned to some tenths.

    **Errors that last** do not average out; where a span is given, each flight draws its own value, evenly. The
    camera's map, calibration and refraction put its poses off by millimetres that change as the view does: 3 to 5 mm
    per axis, lasting 10 to 60 s, with as much of the optical tracking, leave about 5 mm after fusion, as the paper's
    vehicle has (5.2 mm); 0.1 to 0.2 deg goes with that at a metre. The sizes are estimates; that such errors are there,
    and depend on where the marks are seen from, is measured (Z. Xu et al., J. Mar. Sci. Eng. 9 (2021) 1432, doi
    10.3390/jmse9121432). A camera without hardware trigger is stamped late by part of a frame and of its way to the
    host: 5 to 20 ms (an estimate; why, and that it is usual: M. Li, A. I. Mourikis, Int. J. Robot. Res. 33 (2014) 947,
    doi 10.1177/0278364913515286). A pressure sensor of the MS5837-30BA class is right to +-50 mbar, half a metre of
    water, by its maker's data; set to zero at the surface, what is left is some centimetres, of waves at that moment,
    warming and weather (1 mbar is 1 cm): 2 cm, an estimate.
    """

    pose_rate_hz: float = Field(62.0, gt=0.0, le=500.0, description="rate of the camera-based pose")
    pose_noise_m: float = Field(0.002, ge=0.0, le=1.0, description="its position noise, one sigma per axis")
    pose_noise_rad: float = Field(0.0035, ge=0.0, le=1.0, description="its attitude noise, one sigma per axis")
    pose_latency_s: float = Field(0.03, ge=0.0, le=1.0, description="from the instant it shows to its arrival")
    pose_dropout: float = Field(0.01, ge=0.0, le=1.0, description="chance that a pose fails in clear water")
    pose_range_m: float = Field(0.7, gt=0.0, le=20.0, description="distance over which the pose's marks are seen")
    pose_outages_s: tuple[tuple[float, float], ...] = Field(
        (), description="spans of time (from, to) in which there is no pose at all"
    )
    pose_drift_m: Span = Field(
        (0.003, 0.005), description="its position's lasting error, from and to, one sigma per axis"
    )
    pose_drift_rad: Span = Field((0.0015, 0.0035), description="its attitude's lasting error, likewise")
    pose_drift_time_s: Span = Field((10.0, 60.0), description="how long the lasting errors of pose and tracking last")
    pose_timestamp_delay_s: Span = Field(
        (0.005, 0.02), description="by how much its time stamp is later than the picture"
    )
    pose_outliers: float = Field(0.01, ge=0.0, le=1.0, description="chance that a pose is far off")
    tracking_rate_hz: float = Field(10.0, ge=0.0, le=500.0, description="rate of optical tracking, 0 for none")
    tracking_noise_m: float = Field(0.005, ge=0.0, le=1.0, description="its position noise, one sigma per axis")
    tracking_latency_s: float = Field(0.03, ge=0.0, le=1.0, description="from the instant it shows to its arrival")
    tracking_drift_m: Span = Field((0.003, 0.005), description="its lasting error, from and to, one sigma per axis")
    imu_rate_hz: float = Field(50.0, gt=0.0, le=2000.0, description="rate of the inertial unit")
    gyro_noise_rad_s: float = Field(0.002, ge=0.0, le=1.0, description="gyro's white noise per sample, one sigma")
    gyro_bias_rad_s: float = Field(
        0.003, ge=0.0, le=1.0, description="its bias at the start, drawn once, one sigma per axis"
    )
    accelerometer_noise_m_s2: float = Field(
        0.05, ge=0.0, le=10.0, description="accelerometer's white noise per sample, one sigma"
    )
    accelerometer_bias_m_s2: float = Field(
        0.05, ge=0.0, le=10.0, description="its bias at the start, drawn once, one sigma per axis"
    )
    depth_rate_hz: float = Field(20.0, gt=0.0, le=500.0, description="rate of the pressure sensor")
    depth_noise_m: float = Field(0.005, ge=0.0, le=1.0, description="its noise, one sigma")
    depth_bias_m: float = Field(0.02, ge=0.0, le=10.0, description="its constant bias, drawn once, one sigma")
    tilt_bias_rad: float = Field(
        0.005, ge=0.0, le=0.2, description="constant error of the camera's measured tilt, drawn once, one sigma"
    )
    tilt_noise_rad: float = Field(0.002, ge=0.0, le=0.2, description="its noise, one sigma")

    @field_validator(
        "pose_drift_m", "pose_drift_rad", "pose_drift_time_s", "pose_timestamp_delay_s", "tracking_drift_m"
    )
    @classmethod
    def _from_less_to_more(cls, span: Span) -> Span:
        if span[0] > span[1]:
            raise ValueError(f"from {span[0]:g} to {span[1]:g}, the first must not be more than the second")
        return span

    @field_validator("pose_drift_time_s")
    @classmethod
    def _lasts(cls, span: Span) -> Span:
        if span[0] < 0.1:
            raise ValueError(f"from {span[0]:g} s, must be 0.1 or more: what lasts no longer is noise")
        return span

    @field_validator("pose_outages_s")
    @classmethod
    def _spans_run_forwards(cls, spans: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for begin, end in spans:
            if not 0.0 <= begin < end:
                raise ValueError(f"from {begin:g} to {end:g} s, each span must start at 0 or later and end after that")
        return spans


class MismatchSettings(Settings):
    """Deviation of the plant from the controller's model."""

    trim_N: float | None = Field(None, ge=-50.0, le=50.0, description="buoyancy beyond the believed one; null draws it")
    trim_range_N: float = Field(1.0, ge=0.0, le=50.0, description="a drawn trim lies between minus and plus this")
    mass_pct: float = Field(5.0, ge=0.0, le=90.0, description="plant's mass differs by up to this")
    drag: str = Field(
        "nominal",
        min_length=1,
        description="plant's drag: nominal, a case of the vehicle's file by name, or random for any of them; "
        "damping_pct comes on top",
    )
    damping_pct: float = Field(30.0, ge=0.0, le=90.0, description="plant's drag differs by up to this")
    added_mass_pct: float = Field(20.0, ge=0.0, le=90.0, description="plant's added mass differs by up to this")
    thrust_pct: float = Field(5.0, ge=0.0, le=90.0, description="each thruster's gain differs by up to this")


class TankSettings(Settings):
    """The world of a trial: water, silt, sensors, and the plant's deviation from the controller's model."""

    size_m: tuple[Length, Length, Length] = Field((6.0, 5.0, 1.5), description="length, width and depth of the water")
    density_kg_m3: float = Field(1000.0, gt=900.0, lt=1100.0, description="of the water; vehicles are trimmed in 1000")
    flow_step_s: float = Field(0.05, ge=0.005, le=0.1, description="time step of the water")
    current: CurrentSettings = CurrentSettings()
    waves: WaveSettings = WaveSettings()
    pump: PumpSettings = PumpSettings()
    jets: JetSettings = JetSettings()
    hull_wake: bool = Field(True, description="whether the hull gives back to the water what its drag takes from it")
    silt: SiltSettings = SiltSettings()
    tether: TetherSettings = TetherSettings()
    sensors: SensorSettings = SensorSettings()
    mismatch: MismatchSettings = MismatchSettings()
    ideal_thrusters: bool = Field(
        False, description="thrust continuous through zero, whatever least thrust and steps the vehicle's file states"
    )
    failures: tuple[ThrusterFailure, ...] = Field((), description="thrusters that fail: thruster, at_s, kind, value")

    @model_validator(mode="after")
    def _water_holds_it(self) -> TankSettings:
        """Refuse waves that break, a pump that blows out of the water and a winch outside it."""
        length, width, depth = self.size_m
        if self.waves.amplitude_m > 0.0:
            self._check_wave(depth)
        sides = (length / 2, width / 2)
        if self.pump.speed_m_s > 0.0:
            for name, at, towards, side in zip("xy", self.pump.at_m, self.pump.towards, sides, strict=False):
                if abs(at) >= side and at * towards > 0.0:
                    raise ValueError(f"pump.towards: blows out of the tank through the wall at {name} = {at:g} m")
        if self.tether.diameter_m > 0.0:
            x, y, z = self.tether.from_m
            if abs(x) > sides[0] or abs(y) > sides[1] or z > depth:
                raise ValueError(
                    f"tether.from_m: ({x:g}, {y:g}, {z:g}) m is outside the walls or below the floor of "
                    f"{length:g} x {width:g} x {depth:g} m; give the place at which the cable enters the water"
                )
        return self

    def _check_wave(self, depth_m: float) -> None:
        from wakewise.simulation.water.currents import wave_number_per_m

        # Steepest wave over a level bed: H / L = 0.142 tanh(k h) (R. Miche 1944, Ann. Ponts Chauss. 114).
        k = wave_number_per_m(self.waves.period_s, depth_m)
        most_m = 0.5 * 0.142 * (2 * math.pi / k) * math.tanh(k * depth_m)
        if self.waves.amplitude_m > most_m:
            raise ValueError(
                f"waves.amplitude_m: {self.waves.amplitude_m:g} m, a wave of {self.waves.period_s:g} s "
                f"in {depth_m:g} m of water breaks above {most_m:.3f} m"
            )
