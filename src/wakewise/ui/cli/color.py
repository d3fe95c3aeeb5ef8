"""`wakewise colour`: photographs with the water's colour taken away, for people to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.ui.cli.console import ProgressBars, answer
from wakewise.ui.cli.options import Json


def colour(
    photos: Annotated[Path, typer.Argument(help="Folder of photographs, or of a finished trial.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the corrected photographs; PHOTOS-colour if not given.")
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="Folder that wakewise reconstruct or scan made from the same photographs: with its depths the water "
            "is undone by physics. A trial brings its own."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Correct the colours of underwater photographs for people; matching and measuring use the photographs as taken.

    With a model, the water's veil and attenuation are fitted to colour and depth and undone. Without one, or for a
    photograph that is not part of it, the colour cast is taken away and the contrast stretched.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise colour", "photos")
    from wakewise.vision.texturing.photo_colours import correct_photos

    folder = photos / "images" if (photos / "images").is_dir() else photos
    model = model or (photos if folder != photos else None)
    into = out or photos.with_name(f"{photos.resolve().name}-colour")
    with ProgressBars().stage("colour") as progress:
        done = correct_photos(folder, into, model=model, progress=progress)
    answer(json, done.summary() | {"folder": str(into)}, *done.words(), f"photographs: {into}")
