"""Reading YAML as people mean it: a key given twice is refused, and 12:30 is no number."""

from __future__ import annotations

import re
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from wakewise.core.checks import path_of
from wakewise.core.errors import InputError

MOST_BYTES = 4_000_000
"""A file that a person wrote is smaller, with tables of measured values in it, too."""
MOST_DIGITS = 100
"""Longest whole number that is read as one."""


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

    Raises YamlError if it is not YAML, is longer than `MOST_BYTES`, nests too deep to be read or refers to itself, or
    gives a key twice, which YAML forbids.
    """
    if len(text) > MOST_BYTES:
        raise YamlError(f"{1e-6 * len(text):.1f} million characters, at most {1e-6 * MOST_BYTES:g}", None)
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
    tree = yaml.load(text, Loader=_StrictLoader)
    if _refers_to_itself(tree):
        raise YamlError("an alias stands within what it refers to", None)
    return tree


def _refers_to_itself(tree: Any) -> bool:
    """Whether a list or mapping holds itself, however deep."""
    above: set[int] = set()
    done: set[int] = set()
    waiting: list[tuple[Any, bool]] = [(tree, False)]
    while waiting:
        node, is_left = waiting.pop()
        if not isinstance(node, dict | list):
            continue
        if is_left:
            above.discard(id(node))
            done.add(id(node))
        elif id(node) in above:
            return True
        elif id(node) not in done:
            above.add(id(node))
            waiting.append((node, True))
            waiting += [(inner, False) for inner in (node.values() if isinstance(node, dict) else node)]
    return False


def text_of(path: Path, most_bytes: int = MOST_BYTES, encoding: str = "utf-8") -> str:
    """Text of a file that a person or a program wrote; of a larger one than allowed no more is read than shows it.

    Raises InputError if no file can have that name; OSError, UnicodeDecodeError if it cannot be read as text; YamlError
    if it is larger than `most_bytes`.
    """
    with path_of(path, "file").open("rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise YamlError(f"larger than {1e-6 * most_bytes:g} MB, which no such file is", None)
    return data.decode(encoding)


def yaml_file(path: Path) -> Any:
    """Plain values of a file that a person wrote.

    Raises InputError if it cannot be read, or see `read_yaml`.
    """
    try:
        return read_yaml(text_of(path))
    except (OSError, UnicodeDecodeError, YamlError) as fault:
        why = getattr(fault, "strerror", None) or " ".join(str(fault).split())  # without the path once more
        raise InputError(f"{path}: cannot be read as YAML ({why})") from fault


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice, which the plain loader lets pass, the last one winning.

    Whole numbers of more than `MOST_DIGITS` digits are refused, too: to write one in a message takes minutes.
    """

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > MOST_DIGITS:
            words = f"a number of {len(node.value)} digits, at most {MOST_DIGITS}"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark)
        return int(super().construct_yaml_int(node))

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


_StrictLoader.add_constructor("tag:yaml.org,2002:int", _StrictLoader.construct_yaml_int)
# YAML 1.1 reads 12:30 as 750, a number of base sixty, as no one expects: such texts stay texts.
_SIXTY = re.compile(r"^[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?$")
for _first in "-+0123456789":
    _StrictLoader.add_implicit_resolver("tag:yaml.org,2002:str", _SIXTY, [_first])
    _found = _StrictLoader.yaml_implicit_resolvers[_first]
    _found.insert(0, _found.pop())  # the first that fits is taken
