"""Fields of a scenario that its seed draws, so that many seeds are many worlds.

A draw says from where; what it gives follows from the seed and the field's name alone, so that one more draw leaves the
others what they were, and all methods on one seed meet the same world.

The random streams of a trial.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from wakewise.core.settings import Settings

_STREAM = 23
_SIGNIFICANT = 6  # digits that a drawn number keeps, so that a file holds what was flown


class FieldDistribution(Settings):
    """Where a field's value comes from; written as one of these keys, or as a list of two numbers for `between`."""

    uniform: tuple[float, float] | None = Field(None, description="evenly between two numbers")
    log_uniform: tuple[float, float] | None = Field(
        None, description="evenly in the logarithm between two positive numbers"
    )
    choice: tuple[Any, ...] | None = Field(None, min_length=1, description="any of these, each as likely")
    horizontal: tuple[float, float] | None = Field(
        None, description="a vector north, east, down: its size evenly between two numbers, level, to any side"
    )

    @model_validator(mode="before")
    @classmethod
    def _two_numbers(cls, given: Any) -> Any:
        return {"uniform": given} if isinstance(given, list | tuple) else given

    @model_validator(mode="after")
    def _says_one_thing(self) -> FieldDistribution:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"gives {', '.join(given) or 'nothing'}, must give one of between, log_uniform, choice, level"
            )
        for name in ("uniform", "log_uniform", "horizontal"):
            ends = getattr(self, name)
            if ends is not None and ends[0] > ends[1]:
                raise ValueError(f"{name}: from {ends[0]:g} to {ends[1]:g}, the smaller number comes first")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(f"log_uniform: begins at {self.log_uniform[0]:g}, must be more than 0")
        if self.horizontal is not None and self.horizontal[0] < 0.0:
            raise ValueError(f"horizontal: begins at {self.horizontal[0]:g}, a size is 0 or more")
        return self

    def value(self, rng: np.random.Generator) -> Any:
        """A value from here: a number, a list of three numbers, or one of those listed."""
        if self.uniform is not None:
            return _rounded(rng.uniform(*self.uniform))
        if self.log_uniform is not None:
            return _rounded(math.exp(rng.uniform(math.log(self.log_uniform[0]), math.log(self.log_uniform[1]))))
        if self.horizontal is not None:
            size, heading = rng.uniform(*self.horizontal), rng.uniform(-math.pi, math.pi)
            return [_rounded(size * math.cos(heading)), _rounded(size * math.sin(heading)), 0.0]
        listed = self.choice or ()
        return listed[int(rng.integers(len(listed)))]

    def __str__(self) -> str:
        """The draw in words."""
        if self.uniform is not None:
            return f"{self.uniform[0]:g} to {self.uniform[1]:g}"
        if self.log_uniform is not None:
            return f"{self.log_uniform[0]:g} to {self.log_uniform[1]:g}, evenly in its logarithm"
        if self.horizontal is not None:
            return f"{self.horizontal[0]:g} to {self.horizontal[1]:g} to any side"
        return "any of " + ", ".join(map(str, self.choice or ()))


def sample_fields(draws: dict[str, FieldDistribution], seed: int) -> dict[str, Any]:
    """What a seed draws, by field."""
    return {
        name: draw.value(np.random.default_rng([seed, _STREAM, zlib.crc32(name.encode())]))
        for name, draw in draws.items()
    }


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")


@dataclass(frozen=True)
class Seeds:
    """One random stream for each part of a trial, so that a change in one leaves the draws of the others alone.

    Each call gives a fresh generator at the beginning of its stream.
    """

    seed: int

    def plant(self) -> np.random.Generator:
        """How the true vehicle differs from the believed one."""
        return self._child(0)

    def tank(self) -> np.random.Generator:
        """Water, silt and sensors."""
        return self._child(1)

    def region(self) -> np.random.Generator:
        """Points that stand for the target's water."""
        return self._child(2)

    def start(self) -> np.random.Generator:
        """Where the vehicle really is when the mission begins."""
        return self._child(3)

    def imaging(self) -> np.random.Generator:
        """Noise of the photographs."""
        return self._child(4)

    def drag(self) -> np.random.Generator:
        """Which of its cases the true vehicle's drag is."""
        return np.random.default_rng([self.seed, 12])

    def survey(self) -> tuple[np.random.Generator, np.random.Generator]:
        """What the crew takes the target's place, and its camera, for."""
        place, camera = self._child(5).spawn(2)
        return place, camera

    def current(self) -> tuple[np.random.Generator, np.random.Generator]:
        """What the crew sees of the current before the flight: the water's eddies then, and the error."""
        water, error = np.random.default_rng([self.seed, 13]).spawn(2)
        return water, error

    def person(self) -> np.random.Generator:
        """Who flies by hand."""
        return self._child(6)

    def _child(self, k: int) -> np.random.Generator:
        return np.random.default_rng(self.seed).spawn(7)[k]
