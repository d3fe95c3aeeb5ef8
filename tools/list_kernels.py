"""List the kernels that commands call from Python, with their types, for `wakewise compile` (about five minutes).

    python tools/list_kernels.py

Run it after a change in how kernels are called; tests/core/jit/test_warming.py says when the list is out of date. It
flies, photographs and reconstructs with an empty cache, and notes what Numba is asked to compile by Python.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any


def main() -> int:
    """Write the list; the work is done in a process whose cache is empty."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "kernels")}
        return subprocess.run([sys.executable, __file__, folder], env=environment, check=False).returncode


def note_all(folder: Path) -> None:
    """Do the jobs in their order and write what each was the first to call."""
    import numba.core.event as events

    from wakewise.core.jit.kernel_cache import PACKAGE, type_of
    from wakewise.core.jit.precompile import LIST

    rows: list[dict[str, Any]] = []
    open_calls: list[float] = []
    job = ""

    class Compilations(events.Listener):
        def on_start(self, _event: Any) -> None:
            open_calls.append(time.process_time())

        def on_end(self, event: Any) -> None:
            began = open_calls.pop()
            kernel = event.data["dispatcher"].py_func
            if open_calls or not kernel.__module__.startswith(PACKAGE.name):
                return
            rows.append(
                {
                    "name": f"{kernel.__module__}.{kernel.__qualname__}",
                    "types": [type_of(kind) for kind in event.data["args"]],
                    "job": job,
                    "cost_s": round(time.process_time() - began, 1),
                }
            )

    with events.install_listener("numba:compile", Compilations()):
        for job, work in JOBS.items():
            print(f"{job} ...", file=sys.stderr, flush=True)
            work(folder)
            lines = ",\n".join(json.dumps(row) for row in rows)
            LIST.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    print(f"{len(rows)} kernels, {sum(row['cost_s'] for row in rows):.0f} s", file=sys.stderr)


def _scenario(**changes: Any) -> Any:
    import wakewise as ww

    small = {"mission.elevations_deg": [30], "mission.views": [10], "imaging.width": 640, "imaging.height": 480}
    return ww.Scenario.preset("quick", **small | changes)


def _plan(folder: Path) -> None:
    from wakewise.experiments.trials.trial import write_plan

    parts = _scenario().parts()
    write_plan(parts, folder)
    _ = parts.region


def _fly(_folder: Path) -> None:
    import wakewise as ww

    ww.fly(_scenario())


def _photograph(folder: Path) -> None:
    from wakewise.operation import fly_trial, photograph_flight

    parts = _scenario().parts()
    fly_trial(parts, folder)
    photograph_flight(parts, folder)


def _reconstruct(folder: Path) -> None:
    import wakewise as ww

    ww.trial(_scenario(), folder / "trial")


def _more(_folder: Path) -> None:
    import wakewise as ww

    for method in ww.methods():
        ww.fly(_scenario(method=method), duration_s=1.0)
    for vehicle in ("bluerov2", "bluerov2-heavy"):
        ww.fly(_scenario(vehicle=vehicle), duration_s=1.0)
    for kind in ("branching", "plate"):
        _ = _scenario(**{"target.kind": kind}).parts().region
    ww.fly(_scenario(pilot="find"), duration_s=12.0, checked=False)  # the map is made after some 6 s


JOBS = {"plan": _plan, "fly": _fly, "photograph": _photograph, "reconstruct": _reconstruct, "more": _more}


if __name__ == "__main__":
    if len(sys.argv) == 1:
        sys.exit(main())
    note_all(Path(sys.argv[1]))
