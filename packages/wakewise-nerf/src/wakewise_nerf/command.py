"""`wakewise nerf`: a neural field from a model's photographs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.commands import PHOTOGRAPHS, CliCommand
from wakewise.ui.cli.console import ProgressBars, answer, print_table
from wakewise.ui.cli.options import Json, seed_option


def nerf(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL_FOLDER", help="Folder with a model (sparse/): a trial, or what reconstruct left."
        ),
    ],
    photos: Annotated[
        Path | None, typer.Option(help="Folder of the photographs; MODEL_FOLDER/images if not given.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the field; MODEL_FOLDER/nerf if not given.")] = None,
    profile: Annotated[
        str, typer.Option(help="gpu, as in the paper, or cpu, a demonstration; auto takes what there is.")
    ] = "auto",
    steps: Annotated[
        int | None, typer.Option(min=1, max=1_000_000, help="Steps of training; the profile's if not given.")
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
    region: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,R",
            help="Ball that is wanted, in the model's units; a trial's target, else where the sparse points are.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(callback=seed_option, help="Seed of every random draw.")] = 0,
    threads: Annotated[
        int, typer.Option(min=1, max=64, help="Threads on a CPU; where others work too, 1 may be the fastest.")
    ] = 2,
    no_mesh: Annotated[bool, typer.Option("--no-mesh", help="Stop at the points.")] = False,
    json: Json = False,
) -> None:
    """Train a neural radiance field on a model's photographs; judge it on held-out views; take its surface.

    Needs the extra `nerf`. Leaves views/ (photo left, render right), points.ply, mesh.ply and field.json. In a trial's
    folder the surface is measured against the truth. A run that was stopped goes on where it was.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise nerf", "nerf", "photos")
    from wakewise_nerf.field import pick_device
    from wakewise_nerf.field import profile as profile_of

    chosen = profile
    where = pick_device(device)
    from wakewise_nerf.neural import field_of_model, field_of_trial, is_trial

    if profile == "auto":
        chosen = "gpu" if where.type == "cuda" else "cpu"
    changes: dict[str, int] = {"random_seed": seed, "threads": threads} | ({} if steps is None else {"steps": steps})
    settings = profile_of(chosen).model_copy(update=changes)
    folder = out or model / "nerf"
    ball = None if region is None else _ball(region)
    with ProgressBars().stage("nerf") as progress:
        figures = (field_of_trial if is_trial(model) else field_of_model)(
            model,
            photos or model / "images",
            folder,
            settings,
            region=ball,
            device=where.type,
            mesh=not no_mesh,
            progress=progress,
        )
    figures = {"profile": chosen} | figures
    rows = [(key, value) for key, value in figures.items() if isinstance(value, (int, float, str)) or value is None]
    title = f"{model}, profile {chosen}" + (" (a demonstration)" if chosen == "cpu" else "")
    answer(json, figures, partial(print_table, "tn", ("figure", "value"), rows, title), f"field: {folder}")


def _ball(text: str) -> tuple[list[float], float]:
    """Centre and radius from the words of --region."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 4:
        raise InputError(f"--region {text}: must be four numbers X,Y,Z,R, the centre and the radius of a ball")
    return numbers[:3], numbers[3]


COMMANDS = (CliCommand(PHOTOGRAPHS, "nerf", nerf),)
"""What this package adds to `wakewise`."""
