"""`wakewise photos`: photographs of a dive before they become a model."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, print_table, write_page
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise.core.geometry import Pose

app = typer.Typer(help="Photographs of a dive: pick them along its track.")

Photos = Annotated[Path, typer.Argument(metavar="PHOTOS", help="Folder of photographs, or a film.", show_default=False)]
Log = Annotated[
    Path,
    typer.Option("--log", metavar="DIVE", help="The dive: .tlog, .BIN, BlueOS's .mcap, or a CSV table of poses.",
                 show_default=False),
]  # fmt: skip
Every = Annotated[
    float | None,
    typer.Option("--every", metavar="M", help="Metres flown from one picked photograph to the next; 1 if neither this "
                 "nor --overlap is given.", show_default=False),
]  # fmt: skip
Overlap = Annotated[
    float | None,
    typer.Option("--overlap", metavar="PCT", help="Overlap of neighbours along the picture's shorter side, by altitude "
                 "and field of view, instead of --every.", show_default=False),
]  # fmt: skip
Offset = Annotated[
    float | None,
    typer.Option("--offset", metavar="S", help="Seconds to add to the camera's clock for the log's; where one of them "
                 "has no calendar: time of the first photograph in the log. Found from motion if not given.",
                 show_default=False),
]  # fmt: skip
Window = Annotated[
    float, typer.Option("--window", metavar="S", help="Greatest clock offset that is tried; the default is 15 h.")
]
Interval = Annotated[
    float | None,
    typer.Option("--interval", metavar="S", help="Time from one photograph to the next, where neither EXIF nor names "
                 "say it.", show_default=False),
]  # fmt: skip
VehicleName = Annotated[
    str | None,
    typer.Option("--vehicle", help="Library name or vehicle YAML file: its camera's place and direction.",
                 show_default=False),
]  # fmt: skip
CameraAt = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--camera-at", metavar="X Y Z", help="Camera's place ahead, right and below the vehicle's origin, m; "
                 "0 0 0 without a vehicle.", show_default=False),
]  # fmt: skip
Tilt = Annotated[
    float | None,
    typer.Option("--tilt", metavar="DEG", help="Camera's tilt: 0 looks ahead, 90 straight down; 90 without a vehicle.",
                 show_default=False),
]  # fmt: skip
Distance = Annotated[
    float | None,
    typer.Option("--distance", metavar="M", help="Distance to what is photographed where the log has no altitude; 1.5 "
                 "if not given.", show_default=False),
]  # fmt: skip
FieldOfView = Annotated[
    float | None,
    typer.Option("--fov", metavar="DEG", help="Field of view across the picture, in water; found from motion if not "
                 "given.", show_default=False),
]  # fmt: skip
PositionSigma = Annotated[
    float, typer.Option("--position-sigma", metavar="M", help="Standard deviation of the log's positions.")
]
Drift = Annotated[
    float, typer.Option("--drift", metavar="PCT", help="Drift of the log's positions, a share of the metres flown.")
]
Out = Annotated[
    Path | None,
    typer.Option("--out", help="Folder for the results; runs/picked-NAME if not given.", show_default=False),
]
Link = Annotated[bool, typer.Option("--link", help="Make symbolic links to the photographs, not copies.")]


@app.command("pick")
def pick(
    photos: Photos,
    log: Log,
    every: Every = None,
    overlap: Overlap = None,
    offset: Offset = None,
    window: Window = 54_000.0,
    interval: Interval = None,
    vehicle: VehicleName = None,
    camera_at: CameraAt = None,
    tilt: Tilt = None,
    distance: Distance = None,
    fov: FieldOfView = None,
    position_sigma: PositionSigma = 0.1,
    drift: Drift = 1.0,
    out: Out = None,
    link: Link = False,
    json: Json = False,
) -> None:
    """Pick one sharp photograph for each metre flown, with its pose by the dive's log.

    The offset of the camera's clock is found from motion. Leaves photos/, cameras.csv (for `wakewise reconstruct
    --reference-cameras`), picked.json and track.png. What they hold is in docs/picking.md.
    """
    from wakewise.core.optional_dependencies import has, need

    need("wakewise photos pick", "photos")
    from wakewise.core.files import whole_folder
    from wakewise.vision.photo_selection.dive_track import read_track
    from wakewise.vision.photo_selection.pick import PICTURE, PickRequest, check_folder, pick_photos, write_picked

    folder = out or Path("runs") / f"picked-{photos.stem or 'photos'}"
    check_folder(folder, photos)
    request = PickRequest(
        every_m=1.0 if every is None and overlap is None else every,
        overlap_pct=overlap,
        offset_s=offset,
        window_s=window,
        interval_s=interval,
        X_BC=_camera(vehicle, camera_at, tilt),
        distance_m=distance,
        field_of_view_deg=fov,
        position_sigma_m=position_sigma,
        drift_pct=drift,
    )
    track = read_track(log)
    with ProgressBars().stage("pick") as progress:
        found = pick_photos(photos, track, request, progress=progress)
    with ProgressBars().stage("copy") as progress, whole_folder(folder) as temporary:
        write_picked(found, temporary, link, progress)
    if has("reports"):
        from wakewise.ui.reports.photo_track import write_photo_track

        write_page("track", lambda: write_photo_track(folder / PICTURE, found))
    figures = {key: value for key, value in found.figures.items() if key != "left_out"} | {"folder": str(folder)}
    table = partial(print_table, "tn", ("photos", "count"), list(found.figures["counts"].items()), str(photos))
    answer(json, figures, table, *_lines(found.figures), f"written to {folder}")


def _camera(vehicle: str | None, at: tuple[float, float, float] | None, tilt: float | None) -> Pose:
    """X_BC: what the options say, else the vehicle's, else at its origin and straight down."""
    import numpy as np

    from wakewise.core.geometry import Pose
    from wakewise.robot.vehicles import load_vehicle
    from wakewise.vision.photo_selection.dive_track import mounted_camera

    if at is not None and not (np.isfinite(at).all() and np.abs(at).max() <= 100.0):
        raise InputError(f"--camera-at {' '.join(f'{x:g}' for x in at)}: must be numbers from -100 to 100 m")
    mount = mounted_camera(np.zeros(3), 90.0) if vehicle is None else load_vehicle(vehicle).X_BC
    if tilt is not None:
        mount = mounted_camera(mount.p_m, tilt)
    return mount if at is None else Pose.from_matrix(mount.R, np.array(at))


def _lines(figures: dict[str, Any]) -> list[str]:
    """What was found, in lines."""
    offset = figures["offset"]
    if offset["from"] == "motion":
        best = max(offset["correlation"].values())
        said = f"standard deviation {offset['sigma_s']:.2f} s, correlation {best:.2f}"
    else:
        said = "as given"
    said = f"clock offset {offset['offset_s']:+.2f} s, {said}"
    if abs(offset.get("whole_hours", 0)) >= 1:
        said += f" (whole hours {offset['whole_hours']:+d}, rest {offset['rest_s']:+.2f} s)"
    outside = figures["counts"].get("outside_the_log", 0)
    if outside:
        said += f"\nwarning: {outside} photos lie outside the log; the longest pause of their clock is "
        said += f"{figures['longest_pause_s']:.0f} s after {figures['longest_pause_after']} (was it set in the dive?)"
    lines = [said, *(f"warning: {text}" for text in figures["warnings"])]
    lines += [f"positions from {figures['positions_from']}, times from {figures['times_from']}"]
    if figures["spacing_median_m"] is not None:
        lines.append(
            f"{figures['counts']['picked']} photos along {figures['way_m']:.1f} m: {figures['spacing_median_m']:.2f} m "
            f"apart (median), {figures['spacing_max_m']:.2f} m at most"
        )
    return lines
