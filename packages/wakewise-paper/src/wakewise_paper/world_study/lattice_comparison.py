"""The second judge: the same hovers in the tank and in the lattice, which shares no law with it.

Do the order of the methods and the size of the gain hold there? The worlds are those of a heavy vehicle, of a near
target and of a current. The target is held still in both, and what the lattice has not (silt, turbulence of the water's
own) is in the tank alone.

Water is looked at on the target's surface, as in every flight, and 8 cm off its hull. The lattice's water comes to rest
on a target and is slow for some centimetres, where the tank's slips along it: sizes can be held against each other off
the surface only (docs/research-log/0075).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from wakewise.core.arrays import Array
from wakewise.operation.loop import Step
from wakewise.scene.targets import Mesh, Target
from wakewise.simulation.tank.water_truth import surface_samples
from wakewise_paper.flight_batches import Key, Row
from wakewise_paper.world_study.flight import WorldTrial, flown_figures, short_flight

JUDGED = ("payload", "close", "kelp")
METHODS = ("dp", "no-forward-jets", "wake-aware")
FLOWS = ("tank", "lattice")
DURATION_S = 23.0
"""Settling and hover: the lattice takes minutes of a core for it."""
CLEAR_M, _LOOK_S, _SETTLED_S, _POINTS = 0.08, 0.5, 8.0, 300
"""How far off the target's hull the water is clear of what the lattice's target slows down."""
CLEAR = "clear_speed_mean_m_s"
_PLACES = {"": "target_speed_mean_m_s", "clear_": CLEAR}


def judged_trial(trial: WorldTrial) -> dict[str, float | None]:
    """Figures of one short flight, with the mean excess speed 8 cm off the target's hull from settling on."""
    parts = short_flight(trial)
    points, speeds = clear_points(parts.target), [(-np.inf, 0.0)]

    def look(step: Step, witness: Any) -> None:
        if step.time_s >= max(_SETTLED_S, speeds[-1][0] + _LOOK_S):
            excess = witness.excess_velocity(points)
            speeds.append((step.time_s, float(np.linalg.norm(excess, axis=1).mean())))

    figures = flown_figures(parts, trial.duration_s, look)
    return figures | {CLEAR: float(np.mean([speed for _, speed in speeds[1:]])) if speeds[1:] else None}


def clear_points(target: Target) -> Array:
    """Points 8 cm off the target's convex hull and as far above the bed as half of that, shape (n, 3)."""
    hull = ConvexHull(target.mesh.vertices_m)
    shell = replace(target, mesh=Mesh(hull.points, hull.simplices.astype(np.int64)))
    points, areas, face = surface_samples(shell, _POINTS, np.random.default_rng(0))
    # Its triangles are turned either way; their planes' equations have normals that point outward.
    outward = areas * np.sign(np.sum(areas * hull.equations[face, :3], axis=1))[:, None]
    off = points + CLEAR_M * outward / np.linalg.norm(areas, axis=1, keepdims=True)
    return np.asarray(off[off[:, 2] < target.bed_z_m - 0.5 * CLEAR_M])


def judge_trials(seeds: int, worlds: tuple[str, ...] = JUDGED) -> dict[Key, WorldTrial]:
    """Flights to make; the flow stands before the world in their keys."""
    return {
        (f"{flow}: {world}", method, seed): WorldTrial(
            world=world, method=method, seed=seed, flow=flow, duration_s=DURATION_S
        )
        for seed in range(1, seeds + 1)
        for world in worlds
        for method in METHODS
        for flow in FLOWS
    }


def judge_table(rows: Mapping[Key, Row]) -> dict[str, Any]:
    """By world and method: speeds on and 8 cm off the target in each flow, and how much less than `dp`'s.

    Means over the seeds that both flew.
    """
    worlds = [name for name in JUDGED if any(key[0].endswith(f": {name}") for key in rows)]
    answer: dict[str, Any] = {}
    for world in worlds:
        table: dict[str, Any] = {}
        for method in METHODS:
            found = [{k[2]: r for k, r in rows.items() if k[:2] == (f"{flow}: {world}", method)} for flow in FLOWS]
            both = sorted(set(found[0]) & set(found[1]))
            table[method] = {"seeds": len(both)}
            for place, figure in _PLACES.items():
                for flow, own in zip(FLOWS, found, strict=True):
                    mean = float(np.mean([own[seed].get(figure) or 0.0 for seed in both])) if both else None
                    table[method][f"{flow}_{place}m_s"] = mean
        for key in [f"{flow}_{place}" for flow in FLOWS for place in _PLACES]:
            base = table[METHODS[0]][f"{key}m_s"]
            for row in table.values():
                own = row[f"{key}m_s"]
                row[f"{key}less_pct"] = 100.0 * (1.0 - own / base) if base and own is not None else None
        answer[world] = table
    return answer
