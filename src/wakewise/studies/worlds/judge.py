"""The second judge: the same hovers in the tank and in the lattice, which shares no law with it.

Do the order of the methods and the size of the gain hold there? The worlds are those of a heavy vehicle, of a near
target and of a current. The target is held still in both, and what the lattice has not (silt, turbulence of the water's
own) is in the tank alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.studies.side_by_side import Key, Row
from wakewise.studies.worlds.flight import WorldTrial

JUDGED = ("payload", "close", "kelp")
METHODS = ("dp", "bow-rule", "wake-aware")
FLOWS = ("tank", "lattice")
DURATION_S = 23.0
"""Settling and hover: the lattice takes minutes of a core for it."""
SPEED = "target_speed_mean_m_s"


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
    """By world and method: the target's speed in each flow, mean over the seeds that both flew; less than `dp`'s."""
    worlds = [name for name in JUDGED if any(key[0].endswith(f": {name}") for key in rows)]
    answer: dict[str, Any] = {}
    for world in worlds:
        table: dict[str, Any] = {}
        for method in METHODS:
            found = [
                {k[2]: r[SPEED] for k, r in rows.items() if k[:2] == (f"{flow}: {world}", method)} for flow in FLOWS
            ]
            both = sorted(set(found[0]) & set(found[1]))
            means = [float(np.mean([speeds[s] or 0.0 for s in both])) if both else None for speeds in found]
            table[method] = {"tank_m_s": means[0], "lattice_m_s": means[1], "seeds": len(both)}
        for flow in FLOWS:
            base = table[METHODS[0]][f"{flow}_m_s"]
            for row in table.values():
                own = row[f"{flow}_m_s"]
                row[f"{flow}_less_pct"] = 100.0 * (1.0 - own / base) if base and own is not None else None
        answer[world] = table
    return answer
