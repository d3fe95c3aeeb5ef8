"""Time-averaged field of one jet from a lattice run, and the constants of the round-jet laws measured on it.

M = T / rho, U0 = sqrt(M / A), lengths in D.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file
from wakewise.core.interfaces import Progress, no_progress
from wakewise.simulation.lattice.cases import LatticeCase, case_hash
from wakewise.simulation.lattice.meanfield import MeanField
from wakewise_paper.lattice_reference.engines import around_axis
from wakewise_paper.lattice_reference.run import LatticeRun

SHIPPED: dict[str, int | None] = {"free": 7, "swirl": 7, "floor": None}
"""Cases whose tables ship, and the cells per diameter of the coarser grid that each is compared with."""

_STEP_D = 0.1  # of the stored tables, along x and r


def mean_field(run: LatticeRun) -> MeanField:
    """Table of a run about the axis of its first jet, as far as the sponges."""
    case = run.case
    x, y, z = run.cell_centres_D()
    _, y0, z0 = case.jets[0].position_D
    last = case.high_D[0] - (0.0 if case.floor else case.sponge_D)
    first, end = round((case.low_D[0] + 1) / _STEP_D), round(last / _STEP_D)
    grid_x: Array = np.linspace(first * _STEP_D, end * _STEP_D, end - first + 1)
    grid_x = grid_x[(grid_x >= x[0]) & (grid_x <= x[-1])]
    reach = min(case.high_D[1] - y0, y0 - case.low_D[1], case.high_D[2] - z0, z0 - case.low_D[2])
    grid_r: Array = np.arange(int((reach - 0.5 / case.cells_per_D) / _STEP_D + 1e-9) + 1.0) * _STEP_D
    tables: dict[str, Any] = {}
    around = around_axis(run.means(), y - y0, z - z0, grid_r)

    def along(values: Array) -> Array:
        return np.stack([np.interp(grid_x, x, column) for column in values.T], axis=1)

    tables.update({name: along(values) for name, values in around.items()})
    times = np.array(run.axis_times)
    # One line per D / U0 tells the start; what comes after the flow has developed is turbulence.
    kept = np.searchsorted(times, np.arange(1.0, min(case.develop, times[-1]) + 20.0))
    kept = np.unique(kept[kept < len(times)])
    return MeanField(
        case=case.name,
        hash=case_hash(case),
        cells_per_D=case.cells_per_D,
        x_D=grid_x,
        r_D=grid_r,
        floor_D=case.high_D[0] if case.floor else math.inf,
        axis_times=times[kept],
        axis_speeds=along(np.array(run.axis_speeds)[kept].T).T,
        **tables,
    )


def save_mean_field(path: Path, table: MeanField) -> None:
    """Write a table in float32, in steps of 2^-16 so that it packs well, whole or not at all."""
    arrays: dict[str, Any] = {
        f.name: (np.round(getattr(table, f.name) * 65536) / 65536).astype(np.float32)
        for f in fields(table)
        if isinstance(getattr(table, f.name), np.ndarray)
    }
    plain = ("case", "hash", "cells_per_D", "figures")
    words: dict[str, Any] = {name: getattr(table, name) for name in plain}
    if math.isfinite(table.floor_D):
        words["floor_D"] = table.floor_D
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, words=json.dumps(words, sort_keys=True), **arrays)


WATCH_EVERY = 0.3
"""Time between samples of the averages, in D / U0."""

_CHECKPOINT_S = 300.0


def compute_run(
    case: LatticeCase, cache: Path | None = None, progress: Progress = no_progress, device: str = "cpu"
) -> LatticeRun:
    """Run a case to its end.

    Parameters
    ----------
    case : LatticeCase
    cache : Path or None
        Folder for a checkpoint every five minutes, from which a run that was stopped goes on; it is left there, so that
        a finished run need not be repeated. None keeps nothing.
    progress : Progress
    device : str
        As `LatticeRun`. A run may go on on another device than it began.

    Raises
    ------
    StageError
        If the flow blows up.
    """
    path = cache / f"{case.name}-{case.cells_per_D}-{case_hash(case)}.npz" if cache else None
    run = LatticeRun.restored(case, path, device) if path else LatticeRun(case, device)
    stride = max(1, run.steps_at(WATCH_EVERY))
    saved = time.monotonic()
    unfinished = run.steps_done < run.steps_total
    while run.steps_done < run.steps_total:
        run.advance(min(stride, run.steps_total - run.steps_done))
        run.watch()
        progress(run.steps_done, run.steps_total, f"{case.name}, {case.cells_per_D} cells per D")
        if path and time.monotonic() - saved > _CHECKPOINT_S:
            run.save(path)
            saved = time.monotonic()
    if path and unfinished:
        run.save(path)
    return run


def compute_mean_field(
    case: LatticeCase, cache: Path | None = None, progress: Progress = no_progress, device: str = "cpu"
) -> MeanField:
    """Mean field of a case with its figures; arguments as `compute_run`."""
    run = compute_run(case, cache, progress, device)
    table = mean_field(run)
    return replace(table, figures=figures(table))


ROOT_M = math.sqrt(math.pi) / 2
"""sqrt(M) in units of U0 D."""


def axis_speed(table: MeanField, x_D: float | Array) -> Array:
    """Mean speed on the axis over U0."""
    return np.asarray(np.interp(x_D, table.x_D, table.axial[:, 0]))


def decay_constant(table: MeanField, x_D: float | Array) -> Array:
    """U_c x / sqrt(M): 6.5 to 7.0 far down a round jet (Albertson et al. 1950; Hussein, Capp and George 1994)."""
    return np.asarray(axis_speed(table, x_D) * np.asarray(x_D) / ROOT_M)


def half_width(table: MeanField, x_D: float | Array) -> Array:
    """Radius over D where the axial speed is half that of the axis; the law is 0.09 to 0.10 x."""
    out = []
    for x in np.atleast_1d(x_D):
        i = int(np.argmin(np.abs(table.x_D - x)))
        u = table.axial[i] / table.axial[i].max()
        # From the outermost point above one half, so that a hollow core of a swirling jet does not end the search.
        j = int(np.flatnonzero(u > 0.5)[-1])
        j = min(j, len(u) - 2)
        out.append(table.r_D[j] + (u[j] - 0.5) / (u[j] - u[j + 1]) * (table.r_D[j + 1] - table.r_D[j]))
    return np.array(out)


def _over_plane(table: MeanField, values: Array) -> Array:
    return np.asarray(2 * np.pi * np.trapezoid(values * table.r_D, table.r_D, axis=1))


def momentum_flux(table: MeanField) -> Array:
    """Momentum and pressure through each plane over T, shape (nx,): the integral of u^2 + u'^2 + p / rho over M."""
    return _over_plane(table, table.axial**2 + table.axial_rms**2 + table.pressure) / (math.pi / 4)


