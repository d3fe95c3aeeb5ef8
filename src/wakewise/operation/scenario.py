"""A scenario: everything a trial needs to know, as one frozen, checked record; read from and written to YAML.

What a scenario may say of the target.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import yaml
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator, model_validator

from wakewise.control import MAKERS, ControlSettings
from wakewise.core.checks import path_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.files import name_fault, write_text
from wakewise.core.plugins import names
from wakewise.core.safe_yaml import YamlError, read_yaml, text_of
from wakewise.core.settings import Seed, Settings, describe_faults, guess
from wakewise.estimation import FilterSettings
from wakewise.operation.calibration_error import CalibrationErrorSettings
from wakewise.operation.pilot_makers import PILOTS
from wakewise.operation.randomization import FieldDistribution, sample_fields
from wakewise.operation.worlds.library import load_world, own_file, world_names
from wakewise.operation.worlds.makers import WORLDS
from wakewise.robot.vehicles.ballast import BallastBlock
from wakewise.scene.missions import MissionSettings
from wakewise.scene.targets import TISSUES, TissueProperties, coral_kinds, is_mesh_file
from wakewise.simulation.tank import TankSettings
from wakewise.simulation.tank.settings import SILTS
from wakewise.vision.imaging import ImagingSettings
from wakewise.vision.imaging.settings import CAMERAS
from wakewise.vision.reconstruction import ReconstructionSettings

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts


class UnanchoredSettings(Settings):
    """Whether the target lies on the bed without being held, and how."""

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
    """What is looked at: a procedural coral by name, or a mesh file."""

    kind: str = Field("branching", description=f"one of {', '.join(coral_kinds())}, or the path of a mesh file")
    size_m: float | None = Field(
        None, ge=0.02, le=2.0, description="scale the largest extent of a mesh file to this; not of a procedural one"
    )
    seed: Seed = Field(0, description="which individual of a procedural coral")
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
        """What the target is made of, with what is set in place of the tissue's own; None of a rigid one."""
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


_OWN: dict[str, Mapping[str, Any]] = {
    "method": MAKERS,
    "world": {**WORLDS, **dict.fromkeys(world_names())},
    "flow": WORLDS,
    "pilot": PILOTS,
}

PRESETS = ("quick", "standard")


class Scenario(Settings):
    """One trial, resolved: vehicle, target, mission, method, world, camera, reconstruction and seed."""

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
        default={}, description="fields that the seed draws, by dotted name: two numbers, or log_uniform, choice, level"
    )
    pilot: str = Field("route", description="who leads: route, human, assisted, operator, package.module:make")
    control_log: str | None = Field(None, description="hands of the pilot `operator`: controls.parquet, .csv, .yaml")
    target: TargetSettings = TargetSettings()
    calibration_error: CalibrationErrorSettings = CalibrationErrorSettings()
    mission: MissionSettings = MissionSettings()
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
            return value  # what the part that was given calls itself
        known = names({"flow": "world"}.get(kind, kind), _OWN[kind])
        if value not in known and ":" not in value:
            hint = own_file(value) or guess(value, known)
            raise ValueError(f"{hint}allowed are {', '.join(known)}, or package.module:make")
        return value

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, value: str) -> str:
        if fault := name_fault(value):
            raise ValueError(f"names a folder, so {fault}")
        return value

    @field_validator("vehicle")
    @classmethod
    def _not_empty(cls, value: str) -> str:
        if not value.strip():
            raise ValueError("empty: give a library name or the path of a vehicle file")
        return value

    @classmethod
    def preset(cls, which: str = "quick", /, **changes: Any) -> Scenario:
        """A preset, with some fields changed.

        Parameters
        ----------
        which : str
            One of `PRESETS`.
        **changes
            Fields by their dotted names, such as ``method="dp"`` or ``**{"mission.standoff_m": 0.6}``.

        Raises
        ------
        InputError
            Naming the preset or field, what was found and what is allowed.

        Examples
        --------
        >>> import wakewise as ww
        >>> ww.Scenario.preset("quick", seed=3).mission.standoff_m
        0.5
        """
        return load_scenario(which, None, changes)

    @classmethod
    def load(cls, path: str | Path, which: str | None = None, /, **changes: Any) -> Scenario:
        """A scenario file, laid over a preset if one is named, with some fields changed; as for `preset`."""
        return load_scenario(which, path_of(path, "scenario"), changes)

    def replace(self, **changes: Any) -> Scenario:
        """The same scenario with some fields changed, by their dotted names; checked as a file is.

        Raises
        ------
        InputError
            Naming the field, what was found and what is allowed.
        """
        tree = self.model_dump()
        if "world" in changes and changes["world"] != self.world:
            _leave(tree, self.world)
            tree = _laid(tree, _world_layer(changes["world"]))
        for name, value in changes.items():
            new = value.model_dump() if isinstance(value, BaseModel) else value
            tree = _laid(tree, _nested(name, new))
        return check_scenario(tree, "scenario")

    def drawn(self) -> Scenario:
        """The same scenario with what its seed draws in place of its draws: the one world that is flown.

        Raises
        ------
        InputError
            If a draw names no field, or gives what its field does not allow.
        """
        if not self.randomize:
            return self
        tree = self.model_dump()
        for name, value in sample_fields(self.randomize, self.seed).items():
            tree = _merged(tree, _with_kinds(_nested(name, value)))
        try:
            return Scenario.model_validate(tree | {"randomize": {}})
        except ValidationError as fault:
            raise InputError(f"randomize: {describe_fault(fault, Scenario)}") from None

    def parts(self) -> Parts:
        """What the scenario's flight is built from, each part made when asked for."""
        from wakewise.operation.parts import Parts

        return Parts(self)


