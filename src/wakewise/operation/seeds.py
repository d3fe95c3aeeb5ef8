"""The random streams of a trial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
