"""What a person with float blocks does: hover, read the load that the estimator found, add a block, fly.

The estimate is the flight's own. Only the true vehicle changes: what was measured and the block that carries it cancel
in what is believed of it.
"""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from typing import Any

from wakewise.core.errors import InputError
from wakewise.operation import Parts, fly
from wakewise.operation.flight_trim import flight_trim
from wakewise.robot.vehicles.ballast import BallastBlock, with_blocks
from wakewise_paper.wash_reduction.routes import held

HOVER_S = 15.0
"""How long the hover is: by its end integral and estimate have settled for some seconds."""


def blocks_of(parts: Parts) -> tuple[BallastBlock, ...]:
    """Blocks that `vehicle trim --flight` proposes after a hover at the start of the flight's own route."""
    hover = parts.replace(route=held(parts.route, HOVER_S))
    flown = fly(hover, checked=False, duration_s=HOVER_S, water_every_s=60).steps
    return tuple(flight_trim(parts.vehicle, flown).blocks)


def ballasted_world(parts: Parts, blocks: tuple[BallastBlock, ...]) -> Parts:
    """The same flight with blocks on the true vehicle, all else drawn alike.

    Raises
    ------
    InputError
        If the world is not one of ours, which hold their vehicle.
    """
    world: Any = parts.world
    if not is_dataclass(world) or isinstance(world, type) or not hasattr(world, "vehicle"):
        raise InputError(f"+trim: world {parts.scenario.world} does not tell its vehicle")
    return parts.replace(world=replace(world, vehicle=with_blocks(world.vehicle, blocks)))
