"""Commands of MAVLink's camera protocol by which an operator designates a target in the picture, and their answers.

CAMERA_TRACK_RECTANGLE, CAMERA_TRACK_POINT and CAMERA_STOP_TRACKING for the companion (component 191, or 0 for all), as
COMMAND_LONG. Boxes are (left, top, right, bottom) in shares of the picture's width and height, from its left top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.controls import LEAST_SIDE, Box
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.protocol import COMPANION_COMPONENT

CAMERA_TRACK_POINT: Final = 2004
CAMERA_TRACK_RECTANGLE: Final = 2005
CAMERA_STOP_TRACKING: Final = 2010
ACCEPTED, TEMPORARILY_REJECTED, DENIED, FAILED = 0, 1, 2, 4
"""MAV_RESULT."""
POINT_RADIUS = 0.06
"""Half the width of the box about a point whose radius is not given, in shares of the picture's width."""
_ALL_COMPONENTS = 0
_STATUS_BYTES, _WARNING = 50, 4
_ACTIVE, _RECTANGLE, _IN_STATUS = 1, 2, 4
"""CAMERA_TRACKING_STATUS_FLAGS, CAMERA_TRACKING_MODE and CAMERA_TRACKING_TARGET_DATA."""


@dataclass(frozen=True, kw_only=True)
class TrackingCommand:
    """A command to track, or to stop that: who sent it, its number and parameters, and how often it was sent before."""

    system: int
    component: int
    command: int
    numbers: tuple[float, float, float, float]
    confirmation: int = 0

    def box(self, aspect: float) -> Box | None:
        """The designated box in a picture of this width over height; None of the command to stop.

        Raises
        ------
        InputError
            If it is no box within the picture.
        """
        if self.command == CAMERA_STOP_TRACKING:
            return None
        if self.command == CAMERA_TRACK_RECTANGLE:
            return checked_box(self.numbers)
        u, v, radius, _ = self.numbers
        if not (0.0 <= u <= 1.0 and 0.0 <= v <= 1.0):
            raise InputError(f"point {u:g}, {v:g}: outside the picture, 0 to 1")
        half = radius if 0.5 * LEAST_SIDE < radius <= 1.0 else POINT_RADIUS
        edges = (u - half, v - half * aspect, u + half, v + half * aspect)
        left, top, right, bottom = (min(max(edge, 0.0), 1.0) for edge in edges)
        return left, top, right, bottom


def tracking_command(said: MavlinkMessage, system: int) -> TrackingCommand | None:
    """The command in a message to the companion of this system; None of any other message."""
    if said.name != "COMMAND_LONG":
        return None
    try:
        meant = int(said.fields["target_system"]) == system
        meant &= int(said.fields["target_component"]) in (_ALL_COMPONENTS, COMPANION_COMPONENT)
        command, confirmation = int(said.fields["command"]), int(said.fields["confirmation"])
        a, b, c, d = (float(said.fields[f"param{i}"]) for i in range(1, 5))
    except (KeyError, TypeError, ValueError):
        return None
    if not meant or command not in (CAMERA_TRACK_POINT, CAMERA_TRACK_RECTANGLE, CAMERA_STOP_TRACKING):
        return None
    return TrackingCommand(
        system=said.system,
        component=said.component,
        command=command,
        numbers=(a, b, c, d),
        confirmation=confirmation,
    )


def checked_box(edges: tuple[float, ...]) -> Box:
    """A box of four finite edges within the picture, not smaller than `LEAST_SIDE`; raises InputError if it is none."""
    words = f"box {','.join(f'{edge:g}' for edge in edges)}"
    if len(edges) != 4 or not all(map(math.isfinite, edges)):
        raise InputError(f"{words}: must be four finite numbers, left, top, right, bottom")
    left, top, right, bottom = edges
    if min(edges) < 0.0 or max(edges) > 1.0:
        raise InputError(f"{words}: outside the picture, 0 to 1")
    if right - left < LEAST_SIDE or bottom - top < LEAST_SIDE:
        raise InputError(f"{words}: too small, right and bottom must be {LEAST_SIDE:g} above left and top")
    return left, top, right, bottom


def command_ack(command: TrackingCommand, result: int) -> Mapping[str, Any]:
    """Fields of COMMAND_ACK to its sender."""
    return {
        "command": command.command,
        "result": result,
        "progress": 0,
        "result_param2": 0,
        "target_system": command.system,
        "target_component": command.component,
    }


def status_text(words: str) -> Mapping[str, Any]:
    """Fields of a STATUSTEXT of one line, cut short where it is long."""
    return {"severity": _WARNING, "text": words.encode("ascii", "replace")[:_STATUS_BYTES]}


def tracking_status(box: Box) -> Mapping[str, Any]:
    """Fields of CAMERA_TRACKING_IMAGE_STATUS: where the target is in the picture now, edges NaN where it is not."""
    left, top, right, bottom = box
    return {
        "tracking_status": _ACTIVE,
        "tracking_mode": _RECTANGLE,
        "target_data": _IN_STATUS,
        "point_x": math.nan,
        "point_y": math.nan,
        "radius": math.nan,
        "rec_top_x": left,
        "rec_top_y": top,
        "rec_bottom_x": right,
        "rec_bottom_y": bottom,
    }
