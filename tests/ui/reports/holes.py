"""Copies of a tree of figures, each with one of them missing."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

Place = tuple[Any, ...]


def figure_places(tree: Any, place: Place = ()) -> Iterator[Place]:
    """Where the figures of a tree of mappings, lists and records are: numbers, truth values, and None."""
    if dataclasses.is_dataclass(tree):
        for field in dataclasses.fields(tree):
            yield from figure_places(getattr(tree, field.name), (*place, field.name))
    elif isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from figure_places(value, (*place, key))
    elif isinstance(tree, list | tuple):
        for key, value in enumerate(tree):
            yield from figure_places(value, (*place, key))
    elif tree is None or isinstance(tree, bool | int | float):
        yield place


def without(tree: Any, place: Place) -> Any:
    """The tree with None at a place; the tree itself stays as it is."""
    if not place:
        return None
    key, rest = place[0], place[1:]
    if dataclasses.is_dataclass(tree):
        return dataclasses.replace(tree, **{key: without(getattr(tree, key), rest)})
    if isinstance(tree, Mapping):
        return {**tree, key: without(tree[key], rest)}
    return type(tree)(without(value, rest) if k == key else value for k, value in enumerate(tree))


def with_holes(tree: Any) -> Iterator[tuple[str, Any]]:
    """Name of a figure and the tree without it, each figure in turn; last the tree without any."""
    bare = tree
    for place in figure_places(tree):
        yield "/".join(map(str, place)), without(tree, place)
        bare = without(bare, place)
    yield "all", bare
