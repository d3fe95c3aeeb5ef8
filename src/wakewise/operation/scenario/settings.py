"""Fields of a scenario: everything a trial needs, as one frozen, checked record.

`Scenario` holds the groups of settings. Those of mission, controller, estimator, tank, camera and reconstruction are
defined in their own packages; the target's are here.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import yaml
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator, model_validator

from wakewise.control import MAKERS, ControlSettings
from wakewise.core.checks import path_of
from wakewise.core.errors import InputError
from wakewise.core.files import name_fault, write_text
from wakewise.core.plugins import names
from wakewise.core.settings import Seed, Settings, describe_faults, guess
from wakewise.estimation import FilterSettings
from wakewise.operation.scenario.calibration_error import CalibrationErrorSettings
from wakewise.operation.scenario.find_settings import FindSettings, SurveySettings
from wakewise.operation.scenario.layers import merge_layers, merged, nested, read_tree, replace_fields, with_kinds
from wakewise.operation.scenario.randomization import FieldDistribution, sample_fields
from wakewise.operation.worlds.library import load_world, own_file, world_names
from wakewise.perception.settings import PerceptionSettings
from wakewise.robot.vehicles.ballast import BallastBlock
from wakewise.robot.vehicles.library import draft_names, is_path
from wakewise.scene.missions import MissionSettings
from wakewise.scene.targets import TISSUES, TissueProperties, is_mesh_file, procedural_kinds
from wakewise.simulation.tank import TankSettings
from wakewise.vision.imaging import ImagingSettings
from wakewise.vision.reconstruction import ReconstructionSettings

if TYPE_CHECKING:  # of the shorthand `Scenario.parts` alone: parts are built from scenarios, not the other way round
    from wakewise.operation.parts import Parts

FLOWS = ("tank", "paper", "lattice", "lattice-jets")
"""Our own water models (see `wakewise.operation.worlds.makers`)."""
PILOTS = ("route", "find", "survey", "human", "assisted", "operator")
"""Our own sources of goals (see `wakewise.operation.pilot_makers`)."""


class UnanchoredSettings(Settings):
    """A target that lies on the bed and may slide."""

    weight_N: float | None = Field(
        None, gt=0.0, le=1e4, description="its weight in water, N, if it lies loose and slides when pushed; null: held"
    )
    friction: float = Field(
        0.65,
        gt=0.0,
        le=5.0,
        description="coefficient between it and the bed; 0.65 is the tangent of gravel's 33 deg (Stark et al. 2014, "
        "doi 10.5194/esurf-2-469-2014)",
    )


class TargetSettings(Settings):
    """The target: a procedural coral by name, or a mesh file."""

    kind: str = Field("branching", description=f"one of {', '.join(procedural_kinds())}, or the path of a mesh file")
    size_m: float | None = Field(
        None, ge=0.02, le=2.0, description="scale the largest extent of a mesh file to this; not of a procedural one"
    )
    seed: Seed = Field(0, description="which individual of a procedural one")
    points: int = Field(300, ge=20, le=10000, description="sample points that stand for the target's water in D")
    fragility_gain: float = Field(
        0.0, ge=0.0, le=100.0, description="points on thin or sharp places weigh 1 + this; 0 is the paper's weighting"
    )
    elasticity: Literal["by-kind", "none", "anemone", "gorgonian", "seagrass", "soft-coral"] = Field(
        "by-kind",
        description="the tissue it is made of, which says how it bends in flow, or none for a rigid one; by-kind: soft "
        "procedural targets bend, all others are rigid",
    )
    stiffness_Pa: float | None = Field(None, gt=0.0, le=1e13, description="Young's modulus instead of the tissue's")
    tissue_kg_m3: float | None = Field(None, ge=100.0, le=5000.0, description="density instead of the tissue's")
    drag: float | None = Field(None, gt=0.0, le=10.0, description="drag coefficient instead of the tissue's or 1.2")
    damping: float | None = Field(
        None, ge=0.0, le=2.0, description="damping by the tissue itself, relative to critical, instead of its own"
    )
    unanchored: UnanchoredSettings = UnanchoredSettings()

    @property
    def tissue(self) -> TissueProperties | None:
        """Properties of the target's tissue, with the values set here in place of its own; None if it is rigid."""
        name = self.elasticity if self.elasticity != "by-kind" else self.kind
        if name not in TISSUES:
            return None
        own = {
            "stiffness_Pa": self.stiffness_Pa,
            "density_kg_m3": self.tissue_kg_m3,
            "drag": self.drag,
            "damping": self.damping,
        }
        return dataclasses.replace(TISSUES[name], **{key: value for key, value in own.items() if value is not None})

    @model_validator(mode="after")
    def _size_has_a_use(self) -> Self:
        if self.size_m is not None and not is_mesh_file(self.kind):
            raise ValueError(f"size_m scales a mesh file, {self.kind} has its own size: leave it out")
        return self

    @model_validator(mode="after")
    def _tissue_has_a_use(self) -> Self:
        for name in ("stiffness_Pa", "tissue_kg_m3", "damping"):
            if getattr(self, name) is not None and self.tissue is None:
                raise ValueError(f"{name} is of a target that bends: let elasticity be one of {', '.join(TISSUES)}")
        if self.drag is not None and self.tissue is None and self.unanchored.weight_N is None:
            raise ValueError("drag is of a target that bends or lies loose: set elasticity or unanchored.weight_N too")
        return self


