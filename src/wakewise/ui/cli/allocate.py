"""`wakewise allocate`: one wrench to thrusts, with the disturbance before and after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.defaults import BUDGET, CHANGE_WEIGHT, DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.ui.cli.console import format_value, print_json, print_table
from wakewise.ui.cli.options import Json
from wakewise.ui.cli.points import read_points

if TYPE_CHECKING:
    from wakewise.allocation import Allocation
    from wakewise.core.arrays import Array
    from wakewise.core.geometry import Pose
    from wakewise.robot.vehicles import Vehicle

_STILL_M2_S2 = 1e-12
"""A disturbance below that of a micrometre per second counts as none."""

Six = tuple[float, float, float, float, float, float]


def allocate(
    pose: Annotated[
        Six,
        typer.Option(
            metavar="X Y Z ROLL PITCH YAW",
            help="Where the vehicle is: m and rad; z and yaw as in NED, down and clockwise seen from above.",
        ),
    ],
    wrench: Annotated[
        Six,
        typer.Option(metavar="X Y Z K M N", help="Force (N) and moment (N m) about the body origin, body axes (FRD)."),
    ],
    points: Annotated[Path, typer.Option(help="CSV with x_m, y_m, z_m in the world (NED) and weight: what to spare.")],
    vehicle: Annotated[str, typer.Option(help="Library name or vehicle file.")] = "paper",
    wake_model: Annotated[
        str,
        typer.Option(help="paper, paper-calibrated, fitted, linear, jet, jet-fitted, learned, or package.module:make."),
    ] = "jet",
    sum_: Annotated[str, typer.Option("--sum", help="How jets that meet add up: coherent or incoherent.")] = "coherent",
    failed: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|NUMBER",
            help="A thruster that gives nothing: its name, or its number in the table, from 1; may be repeated.",
        ),
    ] = None,
    priority: Annotated[
        str | None,
        typer.Option(
            metavar="AXES",
            help="What to give up last where limits do not allow the wrench, such as ZKMN,XY; else its direction is "
            "kept.",
        ),
    ] = None,
    w_disturbance: Annotated[
        float, typer.Option(help="Weight of the mean square speed, D over the sum of weights, per (m/s)^2.")
    ] = DISTURBANCE_WEIGHT,
    w_effort: Annotated[float, typer.Option(help="Weight of squared thrusts, per N^2; more than 0.")] = EFFORT_WEIGHT,
    w_previous: Annotated[
        float, typer.Option(help="Weight of squared change from --previous, per N^2.")
    ] = CHANGE_WEIGHT,
    previous: Annotated[
        str | None, typer.Option(metavar="T1,T2,...", help="Thrusts of the step before (N), for --w-previous.")
    ] = None,
    budget: Annotated[int, typer.Option(min=1, max=1_000_000, help="Most boxes that branch and bound takes.")] = BUDGET,
    json: Json = False,
) -> None:
    """Give the thrusts that make a wrench and disturb weighted points least, by the weights of a flight.

    The cost, at its global minimum, is w_disturbance D / (sum of weights) + w_effort |T|^2, where D is the weighted sum
    of squared water speeds at the points, (m/s)^2. The first two weights are a scenario's control.w_disturbance and
    control.w_effort. Beside it stand the least thrusts of the same wrench (pseudo-inverse). The gap is proven: how far
    the cost may lie above its minimum, relative. From Python: wakewise.allocate.
    """
    import numpy as np

    from wakewise import api
    from wakewise.allocation import min_norm_allocation
    from wakewise.api import layout_of, pose_of, view_of
    from wakewise.core.errors import InputError
    from wakewise.robot.importers import any_vehicle
    from wakewise.scene.targets import Region
    from wakewise.wake import SUPERPOSITIONS

    chosen = any_vehicle(vehicle)
    X_WB = pose_of(pose, "--pose")
    if not np.all(np.isfinite(wrench)):
        raise InputError(f"--wrench: {_words(wrench)}, all six must be finite")
    superposition = next((known for known in SUPERPOSITIONS if known == sum_), None)
    if superposition is None:
        raise InputError(f"--sum {sum_}: unknown, allowed: {', '.join(SUPERPOSITIONS)}")
    places, weights = read_points(points, chosen, X_WB)
    region = Region(points_W_m=places, weights=weights, distance_m=np.zeros(len(places)))
    before = None if previous is None else _thrusts(previous, len(chosen.thrusters))
    dead = sorted({_thruster(name, chosen) for name in failed or []})
    names = [t.name for t in chosen.thrusters]
    view = view_of(chosen, region, wake_model, superposition)
    wanted = np.array(wrench)
    gentle = api.allocate(
        chosen,
        wanted,
        X_WB,
        region,
        view.wake,
        w_disturbance=w_disturbance,
        w_effort=w_effort,
        w_previous=w_previous,
        previous_N=before,
        failed=dead,
        superposition=superposition,
        priority=priority,
        budget=budget,
    )
    layout = layout_of(chosen, dead)
    least = min_norm_allocation(layout, wanted, view.gram(X_WB), priority)
    size = float(np.linalg.norm(wanted))
    figures: dict[str, Any] = {
        "vehicle": chosen.name,
        "thrusters": names,
        "failed": [names[i] for i in dead],
        "wake_model": view.wake.name,
        "sum": sum_,
        "thrusts_N": gentle.thrusts_N.tolist(),
        "wrench_made": gentle.wrench_B.tolist(),
        "wrench_error_rel": float(np.linalg.norm(gentle.given_up_B)) / size if size > 0.0 else 0.0,
        "scale": gentle.scale,
        "given_up": gentle.given_up,
        "disturbance": gentle.disturbance,
        "disturbance_pinv": least.disturbance,
        "thrusts_pinv_N": least.thrusts_N.tolist(),
        "method": gentle.method,
        "gap": gentle.gap,
        "null_space": layout.null.T.tolist() if not len(layout.lines) else layout.lines.tolist(),
        "rank": layout.rank,
        "w_disturbance": w_disturbance,
        "w_effort": w_effort,
        "w_previous": w_previous,
    }
    if json:
        print_json(figures)
        return
    _show(chosen, gentle, least, figures)
    if max(gentle.disturbance or 0.0, least.disturbance or 0.0) < _STILL_M2_S2:
        typer.echo(_nobody_near(chosen, X_WB, places[weights > 0.0], gentle, least))


def _show(vehicle: Vehicle, gentle: Allocation, least: Allocation, figures: dict[str, Any]) -> None:
    rows = []
    most = max(1e-9, *(abs(float(T)) for a in (gentle, least) for T in a.thrusts_N))
    for i, thruster in enumerate(vehicle.thrusters):
        name = f"{i + 1} {thruster.name}" + (" (failed)" if thruster.name in figures["failed"] else "")
        old, new = float(least.thrusts_N[i]), float(gentle.thrusts_N[i])
        rows.append((name, _newton(old), _bar(old, most), _newton(new), _bar(new, most)))
    print_table("tntnt", ("thruster", "least thrusts", "", "gentle", ""), rows, box=None, pad_edge=False)
    before, after = figures["disturbance_pinv"], figures["disturbance"]
    typer.echo(
        f"\ndisturbance D   {format_value(before)} (m/s)^2 before, {format_value(after)} after" + _saved(before, after)
    )
    certain = "exact" if gentle.gap <= 1e-5 else "budget spent: raise --budget for a smaller gap"
    typer.echo(f"method          {gentle.method}, gap {gentle.gap:.1e} ({certain})")
    typer.echo(f"wrench          error {figures['wrench_error_rel']:.1e} of what was asked")
    units = {"X": "N", "Y": "N", "Z": "N", "K": "N m", "M": "N m", "N": "N m"}
    if gentle.given_up:
        lost = ", ".join(f"{axis} {value:.3g} {units[axis]}" for axis, value in gentle.given_up.items())
        typer.echo(f"given up        {lost}")


def _nobody_near(vehicle: Vehicle, X_WB: Pose, places: Array, gentle: Allocation, least: Allocation) -> str:
    """Why nothing is to be spared: no thruster pushes, or how far from a point the nearest jet passes."""
    import numpy as np

    start, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    distances = []
    for allocation in (gentle, least):
        pushing = np.abs(allocation.thrusts_N) > 1e-6
        # Water goes against the thrust; behind the disk no jet passes, so nothing is nearer than the disk.
        jets = -np.sign(allocation.thrusts_N[pushing])[:, None] * axes[pushing]
        offset = places[:, None] - start[pushing]
        along = np.maximum(np.einsum("ptk,tk->pt", offset, jets), 0.0)
        distances += np.linalg.norm(offset - along[..., None] * jets, axis=-1).ravel().tolist()
    if not distances:
        return "                no thruster pushes, so there is nothing to spare"
    return f"                no jet of either reaches a point; the nearest passes {min(distances):.2f} m from one"


def _saved(before: float, after: float) -> str:
    return f": {100.0 * (1.0 - after / before):.1f} % less" if before > 0.0 else ""


def _newton(thrust_N: float) -> str:
    return f"{round(thrust_N, 2) + 0.0:.2f} N"  # no -0.00


def _bar(thrust_N: float, most_N: float) -> str:
    """Ten cells to each side of zero."""
    cells = round(10 * abs(thrust_N) / most_N)
    bar = "█" * cells
    return f"{bar:>10}│{'':10}" if thrust_N < 0 else f"{'':10}│{bar:<10}"


def _words(numbers: tuple[float, ...]) -> str:
    return " ".join(f"{number:g}" for number in numbers)


def _thruster(name: str, vehicle: Vehicle) -> int:
    from wakewise.core.errors import InputError

    names = [t.name for t in vehicle.thrusters]
    if name in names:
        return names.index(name)
    if name.isdecimal() and 1 <= int(name) <= len(names):
        return int(name) - 1
    raise InputError(f"--failed {name}: no such thruster, allowed: 1 to {len(names)}, {', '.join(names)}")


def _thrusts(text: str, count: int) -> Array:
    import numpy as np

    from wakewise.core.errors import InputError

    try:
        thrusts = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise InputError(f"--previous {text}: not numbers separated by commas") from None
    if len(thrusts) != count or not np.all(np.isfinite(thrusts)):
        raise InputError(f"--previous {text}: {len(thrusts)} numbers, allowed: {count} finite ones, one per thruster")
    return thrusts
