"""Kernels are compiled once for what they need, and anew when anything they are made of has changed."""

import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import types
from numba.core.caching import NullCache

from wakewise.core.jit import kernel_cache
from wakewise.core.jit.kernel_cache import PACKAGE, _alone, imported, type_from, type_of
from wakewise.core.jit.njit import assign, njit


class Pair(NamedTuple):
    row: np.ndarray
    count: int


@njit
def _scaled(x, by):
    return by * x


@njit
def _twice_and_thrice(x):
    return _scaled(x, 2) + _scaled(x, 3)


@njit(apart=True)
def _halved(pair, by):
    if by > 100:
        raise ValueError("too many")
    out = np.empty(pair.count)
    for i in range(pair.count):
        out[i] = 0.5 * by * pair.row[i]
    return out, pair.count


@njit
def _halves(row, by):
    first, count = _halved(Pair(row, row.size), by)
    second, _ = _halved(Pair(row, row.size), 4)
    return first + second, count


@njit
def _copied(source):
    out = np.zeros(source.size + 1)
    assign(out[1:], source)
    return out


# Not kept, since their own code is looked at: of what was read from disk there is none.
for _kernel in (_scaled, _twice_and_thrice, _halves):
    _kernel._cache = NullCache()


@pytest.fixture
def small_package(tmp_path: Path) -> Path:
    """A package of the same name in which one file's kernel uses another's, and that one a third's constant."""
    folder = tmp_path / "wakewise"
    folder.mkdir()
    jit = folder / "core" / "jit"
    jit.mkdir(parents=True)
    for place in (folder, jit.parent, jit):
        (place / "__init__.py").touch()
    for name in ("njit.py", "kernel_cache.py"):
        shutil.copy(PACKAGE / "core" / "jit" / name, jit)
    (folder / "constants.py").write_text("STEP = 1.0\n")
    (folder / "callee.py").write_text(
        "from wakewise.core.jit.njit import njit\n"
        "from wakewise.constants import STEP\n@njit\ndef f():\n    return STEP\n"
    )
    (folder / "caller.py").write_text(
        "from wakewise.core.jit.njit import njit\n"
        "from wakewise.callee import (\n    f,\n)\n"
        "@njit\ndef g():\n    return 10.0 * f()\n"
    )
    return folder


def _run(package: Path, name: str = "caller.g") -> list[str]:
    module, _, kernel = name.partition(".")
    code = f"from wakewise.{module} import {kernel} as g; print(g(), sum(g.stats.cache_hits.values()))"
    environment = {"PYTHONPATH": str(package.parent), "PATH": "", "NUMBA_CACHE_DIR": str(package.parent / "kept")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_a_change_far_below_a_kernel_compiles_it_anew(small_package: Path) -> None:
    """What was kept is used while nothing changed, and not once a constant of a callee's file has."""
    assert _run(small_package) == ["10.0", "0"]
    assert _run(small_package) == ["10.0", "1"]
    (small_package / "constants.py").write_text("STEP = 2.0\n")
    assert _run(small_package) == ["20.0", "0"]


def test_a_kernel_apart_is_kept_and_compiled_anew_as_any(small_package: Path) -> None:
    """Its caller is read from disk with it; where it alone is gone from there it is compiled; a change is heard."""
    callee = small_package / "callee.py"
    callee.write_text(callee.read_text().replace("@njit", "@njit(apart=True)"))
    assert _run(small_package) == ["10.0", "0"]
    assert _run(small_package) == ["10.0", "1"]
    for file in (small_package.parent / "kept").rglob("callee*"):
        file.unlink()
    assert _run(small_package) == ["10.0", "1"]
    (small_package / "constants.py").write_text("STEP = 2.0\n")
    assert _run(small_package) == ["20.0", "0"]


@pytest.mark.slow
def test_a_kernel_apart_is_brought_along_through_one_that_was_read_from_disk(small_package: Path) -> None:
    """Two levels up, where the level between was kept before: the caller finds it when it is read from disk alone."""
    callee = small_package / "callee.py"
    callee.write_text(callee.read_text().replace("@njit", "@njit(apart=True)"))
    (small_package / "above.py").write_text(
        "from wakewise.core.jit.njit import njit\n"
        "from wakewise.caller import g\n@njit\ndef h():\n    return 2.0 * g()\n"
    )
    assert _run(small_package) == ["10.0", "0"]
    assert _run(small_package, "above.h") == ["20.0", "0"]
    assert _run(small_package, "above.h") == ["20.0", "1"]


def test_a_kernel_apart_is_not_copied_into_its_caller() -> None:
    """It takes and returns what others do, its errors reach Python, and the caller's code holds but its name."""
    row = np.arange(3.0)
    total, count = _halves(row, 2)
    np.testing.assert_array_equal(total, 3.0 * row)
    assert count == 3
    with pytest.raises(ValueError, match="too many"):
        _halves(row, 101)
    code = _halves.overloads[_halves.signatures[0]].library.get_llvm_str()
    assert code.count("test_numba_kernels._halved.") > 0
    assert not [line for line in code.splitlines() if line.startswith("define") and "_halved" in line]
    with pytest.raises(ValueError, match="only a module's own"):
        njit(apart=True)(lambda x: x)


def test_imports_are_found_wherever_they_stand() -> None:
    """Modules, names from modules, packages, and imports over several lines."""
    names = {file.relative_to(PACKAGE).as_posix() for file in imported(PACKAGE / "planning" / "kernels.py")}
    assert {"core/arrays.py", "robot/vehicles/kernels.py", "wake/plan_disturbance.py"} <= names


def test_a_kernel_is_not_compiled_anew_for_each_whole_number() -> None:
    """Called by another with 2 and with 3, it has one signature."""
    assert _twice_and_thrice(1.0) == 5.0
    assert len(_scaled.signatures) == 1


def test_assign_copies_a_vector() -> None:
    """Into a part of another, too."""
    np.testing.assert_array_equal(_copied(np.arange(3.0)), [0.0, 0.0, 1.0, 2.0])


def test_types_go_into_words_and_back() -> None:
    """Arrays that may be written to and that may not, scalars, tuples, named tuples."""
    writable = types.Array(types.float64, 2, "C")
    fixed = types.Array(types.float64, 1, "C", readonly=True)
    named = types.NamedTuple([fixed, types.int64], Pair)
    for kind in (
        writable,
        fixed,
        types.float64,
        types.boolean,
        types.none,
        types.Tuple([writable, types.int64]),
        named,
    ):
        assert type_from(type_of(kind)) == kind
    assert type_of(fixed) == "const float64[1C]"
    with pytest.raises(ValueError, match="cannot be listed"):
        type_of(types.unicode_type)


def test_one_at_a_time_keeps_kernels_in_a_folder(tmp_path: Path) -> None:
    """A second one waits until the first is done."""
    entered = threading.Event()

    def enter() -> None:
        with _alone(tmp_path):
            entered.set()

    with _alone(tmp_path):
        other = threading.Thread(target=enter)
        other.start()
        assert not entered.wait(0.2)
    other.join()
    assert entered.is_set()


def test_the_cache_knows_the_places_of_numba() -> None:
    """A folder that was given, beside the source, the user's; in this order, as Numba has it."""
    kinds = [kind.__bases__[1].__name__ for kind in kernel_cache._Impl._locator_classes]
    assert kinds == ["UserProvidedCacheLocator", "InTreeCacheLocator", "UserWideCacheLocator"]
