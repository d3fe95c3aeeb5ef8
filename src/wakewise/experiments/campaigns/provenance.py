"""What of a scenario is not the package's own, and which version of it: files by their bytes, packages by number.

It goes into a trial's key, so that a controller that was changed is flown anew.
"""

from __future__ import annotations

import hashlib
from importlib.util import find_spec
from pathlib import Path

from wakewise.control import MAKERS
from wakewise.core.errors import InputError
from wakewise.core.plugins import find
from wakewise.operation.scenario import Scenario

_LARGEST = 2**20  # bytes that are read at once


def external_parts(scenario: Scenario) -> dict[str, str]:
    """Parts that come from elsewhere, each with what says its version.

    Raises
    ------
    InputError
        If a controller or a file cannot be found or read.
    """
    found = dict(scenario.parts().from_outside)
    if scenario.method not in MAKERS:
        find("method", scenario.method, MAKERS)
    for name, named in (
        ("vehicle", scenario.vehicle),
        ("target", scenario.target.kind),
        ("controls", scenario.controls or ""),
    ):
        path = Path(named).expanduser()
        if named and path.is_file():
            found[f"{name} file"] = digest(path)
    for name, named in (
        ("method", scenario.method),
        ("world", scenario.world),
        ("flow", scenario.flow or ""),
        ("pilot", scenario.pilot),
        ("wake", scenario.control.wake.model),
    ):
        if ":" in named:
            found[f"{name} source"] = module_digest(named.partition(":")[0])
    return found


def check_loadable(scenario: Scenario) -> None:
    """Load vehicle and target, which takes a moment; raises InputError if there is none of that name or file."""
    parts = scenario.parts()
    _ = parts.vehicle, parts.target


def digest(path: Path) -> str:
    """Hash of a file."""
    whole = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(_LARGEST):
                whole.update(block)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read, {fault.strerror}") from None
    return whole.hexdigest()


def module_digest(module: str) -> str:
    """Hash of a module's file, or of all Python files of the package that it is in."""
    top = find_spec(module.partition(".")[0])
    if top is None or top.origin is None:
        return "unknown"
    if not top.submodule_search_locations:
        return digest(Path(top.origin))
    folder = Path(top.origin).parent
    whole = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        whole.update(f"{file.relative_to(folder).as_posix()} {digest(file)}\n".encode())
    return whole.hexdigest()
