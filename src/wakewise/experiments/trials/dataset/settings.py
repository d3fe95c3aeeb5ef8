"""What a trial was set to and what was measured of it, from the files of a trial or of a campaign."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml
from wakewise.experiments.trials.dataset.trial_sources import TrialSource


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """A scenario as a tree and as text; nothing where a trial has none.

    Names of folders are taken out of the text: they tell of somebody's computer and lead nowhere else.
    """

    tree: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""
    wakewise: str | None = None

    def word(self, *path: str) -> str | None:
        """A name in the tree as it may be published: of a path the last part; None where there is none."""
        value: Any = self.tree
        for name in path:
            value = value.get(name) if isinstance(value, Mapping) else None
        return Path(value).name if isinstance(value, str) else None


def settings_of(source: TrialSource) -> TrialSettings:
    """Settings of a trial.

    Raises
    ------
    InputError
        If their file is there and cannot be read.
    """
    path = source.settings
    if not path.is_file():
        return TrialSettings()
    if path.suffix == ".json":
        told = _json(path).get("settings")
        tree = told.get("scenario") if isinstance(told, dict) else None
        if not isinstance(tree, dict):
            return TrialSettings()
        return TrialSettings(tree=tree, text=_without_folders(yaml.safe_dump(tree, sort_keys=False)))
    try:
        text = path.read_text(encoding="utf-8")
        tree = read_yaml(text)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text in UTF-8") from None
    except YamlError as fault:
        raise InputError(f"{path}: {fault}") from None
    version = re.search(r"^# wakewise (\S+)$", text, flags=re.M)
    return TrialSettings(
        tree=tree if isinstance(tree, dict) else {},
        text=_without_folders(text),
        wakewise=version[1] if version else None,
    )


def figures_of(source: TrialSource) -> dict[str, float]:
    """What was measured of a trial, as far as it is numbers.

    Raises
    ------
    InputError
        If their file is there and cannot be read.
    """
    if not source.figures.is_file():
        return {}
    told = _json(source.figures)
    inner = told.get("figures")
    told = inner if isinstance(inner, dict) else told
    numbers = {key: value for key, value in told.items() if isinstance(value, int | float) and key != "seed"}
    return {key: float(value) for key, value in numbers.items() if math.isfinite(value)}


def _json(path: Path) -> dict[str, Any]:
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError):
        raise InputError(f"{path}: is no JSON that can be read") from None
    return told if isinstance(told, dict) else {}


def _without_folders(text: str) -> str:
    return re.sub(r"(?m)(:\s+['\"]?)(?:/|[A-Za-z]:[\\/])[^\n'\"]*[/\\]([^/\\\n'\"]+)", r"\1\2", text)
