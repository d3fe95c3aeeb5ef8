"""Lazy imports: the names that a package exports are imported when they are first used (PEP 562).

A package's `__init__` states what it exports as plain imports in a block `if TYPE_CHECKING:`, which type checkers and
the import contracts read, and hands itself to `lazy_attributes`, which reads the same block: nothing is listed twice.
So settings can be read without the package's compiled libraries, and commands that need little start fast.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from wakewise.core.errors import MissingExtra
from wakewise.core.optional_dependencies import missing_extra


class _LazyPackage(ModuleType):
    """A package whose exports are imported at first use (PEP 562, as a class: see `__setattr__`)."""

    _homes: dict[str, tuple[str, str]]
    _extras: tuple[str, ...]

    def __getattr__(self, name: str) -> Any:
        home = self.__dict__["_homes"].get(name)
        if home is None:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        try:
            value = _imported(*home)
        except (ModuleNotFoundError, MissingExtra) as fault:
            # Another lazy package may have refused on the way: the error names what was asked for here.
            missing = fault.__cause__ if isinstance(fault, MissingExtra) else fault
            if not isinstance(missing, ModuleNotFoundError):
                raise
            refusal = missing_extra(f"{self.__name__}.{name}", missing, *self._extras)
            if refusal is None:
                raise
            raise refusal from missing
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute, but leave an export alone when a module of the same name is imported below the package."""
        if not (isinstance(value, ModuleType) and name in self.__dict__["_homes"]):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        """The exports, and what every module has; not what the page itself imported."""
        return sorted({*self._homes, *(name for name in self.__dict__ if name.startswith("__"))})


def lazy_attributes(name: str, *extras: str) -> None:
    """Make a package import its exports lazily; called as ``lazy_attributes(__name__)`` in its `__init__`.

    Parameters
    ----------
    name : str
        Of the package; what its `if TYPE_CHECKING:` block imports from elsewhere is what it exports.
    *extras : str
        Extras to name first where a third party's module is missing, see `wakewise.core.optional_dependencies`.
    """
    package = sys.modules[name]
    loader = package.__spec__.loader if package.__spec__ is not None else None
    source = loader.get_source(name) if loader is not None and hasattr(loader, "get_source") else None
    if source is None:
        raise ImportError(f"{name}: its source is not there, and a lazy package is read from it", name=name)
    package.__dict__.update(_homes=_homes(source), _extras=extras)
    package.__class__ = _LazyPackage


def _imported(module: str, name: str) -> Any:
    """An object of a module, or a module of a package, which is no attribute of it before it is imported."""
    home = import_module(module)
    return getattr(home, name) if hasattr(home, name) else import_module(f"{module}.{name}")


def _homes(source: str) -> dict[str, tuple[str, str]]:
    """Module and name there of every import below `if TYPE_CHECKING:`."""
    return {
        alias.asname or alias.name: (line.module, alias.name)
        for block in ast.parse(source).body
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for line in block.body
        if isinstance(line, ast.ImportFrom) and line.module is not None
        for alias in line.names
    }
