"""Commands as entries of the `wakewise` program; installed packages add their own through entry points.

A package offers a tuple of `CliCommand` under the entry point group `wakewise.commands`.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any, NamedTuple

GROUP = "wakewise.commands"

FLIGHT = "Fly in the simulated tank"
PHOTOGRAPHS = "Photographs and models"
VEHICLES = "Vehicles and thrusts"
REAL_VEHICLE = "A real vehicle"
STUDIES = "Studies and benchmarks"
PANELS = (FLIGHT, PHOTOGRAPHS, VEHICLES, REAL_VEHICLE, STUDIES)
"""Sections of `wakewise --help`, in their order."""


class CliCommand(NamedTuple):
    """One command.

    `parent` is one of `PANELS` for a command of `wakewise`, or the name of a command group, such as "wake". `run` is a
    function with typer annotations, or a `typer.Typer` group.
    """

    parent: str
    name: str
    run: Any


def installed_commands() -> tuple[CliCommand, ...]:
    """Commands of the installed packages, packages in alphabetical order."""
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return tuple(command for point in points for command in point.load())
