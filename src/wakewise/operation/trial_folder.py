"""What a flight leaves in its folder beside its record: the scenario, the truth, where photographs were to be taken."""

from __future__ import annotations

import csv
import io
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.files import write_text
from wakewise.core.geometry import Pose
from wakewise.operation.photography import photo_name
from wakewise.operation.plugin_adapter import is_builtin
from wakewise.operation.scenario import Scenario, differences, read_scenario, write_scenario
from wakewise.scene.targets import write_mesh

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts

BY_HAND = "operator"
"""The pilot that a scenario names where a person flew."""


def resolved_scenario(parts: Parts) -> Scenario:
    """The scenario that a trial leaves behind: what was given in Python in place of its own parts is named in it."""
    if not parts.given:
        return parts.scenario
    scenario, given = parts.scenario, parts.given
    told: dict[str, Any] = {"method": parts.method, "overrides": parts.overrides}
    told |= {name: given[name].name for name in ("vehicle", "world") if name in given}
    if "target" in given:
        told["target"] = scenario.target.model_copy(update={"kind": given["target"].name})
    return scenario.model_copy(update=told)


def check_place(folder: Path, scenario: Scenario) -> None:
    """Refuse a folder in which the trial cannot be, before seconds are spent on whether it can be flown.

    Raises
    ------
    InputError
        If the folder holds another trial, or is a file.
    EnvironmentFailure
        If it would lie below a file.
    """
    path = folder / "scenario.yaml"
    above = next((place for place in folder.parents if place.exists()), None)
    if above is not None and not above.is_dir():
        raise EnvironmentFailure(f"{above}: Not a directory")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file, must be a folder or not exist")
    if path.exists():
        changed = differences(read_scenario(path), scenario)
        if changed:
            raise InputError(
                f"--out {folder}: holds another trial ({'; '.join(changed[:3])}); give another --out or remove it"
            )


def write_or_check_scenario(folder: Path, scenario: Scenario) -> None:
    """Write scenario.yaml, or check that the one in the folder is the same trial; raises as `check_place`."""
    check_place(folder, scenario)
    path = folder / "scenario.yaml"
    if path.exists():
        return
    packages = ("wakewise", "numpy", "numba", "pycolmap", "opencv-python-headless", "embreex")
    versions = {"python": platform.python_version()} | {name: version(name) for name in packages}
    write_scenario(path, scenario, versions)


def flown_by_hand(parts: Parts) -> Scenario:
    """The scenario of a flight by hand: its pilot is a person, and what served the hands is not named.

    Pilot and controller that `assisted` put in place come back with the pilot's name; others are named as ever.
    """
    ours = {name for name in ("pilot", "controller") if name in parts.given and is_builtin(parts.given[name])}
    scenario = resolved_scenario(
        type(parts)(parts.scenario, {k: part for k, part in parts.given.items() if k not in ours})
    )
    return scenario.model_copy(update={"pilot": BY_HAND}) if "pilot" in ours else scenario


def write_plan(parts: Parts, folder: Path) -> None:
    """Write the truth (truth.ply) and where the photographs are to be taken from (planned.csv)."""
    write_truth(parts, folder)
    route = parts.route
    write_views(parts, folder, zip(route.exposure_names, route.exposures_s, route.X_WC_planned, strict=True))


def write_views(parts: Parts, folder: Path, views: Iterable[tuple[str, float, Pose]]) -> None:
    """Write planned.csv: names, times and wished poses of photographs."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("name", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"))
    for name, time_s, X_WC in views:
        writer.writerow(
            (photo_name(name, parts.scenario), f"{time_s:.6f}", *(f"{value:.9f}" for value in (*X_WC.p_m, *X_WC.q)))
        )
    write_text(folder / "planned.csv", text.getvalue())


def write_truth(parts: Parts, folder: Path) -> None:
    """Write the target as it truly is (truth.ply)."""
    write_mesh(folder / "truth.ply", parts.target.mesh)
