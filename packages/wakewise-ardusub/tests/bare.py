"""A new Python process that can import the standard library, NumPy, pymavlink and the two Wakewise packages only."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SOURCES = (Path(__file__).parents[1] / "src", Path(__file__).parents[3] / "src")
GATE = """
import sys
class Gate:
    allowed = frozenset(sys.stdlib_module_names) | {"numpy", "pymavlink", "fastcrc", "wakewise", "wakewise_ardusub"}
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in self.allowed:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Gate())
"""
"""fastcrc is pymavlink's own."""


def command(code: str, *arguments: str) -> list[str]:
    """What to run; `-X importtime` would show that nothing else is there."""
    return [sys.executable, "-W", "error", "-c", GATE + code, *arguments]


def environment(sources: Sequence[Path] = SOURCES) -> dict[str, str]:
    """Both packages from their sources, whatever is installed."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, sources))}


def bare(code: str, *arguments: str, sources: Sequence[Path] = SOURCES) -> str:
    """Run code there; what it printed."""
    done = subprocess.run(
        command(code, *arguments), env=environment(sources), capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
