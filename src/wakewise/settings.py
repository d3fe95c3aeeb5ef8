"""Base of every group of settings that a user may write in a scenario file."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator


class Settings(BaseModel):
    """Frozen, refuses unknown fields, NaN and infinity; each room's settings derive from it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _yes_is_no_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Keep `true` from being read as 1 where a number is meant."""
        if isinstance(value, bool) and info.field_name is not None:
            annotation = cls.model_fields[info.field_name].annotation
            meant = {annotation, *get_args(annotation)}
            if bool not in meant and meant & {int, float}:
                raise ValueError("must be a number, not true or false")
        return value
