"""Numba's `njit` as kernels here use it: kept on disk, compiled anew when anything they are made of changes.

A kernel holds the code of the kernels that it calls and the constants that it names. Numba looks at the kernel's own
file only when it asks whether what it kept is still right, so a change in a callee would go unheard. Here the question
is asked of the file and of every file of the package that it imports, and those import in turn. Numba's index of what
it kept is read, changed and written with no lock, so that of two processes that compile at once one can leave the
other's code under a wrong name; here they wait for each other.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from copy import copy
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import add_symbol, parse_assembly
from numba.core import caching

PACKAGE = Path(__file__).resolve().parents[2]
LOCK = "kernels.lock"
_IMPORTS = re.compile(r"^\s*from (wakewise[\w.]*) import (\([^)]*\)|[^\n#]*)", re.MULTILINE)

_ARRAY = re.compile(r"(const )?(\w+)\[(\d)([CFA])\]")

TypeWords = str | list[Any] | dict[str, list[Any]]

JIT = not numba.config.DISABLE_JIT
"""Whether Numba compiles: not with NUMBA_DISABLE_JIT=1, where kernels run as the Python that they are written in."""

prange = numba.prange
types: Any = numba.types


def njit(function: Callable[..., Any] | None = None, *, apart: bool = False, **options: Any) -> Any:
    """`numba.njit`, kept on disk, with NumPy's rules for division by zero unless `options` say otherwise.

    Numba copies a kernel's code into each that calls it, and optimises and emits it there again, at each level. One
    that is `apart` is compiled once and called by its name; meant for kernels that are long to compile and long to run.

    Raises
    ------
    ValueError
        If a kernel that is to be apart is no module's own, so that no other process would find it by its name.
    """

    def decorate(work: Callable[..., Any]) -> Any:
        if apart and "<locals>" in work.__qualname__:
            raise ValueError(f"kernel {work.__qualname__}: only a module's own kernel can stand apart")
        if not JIT:
            return work
        # No kernel is handed to C as a callback, and what that takes is a share of each compilation.
        kernel = numba.njit(**{"error_model": "numpy", "no_cfunc_wrapper": True} | options)(work)
        kernel._cache = KernelCache(work)  # as Dispatcher.enable_caching does it with Numba's own
        typed = kernel.get_call_template

        def template(args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
            answer = typed(tuple(map(_widened, args)), kws)
            if apart:
                for kinds in kernel.overloads:
                    _call_by_name(kernel, kinds)
            return answer

        kernel.get_call_template = template
        return kernel

    return decorate if function is None else decorate(function)


_named: dict[str, Any] = {}


def _call_by_name(kernel: Any, kinds: tuple[Any, ...]) -> None:
    """Let kernels that are compiled from now on call this one by a name, which is the same in every process."""
    module, name = kernel.py_func.__module__, kernel.py_func.__qualname__
    symbol = f"{module}.{name}.{hashlib.sha256(repr(kinds).encode()).hexdigest()[:16]}"
    if symbol in _named:
        return
    made = _named[symbol] = kernel.overloads[kinds]
    add_symbol(symbol, made.library.get_pointer_to_function(made.fndesc.llvm_func_name))
    called = copy(made.fndesc)
    called.mangled_name = symbol
    context = made.target_context
    context.remove_user_function(made.entry_point)
    context.insert_user_function(made.entry_point, called, [_ByName(partial(_bring, module, name, kinds))])


class _ByName:
    """Linked to a caller in place of a kernel's code: only word of what must be there when the caller is loaded."""

    def __init__(self, bring: Callable[[], None]) -> None:
        self._reload_init = {bring}

    def _ensure_finalized(self) -> None:
        pass

    def _get_module_for_linking(self) -> Any:
        return parse_assembly("")


def _bring(module: str, name: str, kinds: tuple[Any, ...]) -> None:
    """Have a kernel there by its name: read from disk, or compiled where it is gone from there."""
    kernel = getattr(import_module(module), name)
    kernel.compile(kinds)
    _call_by_name(kernel, kinds)


def _widened(kind: Any) -> Any:
    """A whole number's type without its value: one kernel calls another with 0 and with 1 and needs it but once."""
    return types.unliteral(kind) if isinstance(kind, types.IntegerLiteral) else kind


class _OfAllItsFiles:
    """What makes one of Numba's locators ask about all of a kernel's files."""

    _py_file: str

    def get_source_stamp(self) -> bytes:
        """Digest of the kernel's file and all that it imports from the package."""
        return digest(Path(self._py_file).resolve())


