"""`wakewise measure`: size of a colony or a box of a model, each figure with its 95 % interval."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import ProgressBars, answer, interval, print_table
from wakewise.ui.cli.options import Json, check_file

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.quality.finished_models import FinishedModel
    from wakewise.vision.reconstruction.quality.photo_jackknife import MeasuredModel

ModelPath = Annotated[
    Path,
    typer.Argument(help="Folder of `wakewise reconstruct` or `wakewise scan`, or a mesh (PLY, STL, OBJ, OFF, GLB).",
                   show_default=False),
]  # fmt: skip
Box = Annotated[
    tuple[float, float, float, float, float, float] | None,
    typer.Option("--box", metavar="X0 Y0 Z0 X1 Y1 Z1", help="Measure all in this box of the model's frame, m, bed "
                 "included.", show_default=False),
]  # fmt: skip
Colony = Annotated[
    bool,
    typer.Option("--colony", help="Measure the colony nearest the middle; what is done without --box. With --box: the "
                 "one in the box."),
]  # fmt: skip
Bed = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option("--bed", metavar="NX NY NZ D", help="Bed plane: its upward normal in the model's frame, and how far "
                 "along it the bed lies, m; fitted if not given.", show_default=False),
]  # fmt: skip
Unit = Annotated[
    float | None,
    typer.Option("--unit-m", metavar="M", help="Length of the model's unit in metres, for a mesh in millimetres "
                 "(0.001) or a model without scale.", show_default=False),
]  # fmt: skip
Out = Annotated[
    Path | None, typer.Option("--out", help="Write the figures as JSON into this file, too.", show_default=False)
]


def measure(
    model: ModelPath,
    box: Box = None,
    colony: Colony = False,
    bed: Bed = None,
    unit_m: Unit = None,
    out: Out = None,
    json: Json = False,
) -> None:
    """Measure a colony: length, width, height, areas, volume and rugosity, each with a 95 % interval.

    Intervals come from photographs left out in turn, the surface's noise and the scale's uncertainty; a bare mesh has
    none. What each figure means is in docs/measuring.md.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise measure", "photos")
    check_file(out)
    import numpy as np

    from wakewise.core.files import write_json
    from wakewise.vision.evaluation.bed_and_colony import given_bed
    from wakewise.vision.evaluation.measurement import MeasuringRule
    from wakewise.vision.reconstruction.quality.finished_models import read_model
    from wakewise.vision.reconstruction.quality.photo_jackknife import measure_model

    read = read_model(model, unit_m)
    rule = MeasuringRule(
        box=None if box is None else (np.array(box[:3]), np.array(box[3:])),
        colony=colony or box is None,
        bed=None if bed is None else given_bed(np.array(bed[:3]), bed[3]),
        eyes_m=read.eyes_m,
    )
    with ProgressBars().stage("measure") as progress:
        found = measure_model(read, rule, np.random.default_rng(0), progress)
    figures = _figures(read, found)
    if out is not None:
        write_json(out, figures)
    rows: list[tuple[str, object, str, str, str]] = [
        (key, one.value, interval(one.low, one.high, "—"), figures["units"][key], figures["definitions"][key])
        for key, one in found.intervals.items()
    ]
    up = " ".join(f"{round(value, 2) + 0.0:g}" for value in found.bed.axes[2])
    rows.append(("up", up, "", "", "the bed's upward normal in the model's frame"))
    table = partial(print_table, "tnttt", ("figure", "value", "95 % interval", "unit", "what it is"), rows, str(model))
    answer(json, figures, table, *_remarks(read, found))


def _figures(read: FinishedModel, found: MeasuredModel) -> dict[str, Any]:
    """All figures as plain values."""
    from wakewise.vision.evaluation.measurement import DEFINITIONS

    out: dict[str, Any] = {}
    why: dict[str, str] = {}
    for key, one in found.intervals.items():
        out |= {key: one.value, f"{key}_low": one.low, f"{key}_high": one.high}
        out[f"{key}_sigmas"] = {"photos": one.photos_sigma, "surface": one.surface_sigma, "scale": one.scale_sigma}
        if found.why is not None:
            why |= {f"{key}_low": found.why, f"{key}_high": found.why}
    out |= {
        "bed": found.bed.figures(),
        "groups": found.groups,
        "warnings": list(found.warnings),
        "scale_from": read.scale_from,
        "scale_sigma_pct": read.scale_sigma_pct,
        "surface_noise_mm": None if read.noise_m is None else 1e3 * read.noise_m,
    }
    if read.scale_why is not None:
        why["scale_sigma_pct"] = read.scale_why
    if read.scale_from is None:
        why["scale_from"] = "a bare mesh"
    if read.noise_m is None:
        why["surface_noise_mm"] = "there are no dense points (dense.ply)"
    units = {key: unit for key, (unit, _, _) in DEFINITIONS.items()}
    return out | {"why": why, "units": units, "definitions": {key: text for key, (_, _, text) in DEFINITIONS.items()}}


def _remarks(read: FinishedModel, found: MeasuredModel) -> list[str]:
    """What the intervals hold and what they leave out, in lines."""
    warnings = [f"warning: {text}" for text in found.warnings]
    if found.why is not None:
        return [f"no intervals: {found.why}", *warnings]
    scale = (
        f"scale from {read.scale_from}, {read.scale_sigma_pct:.2g} % (one standard deviation)"
        if read.scale_sigma_pct is not None
        else f"without the scale's uncertainty: {read.scale_why}"
    )
    return [f"intervals: {found.groups} groups of photographs left out in turn; {scale}", *warnings]
