"""Files of a trial beside the flight's record: scenario.yaml, truth.ply, planned.csv."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.files import sha256_of, write_rows
from wakewise.core.geometry import Pose
from wakewise.operation.parts import Parts, build
from wakewise.operation.photography import photo_name, pose_cells
from wakewise.operation.plugin_adapter import is_builtin
from wakewise.operation.scenario import Scenario, differences, read_scenario, write_scenario
from wakewise.scene.targets import write_mesh

BY_HAND = "operator"
"""Name of the pilot in the scenario of a flight by hand."""


def resolved_scenario(parts: Parts) -> Scenario:
    """The scenario that a trial writes; parts that were given in Python are named in `overrides`."""
    if not parts.given:
        return parts.scenario
    scenario, given = parts.scenario, parts.given
    update: dict[str, Any] = {"method": parts.method, "overrides": parts.overrides}
    update |= {name: given[name].name for name in ("vehicle", "world") if name in given}
    if "target" in given:
        update["target"] = scenario.target.model_copy(update={"kind": given["target"].name})
    return scenario.model_copy(update=update)


def check_place(folder: Path, scenario: Scenario) -> None:
    """Refuse a folder of another trial and a file (InputError), and a folder below a file (EnvironmentFailure)."""
    path = folder / "scenario.yaml"
    above = next((place for place in folder.parents if place.exists()), None)
    if above is not None and not above.is_dir():
        raise EnvironmentFailure(f"{above}: Not a directory")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file, must be a folder or not exist")
    if path.exists():
        changed = differences(read_scenario(path), scenario) + changed_files(path, scenario)
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
    write_scenario(path, scenario, versions | _check_sums(scenario))


def changed_files(path: Path, scenario: Scenario) -> list[str]:
    """Which files that a trial's scenario.yaml names have other contents than its comments say, in words."""
    lines = path.read_text(encoding="utf-8").splitlines()
    named = {name: f"# {name} {found}" for name, found in _check_sums(scenario).items()}
    return [
        f"the contents of {name} have changed"
        for name, now in named.items()
        if now not in lines and any(line.startswith(f"# {name} sha256 ") for line in lines)
    ]


def _check_sums(scenario: Scenario) -> dict[str, str]:
    """Check sum of each file of vehicle, target, current and control log by its name in the scenario."""
    named = (scenario.vehicle, scenario.target.kind, scenario.tank.current.file, scenario.control_log)
    files = {name: Path(name).expanduser() for name in named if name}
    return {name: f"sha256 {sha256_of(file)}" for name, file in files.items() if file.is_file()}


def flown_by_hand(parts: Parts) -> Scenario:
    """The scenario of a flight by hand: its pilot is `BY_HAND`.

    Pilot and controller of `assisted` follow from that name, so they are not in `overrides`; other given parts are.
    """
    ours = {name for name in ("pilot", "controller") if name in parts.given and is_builtin(parts.given[name])}
    scenario = resolved_scenario(build(parts.scenario, {k: v for k, v in parts.given.items() if k not in ours}))
    return scenario.model_copy(update={"pilot": BY_HAND}) if "pilot" in ours else scenario


def write_plan(parts: Parts, folder: Path) -> None:
    """Write truth.ply and planned.csv."""
    write_truth(parts, folder)
    route = parts.route
    write_views(parts, folder, zip(route.exposure_names, route.exposures_s, route.X_WC_planned, strict=True))


def write_views(parts: Parts, folder: Path, views: Iterable[tuple[str, float, Pose]]) -> None:
    """Write planned.csv: names, times and reference poses of photographs."""
    rows = [(photo_name(name, parts.scenario), f"{time_s:.6f}", *pose_cells(X_WC)) for name, time_s, X_WC in views]
    write_rows(folder / "planned.csv", [("name", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"), *rows])


def write_truth(parts: Parts, folder: Path) -> None:
    """Write the target at its true place (truth.ply)."""
    write_mesh(folder / "truth.ply", parts.target.mesh)