class _GivenFolder(_OfAllItsFiles, caching.UserProvidedCacheLocator):
    """Keeps kernels in the folder of NUMBA_CACHE_DIR."""


class _BesideSource(_OfAllItsFiles, caching.InTreeCacheLocator):
    """Keeps kernels in `__pycache__` beside their source."""


class _UserFolder(_OfAllItsFiles, caching.UserWideCacheLocator):
    """Keeps kernels in the user's cache."""


class _Impl(caching.CompileResultCacheImpl):
    _locator_classes = [_GivenFolder, _BesideSource, _UserFolder]  # noqa: RUF012  (as Numba has it)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """A kernel read from disk, and what must be there when it is loaded.

        Numba does what must be done and forgets it. A caller that is compiled later copies this kernel's code, names of
        kernels apart in it, and is kept; read from disk by a process that has none of them, it would jump nowhere.
        """
        kernel = super().rebuild(target_context, payload)
        kernel.library._reload_init.update(kernel.reload_init)
        return kernel


class KernelCache(caching.FunctionCache):
    """Numba's cache of one kernel, with the two remedies that this page begins with."""

    _impl_class = _Impl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kept code, or None; also where the record of what is kept names a class that has moved since."""
        try:
            return super().load_overload(sig, target_context)
        except (ImportError, AttributeError):
            self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for a signature, while no other process does the same in that folder."""
        with _alone(Path(self.cache_path)):
            super().save_overload(sig, data)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Wait until no other process is in the block with this folder; without locks, go on at once."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        with suppress(OSError):  # a file system that knows no locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


@cache
def digest(path: Path) -> bytes:
    """SHA-256 over the contents of a file and of all files of the package that it imports, near and far."""
    whole = hashlib.sha256()
    for file in sorted(_reached(path)):
        name = file.relative_to(PACKAGE) if PACKAGE in file.parents else file.name
        whole.update(f"{name}\0".encode() + _own_digest(file))
    return whole.digest()


@cache
def _own_digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def _reached(path: Path) -> set[Path]:
    """A file and those that it imports, and so on."""
    found: set[Path] = set()
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting.extend(imported(file))
    return found


@cache
def imported(path: Path) -> frozenset[Path]:
    """Files of the package that a file imports by `from wakewise... import ...`, wherever in it that stands."""
    found: set[Path] = set()
    for module, names in _IMPORTS.findall(path.read_text(encoding="utf-8")):
        place = PACKAGE.joinpath(*module.split(".")[1:])
        for candidate in (place, *(place / name for name in re.findall(r"\w+", names))):
            found.update(file for file in (candidate.with_suffix(".py"), candidate / "__init__.py") if file.exists())
    return frozenset(found - {PACKAGE / "__init__.py"})


def type_of(kind: Any) -> TypeWords:
    """A type of Numba's in words that JSON holds and `type_from` reads.

    `float64`; `const float64[2C]` for a read-only array; a list for a tuple; {class: [...]} for a named one.

    Raises
    ------
    ValueError
        If it is none of the types that kernels here are called with from Python.
    """
    if isinstance(kind, types.Array) and kind.aligned:
        return f"{'' if kind.mutable else 'const '}{kind.dtype}[{kind.ndim}{kind.layout}]"
    if isinstance(kind, types.BaseNamedTuple):
        record = kind.instance_class
        return {f"{record.__module__}.{record.__qualname__}": [type_of(part) for part in kind]}
    if isinstance(kind, types.BaseTuple):
        return [type_of(part) for part in kind]
    if isinstance(kind, types.Number | types.Boolean | types.NoneType) and not isinstance(kind, types.Literal):
        return str(kind)
    raise ValueError(f"a kernel was called with {kind!r}, which cannot be listed")


def type_from(words: TypeWords) -> Any:
    """Type of Numba's from what `type_of` made of it."""
    if isinstance(words, dict):
        ((name, parts),) = words.items()
        module, _, record = name.rpartition(".")
        return types.BaseTuple.from_types([type_from(part) for part in parts], getattr(import_module(module), record))
    if isinstance(words, list):
        return types.BaseTuple.from_types([type_from(part) for part in words])
    if array := _ARRAY.fullmatch(words):
        const, dtype, ndim, layout = array.groups()
        return types.Array(getattr(types, dtype), int(ndim), layout, readonly=bool(const))
    return getattr(types, words)
