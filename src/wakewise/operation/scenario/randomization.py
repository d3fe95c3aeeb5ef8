"""Domain randomization: distributions of scenario fields, and the random streams of a trial.

A drawn value depends on the seed and the field's name alone. So another randomized field leaves the other values as
they are, and all methods with one seed fly in the same world.
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
_SIGNIFICANT = 6  # digits of a drawn number, so that a scenario file holds the number exactly


class FieldDistribution(Settings):
    """Distribution of a field: one of these keys, or a list of two numbers for `uniform`."""

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
                f"gives {', '.join(given) or 'nothing'}, must give one of {', '.join(type(self).model_fields)}"
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
        """A random value: a number, a list of three numbers, or one of `choice`."""
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
        """The distribution in words."""
        if self.uniform is not None:
            return f"{self.uniform[0]:g} to {self.uniform[1]:g}"
        if self.log_uniform is not None:
            return f"{self.log_uniform[0]:g} to {self.log_uniform[1]:g}, evenly in its logarithm"
        if self.horizontal is not None:
            return f"{self.horizontal[0]:g} to {self.horizontal[1]:g} to any side"
        return "any of " + ", ".join(map(str, self.choice or ()))


def sample_fields(draws: dict[str, FieldDistribution], seed: int) -> dict[str, Any]:
    """A value of each field for this seed."""
    return {
        name: draw.value(np.random.default_rng([seed, _STREAM, zlib.crc32(name.encode())]))
        for name, draw in draws.items()
    }


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")


@dataclass(frozen=True)
class Seeds:
    """One random stream for each use in a trial; a change in one use leaves the values of the others.

    Each call gives a fresh generator at the beginning of its stream.
    """

    seed: int

    def plant(self) -> np.random.Generator:
        """Differences between the true vehicle and its model."""
        return self._child(0)

    def tank(self) -> np.random.Generator:
        """Water, silt and sensors."""
        return self._child(1)

    def region(self) -> np.random.Generator:
        """Sample points around the target."""
        return self._child(2)

    def start(self) -> np.random.Generator:
        """Error of the vehicle's initial pose."""
        return self._child(3)

    def imaging(self) -> np.random.Generator:
        """Noise of the photographs."""
        return self._child(4)

    def drag(self) -> np.random.Generator:
        """The case of the true vehicle's drag."""
        return np.random.default_rng([self.seed, 12])

    def survey(self) -> tuple[np.random.Generator, np.random.Generator]:
        """Error of the surveyed target, and of the camera calibration."""
        place, camera = self._child(5).spawn(2)
        return place, camera

    def current(self) -> tuple[np.random.Generator, np.random.Generator]:
        """Eddies of the water during the survey, and the error of the surveyed current."""
        water, error = np.random.default_rng([self.seed, 13]).spawn(2)
        return water, error

    def operator(self) -> np.random.Generator:
        """Properties of a simulated operator."""
        return self._child(6)

    def _child(self, k: int) -> np.random.Generator:
        return np.random.default_rng(self.seed).spawn(7)[k]
