"""Where a vehicle file's own files are: packages by name, and the folders that no path may leave."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.robot.importers.xml import PlacedError, SourceLocation

MAX_FOLDERS = 3000
"""Folders looked into for one package."""
MAX_UP = 4
"""Parent folders searched for a package."""
MAX_DOWN = 3
"""How deep below each of them."""

_CONVENTIONAL = frozenset(
    {"robots", "urdf", "xacro", "sdf", "models", "config", "launch", "description", "scenarios", "drones", "params"}
)
_MARKS = ("model.config", "model.sdf", "CMakeLists.txt", "meshes", "worlds", "data", *sorted(_CONVENTIONAL))
_LEAST_PARTS = 3
"""A folder nearer to the root of the disk than this belongs to no project."""

_PACKAGE_NAME = re.compile(r"<name>\s*([A-Za-z0-9_.-]{1,200})\s*</name>")


class PackagePaths:
    """Finds packages near a file and keeps every path inside the folders that belong to it.

    `file`: the file that the user gave; its package's folder is the first one allowed. `packages`: packages that the
    user placed; their folders are allowed too.
    """

    def __init__(self, file: Path, packages: Mapping[str, Path] | None = None) -> None:
        self.file = file.resolve()
        self.root = _package_root(self.file)
        self.allowed = [self.root]
        self.told: dict[str, Path] = {}
        for name, folder in (packages or {}).items():
            if not folder.is_dir():
                raise InputError(f"package {name}: {folder} is not a folder")
            self.told[name] = folder.resolve()
            self.allowed.append(self.told[name])
        self._found: dict[str, Path | None] = {}

    def package(self, name: str) -> Path | None:
        """Folder of a package: given, or named so (by folder or package.xml) near the file; None if there is none."""
        if name in self.told:
            return self.told[name]
        if name not in self._found:
            found = self._search(name)
            self._found[name] = found
            if found is not None:
                self.allowed.append(found)
        return self._found[name]

    def whence(self, path: Path) -> str:
        """Which package a file is of, if it was found by name alone: a namesake may be meant; "" if given or own."""
        for name, folder in self._found.items():
            if folder is not None and folder != self.root and path.resolve().is_relative_to(folder.resolve()):
                return f"; package {name} was found by its name in {folder}, --package {name}=DIR names another"
        return ""

    def inside(self, path: Path, place: SourceLocation) -> Path:
        """The real path, links followed.

        Raises InputError if it lies outside every folder that belongs to the file.
        """
        try:
            real = path.resolve()
        except (OSError, ValueError, RuntimeError) as fault:
            raise PlacedError(
                f"{place}: path {str(path)[:80]!r} cannot be followed ({type(fault).__name__})"
            ) from fault
        if not any(real.is_relative_to(folder) for folder in self.allowed):
            raise PlacedError(
                f"{place}: path {str(path)[:120]!r} climbs out of {self.root} "
                f"(name its package with --package NAME=DIR to allow it)"
            )
        return real

    def locate(self, name: str, folder: Path, place: SourceLocation) -> Path:
        """Path that a file means by `package://p/x`, `model://p/x`, `file://x`, an absolute or a relative path.

        Raises InputError if the package is not found or the path leaves the allowed folders.
        """
        for scheme in ("package://", "model://"):
            if name.startswith(scheme):
                package, _, rest = name[len(scheme) :].partition("/")
                found = self.package(package)
                if found is None:
                    raise MissingFileError(
                        f"{place}: package {package} not found near {self.file.name}; give --package {package}=DIR"
                    )
                return self.inside(found / rest, place)
        return self.inside(folder / name.removeprefix("file://"), place)

    def _search(self, name: str) -> Path | None:
        if not re.fullmatch(r"[A-Za-z0-9_.-]{1,200}", name) or name in {".", ".."}:
            return None
        above = self.file.parent
        looked = 0
        seen: set[Path] = set()
        for _ in range(MAX_UP + 1):
            if len(above.parts) < _LEAST_PARTS:
                return None
            if _is_package(above, name):
                return above
            level = [above]
            for _ in range(MAX_DOWN):
                below: list[Path] = []
                for folder in level:
                    for child in _subfolders(folder):
                        if child in seen:
                            continue
                        seen.add(child)
                        looked += 1
                        if looked > MAX_FOLDERS:
                            return None
                        if _is_package(child, name):
                            return child
                        below.append(child)
                level = below
            if above.parent == above or (above / ".git").exists() or above == Path.home():
                return None
            above = above.parent
        return None


class MissingFileError(PlacedError):
    """A file or package that another file asks for is not there."""


def _package_root(file: Path) -> Path:
    """Nearest folder above the file with a package.xml or model.config; else its folder, past conventional names."""
    folder = file.parent
    for above in (folder, *list(folder.parents)[:MAX_UP]):
        if (above / "package.xml").is_file() or (above / "model.config").is_file():
            return above
    while folder.name in _CONVENTIONAL and folder.parent != folder:
        folder = folder.parent
    return folder


def _is_package(folder: Path, name: str) -> bool:
    """Whether a folder is the package of this name: package.xml says so, or it is called so and looks like one."""
    declared = _declared_name(folder)
    if declared is not None:
        return declared == name
    return folder.name == name and any((folder / mark).exists() for mark in _MARKS)


def _subfolders(folder: Path) -> list[Path]:
    try:
        return sorted(
            child
            for child in folder.iterdir()
            if not child.name.startswith(".") and not child.is_symlink() and child.is_dir()
        )
    except OSError:
        return []


def _declared_name(folder: Path) -> str | None:
    try:
        with (folder / "package.xml").open(encoding="utf-8", errors="replace") as stream:
            declared = _PACKAGE_NAME.search(stream.read(20_000))
    except OSError:
        return None
    return declared.group(1) if declared else None
