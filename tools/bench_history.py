"""Run short benchmarks and keep their figures with commit and processor in docs/benchmarks/history.jsonl.

    .venv/bin/python tools/bench_history.py            # run, compare with the last row of this processor, keep
    .venv/bin/python tools/bench_history.py --show     # print what is kept

All figures are processor time, so that what else runs on the machine disturbs them little. They are compared only with
those of the same processor.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
HISTORY = ROOT / "docs" / "benchmarks" / "history.jsonl"
# bench, key of its figures, whether less is better
FIGURES = (
    ("allocator", "search_us", True),
    ("allocator", "call_us", True),
    ("allocator", "gram_us", True),
    ("dynamics", "step_us", True),
    ("onboard", "allocator_us_median", True),
    ("onboard", "plan_ms_median", True),
    ("tank", "realtime_factor_one_core", False),
    ("imaging", "frame_cpu_s", True),
)
TOLD = 0.15
"""Changes smaller than this share are not told."""


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def read_history() -> list[dict[str, Any]]:
    """All rows, oldest first; none where there is no file."""
    if not HISTORY.exists():
        return []
    return [json.loads(line) for line in HISTORY.read_text(encoding="utf-8").splitlines() if line]


def measured() -> dict[str, float | None]:
    """Figures of this checkout by `bench.key`."""
    found: dict[str, float | None] = {}
    for bench in dict.fromkeys(bench for bench, _, _ in FIGURES):
        print(f"bench {bench}", file=sys.stderr)
        done = subprocess.run(
            [str(Path(sys.executable).with_name("wakewise")), "bench", bench, "--json", "--quiet"],
            capture_output=True,
            text=True,
            check=False,
            cwd=ROOT,
        )
        if done.returncode:
            raise SystemExit(f"bench {bench} ended with {done.returncode}: {done.stderr.strip()[-300:]}")
        told = json.loads(done.stdout)
        found |= {f"{bench}.{key}": told.get(key) for name, key, _ in FIGURES if name == bench}
    return found


def compared(now: dict[str, float | None], before: dict[str, float | None]) -> list[str]:
    """A line for each figure that changed by more than `TOLD`."""
    lines = []
    for bench, key, less in FIGURES:
        name = f"{bench}.{key}"
        new, old = now.get(name), before.get(name)
        if new is None or old is None or old == 0.0:
            continue
        change = new / old - 1.0
        if abs(change) > TOLD:
            word = "better" if (change < 0.0) is less else "worse"
            lines.append(f"{name}: {old:.3g} -> {new:.3g} ({100 * change:+.0f} %, {word})")
    return lines


def main() -> int:
    """1 if a figure is worse than in the last row of this processor."""
    parser = argparse.ArgumentParser(description="Keep a history of short benchmarks.")
    parser.add_argument("--show", action="store_true", help="print what is kept, and measure nothing")
    if parser.parse_args().show:
        for row in read_history():
            print(row["date"], row["commit"], row["processor"])
            print(
                "  " + ", ".join(f"{name} {value:.3g}" for name, value in row["figures"].items() if value is not None)
            )
        return 0
    now, chip = measured(), processor()
    rows = [row for row in read_history() if row["processor"] == chip]
    lines = compared(now, rows[-1]["figures"]) if rows else []
    print("\n".join(lines) or "no figure changed by more than 15 %, or none of this processor is kept")
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.strip()
    row = {"date": f"{datetime.now(UTC):%Y-%m-%d}", "commit": commit, "processor": chip, "figures": now}
    HISTORY.parent.mkdir(parents=True, exist_ok=True)
    with HISTORY.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
    return int(any(line.endswith("worse)") for line in lines))


if __name__ == "__main__":
    sys.exit(main())
