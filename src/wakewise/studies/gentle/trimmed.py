"""What a person with float blocks does: hover, read the load that the estimator found, add a block, fly.

The estimate is the flight's own. Only the true vehicle changes: what was measured and the block that carries it cancel
in what is believed of it.
"""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np

from wakewise.control.trim import ballasted
from wakewise.errors import InputError
from wakewise.interfaces import Witness
from wakewise.operation import Parts, fly
from wakewise.operation.loop import Step
from wakewise.studies.gentle.courses import held

HOVER_S, READ_FROM_S = 15.0, 7.0
"""How long the hover is, and from when on its load is read: by then integral and estimate have settled."""
BLOCK_N = 0.5
"""Float and lead come in such steps."""


def blocks_N(parts: Parts) -> float:
    """Float to add (negative: lead), in whole blocks, after a hover at the start of the flight's own route."""
    loads: list[float] = []

    def read(step: Step, witness: Witness | None) -> None:  # noqa: ARG001
        if step.time_s >= READ_FROM_S:
            loads.append(float((step.estimate.X_WB.R @ step.estimate.load_B[:3])[2]))

    fly(
        parts.replace(route=held(parts.route, HOVER_S)), checked=False, duration_s=HOVER_S, watch=read, water_every_s=60
    )
    return BLOCK_N * round(float(np.mean(loads)) / BLOCK_N)


def ballasted_world(parts: Parts, float_N: float) -> Parts:
    """The same flight with a truly more buoyant vehicle, all else drawn alike.

    Raises
    ------
    InputError
        If the world is not one of ours, which hold their vehicle.
    """
    world: Any = parts.world
    if not is_dataclass(world) or isinstance(world, type) or not hasattr(world, "vehicle"):
        raise InputError(f"+trim: world {parts.scenario.world} does not tell its vehicle")
    return parts.replace(world=replace(world, vehicle=ballasted(world.vehicle, float_N)))
