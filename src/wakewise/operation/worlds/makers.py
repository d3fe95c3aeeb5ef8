"""Makes the world of a flight from its parts: true vehicle, true start, water."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import BodyState, World
from wakewise.core.plugins import find
from wakewise.operation.worlds.lattice_world import LatticeWorld, box_half_size_m
from wakewise.operation.worlds.library import load_world, world_names
from wakewise.operation.worlds.quasi_steady_world import (
    Jets,
    QuasiSteadyWorld,
    free_jet_field,
    lattice_jets,
    paper_jets,
)
from wakewise.robot.vehicles import Vehicle, perturbed, with_drag
from wakewise.simulation.tank import TankWorld

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts
    from wakewise.operation.scenario import Scenario

START_SPREAD_M, START_SPREAD_RAD = 0.02, 0.03
"""How far the vehicle is from where the mission begins, one sigma per axis."""


def true_vehicle(parts: Parts) -> Vehicle:
    """What the world flies: the believed vehicle with the mismatch that the seed draws."""
    tank, rng = parts.scenario.tank, parts.seeds.plant()
    apart = tank.mismatch
    trim_N = apart.trim_N
    if trim_N is None:
        trim_N = float(rng.uniform(-apart.trim_range_N, apart.trim_range_N))
    return perturbed(
        with_drag(parts.vehicle, apart.drag, parts.seeds.drag()),
        rng,
        mass_pct=apart.mass_pct,
        damping_pct=apart.damping_pct,
        added_mass_pct=apart.added_mass_pct,
        thrust_pct=apart.thrust_pct,
        trim_N=trim_N,
        water_density_kg_m3=tank.density_kg_m3,
    )


def true_start(parts: Parts) -> BodyState:
    """Where the vehicle really is when the mission begins: near the start, not on it."""
    X_WB, rng = parts.start.X_WB, parts.seeds.start()
    turn = quat_from_rotvec(rng.normal(0.0, START_SPREAD_RAD, 3))
    return BodyState(X_WB=Pose(X_WB.p_m + rng.normal(0.0, START_SPREAD_M, 3), quat_multiply(X_WB.q, turn)))


def tank_world(parts: Parts) -> TankWorld:
    """`tank`: water of parcels, walls, silt."""
    return TankWorld(
        vehicle=true_vehicle(parts),
        target=parts.target,
        settings=parts.scenario.tank,
        start=true_start(parts),
        draw=parts.seeds.tank,
        tilt_rad=parts.start_tilt_rad,
        yielding=parts.yielding,
    )


def _check_held(parts: Parts, name: str) -> None:
    """Refuse a target that gives way where nothing moves it."""
    if parts.yielding is not None:
        raise InputError(
            f"flow: '{name}' holds its target still, target.elasticity and target.unanchored move it; "
            "take target.elasticity=none, or the tank"
        )


def _instant(name: str, jets: Callable[[float], Jets], parts: Parts) -> QuasiSteadyWorld:
    seed = parts.scenario.seed
    _check_held(parts, name)
    return QuasiSteadyWorld(
        name=name,
        jets=jets(parts.scenario.tank.density_kg_m3),
        vehicle=true_vehicle(parts),
        target=parts.target,
        settings=parts.scenario.tank,
        start=true_start(parts),
        draw=lambda: np.random.default_rng([seed, 11]),
        tilt_rad=parts.start_tilt_rad,
    )


def lattice_world(parts: Parts) -> LatticeWorld:
    """`lattice`: a large-eddy simulation round the target, with the loop closed."""
    _check_held(parts, "lattice")
    route = parts.route
    times_s = np.linspace(0.0, route.duration_s, 200)
    places = np.array([route.body(float(t), parts.aim).X_WB.p_m for t in times_s])
    return LatticeWorld(
        vehicle=true_vehicle(parts),
        target=parts.target,
        settings=parts.scenario.tank,
        start=true_start(parts),
        half_size_m=box_half_size_m(places, parts.target.centre_W_m, parts.vehicle),
        draw=parts.seeds.tank,
        tilt_rad=parts.start_tilt_rad,
    )


WORLDS: dict[str, Callable[[Parts], World]] = {
    "tank": tank_world,
    "paper": partial(_instant, "paper", lambda _: paper_jets()),
    "lattice": lattice_world,
    "lattice-jets": partial(
        _instant, "lattice-jets", lambda density_kg_m3: lattice_jets(free_jet_field(), density_kg_m3)
    ),
}
"""Our own worlds: what makes each from the parts of a flight."""


def make_world(parts: Parts) -> World:
    """The world that the scenario names, ours or one from outside.

    Raises
    ------
    InputError
        If there is no such world.
    """
    return find("world", flow_name(parts.scenario), WORLDS).maker(parts)


def flow_name(scenario: Scenario) -> str:
    """What the water of a scenario is: its own word for it, else that of its world, which may be a flow itself."""
    if scenario.flow is not None:
        return scenario.flow
    return load_world(scenario.world).file.flow if scenario.world in world_names() else scenario.world
