"""Print statement coverage per package from the data that `make coverage` collects, and compare it with the floors.

The floors are in pyproject.toml, `[tool.wakewise.coverage]`: percent per package, raised by hand, never lowered.
"""

from __future__ import annotations

import sys
import tomllib
from collections import defaultdict
from pathlib import Path

from coverage import Coverage

ROOT = Path(__file__).parents[1]
SOURCES = (ROOT / "src", *sorted(ROOT.glob("packages/*/src")), ROOT / "benchmarks")


def package_of(path: Path) -> str | None:
    """`wakewise.<package>`, or the name of a package beside the library; None for other files."""
    for source in SOURCES:
        if path.is_relative_to(source):
            parts = path.relative_to(source).with_suffix("").parts
            return ".".join(parts[: 2 if parts[0] == "wakewise" else 1])
    return None


def covered(data: Coverage) -> dict[str, tuple[int, int]]:
    """Statements run and statements in all, by package; files that no test imported count as not run."""
    sums: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for source in SOURCES:
        for path in source.glob("wakewise*/**/*.py"):
            name = package_of(path)
            if name is None:
                continue
            _, statements, _, missing, _ = data.analysis2(str(path))
            sums[name][0] += len(statements) - len(missing)
            sums[name][1] += len(statements)
    return {name: (run, whole) for name, (run, whole) in sorted(sums.items())}


def below_floor(percent: dict[str, float], floors: dict[str, float]) -> list[str]:
    """A line for each package that has less than its floor, and for each floor without a package."""
    lines = [
        f"{name}: a floor in pyproject.toml, but no such package" for name in sorted(floors.keys() - percent.keys())
    ]
    return lines + [
        f"{name}: {percent[name]:.1f} % covered, at least {floor:g} asked"
        for name, floor in floors.items()
        if percent.get(name, floor) < floor
    ]


def main() -> int:
    """Print the table; 1 if a package is below its floor, 2 if there is no data."""
    data = Coverage(data_file=str(ROOT / ".coverage"))
    data.load()
    if not data.get_data().measured_files():
        print("no coverage data: run make coverage", file=sys.stderr)
        return 2
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    floors = project["tool"]["wakewise"]["coverage"]
    percent = {}
    print(f"{'package':<28}{'statements':>12}{'covered %':>12}{'floor %':>10}")
    for name, (run, whole) in covered(data).items():
        percent[name] = 100.0 * run / max(whole, 1)
        print(f"{name:<28}{whole:>12}{percent[name]:>12.1f}{floors.get(name, '-'):>10}")
    failures = below_floor(percent, floors)
    for line in failures:
        print(line, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