_BUILTIN: dict[str, tuple[str, ...]] = {
    "method": tuple(MAKERS),
    "world": (*FLOWS, *world_names()),
    "flow": FLOWS,
    "pilot": PILOTS,
}


class Scenario(Settings):
    """Settings of one trial: vehicle, target, mission, method, world, camera, reconstruction and seed."""

    name: str = Field("scan", min_length=1, max_length=80, description="what the trial is called in its report")
    seed: Seed = Field(1, description="every random draw of the trial follows from it")
    overrides: dict[str, str] = Field(
        default={},
        description="parts that were given in Python in place of the scenario's own, in words; not to be set",
    )
    method: str = Field("wake-aware", description="how thrusts are chosen: a method's name, or package.module:make")
    vehicle: str = Field("paper", description="library name or path of a vehicle file")
    ballast: tuple[BallastBlock, ...] = Field(
        (), max_length=20, description="blocks of float or lead on it: float_N, at_B_m"
    )
    world: str = Field("tank", description="a world's name (`wakewise world list`), a flow's, or package.module:make")
    flow: str | None = Field(
        None,
        description="water in place of the world's own: tank, paper (circular), lattice, lattice-jets, a plug-in",
    )
    randomize: dict[str, FieldDistribution] = Field(
        default={},
        description="fields that the seed draws, by dotted name: two numbers, or log_uniform, choice, horizontal",
    )
    pilot: str = Field(
        "route",
        description="source of the goals: route; find, which is told neither the target's shape nor its place; survey, "
        "which scans a patch of the bed by transects and orbits; human, assisted, operator, package.module:make",
    )
    control_log: str | None = Field(None, description="inputs of the pilot `operator`: controls.parquet, .csv, .yaml")
    target: TargetSettings = TargetSettings()
    calibration_error: CalibrationErrorSettings = CalibrationErrorSettings()
    mission: MissionSettings = MissionSettings()
    find: FindSettings = FindSettings()
    survey: SurveySettings = SurveySettings()
    perception: PerceptionSettings = PerceptionSettings()
    control: ControlSettings = ControlSettings()
    estimation: FilterSettings = FilterSettings()
    tank: TankSettings = TankSettings()
    imaging: ImagingSettings = ImagingSettings()
    reconstruction: ReconstructionSettings = ReconstructionSettings()

    @field_validator("method", "world", "flow", "pilot")
    @classmethod
    def _known(cls, value: str | None, info: ValidationInfo) -> str | None:
        kind = str(info.field_name)
        if value is None or {"method": "controller"}.get(kind, kind) in info.data.get("overrides", {}):
            return value  # the name of a part that was given in Python
        known = names({"flow": "world"}.get(kind, kind), dict.fromkeys(_BUILTIN[kind]))
        if value not in known and ":" not in value:
            hint = own_file(value) or guess(value, known)
            raise ValueError(f"{hint}allowed are {', '.join(known)}, or package.module:make")
        return value

    @model_validator(mode="after")
    def _find_can_be_flown(self) -> Self:
        if self.pilot == "find" and self.perception.protect == "view":
            raise ValueError("perception.protect: view has no target to scan, take target with pilot find")
        if self.pilot in ("find", "survey") and self.mission.order != "plain":
            raise ValueError(
                f"mission.order: current needs the target's place beforehand, take plain with pilot {self.pilot}"
            )
        if self.pilot == "survey" and self.perception.protect != "view":
            raise ValueError("perception.protect: target, take view with pilot survey, which has no single target")
        return self

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, value: str) -> str:
        if fault := name_fault(value):
            raise ValueError(f"names a folder, so {fault}")
        return value

    @field_validator("vehicle")
    @classmethod
    def _is_named(cls, value: str, info: ValidationInfo) -> str:
        if not value.strip():
            raise ValueError("empty: give a library name or the path of a vehicle file")
        known = draft_names()
        given = value in known or is_path(value) or "vehicle" in info.data.get("overrides", {})
        if not given and not path_of(value, "vehicle").exists():
            raise ValueError(f"{guess(value, known)}allowed are {', '.join(known)} or the path of a file")
        return value

    @classmethod
    def preset(cls, which: str = "quick", /, **changes: Any) -> Scenario:
        """The preset `which`, one of `PRESETS`, with some fields changed.

        Changes are by dotted name, such as ``method="dp"`` or ``**{"mission.standoff_m": 0.6}``. Raises InputError,
        which names the preset or field, what was found and what is allowed.

        Examples
        --------
        >>> import wakewise as ww
        >>> ww.Scenario.preset("quick", seed=3).mission.standoff_m
        0.5
        """
        return load_scenario(which, None, changes)

    @classmethod
    def load(cls, path: str | Path, which: str | None = None, /, **changes: Any) -> Scenario:
        """A scenario file, merged over a preset if one is named, with some fields changed; as for `preset`."""
        return load_scenario(which, path_of(path, "scenario"), changes)

    def replace(self, **changes: Any) -> Scenario:
        """The same scenario with some fields changed, by their dotted names; checked, and refused, as a file is."""
        plain = {name: v.model_dump() if isinstance(v, BaseModel) else v for name, v in changes.items()}
        return check_scenario(replace_fields(self.model_dump(), self.world, plain), "scenario")

    def drawn(self) -> Scenario:
        """The same scenario with a value, drawn by its seed, for each randomized field.

        Raises InputError if `randomize` names no field, or a value is not allowed there.
        """
        if not self.randomize:
            return self
        tree = self.model_dump()
        for name, value in sample_fields(self.randomize, self.seed).items():
            tree = merged(tree, with_kinds(nested(name, value)))
        try:
            return Scenario.model_validate(tree | {"randomize": {}})
        except ValidationError as fault:
            raise InputError(f"randomize: {describe_fault(fault, Scenario)}") from None

    def parts(self) -> Parts:
        """The parts of the scenario's flight, each made at first use (see `wakewise.operation.parts.build`)."""
        from wakewise.operation.parts import build

        return build(self)

    @property
    def flow_name(self) -> str:
        """Name of the water model: `flow`, else that of the named world, else the world itself."""
        if self.flow is not None:
            return self.flow
        return load_world(self.world).file.flow if self.world in world_names() else self.world


