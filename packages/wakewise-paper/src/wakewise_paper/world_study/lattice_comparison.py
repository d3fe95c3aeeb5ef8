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
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial import ConvexHull

from wakewise.core.arrays import Array
from wakewise.core.interfaces import TruthProvider
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.flights import FlightProbe
from wakewise.experiments.campaigns.study import Row, flight_trial
from wakewise.operation import Parts
from wakewise.operation.loop import Step
from wakewise.scene.targets import Mesh, Target
from wakewise.simulation.tank.water_truth import surface_samples
from wakewise_paper import flights
from wakewise_paper.world_study.flight import SOURCES

JUDGED = ("payload", "close", "kelp")
METHODS = ("dp", "no-forward-jets", "wake-aware")
FLOWS = ("tank", "lattice")
DURATION_S = 23.0
"""Settling and hover: the lattice takes minutes of a core for it."""
CLEAR_M, _LOOK_S, _SETTLED_S, _POINTS = 0.08, 0.5, 8.0, 300
"""How far off the target's hull the water is clear of what the lattice's target slows down."""
CLEAR = "clear_speed_mean_m_s"
_PLACES = {"": "target_speed_mean_m_s", "clear_": CLEAR}


class ClearSpeed(FlightProbe):
    """Mean excess speed of the water 8 cm off the target's hull, from settling on."""

    def __init__(self, parts: Parts, folder: Path) -> None:
        super().__init__(parts, folder)
        self._points = clear_points(parts.target)
        self._speeds: list[tuple[float, float]] = [(-np.inf, 0.0)]

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Look at the water twice a second."""
        if step.time_s >= max(_SETTLED_S, self._speeds[-1][0] + _LOOK_S):
            water: Any = truth_provider  # tank and lattice tell more of their water than every world must
            excess = water.excess_velocity(self._points)
            self._speeds.append((step.time_s, float(np.linalg.norm(excess, axis=1).mean())))

    def figures(self, steps: pl.DataFrame) -> Mapping[str, float | None]:
        """`clear_speed_mean_m_s`; None of a flight that ended before."""
        del steps
        return {CLEAR: float(np.mean([speed for _, speed in self._speeds[1:]])) if self._speeds[1:] else None}


def clear_points(target: Target) -> Array:
    """Points 8 cm off the target's convex hull and as far above the bed as half of that, shape (n, 3)."""
    hull = ConvexHull(target.mesh.vertices_m)
    shell = replace(target, mesh=Mesh(hull.points, hull.simplices.astype(np.int64)))
    points, areas, face = surface_samples(shell, _POINTS, np.random.default_rng(0))
    # Its triangles are turned either way; their planes' equations have normals that point outward.
    outward = areas * np.sign(np.sum(areas * hull.equations[face, :3], axis=1))[:, None]
    off = points + CLEAR_M * outward / np.linalg.norm(areas, axis=1, keepdims=True)
    return np.asarray(off[off[:, 2] < target.bed_z_m - 0.5 * CLEAR_M])


JudgeKey = tuple[str, str, str, int]
"""Flow, world, method and seed."""


def judge_trials(seeds: int, worlds: tuple[str, ...] = JUDGED) -> dict[JudgeKey, PlannedTrial]:
    """Flights to make; the target is held still in both waters."""
    return {
        (flow, world, method, seed): flight_trial(
            f"{flow}: {world}",
            method,
            seed,
            {"world": world, "method": method, "seed": seed, "flow": flow, "target.elasticity": "none"},
            setup={flights.HOVER_AND_ARC: {}},
            probes={f"{__name__}:ClearSpeed": {}},
            duration_s=DURATION_S,
            sources=SOURCES,
            variation="judge",
        )
        for seed in range(1, seeds + 1)
        for world in worlds
        for method in METHODS
        for flow in FLOWS
    }


def judge_table(rows: Mapping[JudgeKey, Row]) -> dict[str, Any]:
    """By world and method: speeds on and 8 cm off the target in each flow, and how much less than `dp`'s.

    Means over the seeds that both flew.
    """
    worlds = [name for name in JUDGED if any(key[1] == name for key in rows)]
    answer: dict[str, Any] = {}
    for world in worlds:
        table: dict[str, Any] = {}
        for method in METHODS:
            found = [{k[3]: r for k, r in rows.items() if k[:3] == (flow, world, method)} for flow in FLOWS]
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
