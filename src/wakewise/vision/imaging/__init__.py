"""The simulated camera: scene, water, motion blur and sensor, as functions of true poses, true silt and a seed.

- `photograph.py`: one photograph, automatic exposure. `settings.py`: settings of camera, light and water.
- `scene.py`: target, bed and stones. `daylight.py`: baked light of sky and panels. `texture.py`: albedo.
- `renderer.py`: radiance and depth without water. `bed_view.py`: the bed as a height field.
- `camera.py`: pinhole, lens with distortion, flat port. `sensor.py`: shot and read noise, sRGB.
- `optics.py`: attenuation, veil and lamps' backscatter. `forward_scatter.py`: diffraction by silt.
- `particles.py`: flakes. `blur.py`: motion blur and rolling shutter.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.imaging.blur import Shutter, motion_blur, motion_px, pose_at
    from wakewise.vision.imaging.camera import Camera, FlatPort, LensCamera, OpenCVCamera, PinholeCamera, calibrate
    from wakewise.vision.imaging.daylight import LedPanels
    from wakewise.vision.imaging.optics import (
        SiltOptics,
        WaterOptics,
        attenuate,
        haze_between,
        water_optics,
        water_types,
    )
    from wakewise.vision.imaging.photograph import RenderedPhoto, photograph, photograph_of, sharpness
    from wakewise.vision.imaging.renderer import Lights, Render, render
    from wakewise.vision.imaging.scene import Scene
    from wakewise.vision.imaging.settings import ImagingSettings

__all__ = [
    "Camera",
    "FlatPort",
    "ImagingSettings",
    "LedPanels",
    "LensCamera",
    "Lights",
    "OpenCVCamera",
    "PinholeCamera",
    "Render",
    "RenderedPhoto",
    "Scene",
    "Shutter",
    "SiltOptics",
    "WaterOptics",
    "attenuate",
    "calibrate",
    "haze_between",
    "motion_blur",
    "motion_px",
    "photograph",
    "photograph_of",
    "pose_at",
    "render",
    "sharpness",
    "water_optics",
    "water_types",
]

lazy_attributes(__name__, "photos")
