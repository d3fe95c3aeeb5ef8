"""What a user may set about camera, light and water."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from wakewise.settings import Settings

if TYPE_CHECKING:
    from wakewise.imaging.camera import LensCamera, PinholeCamera
    from wakewise.imaging.optics import WaterOptics
    from wakewise.imaging.renderer import Lights

WaterType = Literal["I", "IB", "II", "III", "1C", "3C", "5C"]


PORT_GLASS_M, PORT_INDEX = 0.005, 1.49
"""Thickness and refractive index of a flat port: 5 mm of acrylic."""
LAMP_OFFSET_M = 0.2
"""Distance of each of two lamps to the camera's side: where small vehicles carry them."""
FLAKES_PER_KG = 1e6
"""Visible flakes per kilogram of suspended silt."""
ELECTRONS_PER_S, READ_NOISE_E = 1.5e6, 4.0
"""Electrons per second at saturation, 12000 in the default exposure, and read noise, rms, of a small CMOS sensor."""


class ImagingSettings(Settings):
    """Camera, light, water and sensor of the simulated photographs."""

    width: int = Field(960, description="image width, px", ge=16, le=8192)
    height: int = Field(720, description="image height, px", ge=16, le=8192)
    fov_deg: float = Field(90.0, description="horizontal field of view in water, deg", ge=10.0, le=150.0)
    exposure_s: float = Field(0.008, description="time the shutter is open, s", gt=0.0, le=1.0)
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

    def camera(self) -> PinholeCamera | LensCamera:
        """Camera of these settings; an ideal one if it has neither distortion nor port.

        Raises
        ------
        InputError
            If the lens cannot show the field of view.
        """
        from wakewise.imaging.camera import FlatPort, LensCamera, PinholeCamera

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

        from wakewise.imaging.renderer import Lights

        x = LAMP_OFFSET_M
        return Lights(
            ambient=self.ambient,
            panels=self.panels,
            lamp=self.lamp,
            lamps_C_m=np.array([[-x, -0.4 * x, 0.0], [x, -0.4 * x, 0.0]]),
        )

    def water(self) -> WaterOptics:
        """Clear water of the chosen type."""
        from wakewise.imaging.optics import water_optics

        return water_optics(self.water_type)
