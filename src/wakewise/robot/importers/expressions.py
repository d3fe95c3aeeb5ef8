"""Arithmetic of xacro's `${...}`: a small language of numbers, words and tables; never Python itself."""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable
from typing import Any

from wakewise.core.errors import InputError
from wakewise.robot.importers.xml import PlacedError

MAX_LENGTH = 2000
MAX_TEXT = 20_000
_MAX_EXPONENT = 64.0
_MAX_INTEGER = 2**128


def _power(base: Any, exponent: Any) -> Any:
    if abs(exponent) > _MAX_EXPONENT:
        raise InputError(f"exponent {exponent:g} too large")
    return base**exponent


_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: _power,
}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
    ast.Is: lambda a, b: a is b,
    ast.IsNot: lambda a, b: a is not b,
}
_NUMERIC: dict[str, Callable[..., Any]] = {
    **{
        name: getattr(math, name)
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "sqrt", "exp", "log"),
            *("log10", "radians", "degrees", "floor", "ceil", "fabs", "hypot", "fmod", "copysign"),
        )
    },
    "pow": _power,
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
}
_GENERAL: dict[str, Callable[..., Any]] = {"len": len, "str": str, "bool": bool, "int": int, "float": float}
_CONSTANTS: dict[str, Any] = {
    "pi": math.pi,
    "e": math.e,
    "tau": math.tau,
    "inf": math.inf,
    "True": True,
    "False": False,
    "true": True,
    "false": False,
    "None": None,
}
_TEXT_METHODS = frozenset({"lower", "upper", "strip", "startswith", "endswith", "split", "replace", "title", "join"})
_PREFIXES = ("math.", "python.", "xacro.", "python.math.")


