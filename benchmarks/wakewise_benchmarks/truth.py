"""Every figure that can be held against data that nobody in this project made, in one table.

What is asked of each figure stands in `PARTS`, before anything is computed. A figure that cannot be computed is null,
with the reason in `why`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import typer

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.ui.cli.console import format_value
from wakewise_benchmarks import cube_channel, truth_fields, truth_photos, truth_vehicle
from wakewise_benchmarks.truth_records import Asked, Part, rows_of

CASE = cube_channel.ChannelCase()
"""The lattice's run round the cube."""


def cube_figures(folder: Path, progress: Progress, case: cube_channel.ChannelCase = CASE) -> dict[str, Any]:
    """The lattice round a cube against laser Doppler profiles; also the profiles, for a picture."""
    profiles = cube_channel.read_profiles(folder)
    means = cube_channel.run_channel(case, profiles, progress)
    return cube_channel.figures(means, profiles) | {"profiles": cube_channel.compared_profiles(means, profiles)}


_CUBE = Part(
    name="cube_channel",
    source="Martinuzzi and Tropea 1993, laser Doppler",
    asked=(
        Asked(key="u_rms_rel", what="lattice round a cube: rms of U, all points, over the bulk velocity", high=0.15,
              how="asked of the lattice before it was run"),
        Asked(key="reattachment_error_pct", what="lattice round a cube: reattachment length behind it, error",
              unit="%", high=20.0, how="asked of the lattice before it was run"),
    ),
    compute=cube_figures,
    slow="minutes",
)  # fmt: skip
PARTS: dict[str, Part] = {
    part.name: part for part in (_CUBE, *truth_vehicle.PARTS, *truth_fields.PARTS, *truth_photos.PARTS)
}
"""By folder of the data, in the order in which they are told."""


def chosen(only: tuple[str, ...] | None) -> list[Part]:
    """The parts by name, all if None.

    Raises InputError for a name that there is not.
    """
    unknown = [name for name in only or () if name not in PARTS]
    if unknown:
        raise InputError(f"--only {','.join(unknown)}: no such part, allowed {', '.join(PARTS)}")
    return list(PARTS.values()) if only is None else [PARTS[name] for name in PARTS if name in only]


def run(options: BenchOptions) -> dict[str, Any]:
    """All rows, or those of `options.only`; `cube` holds all figures of the lattice's run, or null with `why`."""
    parts = chosen(options.only)
    rows: list[dict[str, Any]] = []
    spent: dict[str, float] = {}
    cube: dict[str, Any] = {}
    for k, part in enumerate(parts):
        began = time.perf_counter()
        options.progress(k, len(parts), f"{part.name}, {part.slow}" if part.slow else part.name)
        found, computed = rows_of(part, options.data, partial(_within, options.progress, k, len(parts)))
        spent[part.name] = time.perf_counter() - began
        rows += found
        if part is _CUBE:
            cube = _cube(found, computed)
    if not cube:
        cube = _cube([{"reached": None, "why": "was left out by --only"} for _ in _CUBE.asked], {})
    judged = [row["met"] for row in rows]
    return {
        "rows": rows,
        "cube": cube,
        "met": judged.count(True),
        "missed": judged.count(False),
        "not_computed": judged.count(None),
        "seconds": spent,
    }


def _within(progress: Progress, part: int, parts: int, done: int, total: int, note: str = "") -> None:
    """Progress of a part, as a share of the whole."""
    progress(part * 1000 + round(1000 * done / max(total, 1)), parts * 1000, note)


def _cube(rows: list[dict[str, Any]], computed: Mapping[str, Any]) -> dict[str, Any]:
    figures = {asked.key: row["reached"] for asked, row in zip(_CUBE.asked, rows, strict=True)}
    why = {asked.key: row["why"] for asked, row in zip(_CUBE.asked, rows, strict=True) if row["reached"] is None}
    stated = {"reynolds": None, "cells_per_H": None, "reattachment_H": None} | dict(computed)
    asked = {asked.key: asked.words for asked in _CUBE.asked}
    return {**stated, **figures, "asked": asked} | ({"why": why} if why else {})


def show_truth(result: Mapping[str, Any]) -> None:
    """The table: source, what, asked, reached, met."""
    rows = result["rows"]
    sources = max((len(row["source"]) for row in rows), default=0)
    whats = max((len(row["what"]) for row in rows), default=0)
    asks = max((len(f"{row['asked']} {row['unit']}") for row in rows), default=0)
    typer.echo(f"  {'source':<{sources}}  {'what':<{whats}}  {'asked':<{asks}}  {'reached':>8}  met")
    for row in rows:
        met = {True: "yes", False: "NO", None: "—"}[row["met"]]
        asked = f"{row['asked']} {row['unit']}".rstrip()
        reached = format_value(row["reached"])
        line = f"  {row['source']:<{sources}}  {row['what']:<{whats}}  {asked:<{asks}}  {reached:>8}  {met}"
        typer.echo(line + (f"  {row['why']}" if "why" in row else ""))
    cube = result["cube"]
    if cube.get("cells_per_H") is not None:
        typer.echo(
            f"  lattice round the cube: {cube['cells_per_H']} cells to H; Reynolds number {cube['reynolds']:.0f} by "
            f"the viscosity, {cube['reynolds_effective']:.0f} with the mean eddy viscosity added; "
            f"measured at {cube_channel.REYNOLDS:.0f}\n"
            f"  without a bound: rms of U {format_value(cube['u_rms_rel_off_walls'])} farther than "
            f"{cube_channel.OFF_WALLS_H:g} H from walls, of V {format_value(cube['v_rms_rel'])}, of W "
            f"{format_value(cube['w_rms_rel'])}, of the resolved stress uu {format_value(cube['uu_rms_rel'])}; "
            f"reattachment after {format_value(cube['reattachment_H'])} H (measured: {cube_channel.REATTACHMENT_H:g})"
        )
    typer.echo(
        f"  {result['met']} met, {result['missed']} missed, {result['not_computed']} not computed, "
        f"{sum(result['seconds'].values()):.0f} s"
    )
