"""Settings of the pilots `find` and `survey`."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from wakewise.core.settings import Settings


class FindSettings(Settings):
    """How the pilot `find` looks for the target before it is scanned."""

    look_deg: float = Field(20.0, ge=5.0, le=90.0, description="how far it moves to each side for the first look, deg")
    settle_s: float = Field(2.0, ge=0.0, le=60.0, description="hover before the first look")
    give_up_s: float = Field(60.0, ge=5.0, le=3600.0, description="without a target for so long the flight ends")
    hold_s: float = Field(0.0, ge=0.0, le=3600.0, description="hover at the standoff before the scan")
    further_views: int = Field(
        8, ge=0, le=200, description="most photographs of what the scan has missed, by the mapped surface"
    )


Side = Annotated[float, Field(ge=0.5, le=20.0)]


class SurveySettings(Settings):
    """How the pilot `survey` scans a patch of the bed: transects at one height, then orbits round parts of it."""

    size_m: tuple[Side, Side] = Field((2.0, 2.0), description="the patch, north and east, about the world's origin")
    height_m: float = Field(0.8, ge=0.3, le=10.0, description="height of the camera over the bed on transects")
    spacing_m: float = Field(0.5, ge=0.1, le=5.0, description="distance between transects")
    photo_every_m: float = Field(0.2, ge=0.05, le=2.0, description="distance between photographs on transects")
    orbits: Literal["chosen", "none", "everywhere"] = Field(
        "chosen",
        description="parts that get an orbit: chosen by coverage and relief, none, or all parts of the patch side by "
        "side",
    )
    least_orbits: int = Field(3, ge=1, le=20, description="so many orbits at least, where parts are chosen")
    most_orbits: int = Field(6, ge=1, le=20, description="and at most")
    orbit_views: int = Field(18, ge=4, le=60, description="photographs on an orbit")

    @model_validator(mode="after")
    def _least_is_not_most(self) -> Self:
        if self.least_orbits > self.most_orbits:
            raise ValueError(f"least_orbits {self.least_orbits}, most_orbits {self.most_orbits}: at most as many")
        return self
