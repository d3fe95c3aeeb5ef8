"""`wakewise compare-models`: growth and loss of a colony between two dates."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, print_table, write_page
from wakewise.ui.cli.options import Json, check_file

if TYPE_CHECKING:
    from wakewise.vision.evaluation.surface_change import SurfaceChange
    from wakewise.vision.reconstruction.quality.finished_models import FinishedModel

First = Annotated[
    Path, typer.Argument(metavar="A", help="Model of the first date: a folder or a mesh.", show_default=False)
]
Second = Annotated[
    Path, typer.Argument(metavar="B", help="Model of the second date: a folder or a mesh.", show_default=False)
]
AlignScale = Annotated[
    bool, typer.Option("--align-scale", help="Fit the scale of B, too; growth all over is then taken for scale.")
]
Unit = Annotated[
    float | None,
    typer.Option("--unit-m", metavar="M", help="Length of the unit of both in metres, for meshes in millimetres "
                 "(0.001) or models without scale.", show_default=False),
]  # fmt: skip
Out = Annotated[
    Path | None,
    typer.Option("--out", help="Write the distances as a picture (.png), the figures beside it (.json).",
                 show_default=False),
]  # fmt: skip


def compare_models(
    first: First,
    second: Second,
    align_scale: AlignScale = False,
    unit_m: Unit = None,
    out: Out = None,
    json: Json = False,
) -> None:
    """Compare a colony at two dates: growth, loss, and the smallest change that can be told at 95 %.

    B is laid on A by what did not change. What each figure means is in docs/measuring.md.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise compare-models", "photos")
    import numpy as np

    from wakewise.core.files import write_json
    from wakewise.vision.evaluation.surface_change import compare_models as compare
    from wakewise.vision.reconstruction.quality.finished_models import read_model

    if out is not None:
        need("the picture of wakewise compare-models", "reports")
        if out.suffix.lower() != ".png":
            raise InputError(f"--out {out}: must end in .png")
        for path in (out, out.with_suffix(".json")):
            check_file(path)
    models = [read_model(path, unit_m) for path in (first, second)]
    sigmas = [model.scale_sigma_pct or 0.0 for model in models]
    with ProgressBars().stage("compare"):
        found = compare(
            models[0].mesh,
            models[1].mesh,
            np.random.default_rng(0),
            eyes=(models[0].eyes_m, models[1].eyes_m),
            scale_sigma_pct=float(np.hypot(sigmas[0], sigmas[1])),
            scale_known=all(model.scale_sigma_pct is not None for model in models),
            align_scale=align_scale,
        )
    doubts = [] if found.scale_warning is None else [f"warning: {found.scale_warning}"]
    figures = _figures(found, models, align_scale) | {"warnings": [*doubts, *_warnings(models)]}
    if out is not None:
        from wakewise.ui.reports.change_map import write_change_map

        write_json(out.with_suffix(".json"), figures)
        if not write_page("picture", partial(write_change_map, out, found)):
            out = None
    rows = [(key, found.figures[key], text) for key, text in figures["definitions"].items()]
    table = partial(print_table, "tnt", ("figure", "value", "what it is"), rows, f"{second} against {first}")
    missing = [f"scale of {name}: {reason}" for name, reason in figures["scale_unknown"].items()]
    picture = None if out is None else f"picture: {out}"
    answer(json, figures, table, *missing, *figures["warnings"], f"verdict: {found.verdict}", picture)


def _warnings(models: list[FinishedModel]) -> list[str]:
    """What makes a comparison doubtful, by model: what `wakewise measure` warns of, which rests on the same bed."""
    import numpy as np

    from wakewise.vision.evaluation.measurement import MeasuringRule, measure, measuring_warnings

    lines = []
    for model in models:
        rule = MeasuringRule(eyes_m=model.eyes_m)
        try:
            size, bed, _ = measure(model.mesh, rule, np.random.default_rng(0))
        except InputError as fault:
            lines.append(f"warning, {model.name}: {fault}")
            continue
        lines += [f"warning, {model.name}: {line}" for line in measuring_warnings(model.mesh, rule, size, bed)]
    return lines


def _figures(found: SurfaceChange, models: list[FinishedModel], align_scale: bool) -> dict[str, Any]:
    """All figures as plain values."""
    from wakewise.vision.evaluation.surface_change import DEFINITIONS

    similarity = found.registration.similarity
    out: dict[str, Any] = found.figures | {
        "change_mm_low": found.change_low_mm,
        "change_mm_high": found.change_high_mm,
        "where": found.where,
        "verdict": found.verdict,
        "bed": None if found.bed is None else found.bed.figures(),
        "registration": {
            "R_AB": similarity.R_AB.tolist(),
            "t_A_m": similarity.t_A_m.tolist(),
            "scale": similarity.scale,
            "scale_aligned": align_scale,
        },
        "scale_unknown": {m.name: m.scale_why for m in models if m.scale_sigma_pct is None and m.scale_why},
    }
    nothing = "no change can be told"
    why = {key: nothing for key, value in out.items() if value is None}
    if found.bed is None:
        why["bed"] = "no bed was found: all is taken for colony, and nothing holds the height"
    units = {key: unit for key, (unit, _) in DEFINITIONS.items()}
    return out | {"why": why, "units": units, "definitions": {key: text for key, (_, text) in DEFINITIONS.items()}}
