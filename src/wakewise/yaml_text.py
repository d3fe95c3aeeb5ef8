"""Reading YAML as people mean it: a key given twice is refused, and 12:30 is no number."""

from __future__ import annotations

import re
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from wakewise.errors import InputError


class YamlError(ValueError):
    """Text that is not YAML, or says one thing twice.

    `reason` is one line without the place; `line` counts from 1 and is None where it is not known.
    """

    def __init__(self, reason: str, line: int | None) -> None:
        super().__init__(reason if line is None else f"{reason} in line {line}")
        self.reason = reason
        self.line = line


def read_yaml(text: str) -> Any:
    """Plain values of YAML text.

    Raises
    ------
    YamlError
        If it is not YAML, nests too deep to be read, or gives a key twice, which YAML forbids.
    """
    try:
        return deepcopy(_loaded(text))
    except yaml.MarkedYAMLError as fault:
        mark = fault.problem_mark or fault.context_mark
        reason = " ".join(str(fault.problem or fault.context or "unreadable").split())
        raise YamlError(reason, mark.line + 1 if mark else None) from None
    except RecursionError:
        raise YamlError("brackets in brackets, too deep to be read", None) from None
    except (yaml.YAMLError, ValueError) as fault:
        raise YamlError(" ".join(str(fault).split()), None) from None


@lru_cache(maxsize=64)
def _loaded(text: str) -> Any:
    """Presets, worlds and vehicles are read again and again in one process; a copy costs a fiftieth of the reading."""
    return yaml.load(text, Loader=_StrictLoader)


def yaml_file(path: Path) -> Any:
    """Plain values of a file that a person wrote.

    Raises
    ------
    InputError
        If it cannot be read, or see `read_yaml`.
    """
    try:
        return read_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YamlError) as fault:
        raise InputError(f"{path}: cannot be read as YAML ({' '.join(str(fault).split())})") from fault


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice, which the plain loader lets pass, the last one winning."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"key {key.value} given more than once", key.start_mark
                    )
                seen.add(key.value)
        return dict(super().construct_mapping(node, deep=deep))


# YAML 1.1 reads 12:30 as 750, a number of base sixty, as no one expects: such texts stay texts.
_SIXTY = re.compile(r"^[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?$")
for _first in "-+0123456789":
    _StrictLoader.add_implicit_resolver("tag:yaml.org,2002:str", _SIXTY, [_first])
    _found = _StrictLoader.yaml_implicit_resolvers[_first]
    _found.insert(0, _found.pop())  # the first that fits is taken
