"""Derivatives of a run by its start and its parameters: what is asked for, and what is read of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

from filippov._core import TracedSystem
from filippov.errors import InputError
from filippov.prepare import Prepared
from filippov.unknown import did_you_mean

__all__ = ["FORWARD_ONLY", "Back", "Wanted", "check_wrt", "refuse_without_derivatives"]

FORWARD_ONLY = "wrt: derivatives are followed forward in time only"
_STATE, _START, _PARAMETER = 0, 1, 2


class Wanted(NamedTuple):
    """By what is differentiated.

    Attributes
    ----------
    names : tuple of str
        The names of the columns.
    columns : list of (int, int)
        Each column as the core takes it: a kind, and a place.
    parameters : list of int
        The places of the parameters among all of the system.
    order : int
        The order of the derivatives; 0 for a run that is kept for gradients of costs.
    memory : int or None
        How many bytes the record of such a run may take; any number if None.
    """

    names: tuple[str, ...]
    columns: list[tuple[int, int]]
    parameters: list[int]
    order: int = 1
    memory: int | None = None

    def for_core(self) -> tuple[list[tuple[int, int]], list[int], int, int | None]:
        """Return what the core takes."""
        return self.columns, self.parameters, self.order, self.memory


class Back(NamedTuple):
    """``wrt=`` of a run that is kept for gradients of costs.

    Attributes
    ----------
    wrt : str or sequence of str
        By what is differentiated.
    memory : int or None
        How many bytes the record of the run may take; any number if None.
    """

    wrt: Any
    memory: int | None = None


def check_wrt(
    wrt: Any,
    states: Sequence[str],
    params: Collection[str],
    discrete: Collection[str],
    order: Any = 1,
) -> Wanted:
    """Return by what is differentiated.

    Parameters
    ----------
    wrt : str, sequence of str, or Back
        ``"y0"`` (all initial states), ``"t0"``, names of parameters and of discrete states (by their values
        at the start), ``"params"`` (all parameters), ``"all"`` (initial states and parameters).
    states : sequence of str
        Names of the states.
    params : collection of str
        Names of the parameters of the system in their order, its discrete states among them.
    discrete : collection of str
        Those that are discrete states.
    order : int, optional
        The order of the derivatives, 1 or 2.

    Raises
    ------
    InputError
        If a name is unknown, or nothing is asked for.
    """
    if order not in (1, 2) or isinstance(order, bool):
        raise InputError(f"order: derivatives are of order 1 or 2, not {order!r}")
    if isinstance(wrt, Back):
        return check_wrt(wrt.wrt, states, params, discrete)._replace(order=0, memory=wrt.memory)
    names = [wrt] if isinstance(wrt, str) else wrt
    if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(
            'wrt: "y0", "t0", "params", "all", or a list of these and of names of parameters is needed, '
            f"not {wrt!r}"
        )
    places = {name: place for place, name in enumerate(params) if name not in discrete}
    held = [name for name in params if name in discrete]
    found: dict[str, tuple[int, int]] = {}
    asked: dict[str, int] = {}
    for name in names:
        if name in ("y0", "all"):
            found.update((state, (_STATE, i)) for i, state in enumerate(states))
        if name in ("params", "all"):
            own = list(places)
        elif name in places:
            own = [name]
        elif name in held:
            # Discrete states are states behind those of the system.
            own = []
            found[name] = (_STATE, len(states) + held.index(name))
        else:
            own = []
            if name == "t0":
                found["t0"] = (_START, 0)
            elif name != "y0":
                known = ", ".join(map(repr, (*places, *held))) if places or held else "none"
                hint = did_you_mean(name, ["y0", "t0", "params", "all", *places, *held])
                raise InputError(
                    f'wrt: {name!r} is none of "y0", "t0", "params" and "all", and no parameter{hint}; '
                    f"parameters: {known}"
                )
        for parameter in own:
            if parameter in states and not {"y0", "all"}.isdisjoint(names):
                raise InputError(
                    f"wrt: {parameter!r} is a state and a parameter, and columns have one name each"
                )
            place = asked.setdefault(parameter, len(asked))
            found[parameter] = (_PARAMETER, place)
    if not found:
        raise InputError(f"wrt: {wrt!r} names nothing: the system has no parameters")
    return Wanted(tuple(found), list(found.values()), [places[name] for name in asked], int(order))


def refuse_without_derivatives(
    prepared: Prepared, t_span: tuple[float, float] = (0.0, 1.0), argument: str = "wrt"
) -> None:
    """Refuse derivatives of what has none, which an argument asks for.

    Raises
    ------
    InputError
        For a black box, a reset whose map is not traced, and time that runs backward.
    """
    if not isinstance(prepared.core, TracedSystem):
        raise InputError(
            f"{argument}: derivatives are those of a traced function, and this one is called: "
            f"{prepared.why_untraced}"
        )
    for action in prepared.actions:
        if not isinstance(action.map, TracedSystem):
            raise InputError(
                f"{argument}: the map of the reset {action.name!r} is not traced: its derivative is not known"
            )
    if t_span[1] < t_span[0]:
        raise InputError(FORWARD_ONLY)
