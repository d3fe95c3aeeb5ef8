"""Reads a trial folder: every part that is there, and in words what is missing."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import polars as pl
import trimesh
import yaml

from wakewise.control import METHODS
from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.operation import Scenario
from wakewise.operation.scenario import check_scenario

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialMesh:
    """A triangle mesh in the world: vertices_m, shape (n, 3), and faces, shape (m, 3)."""

    vertices_m: Array
    faces: IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Photograph:
    """One row of images.csv. Poses are X_WC; a figure that was not recorded is None."""

    name: str
    path: Path
    time_s: float
    X_WC_true: Pose | None
    X_WC_est: Pose | None
    sharpness: float | None
    turbidity_per_m: float | None


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """metrics.json: one flat value per key, with a reason for every null, a definition and a unit where given."""

    values: Mapping[str, Any]
    why: Mapping[str, str]
    definitions: Mapping[str, str]
    units: Mapping[str, str]

    def number(self, key: str) -> float | None:
        """Value of `key` as a number, None if it is absent, null or no number."""
        value = self.values.get(key)
        return None if isinstance(value, bool) or not isinstance(value, int | float) else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """What a trial folder holds, all in world NED.

    `missing` says for every absent part (by file name) why the report has to do without it. `scenario` is the file as
    it stands, `settings` the same checked and typed; None where it is absent or not one that this version can read.
    """

    folder: Path
    scenario: Mapping[str, Any]
    scenario_text: str
    settings: Scenario | None
    metrics: Metrics
    steps: pl.DataFrame | None
    photographs: tuple[Photograph, ...]
    planned: tuple[Pose, ...]
    truth: TrialMesh | None
    model: TrialMesh | None
    cloud_m: Array | None
    missing: Mapping[str, str]

    @property
    def name(self) -> str:
        """Name of the trial: its folder's."""
        return self.folder.resolve().name

    @property
    def method(self) -> str:
        """Control method, as the metrics or the scenario have it."""
        found = self.metrics.values.get("method") or self.scenario.get("method")
        return str(found) if found else "unknown method"

    @property
    def outside(self) -> str:
        """In words what of the flight was not the package's own; empty if all of it was."""
        replaced = self.scenario.get("overrides")
        named = self.method in (*METHODS, "unknown method") or (
            isinstance(replaced, Mapping) and "controller" in replaced
        )
        parts = [] if named else [f"controller from outside: {self.method}"]
        if isinstance(replaced, Mapping):
            parts += [f"{part} replaced: {said}" for part, said in replaced.items()]
        elif replaced:
            parts.append(f"replaced: {replaced}")
        return "; ".join(parts)

    @property
    def seed(self) -> str:
        """Seed of the trial, as the metrics or the scenario have it."""
        found = self.metrics.values.get("seed")
        found = self.scenario.get("seed") if found is None else found
        return "unknown" if found is None else str(found)

    @property
    def bed_z_m(self) -> float:
        """Depth of the bed: the tank's depth, else the lowest point of the target, else of the path."""
        if self.settings is not None:
            return float(self.settings.tank.size_m[2])
        if self.truth is not None:
            return float(self.truth.vertices_m[:, 2].max())
        return float(self.positions("true")[:, 2].max()) if self.steps is not None else 0.0

    def positions(self, prefix: str) -> Array:
        """Positions of the body, shape (n, 3); `prefix` is "true", "est" or "goal"; empty without a record."""
        names = [f"{prefix}_{axis}_m" for axis in "xyz"]
        if self.steps is None or not set(names) <= set(self.steps.columns):
            return np.empty((0, 3))
        return self.steps.select(names).to_numpy().astype(np.float64)

    def column(self, name: str) -> Array | None:
        """One column of the record as numbers, shape (n,), None if it was not recorded or is empty."""
        if self.steps is None or name not in self.steps.columns:
            return None
        values = self.steps[name].cast(pl.Float64, strict=False).fill_null(float("nan")).to_numpy()
        return values if np.isfinite(values).any() else None