def evaluate(text: str, lookup: Callable[[str], Any], functions: dict[str, Callable[[str], Any]] | None = None) -> Any:
    """Evaluate one expression.

    `text`: numbers, words in quotes, names, arithmetic, comparisons, `a if b else c`, indexing of tables, and the
    mathematical functions; nothing else exists in this language. `lookup`: gives the value of a name; raises KeyError
    if there is none. `functions`: further functions of one text argument, such as `load_yaml`. Raises InputError:
    without a place, which the caller adds.
    """
    if len(text) > MAX_LENGTH:
        raise InputError(f"expression of {len(text)} characters, at most {MAX_LENGTH} are read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's advice on its own syntax means nothing to the writer of a xacro
            tree = ast.parse(text.strip(), mode="eval")
        return _Evaluator(lookup, functions or {}).value(tree.body)
    except PlacedError:
        raise
    except KeyError as fault:
        raise InputError(f"in ${{{_short(text)}}}: {fault.args[0]} is not defined") from fault
    except InputError as fault:
        raise InputError(f"in ${{{_short(text)}}}: {fault}") from fault
    except (SyntaxError, TypeError, ValueError, ArithmeticError, LookupError, MemoryError, RecursionError) as fault:
        raise InputError(f"cannot evaluate ${{{_short(text)}}} ({type(fault).__name__})") from fault


class _Evaluator:
    def __init__(self, lookup: Callable[[str], Any], functions: dict[str, Callable[[str], Any]]) -> None:
        self.lookup = lookup
        self.functions = functions

    def value(self, node: ast.expr) -> Any:
        result = self._value(node)
        if isinstance(result, int) and abs(result) > _MAX_INTEGER:
            raise InputError("an integer too large")
        if isinstance(result, str) and len(result) > MAX_TEXT:
            raise InputError("a text too long")
        return result

    def _value(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=bool() | int() | float() | str() | None as constant):
                return constant
            case ast.Name(id=name):
                return self._named(name)
            case ast.BinOp():
                return self._binary(node)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not self.value(operand)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -_numeric(self.value(operand))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return _numeric(self.value(operand))
            case ast.BoolOp(op=ast.And(), values=values):
                return self._joined(values, until=False)
            case ast.BoolOp(op=ast.Or(), values=values):
                return self._joined(values, until=True)
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                return self._compared(left, ops, comparators)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.value(body) if self.value(test) else self.value(orelse)
            case ast.List(elts=elements) | ast.Tuple(elts=elements):
                return [self.value(element) for element in elements]
            case ast.Subscript(value=table, slice=ast.Slice() as part):
                return self._sliced(self.value(table), part)
            case ast.Subscript(value=table, slice=index):
                return self._indexed(self.value(table), self.value(index))
            case ast.Attribute():
                return self._attribute(node)
            case ast.Call(func=ast.Name(id="dict"), args=[], keywords=named):
                if any(word.arg is None for word in named):
                    raise InputError("dict(**table) is not part of the expressions that are read")
                return {word.arg: self.value(word.value) for word in named}
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._called(function, arguments)
            case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
                raise InputError("[... for ... in ...] is not part of the expressions that are read")
            case _:
                raise InputError(f"{type(node).__name__} is not part of the expressions that are read")

    def _named(self, name: str) -> Any:
        try:
            return self.lookup(name)
        except KeyError:
            if name in _CONSTANTS:
                return _CONSTANTS[name]
            raise

    def _binary(self, node: ast.BinOp) -> Any:
        if type(node.op) not in _BINARY:
            raise InputError(f"{type(node.op).__name__} is not part of the expressions that are read")
        left, right = self.value(node.left), self.value(node.right)
        if isinstance(node.op, ast.Add) and isinstance(left, str) and isinstance(right, str):
            return left + right
        left, right = _numeric(left), _numeric(right)
        return _numeric(_BINARY[type(node.op)](left, right))

    def _joined(self, values: list[ast.expr], *, until: bool) -> Any:
        result: Any = None
        for node in values:
            result = self.value(node)
            if bool(result) is until:
                break
        return result

    def _compared(self, left: ast.expr, ops: list[ast.cmpop], comparators: list[ast.expr]) -> bool:
        before = self.value(left)
        for op, node in zip(ops, comparators, strict=True):
            after = self.value(node)
            if not _COMPARE[type(op)](before, after):
                return False
            before = after
        return True

    def _sliced(self, table: Any, part: ast.Slice) -> Any:
        if not isinstance(table, list | str):
            raise InputError("only lists and words can be sliced")
        bounds = [None if node is None else self.value(node) for node in (part.lower, part.upper, part.step)]
        if not all(bound is None or (isinstance(bound, int) and not isinstance(bound, bool)) for bound in bounds):
            raise InputError("the bounds of a slice must be whole numbers")
        return table[slice(*bounds)]

    def _indexed(self, table: Any, index: Any) -> Any:
        if isinstance(table, dict):
            return table[index]
        if isinstance(table, list | str) and isinstance(index, int):
            return table[index]
        raise InputError("only tables, lists and words can be indexed")

    def _attribute(self, node: ast.Attribute) -> Any:
        dotted = _dotted(node)
        if dotted is not None:
            if dotted.startswith("math.") and dotted[5:] in _CONSTANTS:
                return _CONSTANTS[dotted[5:]]
            try:
                return self.lookup(dotted)
            except KeyError:
                pass
        table = self.value(node.value)
        if isinstance(table, dict):
            return table[node.attr]
        raise InputError(f"nothing has an attribute {node.attr} here")

    def _called(self, function: ast.expr, nodes: list[ast.expr]) -> Any:
        if isinstance(function, ast.Attribute) and function.attr in _TEXT_METHODS:
            name = _dotted(function)
            if name is None or not name.startswith(_PREFIXES):
                return self._text_method(function, nodes)
        name = _dotted(function) or ""
        for prefix in _PREFIXES:
            name = name.removeprefix(prefix)
        arguments = [self.value(node) for node in nodes]
        if name in self.functions and len(arguments) == 1 and isinstance(arguments[0], str):
            return self.functions[name](arguments[0])
        if name in _NUMERIC:
            flat = arguments[0] if len(arguments) == 1 and isinstance(arguments[0], list) else arguments
            return _numeric(_NUMERIC[name](*[_numeric(value) for value in flat]))
        if name in _GENERAL and len(arguments) == 1:
            return _GENERAL[name](arguments[0])
        raise InputError(f"{name or 'that'}() is not part of the expressions that are read")

    def _text_method(self, function: ast.Attribute, nodes: list[ast.expr]) -> Any:
        text = self.value(function.value)
        arguments = [self.value(node) for node in nodes]
        if function.attr == "join" and isinstance(text, str) and len(arguments) == 1:
            words = arguments[0]
            if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
                raise InputError(".join() is for words only")
            if sum(len(word) + len(text) for word in words) > MAX_TEXT:
                raise InputError("a text too long")
            return text.join(words)
        if not isinstance(text, str) or not all(isinstance(value, str) for value in arguments):
            raise InputError(f".{function.attr}() is for words only")
        if function.attr == "replace" and len(text) * max(1, len(arguments[-1])) > MAX_TEXT:
            raise InputError("a text too long")
        return getattr(text, function.attr)(*arguments)


def _numeric(value: Any) -> Any:
    if isinstance(value, bool | int | float):
        return value
    raise InputError(f"{value!r:.40} is not a number")


def _dotted(node: ast.expr) -> str | None:
    """`a.b.c` as text, None if the node is anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        left = _dotted(node.value)
        return None if left is None else f"{left}.{node.attr}"
    return None


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
