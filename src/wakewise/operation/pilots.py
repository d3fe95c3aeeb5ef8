"""Pilots by name: where the goals of a flight come from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from wakewise.interfaces import Pilot
from wakewise.missions import RoutePilot
from wakewise.plugins import find

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts


def route_pilot(parts: Parts) -> RoutePilot:
    """`route`: follows the mission's route by the clock."""
    return RoutePilot(route=parts.route, aim=parts.aim, exposure_s=parts.scenario.imaging.window_s)


PILOTS: dict[str, Callable[[Parts], Pilot]] = {"route": route_pilot}
"""Our own pilots: what makes each from the parts of a flight."""


def make_pilot(parts: Parts) -> Pilot:
    """The pilot that the scenario names, ours or one from outside.

    Raises
    ------
    InputError
        If there is no such pilot.
    """
    return find("pilot", parts.scenario.pilot, PILOTS).maker(parts)
