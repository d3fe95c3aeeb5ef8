"""With NUMBA_DISABLE_JIT=1 kernels run as the Python that they are written in: for a debugger and for coverage."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import wakewise
from wakewise.allocation import Weights, min_norm_allocation, min_wash_allocation
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.core.jit.cache_dir import is_interpreted
from wakewise.robot.vehicles import compile_body, load_vehicle, step_rk4

ROOT = Path(wakewise.__file__).parent
USERS = sorted(
    ".".join(("wakewise", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")
    for path in ROOT.rglob("*.py")
    if "from wakewise.core.jit.njit import" in path.read_text(encoding="utf-8")
)


def answers() -> dict[str, list[float]]:
    """What some kernels answer: two allocations, and a step of a vehicle's motion."""
    vehicle = load_vehicle("paper")
    layout = vehicle_layout(vehicle)
    wrench = np.array([4.0, -2.0, 3.0, 0.1, 0.0, 0.3])
    gram = np.diag(np.linspace(1.0, 2.0, 2 * layout.B.shape[1]))
    gram[:4, :4] += 0.2
    place = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.full(6, 0.1))
    moved = step_rk4(compile_body(vehicle), *place, wrench, np.zeros(3), 0.02)
    return {
        "least": min_norm_allocation(layout, wrench).thrusts_N.tolist(),
        "gentle": min_wash_allocation(layout, wrench, gram, Weights()).thrusts_N.tolist(),
        "moved": np.concatenate(moved).tolist(),
    }


_SCRIPT = """
import sys, json, importlib, pathlib
for name in {users}:
    importlib.import_module(name)
lines = set()
def trace(frame, event, _):
    path = frame.f_code.co_filename
    if "wakewise/allocation/" not in path and "wakewise/robot/vehicles/" not in path:
        return None
    lines.add((pathlib.Path(path).name, frame.f_code.co_name))
    return trace
from test_interpreted import answers
from wakewise.core.jit.njit import COMPILED
from wakewise.core.jit.precompile import PrecompileResult, is_warm, compile_kernels
import numpy as np
from wakewise.simulation.lattice.streaming_stores import copy_line, load_element, store_element
from wakewise.simulation.lattice.streaming_stores import settle_stores, stream_line
assert not COMPILED and is_warm() and compile_kernels().kernels == 0
a, b = np.zeros(32, np.float32), np.arange(32, dtype=np.float32)
store_element(a, 0, np.float32(7.0)), copy_line(a, 16, b, 8), stream_line(a, 0, b, 16), settle_stores()
assert load_element(a, 16) == 8.0 and a[0] == 16.0
sys.settrace(trace)
found = answers()
sys.settrace(None)
print(json.dumps([found, sorted(lines)]))
"""


@pytest.mark.slow
def test_every_module_is_imported_and_kernels_are_run_line_by_line(tmp_path: Path) -> None:
    """All that hold kernels; a tracer enters the kernels, and they answer what they answer compiled."""
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
    }
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT.format(users=USERS)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found, entered = json.loads(done.stdout.splitlines()[-1])
    functions = {name for _, name in entered}
    assert {"cost", "line_minimum", "rk4_kernel"} <= functions
    for name, values in answers().items():
        np.testing.assert_allclose(found[name], values, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(("value", "desired"), [("1", True), ("0", False), ("", False), (None, False)])
def test_the_variable_is_read_as_numba_reads_it(value: str | None, desired: bool) -> None:
    """Nothing and 0 compile."""
    assert is_interpreted({} if value is None else {"NUMBA_DISABLE_JIT": value}) is desired
