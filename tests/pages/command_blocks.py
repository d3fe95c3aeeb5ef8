"""Command lines in the fenced blocks of README and docs, and the files that they speak of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = {"commands.md", "scenario.md"}
"""Pages that the program writes from its own help and settings; tests/ui/cli/test_commands.py compares them."""
PROGRAMS = {"python", "toml", "yaml", "json", "text", "mermaid"}
"""Languages of blocks that are no command lines; Python blocks have tests of their own (tests/test_readme.py)."""


@dataclass(frozen=True)
class Line:
    """A command line of a page: the page, the line's number there, its words without the comment."""

    page: str
    number: int
    words: str


def pages() -> list[Path]:
    """README, CONTRIBUTING, docs/*.md and the pages of what lies beside the package."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
    found += sorted(
        [
            *(ROOT / "packages/wakewise-ardusub/ros2").rglob("*.md"),
            *(ROOT / "packages/wakewise-ardusub/extensions").rglob("*.md"),
        ]
    )
    return [page for page in found if page.name not in GENERATED]


def _blocks(page: Path) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Language and numbered lines of each fenced block."""
    language, lines = None, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            if language is None:
                language, lines = line.strip().strip("`").split(" ")[0], []
            else:
                yield language, lines
                language = None
        elif language is not None:
            lines.append((number, line))


def command_lines() -> list[Line]:
    """Every line of every block that is no program; a line that ends in a backslash goes on in the next."""
    found = []
    for page in pages():
        for language, lines in _blocks(page):
            if language in PROGRAMS:
                continue
            held, first = "", 0
            for number, line in lines:
                first = first if held else number
                held += line.strip()
                if held.endswith("\\"):
                    held = held[:-1]
                    continue
                words = re.sub(r"\s+#(?=\s|$).*$", "", held)
                if words and not words.startswith("# "):
                    found.append(Line(str(page.relative_to(ROOT)), first, " ".join(words.split())))
                held = ""
    return found
