"""Write docs/architecture.md: the packages, what each is, and a diagram of who imports whom, from the source.

`make docs` runs it; a test fails when the page is stale.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "architecture.md"
SOURCES = (ROOT / "src", *sorted(ROOT.glob("packages/*/src")), ROOT / "benchmarks")
LAYERS = (
    "wakewise_benchmarks",
    "wakewise_paper",
    "wakewise_ardusub",
    "wakewise_nerf",
    "ui",
    "api",
    "experiments",
    "learning",
    "operation",
    "control",
    "planning",
    "estimation",
    "perception",
    "vision",
    "simulation",
    "wake",
    "scene",
    "allocation",
    "robot",
    "core",
)
"""Packages from the top to the bottom: the order of the import contract in pyproject.toml."""


def package_of(module: str) -> str | None:
    """Package of LAYERS that a module belongs to."""
    parts = module.split(".")
    name = parts[1] if parts[0] == "wakewise" and len(parts) > 1 else parts[0]
    return name if name in LAYERS else None


@cache
def imports() -> dict[str, set[str]]:
    """Packages that each package imports."""
    found: dict[str, set[str]] = {name: set() for name in LAYERS}
    for source in SOURCES:
        for path in source.glob("wakewise*/**/*.py"):
            parts = path.relative_to(source).with_suffix("").parts
            here = package_of(".".join(part for part in parts if part != "__init__"))
            if here is None:
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module:
                    targets = [node.module] + [f"{node.module}.{alias.name}" for alias in node.names]
                elif isinstance(node, ast.Import):
                    targets = [alias.name for alias in node.names]
                else:
                    continue
                found[here] |= {name for target in targets if (name := package_of(target)) is not None}
            found[here].discard(here)
    return found


def reduced(edges: dict[str, set[str]]) -> dict[str, set[str]]:
    """Edges without those that follow from others: the transitive reduction of a graph without cycles."""
    below: dict[str, set[str]] = {}
    for name in reversed(LAYERS):
        below[name] = set(edges[name]).union(*(below.get(other, set()) for other in edges[name]))
    return {
        name: {one for one in others if not any(one in below[other] for other in others if other != one)}
        for name, others in edges.items()
    }


def said(name: str) -> str:
    """First paragraph of the package's docstring, as one line."""
    for source in SOURCES:
        for place in (source / "wakewise" / name / "__init__.py", source / "wakewise" / f"{name}.py"):
            if place.exists():
                return _first(place)
        if (source / name / "__init__.py").exists():
            return _first(source / name / "__init__.py")
    raise FileNotFoundError(name)


def _first(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).replace("|", "\\|")


def page() -> str:
    """Text of docs/architecture.md, as it should be."""
    edges = imports()
    lines = [
        "# Architecture",
        "",
        "`make docs` writes this page from the source; a test fails when it is stale. An arrow means "
        '"imports". Arrows that',
        "follow from others are left out. No arrow points up: import contracts in `pyproject.toml` hold this in "
        "`make test`.",
        "The controller cannot see the simulated truth: `simulation` never imports `wake`, `planning` or "
        "`control`, and these",
        "never import `simulation`. They meet in `operation`.",
        "",
        "```mermaid",
        "flowchart TD",
        *(f"    {name}" for name in LAYERS),
        *(f"    {name} --> {other}" for name in LAYERS for other in sorted(reduced(edges)[name], key=LAYERS.index)),
        "```",
        "",
        "| package | contains | imports |",
        "|---|---|---|",
        *(
            f"| `{name}` | {said(name)} | {', '.join(sorted(edges[name], key=LAYERS.index)) or 'nothing'} |"
            for name in LAYERS
        ),
        "",
        "How one control step runs: [methods.md](methods.md). Why the layers are as they are:",
        "[decisions/01-layers.md](decisions/01-layers.md).",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")