def volume_flux(table: MeanField) -> Array:
    """Volume through each plane over that of the exit, U0 A, shape (nx,).

    Summed to the radius where the mean speed falls below 2 % of the axis': outside, the slow stream through the open
    box would count as part of the jet.
    """
    u = table.axial
    falls = np.cumsum(u < 0.02 * u.max(axis=1, keepdims=True), axis=1) > 0
    return _over_plane(table, np.where(falls, 0.0, u)) / (math.pi / 4)


def angular_flux(table: MeanField) -> Array:
    """Angular momentum through each plane over T D, shape (nx,): constant at Q / (T D) if no wall is near.

    The turbulent share, the correlation of axial and swirling speed, is not stored and left out: 5 to 25 per cent.
    """
    return _over_plane(table, table.axial * table.swirl * table.r_D) / (math.pi / 4)


def front_constant(table: MeanField, share: float = 0.5) -> Array:
    """Front of the starting jet, x / (M^(1/4) t^(1/2)) for each stored time; the law is 2.57.

    The front is where, seen from ahead, the speed on the axis first exceeds half of the later mean there; NaN before
    it is one diameter away from the disk and once it has left the table.
    """
    out = []
    ahead = table.x_D > 1.0
    for t, u in zip(table.axis_times, table.axis_speeds, strict=True):
        moving = np.flatnonzero(ahead & (u > share * table.axial[:, 0]))
        inside = len(moving) > 0 and moving[-1] < len(table.x_D) - 1
        out.append(table.x_D[moving[-1]] / math.sqrt(ROOT_M * t) if inside else math.nan)
    return np.array(out)


