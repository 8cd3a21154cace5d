"""Numbers written as formulas of parameters, such as 2*pi/omega."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from typing import Any

from filippov.cli.mistakes import Mistake, hint

__all__ = ["expression"]

_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Constant, ast.Name, ast.Load, ast.operator, ast.unaryop)


def expression(text: str, names: Sequence[str], where: str) -> Any:
    """Return a number, or a function of parameters, written with + - * / ** and pi.

    Raises
    ------
    Mistake
        If the text is something else, or names what is no parameter.

    Examples
    --------
    >>> expression("2*pi/omega", ["omega"], "--period")(omega=4.0)
    1.5707963267948966
    """
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError):
        raise Mistake(f"{where}: {text!r} cannot be read; write like 2*pi/omega") from None
    used = sorted({node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - {"pi"})
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and type(node.value) not in (int, float)
        if is_text or not isinstance(node, _NODES):
            raise Mistake(f"{where}: {text!r} has more than numbers, parameters, pi and + - * / **")
    for name in used:
        if name not in names:
            raise Mistake(f"{where}: no parameter {name!r}{hint(name, names)}")
    try:
        # Powers of whole numbers have no bound on their digits; those of floats overflow.
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant):
                node.value = float(str(node.value))
        # Nothing but arithmetic of numbers and names is left in the text.
        value = eval(f"lambda {', '.join(used)}: {ast.unparse(tree)}", {"__builtins__": {}, "pi": math.pi})
        return value if used else value()
    except (ArithmeticError, TypeError) as error:
        raise Mistake(f"{where}: {text!r} has no value: {error}") from None
