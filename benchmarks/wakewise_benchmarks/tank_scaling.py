"""Processor time of the tank against the number of parcels, of points and of silt particles, and its order of growth.

Parcels grow with their jets at constant density: thrusters lie at random in an open box whose volume grows with their
number. The direct sum over all pairs of point and parcel is measured beside the clustered one, at the same points.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import typer

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.simulation.tank.sediment import Silt, SiltProperties
from wakewise.simulation.water import Water
from wakewise.simulation.water.clusters import ImpulseField
from wakewise.simulation.water.induction import impulse_velocity, spatial_order
from wakewise.ui.cli.console import format_value

THRUSTERS = (2, 4, 8, 16, 32, 64)
POINTS = (500, 2000, 8000, 32000)
PARTICLES = (1000, 4000, 16000, 64000)
"""Numbers that are measured; 8 thrusters for the points and the particles."""
AT_POINTS, USUAL_THRUSTERS = 5000, 8
_SPIN_UP_S, _STEP_S, _STEPS, _CALLS = 15.0, 0.02, 40, 5
_THRUST_N, _DISK_M2, _M3_PER_THRUSTER, _DENSITY_KG_M3 = 8.0, 0.0045, 6.0, 1000.0
_SEED = 1


def measure_scaling(
    progress: Progress,
    thrusters: Sequence[int] = THRUSTERS,
    points: Sequence[int] = POINTS,
    particles: Sequence[int] = PARTICLES,
    spin_up_s: float = _SPIN_UP_S,
) -> dict[str, Any]:
    """Median processor time in ms by number, and each cost's exponent, that of the number n in cost ~ n^exponent.

    `exponent_of_n_log_n` is that of n log n over the same numbers.
    """
    rows: dict[str, list[dict[str, float]]] = {"parcels": [], "points": [], "particles": []}
    usual = None
    for done, count in enumerate(thrusters):
        progress(done, len(thrusters), f"water of {count} thrusters")
        jets = _Jets(count)
        jets.move(round(spin_up_s / _STEP_S))
        rows["parcels"].append(_parcel_row(jets))
        if usual is None or count <= USUAL_THRUSTERS:
            usual = jets
    if usual is None:
        raise InputError("thrusters: none given, at least one is needed")
    flow = usual.water.now
    for count in points:
        rows["points"].append({"count": count, "flow_ms": _median_ms(partial(flow.jets, usual.places(count)), _CALLS)})
    for count in particles:
        rows["particles"].append({"count": count, "step_ms": _silt_ms(usual, count)})
    costs = {"parcels": ("step_ms", "flow_ms", "direct_ms"), "points": ("flow_ms",), "particles": ("step_ms",)}
    return {
        "rows": rows,
        "exponents": {
            name: {cost: exponent(rows[name], cost) for cost in each}
            | {"n_log_n": exponent([row | {"law": row["count"] * math.log(row["count"])} for row in rows[name]], "law")}
            for name, each in costs.items()
        },
    }


def exponent(rows: Sequence[dict[str, float]], cost: str) -> float | None:
    """Slope of log(cost) over log(count) by least squares over the larger half of the rows; None for fewer than 2."""
    larger = rows[len(rows) // 2 :] if len(rows) > 3 else rows
    if len(larger) < 2:
        return None
    slope = np.polyfit(np.log([row["count"] for row in larger]), np.log([row[cost] for row in larger]), 1)[0]
    return float(slope)


class _Jets:
    """Open water over a bed with thrusters that blow at random places in random directions."""

    def __init__(self, count: int) -> None:
        rng = np.random.default_rng(_SEED)
        self.side_m = (_M3_PER_THRUSTER * count) ** (1 / 3)
        self._at = rng.uniform(-0.5, 0.5, (count, 3)) * self.side_m
        self._at[:, 2] += 0.5 * self.side_m
        axes = rng.standard_normal((count, 3))
        self._axes = axes / np.linalg.norm(axes, axis=1)[:, None]
        self._impulses_N_s = np.tile([_THRUST_N * _STEP_S, 0.0], (count, 1))
        self.water = Water(
            np.full(count, _DISK_M2),
            density_kg_m3=_DENSITY_KG_M3,
            bed_z_m=self.side_m,
            rng=rng,
            turbulence=0.2,
            max_parcels=100_000,
        )

    def move(self, steps: int = 1) -> None:
        """Move the water on."""
        for _ in range(steps):
            self.water.step(_STEP_S, self._at, self._at, self._axes, self._impulses_N_s)

    def places(self, count: int) -> Array:
        """Points all over the box, shape (count, 3), in the order of space."""
        points = np.random.default_rng(_SEED).uniform(-0.5, 0.5, (count, 3)) * self.side_m
        points[:, 2] += 0.5 * self.side_m
        return np.ascontiguousarray(points[spatial_order(points)])


def _parcel_row(jets: _Jets) -> dict[str, float]:
    counts = []

    def step() -> None:
        jets.move()
        counts.append(jets.water.counts.parcels)

    step_ms = _median_ms(step, _STEPS)
    parcels, at = jets.water.parcels, jets.places(AT_POINTS)
    rows = parcels.position_m, parcels.impulse_m4_s, parcels.sigma_m
    field = ImpulseField.of(*rows)
    return {
        "count": float(np.mean(counts)),
        "step_ms": step_ms,
        "flow_ms": _median_ms(lambda: field.velocity(at), _CALLS),
        "direct_ms": _median_ms(lambda: impulse_velocity(at, *rows), _CALLS),
    }


def _silt_ms(jets: _Jets, count: int) -> float:
    """Of a step of silt with about so many particles in the water of the jets as it is."""
    laws = SiltProperties.of(20e-6, 2710.0, _DENSITY_KG_M3, 5e-5)
    size = (jets.side_m, jets.side_m, jets.side_m)
    silt = Silt(laws, 0.01, size, 2 * count, np.random.default_rng(_SEED))
    silt.suspend(1e-3, np.array([0.0, 0.0, jets.side_m]))
    flow, stirred = jets.water.now, np.array([[0.0, 0.0, 0.4]])
    return _median_ms(lambda: silt.step(flow, stirred, _STEP_S), _STEPS)


def _median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median processor time of all threads."""
    work()
    spans = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        spans.append(1e3 * (time.process_time() - began))
    return float(np.median(spans))


def show_tank(result: Mapping[str, Any]) -> None:
    """The tank's figures, and a row for each number that was measured."""
    for key, value in result.items():
        if key == "cpu_s_per_s_by":
            for part, share in value.items():
                typer.echo(f"  {part:<34}{format_value(share):>10}")
        elif key != "scaling":
            typer.echo(f"  {key:<34}{format_value(value):>10}")
    for name, rows in result["scaling"]["rows"].items():
        grows = result["scaling"]["exponents"][name]
        for row in rows:
            costs = ", ".join(f"{cost} {format_value(ms)}" for cost, ms in row.items() if cost != "count")
            typer.echo(f"  {row['count']:>8.0f} {name:<11}{costs}")
        told = ", ".join(f"{cost} {format_value(value)}" for cost, value in grows.items())
        typer.echo(f"  {'':>8} {'exponents':<11}{told}")
