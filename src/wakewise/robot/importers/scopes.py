"""Names in a xacro document: scopes of properties, macros, and what a text means as a value."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation


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