def load_scenario(preset: str | None, path: Path | None, overrides: dict[str, Any]) -> Scenario:
    """Lay a scenario file over a preset and the overrides over both, then check the whole.

    A world of the library that one of them names lies between the preset and the file: it gives values, and draws,
    which yield to what file and overrides say of their fields.

    A kind of silt (`tank.silt.kind`) sets load and grains, one of camera (`imaging.kind`) its fields: they replace
    those of the layers below it, where a scenario that a trial left behind spells them out, and yield to what its own
    layer, or one above, says of them.

    Parameters
    ----------
    preset : str or None
        One of `PRESETS`; None starts from the defaults.
    path : Path or None
        A scenario YAML file, which may hold any part of a scenario.
    overrides : dict
        Dotted field names to values, such as ``{"mission.standoff_m": 0.6}``.

    Raises
    ------
    InputError
        Naming the file or field, what was found and what is allowed.
    """
    layers: list[dict[str, Any]] = []
    source = "scenario"
    if preset is not None:
        if not isinstance(preset, str) or preset not in PRESETS:
            raise InputError(f"--preset: '{quoted(preset)}', allowed are {', '.join(PRESETS)}")
        text = resources.files("wakewise.operation").joinpath("presets", f"{preset}.yaml").read_text(encoding="utf-8")
        layers.append(read_yaml(text))
    if path is not None:
        source = str(path)
        layers.append(_read_yaml(path))
    changes: dict[str, Any] = {}
    for name, value in overrides.items():
        changes = _merged(changes, _nested(name, value))
    layers.append(changes)
    world = next((layer["world"] for layer in reversed(layers) if "world" in layer), None)
    layers.insert(0 if preset is None else 1, _world_layer(world))
    tree: dict[str, Any] = {}
    for layer in layers:
        tree = _laid(tree, layer)
    return check_scenario(tree, source)


def check_scenario(tree: dict[str, Any], source: str) -> Scenario:
    """Turn a tree of plain values into a scenario; every fault becomes one line that names the field."""
    try:
        scenario = Scenario.model_validate(tree)
    except ValidationError as fault:
        raise InputError(f"{source}: {describe_fault(fault, Scenario)}") from None
    scenario.drawn()  # so that a draw of what is not there is told of now
    return scenario


def describe_fault(fault: ValidationError, model: type[BaseModel]) -> str:
    """Say in one line which fields of `model` are wrong, what was found and what is allowed."""
    return describe_faults(fault, model, "scenario")


def parse_overrides(items: list[str]) -> dict[str, Any]:
    """Parse ``field=value`` pairs of the command line; values are YAML, so numbers, lists and null work."""
    overrides: dict[str, Any] = {}
    for item in items:
        name, equals, text = item.partition("=")
        if not equals or not name.strip():
            raise InputError(f"--set: '{item}', must be FIELD=VALUE such as mission.standoff_m=0.6")
        try:
            overrides[name.strip()] = read_yaml(text)
        except YamlError as fault:
            shown = text if len(text) <= 60 else text[:60] + "..."
            raise InputError(f"--set {name.strip()}: '{shown}' is not a value that YAML can read ({fault})") from None
    return overrides


def dump_scenario(scenario: Scenario, versions: dict[str, str] | None = None) -> str:
    """YAML text of a scenario, everything resolved, with the versions that ran it as comments."""
    head = "".join(f"# {name} {version}\n" for name, version in (versions or {}).items())
    return head + yaml.safe_dump(scenario.model_dump(mode="json"), sort_keys=False, allow_unicode=True)


