"""`wakewise film`: a finished trial as a film, or a comparison as rows of pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, write_page
from wakewise.ui.cli.options import Json


def film(
    trial: Annotated[
        Path | None, typer.Argument(metavar="trial", help="Folder of a finished trial (wakewise scan).")
    ] = None,
    rows: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Instead of a film: one picture of a folder that compare left, methods in rows, times in columns.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write: .mp4, .webm or .webp (rows: .png or .jpg). In the trial's folder, film.mp4 or "
            "rows.png, if not given."
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of the film; it shows the whole flight.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 12.0,
    view: Annotated[str, typer.Option(help="camera, outside or both.")] = "both",
    at: Annotated[
        str, typer.Option(metavar="S,S,...", help="Rows: times in s, counted from the first photograph.")
    ] = "0,5,10",
    json: Json = False,
) -> None:
    """Make a film of a trial: what the camera saw, and from outside the vehicle, its wash, the silt and the target.

    The wash is the tank's own water, driven once more by the thrusts on record. Frames that are done are kept until
    the film is whole, so running the same command again continues where it stopped. A film or rows that lie in their
    default place are shown by the report beside them.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise film", "photos", "reports")
    from wakewise.ui.film import VIEWS, compared_trials, write_film, write_rows
    from wakewise.ui.reports import write_comparison, write_report
    from wakewise.ui.reports.media import FILMS

    if (trial is None) == (rows is None):
        raise InputError("film: give either the folder of a trial, or --rows with the folder of a comparison")
    if rows is not None:
        path = out or rows / "rows.png"
        with ProgressBars().stage("rows") as progress:
            write_rows(rows, path, times_s=_times(at), progress=progress)
        if path.parent == rows and (rows / "comparison.html").is_file():
            write_page("report", lambda: write_comparison(compared_trials(rows), rows))
    elif trial is not None:
        if view not in VIEWS:
            raise InputError(f"--view: '{view}', allowed are {', '.join(VIEWS)}")
        path = out or trial / "film.mp4"
        with ProgressBars().stage("film") as progress:
            write_film(trial, path, seconds=seconds, fps=fps, view=view, progress=progress)
        if path.parent == trial and path.name in FILMS and (trial / "report.html").is_file():
            write_page("report", lambda: write_report(trial))
    answer(json, {"file": str(path), "size_MB": path.stat().st_size / 1e6}, f"{'rows' if rows else 'film'}: {path}")


def _times(text: str) -> tuple[float, ...]:
    try:
        times = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InputError(f"--at: '{text}', must be times in s such as 0,5,10") from None
    if not times or any(not 0.0 <= time_s < 1e6 for time_s in times):
        raise InputError(f"--at: '{text}', must be one or more times in s, none negative")
    return times
