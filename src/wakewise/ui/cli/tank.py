"""`wakewise tank`: what the simulated water does, for anyone who wants to hold it against other water."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wakewise.core.constants import TRIM_WATER_KG_M3
from wakewise.ui.cli.console import print_json
from wakewise.ui.cli.options import Json, seed_option

if TYPE_CHECKING:
    from wakewise.core.arrays import Array
    from wakewise.scene.targets import Target

app = typer.Typer(help="The simulated water: its flow at any points.")


@app.callback()
def _group() -> None:
    """The simulated water: its flow at any points."""


@app.command("probe")
def probe_command(
    thrusts: Annotated[
        Path,
        typer.Option(
            help="CSV with time_s and one thrust in N per thruster (thrust_1_N ... or the thrusters' names, any "
            "order), each row held until the next; the last row ends the history."
        ),
    ],
    points: Annotated[Path, typer.Option(help="CSV with x_m, y_m, z_m in the world (NED).")],
    vehicle: Annotated[str, typer.Option(help="Library name or vehicle YAML file.")] = "paper",
    pose: Annotated[
        tuple[float, float, float, float, float, float],
        typer.Option(
            metavar="X Y Z ROLL PITCH YAW",
            help="Where the vehicle is held: m and rad; z and yaw as in NED, down and clockwise seen from above.",
        ),
    ] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    floor: Annotated[
        float | None, typer.Option(metavar="Z", help="Depth of the floor; open water if not given.")
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            metavar="MESH",
            help="A mesh file in m, or a coral (branching, gorgonian, ...): stands on the floor at x = y = 0.",
        ),
    ] = None,
    flow: Annotated[str, typer.Option(help="parcels, the water of trials; or lattice, steady mean jets.")] = "parcels",
    every: Annotated[
        float | None, typer.Option(metavar="S", help="Times of the answer; else those of the thrusts.")
    ] = None,
    seed: Annotated[int, typer.Option(callback=seed_option, help="Seed of the turbulence.")] = 0,
    turbulence: Annotated[
        bool, typer.Option("--turbulence", help="With the turbulence of trials; else mean jets.")
    ] = False,
    swirl: Annotated[bool, typer.Option("--swirl", help="Parcels as wide as a propeller's swirling jets.")] = False,
    density: Annotated[float, typer.Option(min=900.0, max=1100.0, help="Of the water, kg/m3.")] = TRIM_WATER_KG_M3,
    out: Annotated[Path | None, typer.Option(help="Write the JSON object here, or arrays to a .npz.")] = None,
    json: Json = False,
) -> None:
    """Give the flow at points and times for a vehicle held in place and a history of thrusts.

    Thrusts are those delivered (no lag). Mean and 95th percentile of the speed are over all points and times at which
    the flow is known; --flow lattice knows none outside the boxes of its jets, and gives null there (NaN in a .npz).
    """
    import numpy as np

    from wakewise.api import pose_of
    from wakewise.core.errors import InputError
    from wakewise.robot.vehicles import load_vehicle
    from wakewise.simulation.tank import TankSettings
    from wakewise.simulation.tank.probe import probe, read_points, read_thrusts, regular_times

    if out is not None and out.suffix not in (".json", ".npz"):
        raise InputError(f"--out {out}: must end in .json or .npz")
    chosen = load_vehicle(vehicle)
    history, columns = read_thrusts(thrusts, chosen)
    result = probe(
        chosen,
        pose_of(pose, "--pose"),
        history,
        read_points(points),
        times_s=None if every is None else regular_times(history, every),
        floor_z_m=floor,
        target=_target(target, floor),
        flow=flow,
        turbulence=TankSettings().jets.turbulence if turbulence else 0.0,
        swirl=swirl,
        density_kg_m3=density,
        seed=seed,
    )
    known, velocities = result.known, np.where(result.known[..., None], result.velocities_m_s, np.nan)
    speeds = result.speeds_m_s[known]
    unknown = int(np.count_nonzero(~known))
    why = {}
    if unknown:
        outside = f"{unknown} of {known.size} values are outside the boxes of the jets that the lattice computed"
        why["velocities_m_s"] = outside
        if not len(speeds):
            why["speed_mean_m_s"] = why["speed_p95_m_s"] = outside
    figures = {
        "vehicle": chosen.name,
        "flow": flow,
        "thruster_of_column": columns,
        "thrusts_held": "until the next row",
        "times_s": result.times_s.tolist(),
        "velocities_m_s": [
            [u if k else [None] * 3 for u, k in zip(*row, strict=True)]
            for row in zip(result.velocities_m_s.tolist(), known.tolist(), strict=True)
        ],
        "speed_mean_m_s": float(speeds.mean()) if len(speeds) else None,
        "speed_p95_m_s": float(np.quantile(speeds, 0.95)) if len(speeds) else None,
        "why": why,
    }
    if out is not None and out.suffix == ".npz":
        from wakewise.core.files import whole_file

        with whole_file(out) as temporary:
            np.savez_compressed(
                temporary, times_s=result.times_s, points_W_m=result.points_W_m, velocities_m_s=velocities
            )
    elif out is not None:
        from wakewise.core.files import write_json

        write_json(out, figures)
    if json:
        print_json(figures)
        return
    typer.echo(f"{chosen.name}, {flow}: {len(result.times_s)} times, {len(result.points_W_m)} points")
    for time_s, row, at in zip(result.times_s, result.speeds_m_s, known, strict=True):
        typer.echo(f"{time_s:8.2f} s   {_summary(row[at])}")
    typer.echo(f"all          {_summary(speeds)}")
    for reason in dict.fromkeys(why.values()):
        typer.echo(f"not known: {reason}")
    if out is not None:
        typer.echo(f"written: {out}")


def _summary(speeds_m_s: Array) -> str:
    import numpy as np

    if not len(speeds_m_s):
        return "not known at any of the points"
    return f"mean {speeds_m_s.mean():.4f} m/s   95th percentile {np.quantile(speeds_m_s, 0.95):.4f} m/s"


def _target(name: str | None, floor_z_m: float | None) -> Target | None:
    if name is None:
        return None
    from wakewise.core.errors import InputError
    from wakewise.scene.targets import find_mesh, place_on_bed

    if floor_z_m is None:
        raise InputError("--target: stands on a floor, give --floor Z too")
    called, mesh = find_mesh(name)
    return place_on_bed(called, mesh, floor_z_m)
