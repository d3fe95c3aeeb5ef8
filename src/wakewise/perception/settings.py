"""Settings of the perception: pictures, features, detection and the protected region."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wakewise.core.settings import Settings

DISTANCE_STD = 0.2
"""Standard deviation of the distance of a target that is not mapped yet, as a share of it."""


class PerceptionSettings(Settings):
    """How the target is found, mapped and tracked in the camera's pictures."""

    protect: Literal["target", "view"] = Field(
        "target", description="what is protected: the target, or all that is in view within view_distance_m"
    )
    rate_hz: float = Field(5.0, description="pictures per second", ge=0.5, le=60.0)
    width_px: int = Field(
        640, description="width that pictures are worked on in; wider ones are reduced", ge=160, le=4096
    )
    latency_s: float = Field(0.1, description="from the picture to its use in control, s", ge=0.0, le=1.0)
    features: int = Field(300, description="features tracked over the whole picture", ge=50, le=3000)
    target_features: int = Field(200, description="features tracked beside these about the target", ge=20, le=3000)
    assumed_distance_m: float = Field(
        0.8,
        description="distance of what is in view until it is measured: altitude, sonar or operator",
        gt=0.05,
        le=20.0,
    )
    assumed_radius_m: float = Field(0.15, description="radius of the target until it is measured", gt=0.01, le=5.0)
    view_distance_m: float = Field(1.5, description="view: what is farther off is not protected", gt=0.1, le=20.0)
    accept_s: float = Field(
        2.0,
        description="a proposed target is accepted after this time, once it was seen from a sixth of a circle",
        ge=0.0,
        le=600.0,
    )
    points: int = Field(300, description="points of the protected region", ge=20, le=10000)
    detector: str | None = Field(
        None, description="a detector's name, an .onnx file or package.module:make; none: what stands on the bed"
    )
