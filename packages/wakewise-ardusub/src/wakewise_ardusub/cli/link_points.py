"""Options that say what is to be spared before a real vehicle: a ball ahead of the bow, or points of a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle
    from wakewise.scene.targets import Region

Ahead = Annotated[
    float,
    typer.Option(
        "--ahead",
        metavar="M",
        help="From the bow to the middle of a ball of 0.5 m across, which stands for the target.",
    ),
]
Points = Annotated[
    Path | None,
    typer.Option(
        "--points",
        help="CSV with x_m, y_m, z_m from the middle of the vehicle (forward, right, down) and weight: what to spare "
        "instead.",
        show_default=False,
    ),
]
WakeModelName = Annotated[
    str, typer.Option("--wake-model", help="paper, paper-calibrated, fitted, linear, jet or jet-fitted.")
]


def region_ahead(vehicle: Vehicle, ahead: float, points: Path | None) -> Region:
    """What is to be spared, in the vehicle's frame.

    Raises
    ------
    InputError
        If the ball is out of range, or the file holds no points outside the vehicle.
    """
    import numpy as np

    from wakewise.core.geometry import Pose
    from wakewise.scene.targets import Region
    from wakewise.ui.cli.points import read_points
    from wakewise_ardusub.logs.replay_allocation import bow_points

    if points is None:
        return bow_points(vehicle, ahead)
    places, weights = read_points(points, vehicle, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    return Region(points_W_m=places, weights=weights, distance_m=np.zeros(len(places)))


def region_words(ahead: float, points: Path | None) -> str:
    """The same in words."""
    return f"of {points}" if points is not None else f"of a ball {ahead:g} m ahead of the bow"
