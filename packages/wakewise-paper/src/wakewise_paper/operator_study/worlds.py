"""Which world a seed flies in: those of the library in which users have the trouble, in strata.

Trim, the side of the current and the course are Latin squares that stand upright on each other: three seeds in a row
have each of them once, nine have every pair. Everything else is what the world's own seed draws.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.operation.scenario.randomization import FieldDistribution
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper.wash_reduction.scenario_files import Side, current_W_m_s, stratum

TROUBLE = ("payload", "close", "fluff", "mud")
"""Chosen beforehand (docs/research-log/0047), as is the control; `--worlds` flies any other of the library, too."""
CONTROL = "still-tank"
TRIMS = ("heaviest", "middle", "lightest")
"""Thirds of the range from which a world draws its trim."""
TRIM, CURRENT = "tank.mismatch.trim_N", "tank.current.velocity_m_s"
TRIM_RANGE_N = 1.0
"""Of a world that says nothing of it: the default of `tank.mismatch.trim_range_N`."""
SEEDS_EACH = 1000


@dataclass(frozen=True, kw_only=True)
class OperatorWorld:
    """What a seed of a world is, beside what its own seed draws.

    `trim_N` is the buoyancy beyond the believed one; `course_number` counts the courses of a script from 0. `side` is
    None, as is `current_W_m_s`, where the world's water rests.
    """

    world: str
    seed: int
    azimuth_rad: float
    trim: str
    trim_N: float
    side: Side | None
    current_W_m_s: tuple[float, ...] | None
    course_number: int

    @property
    def fields(self) -> dict[str, Any]:
        """Fields of a scenario in this water."""
        told: dict[str, Any] = {"world": self.world, "seed": self.seed, TRIM: self.trim_N}
        return told if self.current_W_m_s is None else told | {CURRENT: self.current_W_m_s}


def water_of(name: str, seed: int) -> OperatorWorld:
    """The water of a seed, from 1, of a world of the library.

    Raises
    ------
    InputError
        If there is no such world.
    """
    world, turned = load_world(name), sorted(world_names()).index(name)
    own, place = SEEDS_EACH * (turned + 1) + seed, seed - 1
    trim, side = stratum(TRIMS, turned, seed)

    def rng(what: str) -> np.random.Generator:
        return np.random.default_rng([own, 37, zlib.crc32(what.encode())])

    drawn, flows = world.randomize.get(TRIM), world.randomize.get(CURRENT)
    low, high = _range(drawn)
    third = (high - low) / len(TRIMS)
    begins = low + third * TRIMS.index(trim)
    azimuth = float(rng("azimuth").uniform(-np.pi, np.pi))
    current = None
    if flows is not None and flows.horizontal is not None:
        current = current_W_m_s(side, azimuth, float(rng("current").uniform(*flows.horizontal)), rng("side"))
    return OperatorWorld(
        world=name,
        seed=own,
        azimuth_rad=azimuth,
        trim=trim,
        trim_N=round(float(rng("trim").uniform(begins, begins + third)), 6),
        side=None if current is None else side,
        current_W_m_s=current,
        course_number=(place + 2 * (place // 3) + turned) % 3,
    )


def _range(drawn: FieldDistribution | None) -> tuple[float, float]:
    """Of a world's trim: what it draws from, else the default of the plant."""
    return (-TRIM_RANGE_N, TRIM_RANGE_N) if drawn is None or drawn.uniform is None else drawn.uniform