def write_scenario(path: Path, scenario: Scenario, versions: dict[str, str]) -> None:
    """Write a scenario whole or not at all."""
    write_text(path, dump_scenario(scenario, versions))


def read_scenario(path: Path) -> Scenario:
    """Read a scenario that a trial left behind."""
    return check_scenario(_read_yaml(path), str(path))


def differences(a: BaseModel, b: BaseModel, prefix: str = "") -> list[str]:
    """Fields in which two settings differ, as 'name value, now value'."""
    lines: list[str] = []
    for name in type(a).model_fields:
        old, new = getattr(a, name), getattr(b, name)
        if isinstance(old, BaseModel) and isinstance(new, BaseModel):
            lines += differences(old, new, f"{prefix}{name}.")
        elif old != new:
            lines.append(f"{prefix}{name} {old}, now {new}")
    return lines


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        tree = read_yaml(text_of(path))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, a scenario YAML file is needed") from None
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read as text, a scenario YAML file is needed") from None
    except YamlError as fault:
        line = "" if fault.line is None else f" line {fault.line}"
        raise InputError(f"{path}{line}: not YAML ({fault.reason})") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path}: holds {type(tree).__name__}, must hold fields of a scenario such as 'seed: 1'")
    return tree


def _with_silt(layer: dict[str, Any]) -> dict[str, Any]:
    """The layer with what its kind of silt says and it does not, so that this replaces what lies below."""
    tank = layer.get("tank")
    silt = tank.get("silt") if isinstance(tank, dict) else None
    if not isinstance(tank, dict) or not isinstance(silt, dict) or not isinstance(silt.get("kind"), str):
        return layer
    return layer | {"tank": tank | {"silt": SILTS.get(silt["kind"], {}) | silt}}


def _world_layer(name: Any) -> dict[str, Any]:
    """What a world of the library says; nothing for a name that is none."""
    return load_world(name).layer() if name in world_names() else {}


def _leave(tree: dict[str, Any], name: str) -> None:
    """Take what a world said, and nobody changed since, out of a scenario's tree."""
    if name not in world_names():
        return
    world = load_world(name)
    for dotted in world.randomize:
        tree["randomize"].pop(dotted, None)
    for dotted, value in world.values.items():
        *parents, leaf = dotted.split(".")
        branch = tree
        for parent in parents:
            branch = branch.get(parent, {})
        found = branch.get(leaf)
        if found == (tuple(value) if isinstance(found, tuple) else value):
            del branch[leaf]


def _laid(tree: dict[str, Any], layer: dict[str, Any]) -> dict[str, Any]:
    """The layer over the tree; draws of fields that the layer gives are gone."""
    full = _with_kinds(layer)
    given = _leaves({name: value for name, value in full.items() if name != "randomize"})
    draws = tree.get("randomize", {})
    kept = {name: draw for name, draw in draws.items() if not any(f"{name}.".startswith(f"{g}.") for g in given)}
    drawn = {**kept, **full.get("randomize", {})}  # a draw takes the place of another whole
    rest = {name: value for name, value in full.items() if name != "randomize"}
    return _merged(tree, rest) | ({"randomize": drawn} if draws or drawn else {})


def _leaves(tree: dict[str, Any], prefix: str = "") -> list[str]:
    """Dotted names of what a tree gives values."""
    found: list[str] = []
    for key, value in tree.items():
        found += _leaves(value, f"{prefix}{key}.") if isinstance(value, dict) else [f"{prefix}{key}"]
    return found


def _with_kinds(layer: dict[str, Any]) -> dict[str, Any]:
    """The layer with what its kinds of silt and camera say and it does not."""
    return _with_camera(_with_silt(layer))


def _with_camera(layer: dict[str, Any]) -> dict[str, Any]:
    """The same for its kind of camera; `still` takes back what another kind had set."""
    imaging = layer.get("imaging")
    if not isinstance(imaging, dict) or not isinstance(imaging.get("kind"), str):
        return layer
    fields, own = ImagingSettings.model_fields, {name for kind in CAMERAS.values() for name in kind}
    usual = {name: fields[name].default for name in own}
    return layer | {"imaging": usual | CAMERAS.get(imaging["kind"], {}) | imaging}


def _nested(dotted: str, value: Any) -> dict[str, Any]:
    tree: Any = value
    for part in reversed(dotted.split(".")):
        tree = {part: tree}
    return dict(tree)


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result
