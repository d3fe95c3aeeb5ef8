"""Plots of flights and allocations on matplotlib: wake field, thrusts, null space, disturbance, wash against energy.

Every function draws into the axes `ax`, or into new ones, and returns them, so that labels and limits can be changed
and plots be put side by side. `film` makes a film of a trial.

Examples
--------
>>> import numpy as np, wakewise as ww
>>> rov = ww.load_vehicle("bluerov2-heavy")
>>> ax = ww.plot.wake_field(rov, np.full(8, 2.0), [0, 0, 1, 0, 0, 0], cells=20)
>>> ax.get_xlabel(), ax.get_ylabel()
('east (m)', 'north (m)')
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from wakewise.api import PoseLike, pose_of, velocity
from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import finite_number, instance_of, path_of, quoted, whole_number
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.operation.flying import Flight
from wakewise.robot.vehicles import Vehicle, null_space_names
from wakewise.scene.targets import Region
from wakewise.ui.film import write_film
from wakewise.ui.reports.svg_style import thinned

__all__ = ["disturbance", "film", "null_space", "thrusts", "wake_field", "wash_energy"]

Plane = Literal["horizontal", "vertical"]
Measure = Literal["disturbance", "speed"]
Flights = Flight | Mapping[str, Flight] | Sequence[Flight]
"""One flight, flights by name, or several, which are then named by their methods."""
_MEASURES: dict[str, tuple[str, float, str]] = {
    "disturbance": ("disturbance", 1.0, "disturbance D by the wake model (m²/s²)"),
    "speed": ("target_speed_mean_m_s", 1e3, "water speed at the target (mm/s)"),
}


def wake_field(
    vehicle: Vehicle,
    thrusts_N: ArrayLike,
    pose: PoseLike,
    *,
    region: Region | ArrayLike | None = None,
    wake: WakeModel | str = "jet",
    plane: Plane = "horizontal",
    half_width_m: float = 1.2,
    cells: int = 100,
    max_m_s: float = 0.3,
    ax: Axes | None = None,
) -> Axes:
    """Water speed that thrusts make by a wake model, in a plane through the vehicle.

    The plane is horizontal at the depth of the body, or vertical and north through it. The vehicle is drawn as the
    outline of the box around it; the points of `region` are drawn as they lie behind or before the plane.

    Parameters
    ----------
    half_width_m : float
        Of the square that is drawn, with the body in the middle.
    cells : int
        Points along each side.
    max_m_s : float
        Speed at the end of the colour scale; what is faster has its last colour.

    Raises
    ------
    InputError
        If shapes do not match, a number is not finite, or a word is unknown.
    """
    if plane not in ("horizontal", "vertical"):
        raise InputError(f"plane: {quoted(plane)}, allowed are horizontal, vertical")
    half = finite_number(half_width_m, "half_width_m", above=0.0)
    most = 100.0 * finite_number(max_m_s, "max_m_s", above=0.0)
    cells = whole_number(cells, "cells", 2, 2000)
    X_WB = pose_of(pose)
    # Axes of the world (north, east, down) that the picture shows to the right and upwards.
    right, up = (1, 0) if plane == "horizontal" else (0, 2)
    across, along = np.meshgrid(*(np.linspace(-half, half, cells) + X_WB.p_m[axis] for axis in (right, up)))
    points = np.tile(X_WB.p_m, (across.size, 1))
    points[:, right], points[:, up] = across.ravel(), along.ravel()
    speed = np.linalg.norm(velocity(vehicle, thrusts_N, X_WB, points, wake), axis=1).reshape(across.shape)

    ax = _axes(ax)
    drawn = ax.contourf(across, along, 100.0 * speed, levels=np.linspace(0.0, most, 16), extend="max")
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * vehicle.size_m
    outline = X_WB.apply(corners)[:, [right, up]]
    outline = outline[ConvexHull(outline).vertices]
    ax.fill(*outline.T, facecolor="none", edgecolor="white", linewidth=1.2)
    if region is not None:
        spared = region.points_W_m if isinstance(region, Region) else frozen(region, (None, 3), "region")
        ax.plot(spared[:, right], spared[:, up], ".", color="white", markersize=2)
    names = ("north (m)", "east (m)", "down (m)")
    ax.set(aspect="equal", xlabel=names[right], ylabel=names[up])
    ax.set_xlim(across.min(), across.max())
    ax.set_ylim(*((along.max(), along.min()) if up == 2 else (along.min(), along.max())))
    _colourbar(ax, drawn, "water speed by the wake model (cm/s)")
    return ax


def thrusts(flight: Flight, *, limit_N: float | None = None, ax: Axes | None = None) -> Axes:
    """Thrust of every thruster over time, a row each; forward and reverse in two colours.

    - `limit_N`: end of the colour scale, for pictures that are compared; 99.5 % of the thrusts if not given.

    Raises InputError if `flight` is no flight, or `limit_N` is not more than 0.
    """
    time_s, thrusts_N = _recorded(flight)
    if limit_N is not None:
        limit_N = finite_number(limit_N, "limit_N", above=0.0)
    ax = _axes(ax)
    # A row of colour cannot show more instants than a page has pixels; means over some keep short pulses in view.
    buckets = min(1200, len(time_s))
    edges = np.linspace(0, len(time_s), buckets + 1).astype(int)
    shown = np.add.reduceat(np.nan_to_num(thrusts_N), edges[:-1], axis=0) / np.diff(edges)[:, None]
    limit = max(float(np.quantile(np.abs(shown), 0.995)), 1e-6) if limit_N is None else limit_N
    count = shown.shape[1]
    drawn = ax.imshow(
        shown.T,
        aspect="auto",
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        interpolation="nearest",
        extent=(float(time_s[0]), float(time_s[-1]), count + 0.5, 0.5),
    )
    ax.set_yticks(range(1, count + 1), [thruster.name for thruster in flight.parts.vehicle.thrusters])
    ax.set(xlabel="time (s)")
    _colourbar(ax, drawn, "thrust (N)")
    return ax


def null_space(flight: Flight, *, ax: Axes | None = None) -> Axes:
    """Use of the null space over time: coordinates of the thrusts in its orthonormal basis, a line for each direction.

    Zero is the minimum-norm allocation of the same wrench. The sum of the squares is what the thrusts' squared norm
    exceeds that of the minimum-norm allocation by, in N².

    Raises InputError if `flight` is no flight, or its vehicle has no null space.
    """
    time_s, thrusts_N = _recorded(flight)
    vehicle = flight.parts.vehicle
    if vehicle.null_space.shape[1] == 0:
        raise InputError(f"{vehicle.name}: {len(vehicle.thrusters)} thrusters leave no null space to plot")
    names = null_space_names(vehicle)
    if len(names) != vehicle.null_space.shape[1]:  # directions that are weak, too: the exact ones have no names then
        names = [f"direction {k + 1}" for k in range(vehicle.null_space.shape[1])]
    ax = _axes(ax)
    for name, values in zip(names, (thrusts_N @ vehicle.null_space).T, strict=True):
        ax.plot(*thinned(time_s, values), linewidth=1.1, label=name)
    ax.axhline(0.0, color="grey", linewidth=0.8)
    ax.set(xlabel="time (s)", ylabel="null-space coordinate (N)")
    ax.legend(frameon=False)
    return ax


def disturbance(flights: Flights, *, measure: Measure = "disturbance", ax: Axes | None = None) -> Axes:
    """Disturbance D along flights, or the true water speed at the target, over time.

    Parameters
    ----------
    measure : "disturbance" or "speed"
        D by the wake model that the controller minimises, or the mean speed that the simulated water has at the target.

    Raises
    ------
    InputError
        If these are no flights, or a flight has no such record, as a flight without a simulated world.
    """
    if measure not in _MEASURES:
        raise InputError(f"measure: {quoted(measure)}, allowed are {', '.join(_MEASURES)}")
    column, scale, label = _MEASURES[measure]
    ax, most = _axes(ax), 0.0
    for name, flight in _named(flights).items():
        time_s = _column(flight, "time_s")
        values = scale * _column(flight, column)
        if not np.isfinite(values).any():
            raise InputError(f"{name}: its record has no {column}")
        most = max(most, float(np.nanmax(values)))
        ax.plot(*thinned(time_s, values), linewidth=1.1, label=name)
    ax.set(xlabel="time (s)", ylabel=label, ylim=(0.0, 1.05 * most or 1.0))
    ax.legend(frameon=False)
    return ax


def wash_energy(flights: Flights, *, ax: Axes | None = None) -> Axes:
    """Wash against energy: the mean water speed at the target and the electrical energy, a point for each flight.

    Both are means and sums from the first leg on, as in `Flight.figures`. Nearer to the origin is better.

    Raises
    ------
    InputError
        If these are no flights, or a flight has no such figures, as a flight without a simulated world.
    """
    ax, places = _axes(ax), []
    for name, flight in _named(flights).items():
        energy_kJ, speed_m_s = flight.figures["energy_kJ"], flight.figures["target_speed_mean_m_s"]
        if energy_kJ is None or speed_m_s is None:
            raise InputError(f"{name}: its figures have no energy or no water speed at the target")
        place = (energy_kJ, 1e3 * speed_m_s)
        places.append(place)
        (point,) = ax.plot(*place, "o", markersize=7)
        ax.annotate(name, place, xytext=(7, 5), textcoords="offset points", color=point.get_color())
    # From zero, so that lengths are ratios; the names stand to the right of the points.
    right, top = np.max(places, axis=0)
    ax.set(xlabel="energy (kJ)", ylabel="water speed at the target (mm/s)")
    ax.set(xlim=(0.0, 1.35 * right or 1.0), ylim=(0.0, 1.15 * top or 1.0))
    return ax


def film(folder: str | Path, out: str | Path | None = None, **options: Any) -> Path:
    """Film of a finished trial in one line; `film.mp4` in its folder if no other file is named.

    `options` are `seconds`, `fps` and `view` ("both", "outside" or "camera"). A flight becomes a trial by `ww.trial`.

    Raises InputError if the folder is no finished trial, or an option is out of range; StageError if no encoder works.
    """
    trial = path_of(folder, "folder")
    unknown = sorted(set(options) - {"seconds", "fps", "view"})
    if unknown:
        raise InputError(f"film: no option {unknown[0]}, allowed are seconds, fps, view")
    return write_film(trial, trial / "film.mp4" if out is None else path_of(out, "out"), **options)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return instance_of(ax, Axes, "ax")
    return plt.subplots(layout="constrained")[1]


def _colourbar(ax: Axes, drawn: Any, label: str) -> None:
    ax.figure.colorbar(drawn, ax=ax, label=label, shrink=0.85)


def _named(flights: Flights) -> dict[str, Flight]:
    """Flights by name; of several without names, those of one method are told apart by their number."""
    if isinstance(flights, Flight):
        flights = [flights]
    if isinstance(flights, Mapping):
        named = dict(flights)
    elif isinstance(flights, Sequence):
        for flight in flights:
            instance_of(flight, Flight, "flights")
        methods = [flight.parts.method for flight in flights]
        named = {
            method if methods.count(method) == 1 else f"{method} {k}": flight
            for k, (method, flight) in enumerate(zip(methods, flights, strict=True), 1)
        }
    else:
        raise InputError(f"flights: {quoted(flights)}, must be a flight, or flights by name or in a list")
    if not named:
        raise InputError("flights: none is given")
    for name, flight in named.items():
        instance_of(flight, Flight, str(name))
    return named


def _column(flight: Flight, name: str) -> Array:
    return flight.steps[name].cast(float).fill_null(np.nan).to_numpy()


def _recorded(flight: Flight) -> tuple[Array, Array]:
    """Times in s, shape (n,), and thrusts in N, shape (n, m), of a flight."""
    instance_of(flight, Flight, "flight")
    count = len(flight.parts.vehicle.thrusters)
    return _column(flight, "time_s"), np.column_stack([_column(flight, f"thrust_{i}_N") for i in range(1, count + 1)])
