"""What a user may say about a mission."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from wakewise.core.settings import Settings

Elevation = Annotated[float, Field(gt=0.0, lt=85.0)]
Views = Annotated[int, Field(ge=3, le=360)]


class MissionSettings(Settings):
    """Layered hemispherical orbits about the target's centre, flown without stopping between photographs."""

    elevations_deg: tuple[Elevation, ...] = Field(
        (20.0, 40.0, 60.0), min_length=1, max_length=8, description="elevation of each orbit above the target's centre"
    )
    views: tuple[Views, ...] = Field(
        (20, 16, 12), min_length=1, max_length=8, description="photographs on each orbit, evenly spread"
    )
    order: Literal["plain", "current"] = Field(
        "plain",
        description="where orbits begin: plain, in the north; current, downstream of the target by the surveyed "
        "current, where the vehicle's wash is carried away",
    )
    aim: Literal["auto", "pitch", "tilt", "both"] = Field(
        "auto",
        description="what aims the camera: the vehicle's pitch, the camera's tilt joint, or the joint to its stops and "
        "pitch for the rest; auto is both where there is a joint, else pitch",
    )
    standoff_m: float = Field(0.5, gt=0.0, le=3.0, description="distance of the camera from the target's centre")
    speed_m_s: float = Field(0.10, ge=1e-3, le=0.5, description="speed of the camera along its path")
    acceleration_m_s2: float = Field(0.05, ge=1e-3, le=1.0, description="greatest acceleration along the path")
    approach_m: float = Field(0.3, ge=0.0, le=2.0, description="the flight starts this much farther out")
    settle_s: float = Field(
        12.0, ge=0.0, le=120.0, description="hover before the first leg, until the integral knows trim and current"
    )
    max_tracking_deviation: float | None = Field(
        0.02,
        gt=0.0,
        le=1.0,
        description="largest share of the next half second's way that a method which plans may leave undone for the "
        "water's sake; null: as much as control.plan.w_track lets it",
    )
    clearance_m: float = Field(0.05, ge=0.0, le=1.0, description="least distance of the hull to anything solid")

    @model_validator(mode="after")
    def _one_count_per_orbit(self) -> MissionSettings:
        if len(self.views) != len(self.elevations_deg):
            raise ValueError(
                f"views has {len(self.views)} entries, elevations_deg {len(self.elevations_deg)}: one count per orbit"
            )
        return self
