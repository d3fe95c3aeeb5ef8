"""How well a wake model meets measured speeds, region by region.

R2 = 1 - sum (u - model)^2 / sum (u - mean)^2 on the axial speed in m/s, the mean taken per thrust: that some thrusts
are stronger than others explains nothing. (`r2_*_pooled` takes one mean over all thrusts, which is kinder.)
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.interfaces import WakeModel
from wakewise.wake.disturbance import unit_velocity
from wakewise.wake.jets import AxialJet
from wakewise.wake.samples import CORE, FAR, WAKE, JetSamples

_LEAST_REGION = 8


@dataclass(frozen=True, kw_only=True)
class WakeScores:
    """How well a model meets samples; None where there are too few points or no spread, with the reason in `why`.

    `r2_core` and `r2_wake` are R2 in the paper's regions A and B, `r2` over all points; `r2_vector` counts the velocity
    across the jet, which no model has. `bias_far_pct` is 100 (sum model / sum measured - 1) beyond 0.4 m.
    """

    r2: float | None
    r2_core: float | None
    r2_wake: float | None
    r2_core_pooled: float | None
    r2_wake_pooled: float | None
    r2_vector: float | None
    bias_far_pct: float | None
    points: int
    points_core: int
    points_wake: int
    why: dict[str, str]

    def plain(self) -> dict[str, Any]:
        """As plain values, ready for JSON."""
        return asdict(self)


def predicted_speed(model: WakeModel, samples: JetSamples) -> Array:
    """Axial speed in m/s of a model, ours or one from outside, at the points and thrusts of samples, shape (n,)."""
    if isinstance(model, AxialJet):
        return model.speed(samples.x_m, samples.r_m, samples.thrust_N, samples.disk_area_m2)
    areas, which = np.unique(samples.disk_area_m2, return_inverse=True)
    ahead = np.tile([1.0, 0.0, 0.0], (len(areas), 1))
    points = np.column_stack([samples.x_m, samples.r_m, np.zeros(len(samples))])
    unit = unit_velocity(model, points, np.zeros((len(areas), 3)), ahead, areas)
    return np.asarray(np.sqrt(samples.thrust_N) * unit[which, np.arange(len(samples)), 0])


def score(model: WakeModel, samples: JetSamples) -> WakeScores:
    """Scores of a model on samples."""
    return score_speeds(predicted_speed(model, samples), samples)


def score_speeds(predicted_m_s: Array, samples: JetSamples) -> WakeScores:
    """Scores of predicted axial speeds, shape (n,)."""
    why: dict[str, str] = {}
    core, wake, far = (region.holds(samples) for region in (CORE, WAKE, FAR))
    everything = np.ones(len(samples), dtype=np.bool_)
    keys: dict[str, tuple[BoolArray, bool, bool]] = {
        "r2": (everything, False, False),
        "r2_core": (core, False, False),
        "r2_wake": (wake, False, False),
        "r2_core_pooled": (core, True, False),
        "r2_wake_pooled": (wake, True, False),
        "r2_vector": (everything, False, True),
    }
    values: dict[str, float | None] = {}
    for key, (rows, pooled, vector) in keys.items():
        values[key] = _r2(predicted_m_s[rows], samples.take(rows), pooled=pooled, vector=vector)
        if values[key] is None:
            why[key] = f"{int(rows.sum())} test points there, or all with the same speed"
    total = float(samples.speed_m_s[far].sum())
    bias = 100.0 * (float(predicted_m_s[far].sum()) / total - 1.0) if far.sum() >= _LEAST_REGION and total > 0 else None
    if bias is None:
        why["bias_far_pct"] = f"{int(far.sum())} test points beyond {FAR.nearest_m:g} m"
    return WakeScores(
        **values,
        bias_far_pct=bias,
        points=len(samples),
        points_core=int(core.sum()),
        points_wake=int(wake.sum()),
        why=why,
    )


def _r2(predicted: Array, samples: JetSamples, *, pooled: bool, vector: bool) -> float | None:
    if len(samples) < _LEAST_REGION:
        return None
    u = samples.speed_m_s
    mean = np.full(len(samples), u.mean())
    if not pooled:
        level, row = np.unique(samples.thrust_N, return_inverse=True)
        row = row.ravel()
        mean = (np.bincount(row, u, len(level)) / np.bincount(row, minlength=len(level)))[row]
    # The mean velocity across an axisymmetric jet is nil, so what is across counts whole in both sums.
    across = float(np.sum(samples.across_m_s**2)) if vector else 0.0
    spread = float(np.sum((u - mean) ** 2)) + across
    if spread <= 1e-12 * float(np.sum(u**2)):
        return None
    return 1.0 - (float(np.sum((u - predicted) ** 2)) + across) / spread
