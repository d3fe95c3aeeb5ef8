"""`wakewise export`: a trial, a folder of trials, or a vehicle's allocation matrix, as files that other tools open.

`wakewise export --to dataset`: a folder of trials as a data set, and whether one is still what it was.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.core.checks import counted
from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, print_json
from wakewise.ui.cli.options import Json, check_file, seed_option

LISTED = 5
"""Trials that were left out are listed up to so many; DATASHEET.md lists all."""


def _dataset(folder: Path, out: Path | None, options: dict[str, Any], json: bool) -> None:
    from wakewise.experiments.trials.dataset import build_dataset, read_words
    from wakewise.experiments.trials.dataset.statement import QUESTIONS

    path = out or folder / "export" / "dataset"
    words = read_words(
        name=folder.resolve().name if options["name"] is None else options["name"],
        licence=options["license"],
        creators=tuple(options["creator"] or ()),
        url=options["url"],
        published=options["date"],
        version=options["version"] or "1.0.0",
        answers=options["answers"],
    )
    with ProgressBars().stage("trials") as progress:
        built = build_dataset(folder, path, words, progress)
    facts: dict[str, Any] = {"to": "dataset", **asdict(built), "path": str(built.path)}
    kept = f", {built.trials - built.made} of them from before" if built.made < built.trials else ""
    lines = [
        f"{built.path}: {counted(built.trials, 'trial')}{kept}, {counted(built.photographs, 'photograph')}, "
        f"{built.files} files, {built.bytes / 1e6:.1f} MB",
        *(f"left out        {name}: {why}" for name, why in list(built.left_out.items())[:LISTED]),
    ]
    if len(built.left_out) > LISTED:
        lines.append(f"                and {len(built.left_out) - LISTED} more, see DATASHEET.md")
    if open_questions := [question for question in QUESTIONS if question not in words.answers]:
        lines.append(
            f"open            {', '.join(open_questions)}: answers are missing in DATASHEET.md (--answers FILE)"
        )
    answer(json, facts, *lines)


def _check(folder: Path, json: bool) -> None:
    from wakewise.experiments.trials.dataset import check_dataset

    with ProgressBars().stage("check sums") as progress:
        checked = check_dataset(folder, progress)
    amiss = checked.differences
    facts = {"path": str(folder), "files": checked.files, "bytes": checked.bytes}
    if json:
        print_json(facts | {"differences": {one.path: one.what for one in amiss}})
    if amiss:
        more = f", and {len(amiss) - 1} more" if len(amiss) > 1 else ""
        raise InputError(f"{folder}: is not as it was made: {amiss[0].path} {amiss[0].what}{more}")
    if not json:
        typer.echo(f"{folder}: {checked.files} files, {checked.bytes / 1e6:.1f} MB, all as they were made")


def export(
    trial: Annotated[
        Path | None,
        typer.Argument(metavar="trial", help="Folder of a trial that was flown; dataset: of a campaign, too."),
    ] = None,
    to: Annotated[str, typer.Option(help="nerfstudio, colmap, tum, rosbag2, qgc-plan; dataset; auv_controllers.")] = "",
    vehicle: Annotated[str | None, typer.Option(help="auv_controllers: library name or vehicle YAML file.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="New folder to write (qgc-plan, auv_controllers: file). In the trial's folder, export/, or "
            "NAME-auv_controllers.yaml, if not given."
        ),
    ] = None,
    poses: Annotated[
        str,
        typer.Option(
            help="nerfstudio, colmap: true poses and camera, or estimated ones as the crew has them. The others hold "
            "both poses; a bag's camera_info is the crew's calibration, as at sea, beside nerfstudio's true one."
        ),
    ] = "true",
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="qgc-plan: the world's origin in degrees.")
    ] = None,
    frame: Annotated[
        str, typer.Option(help="auv_controllers: fsd, for its own controllers, or flu, for wrenches as ROS has them.")
    ] = "fsd",
    held_out: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="nerfstudio, colmap: hold one photograph in N out from training, spread over the path; 0 for none; 8.",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(callback=seed_option, help="nerfstudio, colmap: draws held-out photographs; 0.")
    ] = None,
    licence: Annotated[
        str | None, typer.Option("--license", help="dataset: SPDX name, such as CC-BY-4.0, or the address of another.")
    ] = None,
    creator: Annotated[list[str] | None, typer.Option(help="dataset: who made it; may be repeated.")] = None,
    name: Annotated[str | None, typer.Option(help="dataset: its name; the folder's.")] = None,
    url: Annotated[str | None, typer.Option(help="dataset: where it will be found.")] = None,
    date: Annotated[str | None, typer.Option(metavar="YYYY-MM-DD", help="dataset: of publication; today.")] = None,
    version: Annotated[str | None, typer.Option(metavar="X.Y.Z", help="dataset: its version; 1.0.0.")] = None,
    answers: Annotated[
        Path | None,
        typer.Option(
            metavar="YAML",
            help="dataset: answers that its data sheet asks for: purpose, funding, period, ethics, maintenance.",
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="dataset: hold a data set against its check sums instead.")
    ] = False,
    json: Json = False,
) -> None:
    """Export a trial to other tools: trainers of splats and NeRFs, COLMAP, evo, ROS 2, QGroundControl.

    Frames become those of the tool: OpenGL cameras and z up for nerfstudio, ENU and FLU in bags; COLMAP and TUM keep
    north-east-down. A bag's times count from the begin of the flight or the log, so they begin near 0. COLMAP's points
    have the observations of the trial's own model, and errors with the poses that are written. A plan has a waypoint
    per photograph at its depth; satellites place none of them to a decimetre.
    For trainers of fields and splats, nerfstudio and colmap also hold undistorted photographs, dense points, a held-out
    split, and the attenuation of the water per colour channel, all listed in export.json.
    With --vehicle, write its allocation matrix as ROS 2's auv_controllers take it.

    A data set takes all trials of a folder, what a controller could know apart from the truth, with Croissant metadata,
    check sums and a data sheet; it goes on where it was cut off.
    """
    options: dict[str, Any] = {
        "license": licence,
        "creator": creator,
        "name": name,
        "url": url,
        "date": date,
        "version": version,
        "answers": answers,
    }
    given = [option for option, value in options.items() if value]
    if to == "dataset":
        if trial is None or vehicle is not None:
            raise InputError("export --to dataset: give the folder of a campaign, of trials or of one, and no vehicle")
        if held_out is not None or seed is not None:
            raise InputError("--held-out, --seed: go with --to nerfstudio and colmap only, not with dataset")
        if origin is not None or poses != "true" or frame != "fsd":
            raise InputError("export --to dataset: no --origin, --poses or --frame; it keeps all poses as they are")
        if check and (out is not None or given):
            raise InputError("--check: takes the folder of a data set and no other option")
        if check:
            _check(trial, json)
        else:
            _dataset(trial, out, options, json)
        return
    if given or check:
        raise InputError(f"--{[*given, 'check'][0]}: goes with --to dataset only, not with {to or 'FORMAT'}")
    water = None
    if to == "auv_controllers":
        if vehicle is None or trial is not None:
            raise InputError("export --to auv_controllers: give --vehicle NAME and no trial")
        if origin is not None:
            raise InputError("--origin: goes with --to qgc-plan only, not with auv_controllers")
        if held_out is not None or seed is not None:
            raise InputError("--held-out, --seed: go with --to nerfstudio and colmap only, not with auv_controllers")
        path, holds = _allocation(vehicle, out, frame)
    else:
        if trial is None or vehicle is not None:
            raise InputError(
                f"export --to {to or 'FORMAT'}: give the folder of a trial; --vehicle is for auv_controllers"
            )
        from wakewise.experiments.exports import GeodeticOrigin
        from wakewise.experiments.trials.export import export_trial

        place = None if origin is None else GeodeticOrigin(*_two(origin))
        done = export_trial(trial, to, out=out, poses=poses, origin=place, held_out=held_out, seed=seed)
        path, holds, water = done.path, done.holds, done.water
    contents = ", ".join(f"{count} {what.replace('_', ' ')}" for what, count in holds.items())
    lines = [f"{path}: {contents}"]
    if water is not None and water.attenuation_per_m is not None:
        red, green, blue = water.attenuation_per_m
        lines.append(f"water ({water.source}): attenuation {red:.3g}, {green:.3g}, {blue:.3g} /m in red, green, blue")
    elif water is not None:
        lines.append(f"water: attenuation is not known ({water.why})")
    answer(json, {"to": to, "path": str(path), **holds} | ({} if water is None else {"water": water.figures()}), *lines)


def _allocation(vehicle: str, out: Path | None, frame: str) -> tuple[Path, dict[str, int]]:
    from wakewise.core.files import write_text
    from wakewise.experiments.exports import tam_yaml
    from wakewise.robot.vehicles import load_draft

    draft = load_draft(vehicle)
    path = out or Path(f"{Path(draft.name).name}-auv_controllers.yaml")
    check_file(path)
    text = tam_yaml(draft.name, draft.thruster_names, draft.allocation_matrix, draft.thrust_limits_N, frame)
    write_text(path, text)
    return path, {"thrusters": len(draft.thruster_names)}


def _two(text: str) -> tuple[float, float]:
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--origin: '{text}', must be LAT,LON in degrees, such as 36.52,-6.28") from None
    return lat, lon
