"""Where Numba is not to be had, kernels are the Python that they are written in."""

from __future__ import annotations

import subprocess
import sys

RUN = """
import sys
class Without:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == sys.argv[1]:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Without())
sys.modules.pop(sys.argv[1], None)  # what measures coverage has imported it
"""
PLAIN = """
import numpy as np
from wakewise.core.jit.njit import COMPILED, assign, assign_rows, njit, prange
assert not COMPILED
assert prange is range
@njit
def twice(x):
    return 2 * x
@njit(apart=True, fastmath={"contract"}, inline="always")
def thrice(x):
    return 3 * x
assert (twice("a"), thrice("a")) == ("aa", "aaa")
to = np.zeros((2, 3))
assign(to[0], np.ones(3))
assign_rows(to[:, 1:], np.full((2, 2), 5.0))
assert to.tolist() == [[1.0, 5.0, 5.0], [0.0, 5.0, 5.0]]
"""


def _run(code: str, without: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", RUN + code, without], capture_output=True, text=True, check=False)


def test_without_numba_kernels_run_as_they_are_written() -> None:
    """Whatever Numba would have been told, and also where only its compiler is missing."""
    for missing in ("numba", "llvmlite"):
        done = _run(PLAIN, missing)
        assert done.returncode == 0, done.stderr


def test_another_module_that_is_missing_is_not_taken_for_numba() -> None:
    """A broken installation is told of, not run a hundred times slower."""
    done = _run("import wakewise.core.jit.njit", "hashlib")
    assert done.returncode == 1
    assert "No module named 'hashlib'" in done.stderr


def test_with_numba_kernels_are_compiled() -> None:
    """As everywhere but on small computers."""
    from wakewise.core.jit.njit import COMPILED, assign

    assert COMPILED
    assert hasattr(assign, "py_func")
