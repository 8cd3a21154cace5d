"""What a function assigns outside of itself: it may remember earlier calls, which a trace does not."""

from __future__ import annotations

import dis
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Any

__all__ = ["remembered"]


def remembered(function: Any) -> list[str]:
    """Return the names outside of itself that a function assigns, or whose entries it assigns.

    Parameters
    ----------
    function : callable
        ``fun(t, x, ...)``: a function, a method, a partial of these, or an object with `__call__`. Anything
        else assigns nothing that could be seen.

    Returns
    -------
    list of str
        Entries are those of globals, of variables of outer functions, of attributes, and of arguments other
        than t and x.

    Notes
    -----
    Methods that change an object, such as `append`, and functions that are called are not looked into.

    Examples
    --------
    >>> from filippov.trace.memory import remembered
    >>> relay = {"on": True}
    >>> def room(t, x):
    ...     relay["on"] = x[0] < 19
    ...     return [2 * relay["on"] - 0.1 * x[0]]
    >>> remembered(room), remembered(lambda t, x: -x)
    (['relay[...]'], [])
    """
    n_bound = 0  # arguments in front of t and x
    if isinstance(function, partial):
        n_bound = len(function.args)
        function = function.func
    if not isinstance(function, FunctionType | MethodType):
        function = getattr(function, "__call__", None)  # noqa: B004
    if isinstance(function, MethodType):
        n_bound += 1
        function = function.__func__
    if not isinstance(function, FunctionType):
        return []
    code = function.__code__
    arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    walk = _Walk(code, {*arguments} - {*arguments[n_bound : n_bound + 2]})
    for instruction in dis.get_instructions(code):
        walk.take(instruction)
    return sorted(walk.assigned)


class _Walk:
    """A walk along the instructions of a function, with what is known of the stack of its interpreter.

    An entry of the stack is the name of an object that was there before the call, or None. Jumps are not
    followed: what is unknown is None, so that something may be missed.
    """

    def __init__(self, code: CodeType, outer_arguments: set[str]) -> None:
        self.assigned: set[str] = set()
        self._free = frozenset(code.co_freevars)
        self._locals: dict[str, str | None] = {name: name for name in outer_arguments}
        self._stack: list[str | None] = []
        self._before = ""

    def take(self, instruction: dis.Instruction) -> None:
        """Take one instruction."""
        name, argument = instruction.opname, instruction.argval
        effect = dis.stack_effect(instruction.opcode, instruction.arg, jump=False)
        if instruction.is_jump_target and self._stack:
            self._stack[-1] = None  # one of several values
        if name in ("STORE_GLOBAL", "STORE_ATTR") or (name == "STORE_DEREF" and argument in self._free):
            self.assigned.add(str(argument))
        elif name in _PLACES_OF_CONTAINERS:
            container = self._at(_PLACES_OF_CONTAINERS[name])
            if container is not None:
                self.assigned.add(f"{container}[...]")
        if name in _ENDS:
            self._stack.clear()
        elif name in _UNSEEN:
            pass
        elif name in _MOVES:
            self._move(_MOVES[name], instruction.arg or 0)
        elif "_FAST" in name:
            # From Python 3.13 on one instruction may do two things: STORE_FAST_LOAD_FAST.
            names = argument if isinstance(argument, tuple) else (argument,)
            verbs = [verb for verb in name.split("_") if verb in ("LOAD", "STORE", "DELETE")]
            for verb, each in zip(verbs, names, strict=False):
                self._take_local(verb, each)
        else:
            self._replace(effect, name, argument)
        self._before = name

    def _take_local(self, verb: str, name: str) -> None:
        if verb == "LOAD":
            self._stack.append(self._locals.get(name))
        elif verb == "STORE":
            self._locals[name] = self._stack.pop() if self._stack else None

    def _replace(self, effect: int, name: str, argument: Any) -> None:
        """Take an instruction that replaces entries at the top of the stack by one or more."""
        value = None
        is_free = name in ("LOAD_DEREF", "LOAD_CLASSDEREF") and argument in self._free
        is_global = name == "LOAD_GLOBAL" and effect == 1  # 2 where it is called
        is_attribute = name == "LOAD_ATTR" and effect == 0 and self._at(1) is not None  # 1 where it is called
        if is_free or is_global or is_attribute:
            value = argument
        elif name == "BINARY_SUBSCR" and self._before != "BUILD_SLICE":  # a slice of a list is a copy
            value = self._at(2)
        pops = -effect if effect < 0 else 0
        if pops:
            del self._stack[-pops:]
        only_pushes = name.startswith(("LOAD_", "PUSH_")) and name not in ("LOAD_ATTR", "LOAD_METHOD")
        if self._stack and not only_pushes:
            self._stack[-1] = None
        self._stack += [None] * max(effect, 0)
        if self._stack:
            self._stack[-1] = value

    def _move(self, move: str, count: int) -> None:
        """Copy or exchange entries at the top of the stack."""
        stack = self._stack
        n_needed = max(count, 4)
        stack[:0] = [None] * (n_needed - len(stack))
        if move == "copy":
            stack.append(stack[-max(count, 1)])
        elif move == "copy two":
            stack += stack[-2:]
        elif move == "swap":
            stack[-1], stack[-count] = stack[-count], stack[-1]
        else:
            stack.insert(-int(move) + 1, stack.pop())

    def _at(self, depth: int) -> str | None:
        """Return the entry that is number `depth` from the top."""
        return self._stack[-depth] if depth <= len(self._stack) else None


_PLACES_OF_CONTAINERS = {"STORE_SUBSCR": 2, "STORE_SLICE": 3}
_ENDS = frozenset(
    [
        *("JUMP_FORWARD", "JUMP_BACKWARD", "JUMP_ABSOLUTE", "JUMP_BACKWARD_NO_INTERRUPT"),
        *("RETURN_VALUE", "RETURN_CONST", "RAISE_VARARGS", "RERAISE"),
    ]
)
_UNSEEN = frozenset(["NOP", "CACHE", "EXTENDED_ARG", "RESUME"])
_MOVES = {
    "COPY": "copy",
    "DUP_TOP": "copy",
    "DUP_TOP_TWO": "copy two",
    "SWAP": "swap",
    "ROT_TWO": "2",
    "ROT_THREE": "3",
    "ROT_FOUR": "4",
}
