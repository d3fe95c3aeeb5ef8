"""Text in a xacro document: `${...}` and `$(...)` replaced by values, within limits on depth and length.

Names in a xacro document: scopes of properties, macros, and what a text means as a value.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import yaml

from wakewise.core.errors import InputError
from wakewise.robot.importers.expressions import MAX_TEXT, evaluate
from wakewise.robot.importers.packages import PackagePaths
from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation, read_text


@dataclass(frozen=True)
class MacroParameter:
    """One parameter of a macro: `block` is "", "*" or "**"; `forward` takes the caller's value of the same name."""

    name: str
    default: str | None = None
    forward: bool = False
    block: str = ""


@dataclass(frozen=True, eq=False)
class Macro:
    """A macro as defined; `scope` is where."""

    name: str
    parameters: tuple[MacroParameter, ...]
    body: Element
    scope: Scope


class Scope:
    """Properties and blocks of one level; a name not found here is sought in the parent."""

    def __init__(self, parent: Scope | None) -> None:
        self.parent = parent
        self.values: dict[str, Any] = {}
        self.raws: dict[str, tuple[str, SourceLocation]] = {}
        self.blocks: dict[str, tuple[Element, bool]] = {}
        self.pending: set[str] = set()

    @property
    def top(self) -> Scope:
        """The document's own scope."""
        scope = self
        while scope.parent is not None:
            scope = scope.parent
        return scope

    def set_raw(self, name: str, text: str, place: SourceLocation) -> None:
        """Keep a property's text; it is evaluated when it is first used."""
        self.values.pop(name, None)
        self.raws[name] = (text, place)

    def owner(self, name: str) -> Scope | None:
        """The nearest scope that holds this property."""
        scope: Scope | None = self
        while scope is not None and name not in scope.values and name not in scope.raws:
            scope = scope.parent
        return scope

    def __contains__(self, name: str) -> bool:
        """Whether this property can be seen from here."""
        return self.owner(name) is not None

    def block(self, name: str) -> tuple[Element, bool] | None:
        """A block of elements, and whether only its children are meant."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.blocks:
                return scope.blocks[name]
            scope = scope.parent
        return None


_PARAMETER = re.compile(
    r"""\s*(?P<block>\*{0,2})(?P<name>[^\s=:*]+)(?:\s*:?=\s*(?P<forward>\^\|?)?(?P<default>(?:'[^']*'|"[^"]*"|\$\{[^}]*\}|\$\([^)]*\)|[^\s'"$])*))?"""
)


def parse_parameters(text: str, place: SourceLocation) -> tuple[MacroParameter, ...]:
    """Read a macro's parameter list, such as `prefix *origin id:=1 parent:=^|base_link`."""
    found: list[MacroParameter] = []
    at = 0
    text = text.strip()
    while at < len(text):
        match = _PARAMETER.match(text, at)
        if match is None or match.end() == at:
            raise PlacedError(f"{place}: macro parameters {text[at : at + 40]!r} cannot be read")
        at = match.end()
        default = match["default"]
        if default is not None and len(default) > 1 and default[0] == default[-1] and default[0] in "'\"":
            default = default[1:-1]
        elif default == "" and match["forward"]:
            default = None
        found.append(MacroParameter(match["name"], default, bool(match["forward"]), match["block"]))
    return tuple(found)


def literal(value: Any) -> Any:
    """What a property's text means: an integer, a number, true or false, or the text itself."""
    if not isinstance(value, str):
        return value
    text = value.strip()
    if len(text) > 1 and text[0] == text[-1] == "'":
        return text[1:-1]
    if text in {"true", "True"}:
        return True
    if text in {"false", "False"}:
        return False
    if "_" in text or len(text) > 40:
        return value
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return value


MAX_CALLS = 60
"""Macros, includes and properties within one another."""
MAX_TOTAL_TEXT = 20_000_000

_PIECES = re.compile(r"\$\$+(?=[{(])|\$\{(?:[^{}]|\{[^{}]*\})*\}|\$\([^)]*\)|\$|[^$]+", re.DOTALL)


class TextSubstitution:
    """Puts values into the text of one document, and counts how deep and how long that gets.

    `folders`: finds packages, and keeps `load_yaml` inside. `arguments`: values of `$(arg NAME)`; the document adds its
    defaults.
    """

    def __init__(self, folders: PackagePaths, arguments: Mapping[str, str]) -> None:
        self.folders = folders
        self.arguments: dict[str, str] = dict(arguments)
        self._depth = 0
        self._length = 0

    @contextmanager
    def deeper(self, place: SourceLocation) -> Iterator[None]:
        """Count one more level while the block runs.

        Raises InputError beyond `MAX_CALLS` levels.
        """
        if self._depth >= MAX_CALLS:
            raise PlacedError(f"{place}: macros, includes and properties within one another more than {MAX_CALLS} deep")
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1

    def string(self, text: str, scope: Scope, place: SourceLocation) -> str:
        """Text with its values put in."""
        return text if "$" not in text else _as_text(self.value(text, scope, place))

    def value(self, text: str, scope: Scope, place: SourceLocation) -> Any:
        """Value of a text with `${...}` and `$(...)` in it; a lone `${...}` keeps its type."""
        if "$" not in text:
            return text
        parts: list[Any] = []
        for piece in _PIECES.findall(text):
            if piece.startswith("$$"):
                parts.append(piece[1:])
            elif piece.startswith("${"):
                parts.append(self._expression(piece[2:-1], scope, place))
            elif piece.startswith("$("):
                parts.append(self._substitution(piece[2:-1], scope, place))
            else:
                parts.append(piece)
        if len(parts) == 1:
            return parts[0]
        joined = "".join(_as_text(part) for part in parts)
        self._length += len(joined)
        if len(joined) > MAX_TEXT + len(text) or self._length > MAX_TOTAL_TEXT:
            raise PlacedError(f"{place}: expands to more text than is read")
        return joined

    def _expression(self, text: str, scope: Scope, place: SourceLocation) -> Any:
        if "$(" in text:
            text = self.string(text, scope, place)
        functions = {
            "load_yaml": lambda name: self._load_yaml(name, place),
            "arg": lambda name: literal(self._named_argument(name, place)),
        }
        with self.deeper(place):
            try:
                return evaluate(text, lambda name: self.lookup(name, scope), functions)
            except PlacedError:
                raise
            except InputError as fault:
                raise PlacedError(f"{place}: {fault}") from fault

    def lookup(self, name: str, scope: Scope) -> Any:
        """Value of a property; its text is evaluated on first use. Raises KeyError if there is none."""
        owner = scope.owner(name)
        if owner is None:
            raise KeyError(name)
        if name in owner.values:
            return owner.values[name]
        raw, where = owner.raws[name]
        if name in owner.pending:
            raise InputError(f"property {name} refers to itself")
        owner.pending.add(name)
        try:
            value = literal(self.value(raw, owner, where))
        except KeyError as fault:
            raise PlacedError(f"{where}: {fault.args[0]} is not defined") from fault
        finally:
            owner.pending.discard(name)
        owner.values[name] = value
        return value

    def _substitution(self, text: str, scope: Scope, place: SourceLocation) -> Any:
        word, _, rest = text.strip().partition(" ")
        rest = self.string(rest.strip(), scope, place)
        match word:
            case "arg":
                return self._named_argument(rest, place)
            case "find" | "find-pkg-share":
                folder = self.folders.package(rest)
                return f"package://{rest}" if folder is None else str(folder)
            case "dirname" | "cwd":
                return str(place.file.parent)
            case "env":
                # The environment is no part of a vehicle: the text stays as it is, and opens no file.
                return f"$(env {rest})"
            case "optenv":
                return rest.partition(" ")[2].strip()
            case "eval":
                return self._expression(rest, scope, place)
            case _:
                raise PlacedError(f"{place}: $({text[:40]}) is not read; arg, find, dirname, optenv and eval are")

    def _named_argument(self, name: str, place: SourceLocation) -> str:
        if name not in self.arguments:
            raise PlacedError(f"{place}: argument {name} has no value; give --arg {name}:=VALUE")
        return self.arguments[name]

    def _load_yaml(self, name: str, place: SourceLocation) -> Any:
        path = self.folders.locate(name, place.file.parent, place)
        try:
            return yaml.safe_load(read_text(path))
        except (yaml.YAMLError, ValueError, RecursionError) as fault:
            raise PlacedError(f"{path}: not readable YAML ({type(fault).__name__})") from fault


def _as_text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    text = str(value)
    if len(text) > MAX_TEXT * 10:
        raise InputError("a text too long")
    return text
