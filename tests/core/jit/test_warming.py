"""What a job needs is compiled beforehand, side by side; afterwards nothing is compiled, and faults are told."""

import inspect
import json
import subprocess
import sys
from importlib import import_module

import pytest

from wakewise.core.errors import InputError
from wakewise.core.jit import precompile
from wakewise.core.jit.precompile import (
    JOBS,
    BackgroundCompilation,
    KernelEntry,
    compile_kernels,
    kernels_of_jobs,
    listed,
)

FLIGHT = """
import gc, json
import wakewise as ww
from numba.core.dispatcher import Dispatcher
from wakewise.core.jit.precompile import compile_kernels
compile_kernels(("plan", "fly"))
ww.fly(ww.Scenario.preset("quick"), duration_s=0.2)
kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, Dispatcher)]
used = [kernel for kernel in kernels if kernel.py_func.__module__.startswith("wakewise") and kernel.signatures]
print(json.dumps([len(used), [kernel.py_func.__qualname__ for kernel in used if kernel.stats.cache_misses]]))
"""


def test_the_list_names_kernels_that_are_there() -> None:
    """Each with as many types as it has arguments, in a job that there is; none twice."""
    assert {kernel.job for kernel in listed()} == set(JOBS)
    assert len({(kernel.name, json.dumps(kernel.types)) for kernel in listed()}) == len(listed())
    for kernel in listed():
        module, _, name = kernel.name.rpartition(".")
        work = getattr(import_module(module), name)
        assert len(inspect.signature(work.py_func).parameters) >= len(kernel.types), kernel.name


@pytest.mark.slow
def test_once_warm_a_flight_compiles_nothing() -> None:
    """The list is whole: tools/list_kernels.py writes it anew after a change in how kernels are called."""
    done = subprocess.run([sys.executable, "-c", FLIGHT], capture_output=True, text=True, check=True)
    used, compiled = json.loads(done.stdout)
    assert used > 20
    assert compiled == []


def test_what_cannot_be_compiled_is_told_and_holds_nothing_up(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """A kernel that is not there gives a line, now and whenever somebody asks; it is not tried again."""
    wrong = KernelEntry(name="wakewise.core.jit.njit.nothing", types=("float64",), job="more", cost_s=1.0)
    monkeypatch.setattr(precompile, "listed", lambda: (wrong,))
    monkeypatch.setattr(precompile, "_made_from", lambda job: "0")
    monkeypatch.setattr(precompile, "_tried", set())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    told: list[tuple[float, float, str]] = []
    made = compile_kernels(("more",), lambda *now: told.append(now))
    assert made.kernels == 0
    assert "AttributeError" in made.amiss[0]
    assert told[0][:2] == (0.0, 1.0)
    monkeypatch.setattr(precompile, "_tried", set())
    assert precompile.is_warm(("more",))
    assert compile_kernels(("more",)) == made


def test_a_killed_process_is_no_verdict_on_a_kernel(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """The job is not noted as done: another try is made by the next process."""
    one = KernelEntry(name="wakewise.robot.vehicles.kernels.normalise", types=("float64[1C]",), job="more", cost_s=1.0)
    monkeypatch.setattr(precompile, "listed", lambda: (one,))
    monkeypatch.setattr(precompile, "_made_from", lambda job: "0")
    monkeypatch.setattr(precompile, "_tried", set())
    monkeypatch.setattr(precompile, "_asked", lambda *_: "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert compile_kernels(("more",)).amiss == ("wakewise.robot.vehicles.kernels.normalise: its process ended",)
    assert not precompile.is_warm(("more",))


def test_a_note_is_taken_when_a_job_is_done(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """Then nothing is done the next time, in another process neither."""
    one = KernelEntry(name="wakewise.robot.vehicles.kernels.normalise", types=("float64[1C]",), job="more", cost_s=1.0)
    monkeypatch.setattr(precompile, "listed", lambda: (one,))
    monkeypatch.setattr(precompile, "_made_from", lambda job: "0")
    monkeypatch.setattr(precompile, "_tried", set())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not precompile.is_warm(("more",))
    assert compile_kernels(("more",)) == precompile.PrecompileResult(kernels=1)
    assert [note.name for note in tmp_path.glob("*.warm")] == ["wakewise-more-0.warm"]
    assert precompile.is_warm(("more",))
    monkeypatch.setattr(precompile, "_tried", set())
    assert compile_kernels(("more",)) == precompile.PrecompileResult(kernels=0)


def test_stopped_it_ends() -> None:
    """No process is left behind, and waiting returns."""
    begun = BackgroundCompilation(("more",), processes=1)
    begun.stop()
    begun.wait(("more",))
    assert all(worker.wait(10) is not None for worker in begun._workers)


def test_an_unknown_job_is_refused() -> None:
    """With those that there are."""
    with pytest.raises(InputError, match="job 'flying': no such job, allowed plan, fly"):
        kernels_of_jobs(("flying",))
