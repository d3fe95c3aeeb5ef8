"""`wakewise link transect`: a slow survey on stock ArduSub by GUIDED targets."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.options import Json
from wakewise_ardusub.cli import link_survey

if TYPE_CHECKING:
    from wakewise_ardusub.survey.survey_plan import MakeLines


def transect(
    connection: link_survey.Connection = link_survey.DEFAULT_CONNECTION,
    length: Annotated[
        float | None,
        typer.Option(metavar="M", help="One line of this length from here; 20 if neither --area nor --map is given."),
    ] = None,
    area: Annotated[
        str | None, typer.Option(metavar="WIDTHxLENGTH", help="A lawnmower from here, m: lines of LENGTH side by side.")
    ] = None,
    spacing: Annotated[
        float | None, typer.Option(metavar="M", help="Between two lines of --area; 0.5 if not given.")
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", help="GeoJSON or KML file with one LineString in WGS 84 (longitude, latitude)."),
    ] = None,
    heading: Annotated[
        str,
        typer.Option(
            metavar="DEG", help="Of the line or of --area: degrees from north; here (as it is) or current (against it)."
        ),
    ] = "here",
    speed: link_survey.Speed = 0.1,
    altitude: Annotated[float, typer.Option(metavar="M", help="Of the rangefinder above the bed.")] = 0.8,
    every: link_survey.Every = 0.0,
    camera: link_survey.Camera = "mavlink",
    current: link_survey.Current = "felt",
    range_delay: link_survey.RangeDelay = 0.3,
    gap: link_survey.Gap = 0.8,
    fence: link_survey.Fence = 200.0,
    allocate: Annotated[
        bool,
        typer.Option(
            "--allocate",
            help="In ALT_HOLD by thrusts through the script on the autopilot (`wakewise link install-script`), which "
            "are chosen to spare the bed below and ahead; without it by GUIDED targets.",
        ),
    ] = False,
    vehicle: link_survey.VehicleName = link_survey.DEFAULT_VEHICLE,
    system: link_survey.System = 1,
    consent: link_survey.Consent = False,
    wait: link_survey.Wait = 120.0,
    out: link_survey.Out = None,
    json: Json = False,
) -> None:
    """Fly slow lines at an altitude above the bed on stock ArduSub: GUIDED targets, no script; or --allocate.

    The pilot arms and keeps the sticks. Enter (or setting GUIDED) consents; Enter pauses and goes on, q and Enter or
    Ctrl-C ends. Any stick, mode change or loss ends it in POSHOLD; if this program dies, ArduSub stops after 3 s, with
    --allocate after 0.3 s in ALT_HOLD.
    """
    from wakewise_ardusub.survey.survey_plan import SurveyPace

    pace = SurveyPace(speed_m_s=speed, altitude_m=altitude)
    lines = _lines(length, area, spacing, map_file, heading, fence)
    given = link_survey.SurveyCommand(
        name="transect", connection=connection, every=every, camera=camera, current=current, range_delay=range_delay,
        gap=gap, fence=fence, vehicle=vehicle, system=system, consent=consent, wait=wait, out=out, json=json,
        allocate=allocate,
    )  # fmt: skip
    link_survey.fly_survey(given, pace, lines)


def _lines(
    length: float | None, area: str | None, spacing: float | None, map_file: Path | None, heading: str, fence_m: float
) -> MakeLines:
    """What makes the lines once the vehicle's place, heading and the current are known."""
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise_ardusub.survey.survey_plan import SHORTEST_M, WEAK_M_S, ordered, parallel_lines, upstream_side

    if sum((length is not None, area is not None, map_file is not None)) > 1:
        raise InputError("--length, --area, --map: give one of them")
    if spacing is not None and area is None:
        raise InputError("--spacing: is of the lines of --area, which is not given")
    if map_file is not None:
        if heading != "here":
            raise InputError("--heading: the map has it")
        return _map_lines(map_file)
    width_m, length_m = (SHORTEST_M, 20.0 if length is None else length) if area is None else _area(area)
    apart_m = 2.0 * SHORTEST_M if area is None else 0.5 if spacing is None else spacing
    given = None if heading in ("here", "current") else _degrees(heading)
    # Refuses sizes before anything is connected.
    corners = np.concatenate(parallel_lines(np.zeros(2), 0.0, width_m, length_m, apart_m, 1))
    away_m = float(np.hypot(*corners.T).max())
    if away_m > fence_m:
        raise InputError(f"--fence {fence_m:g}: the lines reach {away_m:.0f} m from the start")

    def make(place: Any, here_rad: float, current: Any, _anchor: Any) -> list[Any]:
        along = here_rad if given is None else given
        if heading == "current" and math.hypot(*current) >= WEAK_M_S:
            along = math.atan2(-current[1], -current[0])
        side = upstream_side(along, current)
        lines = parallel_lines(place, along, width_m, length_m, apart_m, side)
        return lines if area is None else ordered(lines, current) if heading == "here" else lines

    return make


def _map_lines(path: Path) -> MakeLines:
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise_ardusub.survey.map_files import local_m, read_map
    from wakewise_ardusub.survey.survey_plan import ordered

    corners = read_map(path)

    def make(_place: Any, _heading: float, current: Any, anchor: Any) -> list[Any]:
        if anchor is None:
            raise InputError(f"{path}: the autopilot does not tell where it is on the globe (GLOBAL_POSITION_INT)")
        places = np.array([anchor.north_m, anchor.east_m]) + local_m(corners, anchor.latitude_deg, anchor.longitude_deg)
        return ordered([places[k : k + 2] for k in range(len(places) - 1)], current)

    return make


def _area(text: str) -> tuple[float, float]:
    from wakewise.core.errors import InputError

    try:
        width, length = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--area {text!r}: must be WIDTHxLENGTH in m, such as 4x20") from None
    return width, length


def _degrees(text: str) -> float:
    from wakewise.core.errors import InputError

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not -360.0 <= value <= 360.0:
        raise InputError(f"--heading {text!r}: must be degrees from north (-360 to 360), here or current")
    return math.radians(value)