def load_scenario(preset: str | None, path: Path | None, overrides: dict[str, Any]) -> Scenario:
    """Merge a preset, its named world, a scenario file and overrides, then check the result.

    `overrides` has dotted names, such as ``{"mission.standoff_m": 0.6}``. Without preset the defaults are the lowest
    layer. Raises InputError, which names the file or field, what was found and what is allowed.
    """
    return check_scenario(merge_layers(preset, path, overrides), "scenario" if path is None else str(path))


def check_scenario(tree: dict[str, Any], source: str) -> Scenario:
    """Turn a tree of plain values into a scenario; every fault becomes one line that names the field."""
    try:
        scenario = Scenario.model_validate(tree)
    except ValidationError as fault:
        raise InputError(f"{source}: {describe_fault(fault, Scenario)}") from None
    scenario.drawn()  # a distribution of a field that is not there is refused now
    return scenario


def describe_fault(fault: ValidationError, model: type[BaseModel]) -> str:
    """One line that says which fields of `model` are wrong, what was found and what is allowed."""
    return describe_faults(fault, model, "scenario")


def dump_scenario(scenario: Scenario, versions: dict[str, str] | None = None) -> str:
    """YAML text of a scenario with all its fields; versions of software stand above as comments."""
    head = "".join(f"# {name} {version}\n" for name, version in (versions or {}).items())
    return head + yaml.safe_dump(scenario.model_dump(mode="json"), sort_keys=False, allow_unicode=True)


def write_scenario(path: Path, scenario: Scenario, versions: dict[str, str]) -> None:
    """Write a scenario as YAML, whole or not at all."""
    write_text(path, dump_scenario(scenario, versions))


def read_scenario(path: Path) -> Scenario:
    """Read the scenario.yaml of a trial."""
    return check_scenario(read_tree(path), str(path))


def differences(a: BaseModel | dict[str, Any], b: BaseModel | dict[str, Any], prefix: str = "") -> list[str]:
    """Fields in which two settings differ, as 'name value, now value', in the words of a scenario's file."""
    old, new = (one if isinstance(one, dict) else one.model_dump(mode="json", exclude_none=True) for one in (a, b))
    lines: list[str] = []
    for name in old | new:
        pair = old.get(name, "not set"), new.get(name, "not set")
        if isinstance(pair[0], dict) and isinstance(pair[1], dict):
            lines += differences(*pair, f"{prefix}{name}.")
        elif pair[0] != pair[1]:
            before, now = (value if isinstance(value, str) else json.dumps(value) for value in pair)
            lines.append(f"{prefix}{name} {before}, now {now}")
    return lines
