"""Layers of a scenario: trees of plain values, each merged over the ones below it.

From low to high: preset, named world (`wakewise.operation.worlds.library`), scenario file, overrides. A field that a
layer gives a value loses the distribution that a lower layer gave it.

A kind of silt (`tank.silt.kind`) stands for load and grains, a kind of camera (`imaging.kind`) for its fields. The kind
replaces these fields in lower layers; fields of the same layer or of a higher one replace those of the kind.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from wakewise.core.checks import quoted
from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml, text_of
from wakewise.core.settings import guess
from wakewise.operation.worlds.library import load_world, world_names
from wakewise.simulation.tank.settings import SILTS
from wakewise.vision.imaging import ImagingSettings
from wakewise.vision.imaging.settings import CAMERAS

PRESETS = ("quick", "standard", "reef")

Tree = dict[str, Any]
"""Plain values by field name; a group of fields is a tree."""


def merge_layers(preset: str | None, path: Path | None, overrides: dict[str, Any]) -> Tree:
    """The tree of a preset, the scenario's named world, a scenario file and dotted overrides, the last one on top.

    Raises InputError, which names preset, file or line.
    """
    layers: list[Tree] = []
    if preset is not None:
        if not isinstance(preset, str) or preset not in PRESETS:
            near = guess(preset, tuple(PRESETS)) if isinstance(preset, str) else ""
            raise InputError(f"preset {quoted(preset)}: {near}allowed are {', '.join(PRESETS)}")
        text = resources.files("wakewise.operation").joinpath("presets", f"{preset}.yaml").read_text(encoding="utf-8")
        layers.append(read_yaml(text))
    if path is not None:
        layers.append(read_tree(path))
    changes: Tree = {}
    for name, value in overrides.items():
        changes = merged(changes, nested(name, value))
    layers.append(changes)
    world = next((layer["world"] for layer in reversed(layers) if "world" in layer), None)
    layers.insert(0 if preset is None else 1, _world_layer(world))
    tree: Tree = {}
    for layer in layers:
        tree = overlay(tree, layer)
    return tree


def replace_fields(tree: Tree, world: str, changes: dict[str, Any]) -> Tree:
    """The tree of a scenario that is flown in `world`, with some fields changed, by their dotted names.

    Another world replaces what the old one gave and nobody changed since.
    """
    if "world" in changes and changes["world"] != world:
        _remove_world(tree, world)
        tree = overlay(tree, _world_layer(changes["world"]))
    for name, value in changes.items():
        tree = overlay(tree, nested(name, value))
    return tree


def read_tree(path: Path) -> Tree:
    """The tree in a YAML file; raises InputError, which names the file and, where it is not YAML, the line."""
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


def nested(dotted: str, value: Any) -> Tree:
    """The tree in which a dotted name has a value."""
    tree: Any = value
    for part in reversed(dotted.split(".")):
        tree = {part: tree}
    return dict(tree)


def merged(below: Tree, above: Tree) -> Tree:
    """Both trees as one; where both have a value, that of `above`."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result


def overlay(tree: Tree, layer: Tree) -> Tree:
    """The layer merged over the tree; distributions of fields that the layer gives a value are removed."""
    full = with_kinds(layer)
    rest = {name: value for name, value in full.items() if name != "randomize"}
    given = _leaves(rest)
    draws = tree.get("randomize", {})
    kept = {name: draw for name, draw in draws.items() if not any(f"{name}.".startswith(f"{g}.") for g in given)}
    drawn = {**kept, **full.get("randomize", {})}  # a distribution replaces another as a whole
    return merged(tree, rest) | ({"randomize": drawn} if draws or drawn else {})


def with_kinds(layer: Tree) -> Tree:
    """The layer with the fields that its kinds of silt and camera stand for, unless the layer itself gives them."""
    tank = layer.get("tank")
    silt = tank.get("silt") if isinstance(tank, dict) else None
    if isinstance(tank, dict) and isinstance(silt, dict) and isinstance(silt.get("kind"), str):
        layer = layer | {"tank": tank | {"silt": SILTS.get(silt["kind"], {}) | silt}}
    imaging = layer.get("imaging")
    if isinstance(imaging, dict) and isinstance(imaging.get("kind"), str):
        # `still` has no fields of its own: the defaults undo those of another kind below.
        defaults = {name: ImagingSettings.model_fields[name].default for kind in CAMERAS.values() for name in kind}
        layer = layer | {"imaging": defaults | CAMERAS.get(imaging["kind"], {}) | imaging}
    return layer


def _world_layer(name: Any) -> Tree:
    """The layer of a named world; empty for any other name."""
    return load_world(name).layer() if name in world_names() else {}


def _remove_world(tree: Tree, name: str) -> None:
    """Take what a world gave, and nobody changed since, out of a scenario's tree."""
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


def _leaves(tree: Tree, prefix: str = "") -> list[str]:
    """Dotted names of the values in a tree."""
    found: list[str] = []
    for key, value in tree.items():
        found += _leaves(value, f"{prefix}{key}.") if isinstance(value, dict) else [f"{prefix}{key}"]
    return found
