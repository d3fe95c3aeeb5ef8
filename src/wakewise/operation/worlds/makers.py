"""Worlds by name, made from the parts of a flight: perturbed vehicle, perturbed start, water model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from wakewise.core.checks import protocol_part
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import BodyState, World
from wakewise.core.plugins import make
from wakewise.operation.parts import Parts
from wakewise.operation.worlds.lattice_world import LatticeWater, box_half_size_m
from wakewise.operation.worlds.quasi_steady_world import (
    Jets,
    QuasiSteadyWater,
    free_jet_field,
    lattice_jets,
    paper_jets,
)
from wakewise.operation.worlds.vehicle_in_water import RepeatableWorld
from wakewise.robot.vehicles import Vehicle, perturbed, with_drag
from wakewise.simulation.tank import TankWorld

START_SPREAD_M, START_SPREAD_RAD = 0.02, 0.03
"""Error of the vehicle's initial position and attitude, one sigma per axis."""


def true_vehicle(parts: Parts) -> Vehicle:
    """The vehicle of the world: the nominal one, perturbed by the mismatch that the seed draws."""
    tank, rng = parts.scenario.tank, parts.seeds.plant()
    mismatch = tank.mismatch
    trim_N = mismatch.trim_N
    if trim_N is None:
        trim_N = float(rng.uniform(-mismatch.trim_range_N, mismatch.trim_range_N))
    return perturbed(
        with_drag(parts.vehicle, mismatch.drag, parts.seeds.drag()),
        rng,
        mass_pct=mismatch.mass_pct,
        damping_pct=mismatch.damping_pct,
        added_mass_pct=mismatch.added_mass_pct,
        thrust_pct=mismatch.thrust_pct,
        trim_N=trim_N,
        water_density_kg_m3=tank.density_kg_m3,
    )


def true_start(parts: Parts) -> BodyState:
    """The vehicle's true initial pose: the start with a random error; at rest."""
    X_WB, rng = parts.start.X_WB, parts.seeds.start()
    turn = quat_from_rotvec(rng.normal(0.0, START_SPREAD_RAD, 3))
    return BodyState(X_WB=Pose(X_WB.p_m + rng.normal(0.0, START_SPREAD_M, 3), quat_multiply(X_WB.q, turn)))


def tank_world(parts: Parts) -> TankWorld:
    """`tank`: water as vortex parcels, with walls, bed and silt."""
    return TankWorld(
        vehicle=true_vehicle(parts),
        target=parts.target,
        settings=parts.scenario.tank,
        start=true_start(parts),
        draw=parts.seeds.tank,
        tilt_rad=parts.start_tilt_rad,
        yielding=parts.compliance,
    )


def _check_rigid(parts: Parts, name: str) -> None:
    """Refuse a target that bends or slides in a world that does not move it."""
    if parts.compliance is not None:
        raise InputError(
            f"flow: '{name}' holds its target still, target.elasticity and target.unanchored move it; "
            "take target.elasticity=none, or the tank"
        )


def _quasi_steady(name: str, jets: Callable[[float], Jets], parts: Parts) -> RepeatableWorld:
    seed, settings = parts.scenario.seed, parts.scenario.tank
    _check_rigid(parts, name)
    flow, around = jets(settings.density_kg_m3), (parts.target, settings, true_start(parts))
    return RepeatableWorld(
        name=name,
        vehicle=true_vehicle(parts),
        make=lambda vehicle, rng: QuasiSteadyWater(flow, vehicle, *around, rng, parts.start_tilt_rad),
        draw=lambda: np.random.default_rng([seed, 11]),
    )


def lattice_world(parts: Parts) -> RepeatableWorld:
    """`lattice`: a large-eddy simulation around the target, stepped with the vehicle."""
    _check_rigid(parts, "lattice")
    route = parts.route
    times_s = np.linspace(0.0, route.duration_s, 200)
    places = np.array([route.body(float(t), parts.aim).X_WB.p_m for t in times_s])
    half_size_m = box_half_size_m(places, parts.target.centre_W_m, parts.vehicle)
    around = (parts.target, parts.scenario.tank, true_start(parts))
    return RepeatableWorld(
        name="lattice",
        vehicle=true_vehicle(parts),
        make=lambda vehicle, rng: LatticeWater(vehicle, *around, rng, half_size_m, tilt_rad=parts.start_tilt_rad),
        draw=parts.seeds.tank,
    )


WORLDS: dict[str, Callable[[Parts], World]] = {
    "tank": tank_world,
    "paper": partial(_quasi_steady, "paper", lambda _: paper_jets()),
    "lattice": lattice_world,
    "lattice-jets": partial(
        _quasi_steady, "lattice-jets", lambda density_kg_m3: lattice_jets(free_jet_field(), density_kg_m3)
    ),
}
"""Our own worlds by name."""


def make_world(parts: Parts) -> World:
    """The world that the scenario names, ours or one from outside; raises InputError if there is none."""
    return make("world", parts.scenario.flow_name, WORLDS, parts, checked=lambda made: protocol_part(made, "world"))
