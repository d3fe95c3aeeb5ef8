"""Base of every group of settings that a user may write in a scenario file."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """Frozen, refuses unknown fields, NaN and infinity; each room's settings derive from it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
