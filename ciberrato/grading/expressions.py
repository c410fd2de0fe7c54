"""Formulas of a course: arithmetic over named numbers, read as a syntax tree and never run as a program."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

from ciberrato.errors import UsageError

MOST_CHARACTERS = 1000

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: math.pow,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
}
_COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_CALLS: dict[str, tuple[Callable[..., float], int, int]] = {
    "min": (min, 2, 20),
    "max": (max, 2, 20),
    "abs": (abs, 1, 1),
    "round": (lambda value: float(math.floor(value + 0.5)), 1, 1),
    "floor": (lambda value: float(math.floor(value)), 1, 1),
    "ceil": (lambda value: float(math.ceil(value)), 1, 1),
    "sqrt": (math.sqrt, 1, 1),
    "exp": (math.exp, 1, 1),
    "log": (math.log, 1, 1),
}


class Formula:
    """A formula.

    It knows numbers, the names given, ``+ - * / // % **``, comparisons, ``and or not``, ``A if C else B``,
    and the functions min, max, abs, round (halves up), floor, ceil, sqrt, exp and log.

    Parameters
    ----------
    text : str
    names : collection of str
        Names that it may use.

    Raises
    ------
    UsageError
        If it is no formula, or uses another name; says which.
    """

    def __init__(self, text: str, names: frozenset[str]) -> None:
        self.text = text
        if len(text) > MOST_CHARACTERS:
            raise UsageError(f"a formula has at most {MOST_CHARACTERS} characters, not {len(text)}")
        try:
            self._root = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise UsageError(f"{text!r} is not a formula") from None
        self.names = frozenset(self._check(self._root, names))

    def __call__(self, values: Mapping[str, float]) -> float:
        """Compute it.

        Parameters
        ----------
        values : mapping of str to float
            True and False count as 1 and 0.

        Returns
        -------
        float

        Raises
        ------
        UsageError
            If it has no finite value there, as after a division by 0.
        """
        try:
            result = float(_value(self._root, values))
        except (ArithmeticError, ValueError) as error:
            raise UsageError(f"{self.text!r} has no value: {error}") from None
        if not math.isfinite(result):
            raise UsageError(f"{self.text!r} has no finite value")
        return result

    def _check(self, node: ast.AST, names: frozenset[str]) -> list[str]:
        match node:
            case ast.Constant(value=bool() | int() | float()):
                return []
            case ast.Name(id=name):
                if name not in names:
                    known = ", ".join(sorted(names))
                    raise UsageError(f"{self.text!r}: unknown name {name!r}; the names are: {known}")
                return [name]
            case ast.BinOp(op=op) if type(op) in _BINARY:
                children: list[ast.AST] = [node.left, node.right]
            case ast.UnaryOp(op=unary) if type(unary) in _UNARY:
                children = [node.operand]
            case ast.Compare() if all(type(op) in _COMPARE for op in node.ops):
                children = [node.left, *node.comparators]
            case ast.BoolOp():
                children = [*node.values]
            case ast.IfExp():
                children = [node.test, node.body, node.orelse]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _CALLS:
                _, least, most = _CALLS[name]
                if not least <= len(arguments) <= most:
                    raise UsageError(f"{self.text!r}: {name} takes {least} or more values")
                children = [*arguments]
            case _:
                raise UsageError(f"{self.text!r}: {ast.unparse(node)!r} is not allowed in a formula")
        return [name for child in children for name in self._check(child, names)]


def _value(node: Any, values: Mapping[str, float]) -> float:
    match node:
        case ast.Constant(value=bool() | int() | float() as value):
            return float(value)
        case ast.Name(id=name):
            return float(values[name])
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_value(left, values), _value(right, values))
        case ast.UnaryOp(op=unary, operand=operand):
            return float(_UNARY[type(unary)](_value(operand, values)))
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            sides = [_value(side, values) for side in (left, *comparators)]
            pairs = zip(ops, sides, sides[1:], strict=False)
            return float(all(_COMPARE[type(op)](one, other) for op, one, other in pairs))
        case ast.BoolOp(op=ast.And(), values=parts):
            return float(all(_value(part, values) for part in parts))
        case ast.BoolOp(values=parts):
            return float(any(_value(part, values) for part in parts))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _value(body if _value(test, values) else orelse, values)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _CALLS[name][0](*(_value(argument, values) for argument in arguments))
    raise AssertionError(ast.dump(node))