def read_trial(folder: Path) -> Trial:
    """Read whatever a trial folder holds.

    A part that is absent or unreadable is left out and named in `missing`; the report then says so.

    Raises InputError if the folder does not exist or holds none of the parts of a trial.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, a trial folder is needed")
    missing: dict[str, str] = {}

    def part(name: str, read: Callable[[Path], T]) -> T | None:
        path = folder / name
        if not path.is_file():
            missing[name] = "was not written"
            return None
        try:
            return read(path)
        except (OSError, ValueError, KeyError, TypeError, IndexError, yaml.YAMLError, pl.exceptions.PolarsError) as e:
            missing[name] = f"could not be read ({str(e).splitlines()[0] if str(e) else type(e).__name__})"
            return None
        except InputError as e:
            missing[name] = f"could not be read ({e})"
            return None

    text = part("scenario.yaml", lambda path: path.read_text(encoding="utf-8")) or ""
    scenario = part("scenario.yaml", _read_scenario) or {}
    trial = Trial(
        folder=folder,
        scenario=scenario,
        scenario_text=text,
        settings=None if not scenario else part("scenario.yaml", lambda _: _typed(scenario)),
        metrics=part("metrics.json", _read_metrics) or Metrics(values={}, why={}, definitions={}, units={}),
        steps=part("steps.parquet", _read_steps),
        photographs=part("images.csv", lambda path: _read_photographs(path, folder / "images")) or (),
        planned=part("planned.csv", _read_planned) or (),
        truth=part("truth.ply", _read_surface),
        model=part("mesh.ply", _read_surface),
        cloud_m=part("dense.ply", _read_cloud),
        missing=missing,
    )
    if trial.steps is None and not trial.metrics.values and not trial.photographs:
        raise InputError(f"{folder}: not a trial folder, needs steps.parquet, images.csv or metrics.json")
    return trial


def _read_scenario(path: Path) -> dict[str, Any]:
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(tree, dict):
        raise ValueError("holds no settings")
    return tree


def _typed(tree: Mapping[str, Any]) -> Scenario:
    """The scenario's settings; what this version has no field for, or a method from outside, is left out."""
    known = {key: value for key, value in tree.items() if key in Scenario.model_fields}
    if known.get("method") not in METHODS:
        known.pop("method", None)
    return check_scenario(known, "scenario")


def _read_metrics(path: Path) -> Metrics:
    tree = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(tree, dict):
        raise ValueError("holds no metrics")
    aside = {name: tree.pop(name, None) or {} for name in ("why", "definitions", "units")}
    for name, mapping in aside.items():
        if not isinstance(mapping, dict):
            raise ValueError(f"{name} is no mapping")
    return Metrics(values=tree, **aside)


def _read_steps(path: Path) -> pl.DataFrame:
    steps = pl.read_parquet(path)
    if steps.is_empty() or "time_s" not in steps.columns:
        raise ValueError("holds no rows with time_s")
    return steps


def _pose(row: Mapping[str, Any], prefix: str = "") -> Pose | None:
    names = [f"{prefix}{a}_m" for a in "xyz"] + [f"{prefix}q{a}" for a in "wxyz"]
    values = [row.get(name) for name in names]
    if any(value is None for value in values):
        return None
    numbers = np.array([float(value) for value in values if value is not None])
    return Pose(numbers[:3], numbers[3:]) if np.isfinite(numbers).all() else None


def _finite(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None


def _read_photographs(path: Path, images: Path) -> tuple[Photograph, ...]:
    return tuple(
        Photograph(
            name=str(row["name"]),
            path=images / str(row["name"]),
            time_s=float(row["time_s"]),
            X_WC_true=_pose(row, "true_"),
            X_WC_est=_pose(row, "est_"),
            sharpness=_finite(row.get("sharpness")),
            turbidity_per_m=_finite(row.get("turbidity_per_m")),
        )
        for row in pl.read_csv(path, infer_schema_length=None).iter_rows(named=True)
    )


def _read_planned(path: Path) -> tuple[Pose, ...]:
    poses = (_pose(row) for row in pl.read_csv(path, infer_schema_length=None).iter_rows(named=True))
    return tuple(pose for pose in poses if pose is not None)


def _read_surface(path: Path) -> TrialMesh:
    mesh = trimesh.load(path, process=False)
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise ValueError("holds no triangles")
    return TrialMesh(vertices_m=np.asarray(mesh.vertices, np.float64), faces=np.asarray(mesh.faces, np.int64))


def _read_cloud(path: Path) -> Array:
    cloud = trimesh.load(path, process=False)
    points = np.asarray(getattr(cloud, "vertices", np.empty((0, 3))), np.float64)
    if len(points) == 0:
        raise ValueError("holds no points")
    return points
