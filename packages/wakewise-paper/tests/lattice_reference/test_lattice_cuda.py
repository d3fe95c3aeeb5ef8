"""The lattice for graphics cards, held against the processor's in Numba's simulator, and what is said without a card.

The simulator runs each thread of a card in Python, in a process of its own: it is chosen before Numba is imported.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import DiskJet, LatticeCase
from wakewise.simulation.lattice.stencil import OPEN
from wakewise_paper.lattice_reference import engines
from wakewise_paper.lattice_reference.engines import DEVICES, CpuEngine, make_engine
from wakewise_paper.lattice_reference.run import LatticeRun

SIDE_BY_SIDE = """
import numpy as np
from numba import cuda
from wakewise.simulation.lattice.stencil import OPEN, WALL
from wakewise_paper.lattice_reference.engines import CpuEngine, make_engine

rng = np.random.default_rng(0)
cells = (4, 5, 6)
water = (np.linspace(0.52, 0.6, 6), np.linspace(0.0, 0.1, 56).reshape(7, 8), 0.36)
faces = np.array([OPEN, WALL, OPEN, WALL, WALL, OPEN])
start = (1e-2 * rng.standard_normal((19, *cells))).astype(np.float32)
pushes = [(np.array([[2, 3, 3], [1, 2, 6]]), np.array([[1e-3, 0.0, -2e-4], [0.0, 5e-4, 0.0]]))]
card, processor = make_engine("cuda", *water, faces), CpuEngine(*water, faces)
assert type(card).__name__ == "CudaEngine"
for engine in (card, processor):
    engine.restore(start, np.zeros((8, *cells)))
    engine.advance(pushes)
    engine.advance([])
    engine.accumulate()
for read in (lambda e: e.populations, lambda e: e.field(), lambda e: e.sums, lambda e: e.along_x(2, 3)):
    a, b = read(card), read(processor)
    assert a.shape == b.shape and a.dtype == b.dtype
    print(np.abs(a - b).max(), np.abs(b).max())
"""


@pytest.mark.slow
def test_a_graphics_card_does_what_the_processor_does():
    """Two steps of random water between walls and open faces, with a force: populations, field, sums and a line."""
    done = subprocess.run(
        [sys.executable, "-c", SIDE_BY_SIDE],
        env=os.environ | {"NUMBA_ENABLE_CUDASIM": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    pairs = [[float(word) for word in line.split()] for line in done.stdout.splitlines()]
    assert len(pairs) == 4
    for gap, size in pairs:
        assert size > 1e-4
        assert gap < 1e-5 * size + 1e-8


def test_without_a_card_cuda_is_refused_in_one_line_and_auto_takes_the_processor(monkeypatch):
    """The line says what is missing, how it is installed where it is not, and what would do."""
    monkeypatch.setattr(engines, "why_no_gpu", lambda: "CUDA finds no graphics card or no driver")
    water = (np.full(6, 0.52), np.zeros((7, 8)), 0.0, np.full(6, OPEN))
    with pytest.raises(InputError, match=r"'cuda': CUDA finds no graphics card or no driver; allowed here: cpu, auto"):
        make_engine("cuda", *water)
    assert isinstance(make_engine("auto", *water), CpuEngine)
    with pytest.raises(InputError, match=r"'tpu': no such device, allowed cpu, cuda, auto"):
        make_engine("tpu", *water)
    assert DEVICES == ("cpu", "cuda", "auto")


def test_a_run_takes_the_device_by_name(monkeypatch):
    """What cannot be had is refused before anything is computed."""
    monkeypatch.setattr(engines, "why_no_gpu", lambda: "no card")
    case = LatticeCase(name="t", jets=(DiskJet(),), low_D=(-2, -2, -2), high_D=(2, 2, 2), cells_per_D=4)
    with pytest.raises(InputError, match="no card"):
        LatticeRun(case, device="cuda")
