"""Every wake model against truth that none was fitted to: even and drawn pushes, the tank's parcels and the lattice.

A model without memory is told the thrust of the moment; the learned one its history, and in a row of its own the
thrust of the moment alone, which is what a controller of today gives it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.interfaces import Progress, WakeModel, no_progress
from wakewise.wake import RoundJet, wake_model
from wakewise.wake.learned import CIRCULAR, EDGES, LearnedWake, Network, shape
from wakewise_paper.learned_wake.truth import (
    DIAMETER_M,
    SampledWater,
    TruthSamples,
    even_lattice_rows,
    even_parcel_rows,
    lattice_rows,
    parcel_rows,
)

MODELS = ("paper", "fitted", "jet", "jet-fitted")
TEST_SEED = 20_000
"""Streams of held-out draws; training uses others."""
TRUTH_LEAST_M_S = 0.01
"""Slower water, at 1 N, has no say in the share within a factor of two: turbulence and rounding rule there."""
ROOT = math.sqrt(1.0 / FRESH_WATER_KG_M3)


@dataclass(frozen=True, kw_only=True)
class WakeModelScore:
    """How one model meets one truth.

    `rmse_mm_s` is of the velocity's two parts, every push scaled so that the greatest thrust remembered is 1 N;
    `error_share` is it over the root mean square of the true velocity; `factor_of_2_pct` the share of the points with
    more than 1 cm/s where the speed is right within a factor of two.
    """

    rmse_mm_s: float
    error_share: float
    factor_of_2_pct: float

    @classmethod
    def of(cls, found: Array, rows: TruthSamples) -> WakeModelScore:
        """Score of f, shape (n, 2)."""
        unit = ROOT / (DIAMETER_M * (rows.points.away_D + 1.0))
        error = np.linalg.norm(found - rows.f, axis=1) * unit
        true = np.linalg.norm(rows.f, axis=1) * unit
        said = np.linalg.norm(found, axis=1) * unit
        moving = true > TRUTH_LEAST_M_S
        within = (said[moving] < 2.0 * true[moving]) & (said[moving] > 0.5 * true[moving])
        rmse = float(np.sqrt(np.mean(error**2)))
        return cls(
            rmse_mm_s=1e3 * rmse,
            error_share=rmse / float(np.sqrt(np.mean(true**2))),
            factor_of_2_pct=100.0 * float(within.mean()) if moving.any() else math.nan,
        )


def predictors(network: Network) -> dict[str, Callable[[TruthSamples], Array]]:
    """What each model says of rows, f of shape (n, 2), by the name it has in the table."""

    def memoryless(model: WakeModel) -> Callable[[TruthSamples], Array]:
        return lambda rows: unit_f(model, rows) * np.sqrt(rows.now)[:, None]

    def true_width(rows: TruthSamples) -> Array:
        if not math.isfinite(rows.half_width_growth):
            return np.full((len(rows), 2), math.nan)
        return memoryless(RoundJet(half_width_slope=rows.half_width_growth))(rows)

    learned = LearnedWake(network=network)
    found = {name: memoryless(wake_model(name)) for name in MODELS}
    found["jet, width told"] = true_width
    found["learned, no memory"] = memoryless(learned)
    found["learned"] = lambda rows: shape(network, rows.points, rows.history)
    return found


def unit_f(model: WakeModel, rows: TruthSamples) -> Array:
    """Values of f at an even push, shape (n, 2), as a wake model has it."""
    at = DIAMETER_M * np.stack([rows.points.x_D, rows.points.r_D, np.zeros(len(rows))], axis=1)
    area = np.array([0.25 * math.pi * DIAMETER_M**2])
    unit = model.unit_velocity(at, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), area)[0, :, :2]
    return np.asarray(unit * (DIAMETER_M * (rows.points.away_D + 1.0) / ROOT)[:, None])


def held_out(draws: int, lattice: bool = True, progress: Progress = no_progress) -> dict[str, list[TruthSamples]]:
    """Truth that was not trained on, by the name it has in the table; a few minutes of a core with the lattice."""
    found: dict[str, list[TruthSamples]] = {"parcels, even": [], "parcels, drawn pushes": []}
    for k in range(draws):
        progress(k, draws + 1, "parcels")
        rng = np.random.default_rng([TEST_SEED, k])
        water = SampledWater.of(rng)
        found["parcels, even"].append(even_parcel_rows(water, rng, count=200, judged=True, likes=2))
        found["parcels, drawn pushes"].append(parcel_rows(water, rng, judged=True, likes=2))
    rng = np.random.default_rng([TEST_SEED, draws])
    found["lattice with swirl, even"] = [even_lattice_rows("swirl", rng, 1500, judged=True)]
    if lattice:
        progress(draws, draws + 1, "lattice")
        found["lattice, second history"] = [_judged(lattice_rows("test", rng))]
    return found


def _judged(rows: TruthSamples) -> TruthSamples:
    """Those rows that lie where a target may: 0.2 m and more from the disk, within 30 degrees of the axis."""
    points = rows.points
    chosen = (points.away_D > 0.2 / DIAMETER_M) & (points.x_D > math.cos(math.pi / 6) * points.away_D)
    return taken(rows, chosen)


def taken(rows: TruthSamples, chosen: BoolArray) -> TruthSamples:
    """Some of the rows."""
    return TruthSamples(
        source=rows.source,
        points=type(rows.points)(x_D=rows.points.x_D[chosen], r_D=rows.points.r_D[chosen]),
        history=rows.history[chosen],
        now=rows.now[chosen],
        f=rows.f[chosen],
        steady=rows.steady,
        half_width_growth=rows.half_width_growth,
    )


def judge(network: Network, truths: dict[str, list[TruthSamples]]) -> dict[str, Any]:
    """Scores of every model on every truth: means over its draws, and the least and the greatest share of error."""
    table: dict[str, Any] = {}
    for truth, draws in truths.items():
        table[truth] = {}
        for name, predict in predictors(network).items():
            scores = [WakeModelScore.of(found, rows) for rows in draws if np.isfinite(found := predict(rows)).all()]
            table[truth][name] = _means(scores)
    return {"scores": table, "circular": CIRCULAR, "weights": network.size, "bins": len(EDGES) - 1}


def _means(scores: list[WakeModelScore]) -> dict[str, Any]:
    if not scores:
        return {"rmse_mm_s": None, "error_share": None, "factor_of_2_pct": None, "why": "nobody set this water's width"}
    shares = [score.error_share for score in scores]
    return {
        "rmse_mm_s": float(np.mean([score.rmse_mm_s for score in scores])),
        "error_share": float(np.mean(shares)),
        "error_share_range": [min(shares), max(shares)],
        "factor_of_2_pct": float(np.mean([score.factor_of_2_pct for score in scores])),
        "draws": len(scores),
    }
