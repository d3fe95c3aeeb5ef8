"""Missions of `success`: starts, angles and patterns drawn by the seed, and again where one does not fit the water."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.operation import Scenario
from wakewise.operation.preflight import check_route
from wakewise_paper.reproduction.worlds import water

SPREAD = {"standoff_m": (0.5, 0.62), "speed_m_s": (0.06, 0.12), "approach_m": (0.2, 0.6)}
"""Evenly between these; elevations up to 8 degrees higher, in either order."""
TRIES = 100
"""A tank of which so many draws find none that fits is too small for them all."""


@lru_cache(maxsize=1024)
def varied_mission(world: str, kind: str | None, seed: int) -> Mapping[str, Any]:
    """Fields of a scenario, by their dotted names, that make the mission of a seed; the same for every method.

    A draw whose hull would come too near to water surface, floor or target is no start that anybody varies: it is
    drawn again, so that what is judged is the methods. `kind` is the target's, None for the world's own.

    Raises
    ------
    InputError
        If none of `TRIES` draws fits.
    """
    rng = np.random.default_rng([seed, 53])
    own = {} if kind is None else {"target.kind": kind}
    for _ in range(TRIES):
        mission = _draw(rng)
        try:
            check_route(Scenario.preset("quick", **water(world).told, **own, **mission, seed=seed).parts())
        except InputError as error:
            refused = error
            continue
        return MappingProxyType(mission)
    raise InputError(f"success: no mission of {TRIES} draws fits into {world}: {refused}")


def _draw(rng: np.random.Generator) -> dict[str, Any]:
    mission: dict[str, Any] = {f"mission.{k}": round(float(rng.uniform(*span)), 4) for k, span in SPREAD.items()}
    elevations = [round(e + float(rng.uniform(0.0, 8.0)), 2) for e in (20.0, 40.0, 60.0)]
    views = [20, 16, 12]
    if rng.uniform() < 0.5:
        elevations, views = elevations[::-1], views[::-1]
    order = "current" if rng.uniform() < 0.5 else "plain"
    return mission | {"mission.elevations_deg": elevations, "mission.views": views, "mission.order": order}
