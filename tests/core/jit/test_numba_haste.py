"""Compiling sooner changes nothing in what is compiled."""

import json
import os
import subprocess
import sys

CODE = """
import json, sys
import numpy as np
from numba import njit
from numba.core.compiler import Flags
from wakewise.core.jit.haste import hasten
if sys.argv[1] == "soon":
    hasten()
@njit
def kernel(x, n):
    out = np.zeros((n, x.size))
    for i in range(n):
        for j in range(x.size):
            out[i, j] = np.sqrt(x[j]) + max(i, 2)
    return out.sum()
made = kernel.compile((__import__("numba").float64[::1], __import__("numba").int64))
unset, told, other = Flags(), Flags(), Flags()
told.nrt = Flags.options["nrt"].default
other.nrt = not told.nrt
print(json.dumps([kernel.inspect_asm(kernel.signatures[0]), unset == told, hash(unset) == hash(told), unset == other]))
"""


def _told(how: str) -> list[object]:
    same_names = os.environ | {"PYTHONHASHSEED": "0"}  # Numba names what it holds by Python's hashes
    done = subprocess.run([sys.executable, "-c", CODE, how], capture_output=True, text=True, check=True, env=same_names)
    answer: list[object] = json.loads(done.stdout)
    return answer


def test_the_machine_code_is_the_same_and_so_are_flags() -> None:
    """To the last instruction; a flag that is set to what it was is as one that is not set, another is not."""
    soon, plain = _told("soon"), _told("plain")
    assert soon == plain
    assert soon[1:] == [True, True, False]
