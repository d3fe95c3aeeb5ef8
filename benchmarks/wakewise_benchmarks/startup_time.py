"""What a user waits for at first: import, --help, compilation with an empty cache, the first flight and the second.

Each is a process of its own, and the time is what a clock on the wall shows.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from wakewise.core.errors import StageError
from wakewise.core.jit.cache_dir import VARIABLE
from wakewise.experiments.trials.timing import BenchOptions

REPEATS = 5
_IMPORT = "import time; began = time.perf_counter(); import wakewise; print(time.perf_counter() - began)"
_COMMAND = "from wakewise.ui.cli.main import main; main()"
_FLIGHT = "import wakewise as ww; print(ww.fly(ww.Scenario.preset('quick')).figures['duration_s'])"


def run(options: BenchOptions) -> dict[str, Any]:
    """Times in seconds; the flight is that of `wakewise scan --preset quick`."""
    options.progress(0, 10, "import and --help")
    imports = [float(_output(_IMPORT)) for _ in range(REPEATS)]
    helps = [_took_s(_COMMAND, "--help") for _ in range(REPEATS)]
    with tempfile.TemporaryDirectory() as folder:
        options.progress(1, 10, "compiling everything")
        compiled = json.loads(_output(_COMMAND, "compile", "--json", cache=Path(folder, "all")))
        options.progress(5, 10, "a first flight")
        first = _took_s(_FLIGHT, cache=Path(folder, "flight"))
        options.progress(9, 10, "a second flight")
        second = _took_s(_FLIGHT, cache=Path(folder, "flight"))
    return {
        "import_s": statistics.median(imports),
        "help_s": statistics.median(helps),
        "compile_s": compiled["wall_s"],
        "kernels": compiled["kernels"],
        "not_compiled": compiled["not_compiled"],
        "first_flight_s": first,
        "second_flight_s": second,
        "flight_simulated_s": float(_output(_FLIGHT)),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
    }


def _took_s(code: str, *arguments: str, cache: Path | None = None) -> float:
    began = time.perf_counter()
    _output(code, *arguments, cache=cache)
    return time.perf_counter() - began


def _output(code: str, *arguments: str, cache: Path | None = None) -> str:
    """What a new interpreter prints that runs `code`; kernels go to `cache` if that is given."""
    environment = os.environ | ({} if cache is None else {VARIABLE: str(cache)})
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, env=environment, check=False
    )
    if done.returncode:
        raise StageError(f"bench cold: a process ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout
