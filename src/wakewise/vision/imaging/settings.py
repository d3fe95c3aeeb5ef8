"""Settings of camera, light and water of simulated photographs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, model_validator

from wakewise.core.settings import Settings

if TYPE_CHECKING:
    from wakewise.vision.imaging.blur import Shutter
    from wakewise.vision.imaging.camera import LensCamera, PinholeCamera
    from wakewise.vision.imaging.optics import WaterOptics
    from wakewise.vision.imaging.renderer import Lights

WaterType = Literal["I", "IB", "II", "III", "1C", "3C", "5C"]


PORT_GLASS_M, PORT_INDEX = 0.005, 1.49
"""Thickness and refractive index of a flat port: 5 mm of acrylic."""
LAMP_OFFSET_M = 0.2
"""Distance of each of two lamps to the camera's side: where small vehicles carry them."""
FLAKES_PER_KG = 1e6
"""Visible flakes per kilogram of suspended silt."""
LONGEST_S = 1.0 / 30.0
"""Longest exposure that is chosen automatically: a frame of video."""
METERED, METERED_EVERY_S = 8, 0.1
"""Views before each photograph that automatic exposure goes by, and the time between them: five of its lags."""
ELECTRONS_PER_S, READ_NOISE_E = 1.5e6, 4.0
"""Electrons per second at saturation, 12000 in the default exposure, and read noise, rms, of a small CMOS sensor."""

CAMERAS: dict[str, dict[str, Any]] = {
    "still": {},
    # Blue Robotics' low-light HD USB camera, what a BlueROV2 carries: Sony IMX322, 1080p at 30/s as H.264, 80 deg
    # across (maker's page). Readout: 1080 of 1125 lines of a frame of 1/30 s, estimate from the sensor's 1080p mode.
    "rov-video": {
        "fov_deg": 80.0,
        "readout_s": 0.032,
        "auto_exposure": True,
        "photo_format": "jpeg",
        "jpeg_quality": 60,
    },
    # A GoPro Hero 8 in 4K at 30/s: readout 17 ms (OpenDroneMap's table of rolling shutters; the Hero 4 has 30 ms).
    # Estimates: 80 deg across behind a flat port, from some 120 deg in air; the quality of its 60 Mbit/s.
    "action-4k": {
        "fov_deg": 80.0,
        "readout_s": 0.017,
        "auto_exposure": True,
        "photo_format": "jpeg",
        "jpeg_quality": 75,
    },
}
"""Fields that a kind of camera sets, unless they are given as well. The size of the image is left to the scenario, as
time grows with it (they have 1920 x 1080 and 3840 x 2160 px). Frames of compressed video are JPEGs of 4:2:0 colour, a
stand-in for H.264: its blocks and its loss of fine detail, not its memory of the frames before."""


class ImagingSettings(Settings):
    """Camera, light, water and sensor of the simulated photographs."""

    kind: Literal["still", "rov-video", "action-4k"] = Field(
        "still", description="sets view, readout, automatic exposure and compression, unless they are given too"
    )
    width: int = Field(960, description="image width, px", ge=16, le=8192)
    height: int = Field(720, description="image height, px", ge=16, le=8192)
    fov_deg: float = Field(90.0, description="horizontal field of view in water, deg", ge=10.0, le=150.0)
    exposure_s: float = Field(0.008, description="time the shutter is open, s", gt=0.0, le=1.0)
    readout_s: float = Field(
        0.0, description="from the first row's exposure to the last's, s; 0 = global shutter", ge=0.0, le=0.2
    )
    auto_exposure: bool = Field(
        False, description="choose exposure and gain by what is seen; exposure_s and gain are then the base sensitivity"
    )
    instants: int = Field(5, description="true camera poses kept across each exposure, for motion blur", ge=2, le=101)
    samples: int = Field(2, description="rays across a pixel (squared in all) on target and edges", ge=1, le=8)
    distortion: tuple[float, float, float, float] = Field(
        (0.0, 0.0, 0.0, 0.0), description="OpenCV's k1, k2, p1, p2 of the lens, in air if there is a port"
    )
    port_air_m: float | None = Field(
        None, description="air between the lens's pupil and a flat port, m; none = no port", ge=0.0, le=1.0
    )
    water_type: WaterType = Field("II", description="Jerlov water type: I to III oceanic, 1C to 5C coastal")
    ambient: float = Field(0.4, description="light from the sky relative to the reference, 0 = night", ge=0.0, le=10.0)
    panels: float = Field(
        0.6,
        description="light from four LED panels at the surface, at the target, relative to the reference",
        ge=0,
        le=10,
    )
    lamp: float = Field(0.35, description="lamps' irradiance at 0.5 m relative to the reference", ge=0.0, le=100.0)
    gain: float = Field(0.75, description="signal, 1 = saturation, of a white card in unit light", gt=0.0, le=100.0)
    flakes_per_m3: float = Field(1500.0, description="visible flakes in clear water, 1/m3", ge=0.0, le=1e6)
    photo_format: Literal["png", "jpeg"] = Field("png", description="how photographs are stored")
    jpeg_quality: int = Field(92, description="quality of photographs stored as JPEG", ge=1, le=100)

    @model_validator(mode="before")
    @classmethod
    def _as_its_kind_has_it(cls, given: Any) -> Any:
        """Fields of the kind that the user does not set."""
        if isinstance(given, dict) and isinstance(given.get("kind"), str):
            return CAMERAS.get(given["kind"], {}) | given
        return given

    @property
    def window_s(self) -> float:
        """From when the first row may open to when the last has closed."""
        return (LONGEST_S if self.auto_exposure else self.exposure_s) + self.readout_s

    def shutter(self, exposure_s: float | None = None) -> Shutter:
        """When rows see, within `window_s`; for an exposure that was chosen, else for the one that is set."""
        from wakewise.vision.imaging.blur import GLOBAL, Shutter

        if self.readout_s == 0.0 and not self.auto_exposure:
            return GLOBAL
        exposure_s = self.exposure_s if exposure_s is None else exposure_s
        return Shutter(open=exposure_s / self.window_s, rolling=self.readout_s / self.window_s)

    def camera(self) -> PinholeCamera | LensCamera:
        """Camera of these settings; an ideal one if it has neither distortion nor port.

        Raises InputError if the lens cannot show the field of view.
        """
        from wakewise.vision.imaging.camera import FlatPort, LensCamera, PinholeCamera

        fov_rad = math.radians(self.fov_deg)
        if self.port_air_m is None and not any(self.distortion):
            return PinholeCamera(self.width, self.height, fov_rad)
        port = None
        if self.port_air_m is not None:
            port = FlatPort(air_m=self.port_air_m, glass_m=PORT_GLASS_M, glass_index=PORT_INDEX)
        return LensCamera(self.width, self.height, fov_rad, self.distortion, port)

    def lights(self) -> Lights:
        """Sky, panels, and two lamps level with the lens, a little above it."""
        import numpy as np

        from wakewise.vision.imaging.renderer import Lights

        x = LAMP_OFFSET_M
        return Lights(
            ambient=self.ambient,
            panels=self.panels,
            lamp=self.lamp,
            lamps_C_m=np.array([[-x, -0.4 * x, 0.0], [x, -0.4 * x, 0.0]]),
        )

    def water(self) -> WaterOptics:
        """Clear water of the chosen type."""
        from wakewise.vision.imaging.optics import water_optics

        return water_optics(self.water_type)
