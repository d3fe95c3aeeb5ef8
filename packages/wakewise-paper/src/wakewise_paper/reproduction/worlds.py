"""Where the trials of a table are made: the paper's pump tank, the worlds with the trouble, the paper's own wake.

Names are those of the library's worlds, and three more: `paper`, the pump tank whose water is the paper's own wake
model, with a vehicle that sinks, so that there is something to avoid (circular: planner and water are one law);
`lattice`, the pump tank judged by the lattice; `caco3` and `field`, the pump tank with calcium carbonate in its water,
and a dive at sea.

Missions of `success`: starts, angles and patterns drawn by the seed, and again where one does not fit the water.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.operation import Scenario
from wakewise.operation.preflight import check_route
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper.wash_reduction.paper import OFF, PAPER_WAKE

PUMP_TANK, PAPER, LATTICE, CACO3, FIELD = "pump-tank", "paper", "lattice", "caco3", "field"


@dataclass(frozen=True, kw_only=True)
class TableWorld:
    """A world as a table knows it.

    Parameters
    ----------
    name, title : str
    world : str
        Of the library.
    fields : dict
        Of a scenario, by their dotted names, over the world's.
    randomize : dict
        What the seed draws beyond the world's own draws.
    circular : bool
        Planner and water are one law: figures say what a method does, not what water does.
    """

    name: str
    title: str
    world: str
    fields: dict[str, Any] = field(default_factory=dict)
    randomize: dict[str, Any] = field(default_factory=dict)
    circular: bool = False

    @property
    def told(self) -> dict[str, Any]:
        """Fields for `Scenario.preset`."""
        draws = {"randomize": self.randomize} if self.randomize else {}
        return {"world": self.world, **self.fields, **draws}


_STILL_TARGET = {"target.elasticity": "none"}
_OWN = {
    PAPER: TableWorld(
        name=PAPER,
        title="the pump tank, its water the paper's own wake model (circular)",
        world=PUMP_TANK,
        fields=_STILL_TARGET
        | {"flow": "paper"}
        | {f"control.wake.{key}": value for key, value in PAPER_WAKE.items()}
        | {f"control.allocation.{key}": value for key, value in OFF.items()},
        randomize={"tank.mismatch.trim_N": [-3.3, -1.0]},
        circular=True,
    ),
    LATTICE: TableWorld(
        name=LATTICE,
        title="the pump tank, judged by the lattice",
        world=PUMP_TANK,
        fields=_STILL_TARGET | {"flow": "lattice"},
    ),
    CACO3: TableWorld(
        name=CACO3,
        title="the pump tank with 50 mg/l of calcium carbonate of 0.3 mm",
        world=PUMP_TANK,
        # A stony coral, as the paper's were: the pump tank's own anemone sways in the stream, whatever the silt.
        fields={"tank.silt.kind": "caco3-50mg", "target.kind": "branching"},
    ),
    FIELD: TableWorld(
        name=FIELD,
        # 4.8 over 1.54 per metre in green is 3.1 m of sight (Zaneveld and Pegau 2003, doi 10.1364/OE.11.002997).
        title="a reef with swell, a current to 0.5 m/s and 3 m of sight",
        world="reef",
        # A stony coral, as the paper's were: the reef's gorgonian bends beyond its theory from about 0.35 m/s on.
        fields={"imaging.water_type": "5C", "target.kind": "branching"},
        randomize={"tank.current.velocity_m_s": {"horizontal": [0.1, 0.5]}},
    ),
}


def water_names() -> tuple[str, ...]:
    """All names."""
    return (*world_names(), *_OWN)


def water(name: str) -> TableWorld:
    """The water of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    if name in _OWN:
        return _OWN[name]
    if name not in world_names():
        raise InputError(f"--world '{name}': not known, allowed: {', '.join(water_names())}")
    return TableWorld(name=name, title=load_world(name).file.title, world=name)


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
