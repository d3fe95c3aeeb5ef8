"""`wakewise export`: a trial, a folder of trials, or a vehicle's allocation matrix, as files that other tools open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import print_json
from wakewise.ui.cli.export_dataset import DatasetOptions, export_dataset
from wakewise.ui.cli.options import Json

Trial = Annotated[
    Path | None,
    typer.Argument(
        metavar="trial", help="Folder of a trial that was flown; dataset: of a campaign, too.", show_default=False
    ),
]
To = Annotated[str, typer.Option("--to", help="nerfstudio, colmap, tum, rosbag2, qgc-plan; dataset; auv_controllers.")]
VehicleName = Annotated[
    str | None,
    typer.Option("--vehicle", help="auv_controllers: library name or vehicle YAML file.", show_default=False),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        help="New folder to write (qgc-plan, auv_controllers: file). In the trial's folder, export/, or "
        "NAME-auv_controllers.yaml, if not given.",
        show_default=False,
    ),
]
Poses = Annotated[
    str,
    typer.Option(
        "--poses",
        help="nerfstudio, colmap: true poses and camera, or estimated ones as the crew has them. The others hold both "
        "poses; a bag's camera_info is the crew's calibration, as at sea, beside nerfstudio's true one.",
    ),
]
Frame = Annotated[
    str,
    typer.Option(
        "--frame", help="auv_controllers: fsd, for its own controllers, or flu, for wrenches as ROS has them."
    ),
]
At = Annotated[
    str | None,
    typer.Option("--origin", metavar="LAT,LON", help="qgc-plan: the world's origin in degrees.", show_default=False),
]
Licence = Annotated[
    str | None,
    typer.Option(
        "--license", help="dataset: SPDX name, such as CC-BY-4.0, or the address of another.", show_default=False
    ),
]
Creator = Annotated[
    list[str] | None,
    typer.Option("--creator", help="dataset: who made it; may be repeated.", show_default=False),
]
Name = Annotated[str | None, typer.Option("--name", help="dataset: its name; the folder's.", show_default=False)]
Url = Annotated[str | None, typer.Option("--url", help="dataset: where it will be found.", show_default=False)]
Date = Annotated[
    str | None, typer.Option("--date", metavar="YYYY-MM-DD", help="dataset: of publication; today.", show_default=False)
]
Version = Annotated[
    str | None, typer.Option("--version", metavar="X.Y.Z", help="dataset: its version; 1.0.0.", show_default=False)
]
Answers = Annotated[
    Path | None,
    typer.Option(
        "--answers",
        metavar="YAML",
        help="dataset: answers that its data sheet asks for: purpose, funding, period, ethics, maintenance.",
        show_default=False,
    ),
]
Check = Annotated[bool, typer.Option("--check", help="dataset: hold a data set against its check sums instead.")]


def export(
    trial: Trial = None,
    to: To = "",
    vehicle: VehicleName = None,
    out: Out = None,
    poses: Poses = "true",
    origin: At = None,
    frame: Frame = "fsd",
    licence: Licence = None,
    creator: Creator = None,
    name: Name = None,
    url: Url = None,
    date: Date = None,
    version: Version = None,
    answers: Answers = None,
    check: Check = False,
    json: Json = False,
) -> None:
    """Export a trial to other tools: trainers of splats and NeRFs, COLMAP, evo, ROS 2, QGroundControl.

    Frames become those of the tool: OpenGL cameras and z up for nerfstudio, ENU and FLU in bags; COLMAP and TUM keep
    north-east-down. A bag's times count from the begin of the flight or the log, so they begin near 0. COLMAP's points
    have the observations of the trial's own model, and errors with the poses that are written. A plan has a waypoint
    per photograph at its depth; satellites place none of them to a decimetre.
    With --vehicle, write its allocation matrix as ROS 2's auv_controllers take it.

    A data set takes all trials of a folder, what a controller could know apart from the truth, with Croissant metadata,
    check sums and a data sheet; it goes on where it was cut off.
    """
    words = DatasetOptions(
        licence=licence,
        creators=tuple(creator or ()),
        name=name,
        url=url,
        published=date,
        version=version,
        answers=answers,
        check=check,
    )
    if to == "dataset":
        if trial is None or vehicle is not None:
            raise InputError("export --to dataset: give the folder of a campaign, of trials or of one, and no vehicle")
        if origin is not None or poses != "true" or frame != "fsd":
            raise InputError("export --to dataset: no --origin, --poses or --frame; it keeps all poses as they are")
        export_dataset(trial, out, words, json)
        return
    words.refuse_beside(to or "FORMAT")
    if to == "auv_controllers":
        if vehicle is None or trial is not None:
            raise InputError("export --to auv_controllers: give --vehicle NAME and no trial")
        if origin is not None:
            raise InputError("--origin: goes with --to qgc-plan only, not with auv_controllers")
        path, holds = _allocation(vehicle, out, frame)
    else:
        if trial is None or vehicle is not None:
            raise InputError(
                f"export --to {to or 'FORMAT'}: give the folder of a trial; --vehicle is for auv_controllers"
            )
        from wakewise.experiments.exports import GeodeticOrigin
        from wakewise.experiments.trials.export import export_trial

        place = None if origin is None else GeodeticOrigin(*_two(origin))
        done = export_trial(trial, to, out=out, poses=poses, origin=place)
        path, holds = done.path, done.holds
    if json:
        print_json({"to": to, "path": str(path), **holds})
        return
    told = ", ".join(f"{count} {what.replace('_', ' ')}" for what, count in holds.items())
    typer.echo(f"{path}: {told}")


def _allocation(vehicle: str, out: Path | None, frame: str) -> tuple[Path, dict[str, int]]:
    from wakewise.core.files import write_text
    from wakewise.experiments.exports import tam_yaml
    from wakewise.robot.vehicles import load_draft

    draft = load_draft(vehicle)
    path = out or Path(f"{Path(draft.name).name}-auv_controllers.yaml")
    if path.is_dir():
        raise InputError(f"--out {path}: is a folder, must be a file")
    text = tam_yaml(draft.name, draft.thruster_names, draft.allocation_matrix, draft.thrust_limits_N, frame)
    write_text(path, text)
    return path, {"thrusters": len(draft.thruster_names)}


def _two(text: str) -> tuple[float, float]:
    try:
        lat, lon = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--origin: '{text}', must be LAT,LON in degrees, such as 36.52,-6.28") from None
    return lat, lon
