"""One way in: a vehicle file of another project becomes a draft, whatever its format."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.importers.gazebo_thrusters import read_thrusters, words
from wakewise.robot.importers.matrices import read_matrix_only, read_yaml
from wakewise.robot.importers.packages import PackagePaths
from wakewise.robot.importers.parsed_vehicle import (
    FRAME_CHOICES,
    QUESTION,
    THRUST_CHOICES,
    ParsedVehicle,
    make_draft,
    wrench_rows_to_frd,
)
from wakewise.robot.importers.robot_description import (
    RobotDescription,
    read_camera,
    read_displacement,
    read_mass,
    read_outline,
)
from wakewise.robot.importers.safe_yaml_nodes import parse_yaml
from wakewise.robot.importers.sdf import left_out, read_sdf
from wakewise.robot.importers.stonefish import read_stonefish
from wakewise.robot.importers.thruster_checks import (
    question_inertia,
    question_names,
    question_rank,
    require_count,
    require_force_columns,
)
from wakewise.robot.importers.urdf import read_urdf
from wakewise.robot.importers.wrench_rows import (
    ARDUSUB,
    FORCES_FIRST,
    MOMENTS_FIRST,
    WrenchOrder,
    matching_entries,
    nearest,
    parse_order,
)
from wakewise.robot.importers.xacro import XacroExpander
from wakewise.robot.importers.xml import Element, PlacedError, parse_xml, read_text
from wakewise.robot.importers.yaml_parameters import read_water
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.vehicle import Provenance


def import_vehicle(
    path: str | Path,
    *,
    convention: str = "auto",
    thrust: str = "auto",
    matrix: Path | None = None,
    packages: Mapping[str, Path] | None = None,
    arguments: Mapping[str, str] | None = None,
    skip_missing: bool = False,
    rows: str | None = None,
) -> VehicleDraft:
    """Read a vehicle description of another project.

    `path`: URDF, xacro, Gazebo SDF, Stonefish scenario, or YAML with an allocation matrix or thruster geometry; the
    format is told by what is in the file, not by its name. `convention`: body axes of the file: "auto" (by format and
    evidence), "FLU" or "FRD". `thrust`: "auto", "axis", "reversed", or an axis of each thruster's own frame such as
    "+x"; see `make_draft`. `matrix`: YAML file with the matrix that the project ships; kept beside the geometry for
    comparison. `packages`: folders of packages that are not found near the file. `arguments`: values of xacro and
    Stonefish arguments. `skip_missing`: leave out xacro includes that are not there, with a note, instead of refusing
    the file. `rows`: what the six rows of a matrix are, in the file's order: names separated by commas, such as
    "roll,pitch,yaw,x,y,z". Returns in FRD. What the file does not hold is None and listed in `missing`; `notes` says
    what was decided and why. Raises InputError in one line with file and line, for anything that cannot be read or is
    not a vehicle.
    """
    path = Path(path)
    for value, choices, option in ((convention, FRAME_CHOICES, "frame"), (thrust, THRUST_CHOICES, "thrust direction")):
        if value not in choices:
            raise InputError(f"{option} {value!r}: allowed {', '.join(choices)}")
    try:
        # Overflow in numbers of absurd size shows as an infinity, which the record refuses; it needs no warning.
        with np.errstate(all="ignore"):
            order = parse_order(rows)
            found = _read(path, packages or {}, arguments or {}, order, skip_missing=skip_missing)
            require_count(len(found.thrusters), f"{path}: ")
            question_inertia(found)
            draft = make_draft(found, convention, thrust)
            draft = draft if matrix is None else _with_matrix(draft, matrix, convention, rows)
            if not draft.thrusters and draft.shipped_matrix is not None:
                named = found.matrix_name or "matrix"
                require_force_columns(draft.shipped_matrix, f"{path if matrix is None else matrix}: {named}")
            if not draft.thrusters and draft.shipped_matrix is None:
                return draft
            doubts = [
                *question_rank(found, draft.allocation_matrix, found.name),
                *question_names(found, draft, told=thrust != "auto"),
            ]
            return replace(draft, notes=(*draft.notes, *doubts)) if doubts else draft
    except (RecursionError, ArithmeticError, np.linalg.LinAlgError) as fault:
        raise InputError(f"{path}: cannot be read ({type(fault).__name__})") from fault


def _read(
    path: Path,
    packages: Mapping[str, Path],
    arguments: Mapping[str, str],
    order: WrenchOrder | None,
    *,
    skip_missing: bool,
) -> ParsedVehicle:
    text = read_text(path)
    if not text.lstrip().startswith("<"):
        _refuse_toml(text, path)
        found = ParsedVehicle(path.stem, "YAML", path, "FLU", "")
        read_yaml(parse_yaml(text, path), path.name, found, order)
        return found
    if order is not None:
        raise InputError(f"{path}: holds no matrix, so rows {order.words} say nothing; they are for YAML files")
    root = parse_xml(text, path)
    folders = PackagePaths(path, packages)
    notes: list[str] = []
    macros: list[str] = []
    if _is_xacro(root):
        xacro = XacroExpander(folders, arguments, skip_missing=skip_missing)
        root = xacro.expand(root)
        notes, macros = xacro.notes, list(xacro.macros)
    elif arguments and root.tag != "scenario" and not _is_stonefish(root):
        raise InputError(f"{path}: has no xacro arguments, {', '.join(arguments)} cannot be set")
    if root.tag == "scenario" or (root.tag == "robot" and _is_stonefish(root)):
        found = ParsedVehicle(
            path.stem, "Stonefish", path, "FRD", "by format: Stonefish worlds are NED and its bodies FRD"
        )
        read_stonefish(root, folders, arguments, macros, found)
    elif root.tag == "robot":
        if not root.all("link") and macros:
            raise PlacedError(
                f"{root.place}: only defines macros ({', '.join(macros)[:120]}); import the file that calls them"
            )
        found = _from_bodies(read_urdf(root), "URDF", path)
    elif root.tag in {"sdf", "gazebo", "model", "world"}:
        wrapped = root if root.tag in {"sdf", "gazebo"} else Element("sdf", {}, root.place, [root])
        found = _from_bodies(read_sdf(wrapped, folders, notes), "SDF", path)
    else:
        raise PlacedError(
            f"{root.place}: root element <{root.tag[:40]}> is not read; "
            f"robot (URDF, xacro), sdf (Gazebo) and scenario (Stonefish) are"
        )
    found.notes[:0] = notes
    if not found.thrusters and found.matrix is None and found.mass_kg is None and found.added_mass is None:
        why = left_out(found.notes) or next((f" ({note})" for note in found.notes if note.startswith("mass: ")), "")
        raise PlacedError(f"{root.place}: holds neither thrusters nor mass nor hydrodynamics{why}")
    if not found.thrusters:
        found.notes.append("no thruster was found in the file")
    return found


def _refuse_toml(text: str, path: Path) -> None:
    if path.suffix.lower() == ".toml" or _TOML.search(text):
        line = next((i for i, row in enumerate(text.splitlines(), 1) if _TOML.match(row)), 1)
        raise PlacedError(
            f"{path}:{line}: is {'TOML' if path.suffix.lower() == '.toml' else 'TOML or INI'}, which is not read; "
            f"vehicles are read from URDF, xacro, SDF, Stonefish (.scn) and YAML"
        )


_TOML = re.compile(r"^(\[\[?[A-Za-z_][\w.-]*\]\]?\s*(#.*)?|[A-Za-z_][\w.-]*\s*=\s*\S.*)$", re.MULTILINE)


def _is_xacro(root: Element) -> bool:
    return any("xacro" in value for key, value in root.attributes.items() if key.startswith("xmlns")) or any(
        element.tag.startswith("xacro:") for element in root.walk()
    )


def _is_stonefish(root: Element) -> bool:
    return root.first("base_link") is not None


def _from_bodies(bodies: RobotDescription, kind: str, path: Path) -> ParsedVehicle:
    found = ParsedVehicle(bodies.name, kind, path, "FLU", "")
    _detect_frame(bodies, found)
    read_mass(bodies, found)
    read_thrusters(bodies, found)
    read_water(bodies, found)
    if any("hydrodynamics" in words(p) or "buoyancy" in words(p) for p in bodies.plugins):
        read_displacement(bodies, found)
    read_camera(bodies, found)
    read_outline(bodies, found)
    return found


def _detect_frame(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """URDF and SDF bodies are FLU by ROS REP 103; ArduPilot's plugin and the base link's name can say otherwise."""
    for plugin in bodies.plugins:
        turn = plugin.value("modelXYZToAirplaneXForwardZDown")
        if "ardupilot" not in words(plugin) or turn is None:
            continue
        parts = turn.split()
        rolled = len(parts) == 6 and abs(abs(float_or_nan(parts[3])) - np.pi) < 0.01
        level = len(parts) == 6 and all(abs(float_or_nan(p)) < 0.01 for p in parts[3:])
        if rolled:
            found.frame_why = "detected: ArduPilot's plugin turns the body by pi about x to point z down"
            return
        if level:
            found.frame, found.frame_why = "FRD", "detected: ArduPilot's plugin takes the body as x forward, z down"
            return
    name = bodies.base.lower()
    if name.endswith(("_ned", "_frd", "_fsd")):
        found.frame, found.frame_why = "FRD", f"detected: the base link is called {bodies.base}"
        return
    found.frame_why = f"by format: {found.kind} bodies have z up (ROS REP 103)"


def float_or_nan(text: str) -> float:
    """A number, or NaN if the text is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_matrix(
    path: Path, convention: str = "auto", geometry: Array | None = None, rows: str | None = None
) -> tuple[Array, list[str]]:
    """Allocation matrix of a YAML file, shape (6, n), in FRD, and notes on how it was read.

    What the file or `rows` state of its rows and its frame is taken, and `convention`; what they leave open, the
    `geometry`, shape (6, n), settles by the way of reading in which most entries agree; without it forces come first
    and the frame is FLU as in ROS.

    Raises InputError if the file holds none or it has the wrong shape.
    """
    found = ParsedVehicle(path.stem, "YAML", path, "FLU", "")
    read_matrix_only(parse_yaml(read_text(path), path), found, parse_order(rows))
    if found.matrix is None:
        raise InputError(f"{path}: holds no allocation matrix")
    frame, why = found.frame, found.frame_why
    known = why.startswith("detected") or convention != "auto"
    if convention != "auto" and not why.startswith("detected"):
        frame, why = ("FRD" if convention == "FRD" else "FLU"), "told"
    stated = wrench_rows_to_frd(found.matrix) if frame == "FLU" else found.matrix
    if geometry is not None and geometry.shape == stated.shape:
        raws = [found.matrix] if found.raw_matrix is None else [found.raw_matrix]
        orders = [FORCES_FIRST] if found.raw_matrix is None else [FORCES_FIRST, MOMENTS_FIRST, ARDUSUB]
        best, words = nearest(raws, geometry, orders, [frame] if known else ["FLU", "FRD"])
        if matching_entries(best, geometry) > matching_entries(stated, geometry) or not known:
            doubts = [note for note in found.notes if note.startswith(QUESTION)]
            found.notes = [note for note in found.notes if note not in doubts]
            return best, [*found.notes, f"matrix read as {words}"]
    doubt = [found.frame_doubt] if found.frame_doubt and convention == "auto" else []
    return stated, [*found.notes, f"frame of the matrix: {frame} ({why})", *doubt]


def _with_matrix(draft: VehicleDraft, path: Path, convention: str, rows: str | None) -> VehicleDraft:
    """Keep a shipped matrix beside the geometry."""
    n = len(draft.thrusters)
    matrix, notes = read_matrix(path, convention, draft.allocation_matrix if n else None, rows)
    if n and matrix.shape[1] != n:
        raise InputError(f"{path}: allocation matrix has {matrix.shape[1]} columns, the vehicle has {n} thrusters")
    origin = Provenance(group="shipped_matrix", source=f"YAML {path.name}", estimate=False)
    return replace(draft, shipped_matrix=matrix, notes=(*draft.notes, *notes), provenance=(*draft.provenance, origin))
