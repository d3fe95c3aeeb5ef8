"""Measured jets of the reference data: velocity fields of an air jet, and image pairs of another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3 as WATER_DENSITY_KG_M3
from wakewise.core.errors import InputError
from wakewise.wake.calibration import DataSplit
from wakewise.wake.samples import CORE, JetSamples
from wakewise.wake.scores import score_speeds

NOZZLE_DIAMETER_M = 0.15
EXIT_SPEED_M_S = 12.0
"""As the data's readme states (F. Moisy, Lab FAST, Univ. Paris-Sud, CNRS)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredJet:
    """Samples of a real jet with the split into snapshots to fit on and snapshots to test on.

    `half_width_m` is half the width at half the peak speed `peak_m_s`, both 0.1 m from the data's edge.
    `snapshots_r2_core` is what the mean of the training snapshots itself scores on the test snapshot in region A:
    with so few snapshots turbulence leaves little to any model of the mean.
    """

    samples: JetSamples
    split: DataSplit
    half_width_m: float
    peak_m_s: float
    snapshots_r2_core: float


def read_air_jet(path: Path) -> MeasuredJet:
    """Three snapshots of a 12 m/s air jet; fit on the first two, test on the third.

    The nozzle's plane is taken at y = 0 of the data and the jet along +y, as the readme has it. The jet's axis is the
    line through the centroids of speed squared of the two snapshots to fit on. Since models know T / (rho A) only, the
    thrust is that which in water gives the same exit speed.

    Raises
    ------
    InputError
        If the file is missing or holds other arrays.
    """
    try:
        with np.load(path) as data:
            across, along, x_mm, y_mm = (np.asarray(data[key], dtype=np.float64) for key in ("u", "v", "x_mm", "y_mm"))
    except (OSError, KeyError, ValueError):
        raise InputError(f"{path}: cannot be read, needs arrays u, v, x_mm and y_mm of the air jet") from None
    x, y = 1e-3 * x_mm, 1e-3 * y_mm
    known_twice = np.isfinite(along[:2]).all(axis=0)
    mean = np.where(known_twice, np.nan_to_num(along[:2]).mean(axis=0), np.nan)
    slope, offset = _axis(mean, x, y)
    Y, X = np.meshgrid(y, x, indexing="ij")
    off = X - (slope * Y + offset)
    rows = []
    for k in range(len(along)):
        known = np.isfinite(along[k]) & np.isfinite(across[k]) & (Y > 0.0)
        n = int(known.sum())
        columns = [Y[known], np.abs(off[known]), along[k][known], np.abs(across[k][known]), np.full(n, float(k))]
        rows.append(np.column_stack(columns))
    table = np.concatenate(rows)
    thrust_N = WATER_DENSITY_KG_M3 * 0.25 * math.pi * NOZZLE_DIAMETER_M**2 * EXIT_SPEED_M_S**2
    samples = JetSamples(
        x_m=table[:, 0],
        r_m=table[:, 1],
        thrust_N=np.full(len(table), thrust_N),
        speed_m_s=table[:, 2],
        across_m_s=table[:, 3],
        disk_diameter_m=NOZZLE_DIAMETER_M,
        title="air jet",
    )
    row = mean[np.argmin(np.abs(y - 0.1))]
    both = samples.take(table[:, 4] == 2)
    known = np.isfinite(along[2]) & np.isfinite(across[2]) & (Y > 0.0)
    inside = CORE.holds(both) & np.isfinite(mean[known])
    explained = score_speeds(mean[known][inside], both.take(inside)).r2_core
    return MeasuredJet(
        samples=samples,
        split=DataSplit(
            train=table[:, 4] < 2,
            test=table[:, 4] == 2,
            words="two snapshots to fit on, the third to test on; one speed",
        ),
        half_width_m=0.5 * float((row > 0.5 * np.nanmax(row)).sum() * abs(x[1] - x[0])),
        peak_m_s=float(np.nanmax(row)),
        snapshots_r2_core=float("nan") if explained is None else explained,
    )


def _axis(speed: Array, x: Array, y: Array) -> tuple[float, float]:
    """Slope and offset of the line x = slope y + offset that the jet runs along; `speed` has a row for each y."""
    weight = np.where(np.isfinite(speed), np.maximum(speed, 0.0), 0.0) ** 2
    whole = np.isfinite(speed).mean(axis=1) > 0.9
    centre = (weight @ x)[whole] / weight.sum(axis=1)[whole]
    slope, offset = np.polyfit(y[whole], centre, 1)
    return float(slope), float(offset)
