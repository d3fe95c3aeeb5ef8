"""Where compiled kernels are kept when neither the package's folder nor the user's cache can be written.

Numba refuses to start there, as in a container with a read-only file system. It reads its settings when it is imported,
so this runs first; it imports neither NumPy nor Numba.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Callable, Mapping, MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
CanWrite = Callable[[Path], bool]


def is_interpreted(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether Numba is told to compile nothing (NUMBA_DISABLE_JIT=1)."""
    return environment.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0")


def select_cache_folder(
    package: Path = Path(__file__).parents[2], environment: MutableMapping[str, str] = os.environ
) -> Path | None:
    """Give Numba a folder under the system's one for temporary files if it would find none; returns that folder."""
    if not needs_folder(package, environment):
        return None
    folder = private_folder()
    if folder is not None:
        environment[VARIABLE] = str(folder)
        if "numba" in sys.modules:  # it has read its settings already
            sys.modules["numba"].config.CACHE_DIR = str(folder)
    return folder


def needs_folder(package: Path, environment: MutableMapping[str, str], can_write: CanWrite | None = None) -> bool:
    """Whether Numba would find no place: none is given, and it may write beside no source nor in the user's cache."""
    can_write = can_write or can_be_written
    if environment.get(VARIABLE):
        return False
    folders = {package, *(module.parent for module in package.rglob("*.py"))}
    if all(can_write(folder / "__pycache__") for folder in folders):
        return False
    return not can_write(user_cache(environment))


def can_be_written(folder: Path) -> bool:
    """Whether files can be made in a folder, or it can be made itself; not where it cannot even be looked for."""
    try:
        there = next((place for place in (folder, *folder.parents) if place.exists()), folder)
        return there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    except OSError:  # a home of another user's
        return False


def private_folder() -> Path | None:
    """Folder of this user's alone (0700) under the system's for temporary files; None if there is no such place.

    Compiled code is run, so a folder that another user made or may write to is not trusted: a new one is taken then.
    """
    try:
        user = os.getuid() if hasattr(os, "getuid") else "user"
        folder = Path(tempfile.gettempdir()) / f"wakewise-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        if not _is_private(folder):
            folder = Path(tempfile.mkdtemp(prefix="wakewise-kernels-"))
    except OSError:
        return None
    return folder


def _is_private(folder: Path) -> bool:
    facts = folder.lstat()
    mine = not hasattr(os, "getuid") or facts.st_uid == os.getuid()
    return stat.S_ISDIR(facts.st_mode) and mine and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def user_cache(environment: MutableMapping[str, str]) -> Path:
    """Numba's folder in the user's cache."""
    home = Path(environment.get("HOME") or os.path.expanduser("~"))  # noqa: PTH111  (Path.home fails without a home)
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "numba"
    return Path(environment.get("XDG_CACHE_HOME") or home / ".cache") / "numba"


CHOSEN = select_cache_folder()
"""The folder that was chosen when `wakewise` was imported; None where Numba finds a place of its own."""
