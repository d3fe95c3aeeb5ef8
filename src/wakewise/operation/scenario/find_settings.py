"""Settings of the pilot `find`."""

from __future__ import annotations

from pydantic import Field

from wakewise.core.settings import Settings


class FindSettings(Settings):
    """How the pilot `find` looks for the target before it is scanned."""

    look_deg: float = Field(20.0, ge=5.0, le=90.0, description="how far it moves to each side for the first look, deg")
    settle_s: float = Field(3.0, ge=0.0, le=60.0, description="hover before the first look")
    give_up_s: float = Field(60.0, ge=5.0, le=3600.0, description="without a target for so long the flight ends")
    hold_s: float = Field(0.0, ge=0.0, le=3600.0, description="hover at the standoff before the scan")
    further_views: int = Field(
        8, ge=0, le=200, description="most photographs of what the scan has missed, by the mapped surface"
    )
