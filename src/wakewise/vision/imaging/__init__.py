"""What the camera would have seen: a lit and textured scene, the water between, motion blur and sensor noise.

`Scene.build` sets the target on its bed, `render` draws it as if there were no water, and `photograph` adds water,
silt, flakes, the camera's motion while the shutter is open and the sensor. Everything is a function of the true
poses, the true silt and a seed.

Start reading in `photograph.py` (one photograph, step by step) and `scene.py` (what stands there). `camera.py`,
`camera.py` and `camera.py` are the camera, also behind a flat port; `renderer.py`, `renderer.py`, `texture.py`,
`bed_view.py`, `daylight.py` and `daylight.py` the picture without water, `bed_view.py`, `bed_view.py` and
`scene.py` what makes it fast; `optics.py`, `forward_scatter.py`, `optics.py` and `particles.py` the water,
`photograph.py`, `blur.py` and `sensor.py` the exposure.
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
