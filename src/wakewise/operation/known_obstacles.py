"""The tank as a controller is told of it: its walls, stated obstacles, the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wakewise.planning import Surroundings, covering_spheres
from wakewise.scene.missions import TankBounds
from wakewise.scene.targets import Target

if TYPE_CHECKING:
    from wakewise.operation.scenario import Scenario


def tank_bounds(scenario: Scenario) -> TankBounds:
    """The tank's water."""
    length, width, depth = scenario.tank.size_m
    return TankBounds(
        low_W_m=np.array([-length / 2, -width / 2, 0.0]), high_W_m=np.array([length / 2, width / 2, depth])
    )


def surroundings_of(scenario: Scenario, target: Target | None = None) -> Surroundings:
    """What a planner keeps clear of: floor, walls and surface of the tank, stated obstacles, the target if given."""
    bounds = tank_bounds(scenario)
    obstacles = np.array(scenario.control.obstacles).reshape(-1, 4)
    names = tuple(f"obstacle {k + 1} (control.obstacles)" for k in range(len(obstacles)))
    around = np.zeros((0, 4)) if target is None else covering_spheres(target.mesh.vertices_m)
    return Surroundings.tank(
        bounds.low_W_m, bounds.high_W_m, np.vstack([obstacles, around]), (*names, *("the target",) * len(around))
    )
