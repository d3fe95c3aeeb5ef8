"""Print statement coverage per package from the data that `make coverage` collects."""

from __future__ import annotations

import sys
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


def main() -> int:
    """Print the table; 2 if there is no data."""
    data = Coverage(data_file=str(ROOT / ".coverage"))
    data.load()
    if not data.get_data().measured_files():
        print("no coverage data: run make coverage", file=sys.stderr)
        return 2
    print(f"{'package':<28}{'statements':>12}{'covered %':>12}")
    for name, (run, whole) in covered(data).items():
        print(f"{name:<28}{whole:>12}{100.0 * run / max(whole, 1):>12.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
