"""Nothing of Wakewise is published yet: no page and no hint tells to install it from an index."""

import re
import tomllib
from pathlib import Path

import pytest

from wakewise.core.optional_dependencies import LIBRARY, OptionalDependencies
from wakewise_ardusub.optional_dependencies import ARDUSUB

ROOT = Path(__file__).parents[1]
PROJECTS = {
    str(path.parent.relative_to(ROOT)): set(
        tomllib.loads(path.read_text(encoding="utf-8"))["project"].get("optional-dependencies", {})
    )
    for path in (ROOT / "pyproject.toml", *ROOT.glob("packages/*/pyproject.toml"))
}
"""Extras of each project by its folder in the clone."""
OTHERS = {"pyserial", "asyncssh", "numpy", "scipy", "numba", "pydantic", "pyyaml", "pre-commit"}
"""Packages of others that a page tells to install, by their names in Python's index."""
INSTALL = re.compile(r"\bpip3? install\b[ \t]*([^`\n]*)")
FOLDER = "|".join(re.escape(folder) for folder in PROJECTS)
FROM_CLONE = re.compile(rf"(?:--no-deps )?-e (?:'({FOLDER})(?:\[([\w,]+)\])?'|({FOLDER})(?=\s|$|\)))")


def _fault(said: str) -> str | None:
    """Why what stands after `pip install` cannot be run; None if it can, in the clone's folder."""
    clone = FROM_CLONE.match(said)
    if clone is not None:
        unknown = set((clone[2] or "").split(",")) - PROJECTS[clone[1] or clone[3]] - {""}
        return f"no extra {sorted(unknown)}" if unknown else None
    words = re.split(r"&&|[#\")]", said)[0].split()
    if words and {re.split("[<>=]", word.strip("'"))[0] for word in words} <= OTHERS:
        return None
    return "not `pip install -e '.[EXTRAS]'`"


def _texts() -> list[Path]:
    """Pages, and sources that print hints; scripts that set up the clone itself install by their own means."""
    folders = [
        ROOT / name
        for name in ("docs", "src", "packages/wakewise-ardusub/ros2", "packages/wakewise-ardusub/extensions")
    ]
    found = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".md", ".py", ".yaml", ".xml")]
    return sorted([*ROOT.glob("*.md"), *found])


def test_every_install_line_can_be_run_in_a_clone() -> None:
    """Every `pip install` of every page and source names the clone's folder with known extras, or another's package."""
    texts = _texts()
    assert {"README.md", "sitl.md", "ardusub.md", "meter.md", "cockpit.md", "node.py"} <= {path.name for path in texts}
    said = [(path, m[1]) for path in texts for m in INSTALL.finditer(path.read_text(encoding="utf-8"))]
    assert len(said) > 6
    # A hint's extras are filled in where it is printed.
    faults = {
        f"{path.relative_to(ROOT)}: {text}": _fault(text.replace("{self.folder}", ".").replace("{extras}", "all"))
        for path, text in said
    }
    assert {line: fault for line, fault in faults.items() if fault is not None} == {}


@pytest.mark.parametrize("owner", [LIBRARY, ARDUSUB], ids=lambda owner: owner.folder)
def test_every_hint_can_be_run_in_a_clone(owner: OptionalDependencies) -> None:
    """What a missing package's message tells to type."""
    for extra in owner.extras:
        found = INSTALL.search(owner.how_to_install(extra))
        assert found is not None
        assert _fault(found[1]) is None
        assert extra in PROJECTS[owner.folder]


@pytest.mark.parametrize(
    "said",
    ["wakewise", "'wakewise-ardusub[links]'", "-e '.[no-such]'", "-e '.[links]'", "-e '.[nothing]'", "-U wakewise"],
)
def test_a_line_that_cannot_be_run_is_found(said: str) -> None:
    """From an index, or with an extra that is not there."""
    assert _fault(said) is not None
