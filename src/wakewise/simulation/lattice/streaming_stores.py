"""Vectorised loads and non-temporal stores of float32 rows, for memory-bound kernels.

`load_element` and `store_element` carry LLVM's scoped `noalias`, so that a loop over nineteen rows is vectorised
without run-time checks: within one function, loaded rows are never stored to.

`stream_line` stores past the caches, because an ordinary store first fetches the line that it overwrites, a third of
the lattice's memory traffic. Processors without such stores use ordinary ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

from wakewise.core.jit.njit import COMPILED

LINE = 16
"""Populations in a line of cache."""

_Intrinsic = tuple[Signature, Any]


def _word(plain: Callable[..., Any]) -> Callable[[Any], Any]:
    """A word for kernels; in those that are interpreted `plain` stands for it."""
    return lambda made: intrinsic(made) if COMPILED else plain


def _place(context: Any, builder: ir.IRBuilder, signature: Signature, arguments: Any, which: int) -> Any:
    """Pointer to array[index], these two being the arguments from `which` on."""
    data = context.make_array(signature.args[which])(context, builder, arguments[which]).data
    return builder.gep(data, [arguments[which + 1]])


def _peeked(module: ir.Module) -> Any:
    domain = module.add_metadata(["wakewise lattice"])
    return module.add_metadata([module.add_metadata(["wakewise lattice: peeked", domain])])


@_word(lambda array, at: array[at])
def load_element(_: Any, array: Any, at: Any) -> _Intrinsic:
    """array[at], float32 in one dimension, `at` not negative; nothing in the function pokes it."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Signature, arguments: Any) -> Any:
        value = builder.load(_place(context, builder, signature, arguments, 0), align=4)
        value.set_metadata("alias.scope", _peeked(builder.module))
        return value

    return types.float32(array, at), generate


@_word(lambda array, at, value: array.__setitem__(at, value))
def store_element(_: Any, array: Any, at: Any, _value: Any) -> _Intrinsic:
    """array[at] = value; nothing in the function peeks it."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Signature, arguments: Any) -> Any:
        store = builder.store(arguments[2], _place(context, builder, signature, arguments, 0), align=4)
        store.set_metadata("noalias", _peeked(builder.module))
        return context.get_dummy_value()

    return types.void(array, at, types.float32), generate


def _copy(past_caches: bool) -> Any:
    def generate(context: Any, builder: ir.IRBuilder, signature: Signature, arguments: Any) -> Any:
        line = ir.VectorType(ir.FloatType(), LINE).as_pointer()
        into, source = (
            builder.bitcast(_place(context, builder, signature, arguments, which), line) for which in (0, 2)
        )
        store = builder.store(builder.load(source, align=4), into, align=4 * LINE if past_caches else 4)
        if past_caches:
            store.set_metadata("nontemporal", builder.module.add_metadata([ir.Constant(ir.IntType(32), 1)]))
        return context.get_dummy_value()

    return generate


def _copied(into: Any, at: int, source: Any, start: int) -> None:
    into[at : at + LINE] = source[start : start + LINE]


@_word(_copied)
def copy_line(_: Any, into: Any, at: Any, source: Any, start: Any) -> _Intrinsic:
    """Write source[start : start + 16] to into[at : at + 16]."""
    return types.void(into, at, source, start), _copy(past_caches=False)


@_word(_copied)
def stream_line(_: Any, into: Any, at: Any, source: Any, start: Any) -> _Intrinsic:
    """`copy_line` past the caches; into[at] must begin a line."""
    return types.void(into, at, source, start), _copy(past_caches=True)


@_word(lambda: None)
def settle_stores(_: Any) -> _Intrinsic:
    """Wait until all that was streamed can be read by other cores."""

    def generate(context: Any, builder: ir.IRBuilder, _signature: Signature, _arguments: Any) -> Any:
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate
