"""`wakewise link orbit`: circles round a target on stock ArduSub by GUIDED targets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from wakewise.ui.cli.options import Json
from wakewise_ardusub.cli import link_survey

if TYPE_CHECKING:
    from wakewise_ardusub.survey.orbit_plan import Direction

DEFAULT_RADIUS_M = 1.5


def orbit(
    connection: link_survey.Connection = link_survey.DEFAULT_CONNECTION,
    ahead: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="The target is this far ahead of the bow: centre and radius; 1.5 without --centre."
        ),
    ] = None,
    centre: Annotated[
        str | None,
        typer.Option(metavar="NORTH,EAST", help="Centre in the autopilot's local frame, m, as an earlier orbit told."),
    ] = None,
    radius: Annotated[float | None, typer.Option(metavar="M", help="Radius round --centre; 1.5 if not given.")] = None,
    turns: Annotated[float, typer.Option(metavar="N", help="Turns of each layer, 0.1 to 20.")] = 1.0,
    altitude: Annotated[
        str, typer.Option(metavar="M[,M...]", help="Of the rangefinder above the bed; several for layers in order.")
    ] = "0.8",
    direction: Annotated[
        str,
        typer.Option(
            help="To where the first layer sets out, as the pilot sees it: right, left, or auto (with the current). "
            "The layers after it alternate, which unwinds the tether."
        ),
    ] = "auto",
    speed: link_survey.Speed = 0.1,
    every: link_survey.Every = 0.0,
    camera: link_survey.Camera = "mavlink",
    current: link_survey.Current = "felt",
    range_delay: link_survey.RangeDelay = 0.3,
    gap: link_survey.Gap = 0.8,
    fence: link_survey.Fence = 20.0,
    vehicle: link_survey.VehicleName = link_survey.DEFAULT_VEHICLE,
    system: link_survey.System = 1,
    consent: link_survey.Consent = False,
    wait: link_survey.Wait = 120.0,
    out: link_survey.Out = None,
    json: Json = False,
) -> None:
    """Fly circles round a target on stock ArduSub, bow towards it, at an altitude above the bed: GUIDED targets.

    The pilot turns the bow to the target, arms and keeps the sticks. Enter (or setting GUIDED) consents; Enter pauses
    and goes on, q and Enter or Ctrl-C ends. Any stick, mode change or loss ends it in POSHOLD; if this program dies,
    ArduSub stops after 3 s.
    """
    from wakewise.core.errors import InputError
    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.survey.orbit_plan import OrbitRequest
    from wakewise_ardusub.survey.survey_plan import SurveyPace

    if direction not in ("auto", "right", "left"):
        raise InputError(f"--direction {direction!r}: must be auto, right or left")
    if centre is not None and ahead is not None:
        raise InputError("--ahead, --centre: give one of them")
    if centre is None and radius is not None:
        raise InputError("--radius: needs --centre; --ahead is the radius otherwise")
    wanted = ahead if centre is None else radius
    layers = _numbers("--altitude", altitude, "metres above the bed, such as 0.8 or 0.8,1.3")
    place = None if centre is None else _numbers("--centre", centre, "NORTH,EAST in m, such as 3.5,-2", 2)
    pace = SurveyPace(speed_m_s=speed, altitude_m=layers[0])
    asked = OrbitRequest(
        radius_m=DEFAULT_RADIUS_M if wanted is None else wanted,
        turns=turns,
        altitudes_m=layers,
        direction=cast("Direction", direction),
        centre_W_m=None if place is None else (place[0], place[1]),
    )
    hull_m = float(any_vehicle(vehicle).size_m[0])
    asked.check(pace, hull_m)

    def legs(here: Any, heading_rad: float, water: Any, _anchor: Any) -> list[Any]:
        return list(asked.legs(here, heading_rad, water))

    given = link_survey.SurveyCommand(
        name="orbit", connection=connection, every=every, camera=camera, current=current, range_delay=range_delay,
        gap=gap, fence=fence, vehicle=vehicle, system=system, consent=consent, wait=wait, out=out, json=json,
    )  # fmt: skip
    link_survey.fly_survey(given, pace, legs, layers_m=layers, off_m=min(0.6, 0.5 * (asked.radius_m - 0.5 * hull_m)))


def _numbers(option: str, text: str, right: str, count: int | None = None) -> tuple[float, ...]:
    import math

    from wakewise.core.errors import InputError

    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if not numbers or not all(map(math.isfinite, numbers)) or count not in (None, len(numbers)):
        raise InputError(f"{option} {text!r}: must be {right}")
    return numbers