def smooth_axis_speed(table: MeanField, x_D: float, half_span: float = 1.0) -> float:
    """U_c / U0 at x_D from a straight line through 1 / U_c within `half_span` of it.

    One point of a time average still scatters by a few per cent; a jet's 1 / U_c is straight over two diameters.
    """
    near = np.abs(table.x_D - x_D) <= half_span + 1e-6
    return float(1 / np.polyfit(table.x_D[near] - x_D, 1 / table.axial[near, 0], 1)[1])


def decay(table: MeanField, first_D: float = 5.0, last_D: float = 9.0) -> tuple[float, float]:
    """K and x0 of U_c = K sqrt(M) / (x - x0), fitted between two distances: the law with its virtual origin."""
    part = (table.x_D >= first_D) & (table.x_D <= last_D)
    slope, start = np.polyfit(table.x_D[part], 1 / table.axial[part, 0], 1)
    return float(1 / (slope * ROOT_M)), float(-start / slope)


def spreading(table: MeanField, first_D: float = 5.0, last_D: float = 9.0) -> float:
    """Growth of the half width with distance, d r_half / dx, fitted between two distances."""
    x = table.x_D[(table.x_D >= first_D) & (table.x_D <= last_D)]
    return float(np.polyfit(x, half_width(table, x), 1)[0])


def entrainment(table: MeanField, first_D: float = 2.0, last_D: float = 9.0) -> float:
    """Growth of the volume flux, d(Q / Q0) / d(x / D), fitted between two distances; the law is 0.32."""
    part = (table.x_D >= first_D) & (table.x_D <= last_D)
    return float(np.polyfit(table.x_D[part], volume_flux(table)[part], 1)[0])


def wall_jet_constant(table: MeanField, r_D: Array) -> Array:
    """Fastest outward speed over the floor times r / sqrt(M), at radii; the law is 1.16 (Rajaratnam 1976).

    Of the last diameter before the floor; the wall's own layer, some hundredths of r, is not resolved.
    """
    above = table.x_D >= table.floor_D - 1.0
    fastest = table.radial[above].max(axis=0)
    return np.asarray(np.interp(r_D, table.r_D, fastest) * np.asarray(r_D) / ROOT_M)


def convergence(fine: MeanField, coarse: MeanField, x_D: float = 5.0) -> dict[str, Any]:
    """How far two grids differ in U_c at 0.3 m from a disk of 60 mm, in per cent of the finer one's, and elsewhere."""
    places = np.arange(max(2.0, math.ceil(fine.x_D[0] + 0.5)), min(fine.x_D[-1], coarse.x_D[-1]) - 0.5, 1.0)
    change = {float(x): 100 * (smooth_axis_speed(coarse, x) / smooth_axis_speed(fine, x) - 1) for x in places}
    return {
        "grid_convergence_pct": abs(change[x_D]),
        "grid_convergence_worst_pct": max(abs(v) for v in change.values()),
        "coarse_cells_per_D": coarse.cells_per_D,
        "coarse_axis_change_pct": {str(x): round(value, 2) for x, value in change.items()},
        "coarse_decay_fit": [round(v, 3) for v in decay(coarse)],
        "coarse_spreading": round(spreading(coarse), 4),
    }


def figures(table: MeanField) -> dict[str, Any]:
    """Every figure of a table that its reader may want beside it, as plain numbers."""
    x = np.array([v for v in (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 9.0, 10.0, 12.0, 14.0) if v <= table.x_D[-1]])
    flux = np.interp(x, table.x_D, momentum_flux(table))
    known: dict[str, Any] = {
        "x_D": x.tolist(),
        "axis_speed": axis_speed(table, x).round(4).tolist(),
        "decay_constant": decay_constant(table, x).round(3).tolist(),
        "half_width_over_x": (half_width(table, x) / x).round(4).tolist(),
        "momentum_flux": flux.round(4).tolist(),
        "volume_flux": np.interp(x, table.x_D, volume_flux(table)).round(3).tolist(),
        "angular_flux": np.interp(x, table.x_D, angular_flux(table)).round(4).tolist(),
    }
    if math.isfinite(table.floor_D):
        radii = np.array([1.5, 2.0, 2.5, 3.0, 4.0])
        known |= {
            "wall_jet_r_D": radii.tolist(),
            "wall_jet_constant": wall_jet_constant(table, radii).round(3).tolist(),
        }
    if table.x_D[-1] >= 9.0:
        known |= {
            "decay_fit": [round(v, 3) for v in decay(table)],
            "spreading": round(spreading(table), 4),
            "entrainment": round(entrainment(table), 4),
        }
    return known
