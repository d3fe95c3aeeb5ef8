"""YAML read safely: text only, no tags, no repeated aliases without end, and a line number on every list and table."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.importers.xml import PlacedError, SourceLocation, number

MAX_TEXT = 600_000
"""Longest YAML text that is read; parsing it takes a few seconds."""
_COMMENT = re.compile(r"(?:^|\s)#+(.*)")
MAX_NODES = 100_000
MAX_DEPTH = 40


@dataclass(eq=False)
class YamlNode:
    """A value in a YAML file: text, a list of items, or a table of items.

    `seen` is set where a reader takes the value; `comments` are those of the whole file, at its root only.
    """

    value: str | list[YamlNode] | dict[str, YamlNode]
    place: SourceLocation
    seen: bool = False
    comments: list[tuple[str, SourceLocation]] = field(default_factory=list)

    def table(self) -> dict[str, YamlNode]:
        """The table; empty if this is something else."""
        return self.value if isinstance(self.value, dict) else {}

    def items(self) -> list[YamlNode]:
        """The list; empty if this is something else."""
        return self.value if isinstance(self.value, list) else []

    def get(self, *keys: str) -> YamlNode | None:
        """The first of these keys that the table has."""
        return next((self.table()[key] for key in keys if key in self.table()), None)

    def walk(self, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], YamlNode]]:
        """Every item below a table's keys with the keys that lead to it, outermost first."""
        for key, item in self.table().items():
            yield (*path, key), item
            yield from item.walk((*path, key))

    def words(self) -> str:
        """The text; "" if this is something else."""
        self.seen = True
        return self.value if isinstance(self.value, str) else ""

    def unread(self, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], YamlNode]]:
        """The outermost keys below this of which no reader took anything, with what leads to them."""
        members = list(self.table().items()) or [("", item) for item in self.items() if item.table()]
        for key, item in members:
            if item.seen:
                continue
            if any(below.seen for _, below in item.walk_all()):
                yield from item.unread((*path, key))
            else:
                yield (*path, key), item

    def walk_all(self) -> Iterator[tuple[tuple[str, ...], YamlNode]]:
        """Every item below this one, in tables and in lists."""
        for key, item in [*self.table().items(), *(("", item) for item in self.items())]:
            yield (key,), item
            yield from item.walk_all()

    def scalar(self, what: str) -> float:
        """The number; refuses anything else."""
        self.seen = True
        if not isinstance(self.value, str):
            raise PlacedError(f"{self.place}: {what} must be a number")
        return number(self.value, self.place, what)

    def numbers(self, what: str, count: int | None = None) -> Array:
        """A flat list of numbers; lists within lists are joined."""
        self.seen = True
        flat = list(self._flat(what))
        if count is not None and len(flat) != count:
            raise PlacedError(f"{self.place}: {what} has {len(flat)} numbers, must have {count}")
        return np.array(flat, dtype=np.float64)

    def rows(self, what: str) -> Array:
        """A list of lists of numbers, all of one length, as a matrix."""
        self.seen = True
        rows = [row.numbers(f"a row of {what}") for row in self.items()]
        lengths = {len(row) for row in rows}
        if not rows or len(lengths) != 1:
            raise PlacedError(f"{self.place}: {what} has rows of {sorted(lengths)} numbers, all must be of one length")
        return np.stack(rows)

    def is_matrix(self) -> bool:
        """Whether this is a list of lists."""
        return bool(self.items()) and all(isinstance(row.value, list) for row in self.items())

    def is_numbers(self) -> bool:
        """Whether this is a list whose first element is a number."""
        first = self.items()[0].value if self.items() else None
        if not isinstance(first, str):
            return False
        try:
            float(first)
        except ValueError:
            return False
        return True

    def _flat(self, what: str) -> Iterator[float]:
        if isinstance(self.value, dict):
            raise PlacedError(f"{self.place}: {what} must be a list of numbers")
        if isinstance(self.value, str):
            yield number(self.value, self.place, what)
            return
        for item in self.value:
            yield from item._flat(what)


def parse_yaml(text: str, path: Path) -> YamlNode:
    """Parse YAML (or JSON) text.

    Raises InputError if it is not YAML or exceeds the limits above.
    """
    if len(text) > MAX_TEXT:
        raise InputError(f"{path}: {len(text)} characters, YAML of at most {MAX_TEXT} is read")
    try:
        root = yaml.compose(text, Loader=yaml.BaseLoader)
        if root is None:
            raise InputError(f"{path}: holds nothing")
        item = _Converter(path).item(root, 0)
    except yaml.MarkedYAMLError as fault:
        line = fault.problem_mark.line + 1 if fault.problem_mark else 1
        raise PlacedError(f"{path}:{line}: neither XML nor YAML ({fault.problem})") from fault
    except (yaml.YAMLError, ValueError) as fault:
        raise InputError(f"{path}: neither XML nor YAML ({type(fault).__name__})") from fault
    except RecursionError as fault:
        raise InputError(f"{path}: lists nested too deeply") from fault
    item.comments = [
        (match[1].strip(), SourceLocation(path, i))
        for i, line in enumerate(text.splitlines(), 1)
        if (match := _COMMENT.search(line))
    ]
    return item


class _Converter:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.count = 0

    def item(self, node: yaml.Node, depth: int) -> YamlNode:
        place = SourceLocation(self.path, node.start_mark.line + 1 if node.start_mark else 1)
        self.count += 1
        if depth > MAX_DEPTH:
            raise PlacedError(f"{place}: nested more than {MAX_DEPTH} deep")
        if self.count > MAX_NODES:
            raise PlacedError(f"{place}: more than {MAX_NODES} values")
        if isinstance(node, yaml.SequenceNode):
            return YamlNode([self.item(child, depth + 1) for child in node.value], place)
        if isinstance(node, yaml.MappingNode):
            table: dict[str, YamlNode] = {}
            for key, child in node.value:
                if isinstance(key, yaml.ScalarNode):
                    if key.value in table:
                        line = key.start_mark.line + 1 if key.start_mark else place.line
                        raise PlacedError(f"{SourceLocation(self.path, line)}: {str(key.value)[:80]} stands twice")
                    table[str(key.value)] = self.item(child, depth + 1)
            return YamlNode(table, place)
        return YamlNode(str(node.value), place)
