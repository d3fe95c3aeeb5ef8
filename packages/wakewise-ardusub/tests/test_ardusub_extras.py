"""A missing library is named together with the package and the extra that install it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from wakewise.core import optional_dependencies
from wakewise.core.errors import MissingExtra
from wakewise.core.optional_dependencies import EXTRAS, missing_extra
from wakewise_ardusub.optional_dependencies import ARDUSUB, need

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
HOW = "pip install -e 'packages/wakewise-ardusub[links]' (in the clone's folder)"


def test_the_extras_are_those_of_the_project_file() -> None:
    """Same names, same packages."""
    stated = {
        name: {re.split("[<>=]", line)[0] for line in lines} for name, lines in PROJECT["optional-dependencies"].items()
    }
    assert stated == {name: set(modules.values()) for name, modules in ARDUSUB.extras.items()}


def test_the_library_knows_none_of_them() -> None:
    """No extra of the library holds what only real vehicles need."""
    assert not {"pymavlink", "lupa", "mcap", "serial", "smbus2"} & {m for modules in EXTRAS.values() for m in modules}


def test_what_is_missing_is_named_with_the_package_that_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that is needed and not there, in one line."""
    monkeypatch.setattr(optional_dependencies, "_is_here", lambda module: module not in ("pymavlink", "lupa"))
    with pytest.raises(MissingExtra) as refusal:
        need("wakewise link sitl-autopilot", "links", only=("pymavlink", "lupa"))
    assert str(refusal.value) == (
        f"wakewise link sitl-autopilot needs pymavlink and lupa, which are not installed: {HOW}"
    )
    need("wakewise link sensors", "links", only=("serial", "smbus2"))


@pytest.mark.parametrize("module", ["pymavlink.mavutil", "serial", "smbus2", "mcap.reader", "lupa"])
def test_a_failed_import_anywhere_names_this_package(module: str) -> None:
    """The command line finds the extra by the entry point of this package."""
    refusal = missing_extra("this command", ModuleNotFoundError(f"No module named {module!r}", name=module))
    assert str(refusal).endswith(f"which is not installed: {HOW}")
