"""Systems as bytes and in files: the traced expressions travel, not the Python functions.

The format is that of the core (``crates/filippov-expr/src/container.rs``, ``crates/filippov/src/saved.rs``).
Everything is checked before it is used, and nothing in it is ever executed.
"""

from __future__ import annotations

import os
import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from filippov._core import TracedSystem, load_system, save_system
from filippov.caution import warn_user
from filippov.errors import InputError, ModelError
from filippov.forms import Source
from filippov.prepare import Prepared
from filippov.resets import CoreAction

if TYPE_CHECKING:
    from typing_extensions import Self

    from filippov.regularized import Twin

__all__ = ["Loaded", "Saving", "packed", "unpacked"]


class Loaded(NamedTuple):
    """What the bytes of a system hold.

    Attributes
    ----------
    prepared : Prepared
        The system, ready to run.
    states : tuple of str or None
        Names of the states, if they have names of their own.
    params : dict of str to float
        Names and default values of the parameters.
    """

    prepared: Prepared
    states: tuple[str, ...] | None
    params: dict[str, float]


class Saving(ABC):
    """Systems that can be saved, sent and copied."""

    _source: Source | None
    _twin: Twin | None
    _params: dict[str, float]
    _states: tuple[str, ...] | None
    _n: int | None
    _prepared: Prepared | None
    _calls: dict[Any, Any]
    _outputs: dict[str, Callable[..., Any]]
    _discrete: tuple[str, ...]

    @abstractmethod
    def _prepared_now(self) -> Prepared:
        """Return the system of the core, traced now if it was not yet."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the system to a file, from which `load` makes it again.

        The file holds the traced expressions, the names and default values of the parameters, the names of
        the states, laws and resets: everything but the Python functions.

        Parameters
        ----------
        path : str or path-like
            The file; one that exists is replaced.

        Raises
        ------
        InputError
            If `path` is no name of a file.
        ModelError
            If the number of states is not known, or a function of the system could not be traced.
        TraceError
            If the system cannot be traced.
        OSError
            If the file cannot be written.

        Notes
        -----
        A function that branches on values of parameters is saved as it is for these values, and the loaded
        system holds for them alone. Backward time, and messages that quote a line of the function, need the
        function and are not possible with a loaded system.

        Examples
        --------
        >>> import tempfile, numpy as np, filippov as fl
        >>> @fl.system(states=("y", "v"))
        ... def oscillator(t, x, F=0.4):
        ...     y, v = x
        ...     return v, -y - F * np.sign(v)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     oscillator.save(folder + "/oscillator.flp")
        ...     copy = fl.System.load(folder + "/oscillator.flp")
        >>> copy
        System(n=2, F=0.4, surfaces=[v])
        >>> sol = copy.solve((0, 5), [1.0, 0.0], F=0.2)
        >>> bool((sol.y == oscillator.solve((0, 5), [1.0, 0.0], F=0.2).y).all())
        True
        """
        place = _path(path)
        place.write_bytes(self.to_bytes())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Return the system that `save` wrote.

        The file is checked before it is used. It holds no code: loading one from somebody else is safe.

        Parameters
        ----------
        path : str or path-like
            The file.

        Returns
        -------
        System

        Raises
        ------
        InputError
            If the file is not one of `save`, of another version, cut short or damaged.
        OSError
            If it cannot be read.
        """
        place = _path(path)
        return cls._restored(place.read_bytes(), f"path: {os.fspath(place)}")

    def to_bytes(self) -> bytes:
        """Return the system as bytes: what `save` writes. Equal systems give equal bytes.

        Raises
        ------
        ModelError, TraceError
            As `save`.
        """
        prepared = self._prepared_now()
        data, functions, _ = packed(prepared, self._params)
        if functions:
            names = [action.name for action in prepared.actions if not isinstance(action.map, TracedSystem)]
            raise ModelError(
                f"the map of the reset {names[0]} could not be traced, or jumps, and is called as a Python "
                "function; Python functions are not saved: write it with continuous NumPy functions"
            )
        return data

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Return the system that `to_bytes` wrote.

        Raises
        ------
        InputError
            If the bytes are others, of another version, cut short or damaged.

        Examples
        --------
        >>> import filippov as fl
        >>> relay = fl.System.relay([[0, 1], [-1, 0]], [0, 0.5], [0, 1])
        >>> fl.System.from_bytes(relay.to_bytes()).surfaces
        ['x[1]']
        >>> fl.System.from_bytes(relay.to_bytes()[:-1])
        Traceback (most recent call last):
        filippov.errors.InputError: data: incomplete, or with something behind its end: 247 bytes of 248
        """
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise InputError(f"data: bytes are needed, not {type(data).__name__}")
        return cls._restored(bytes(data), "data")

    @classmethod
    def _restored(cls, data: bytes, what: str) -> Self:
        new = cls.__new__(cls)
        try:
            new._restore(data, ())
        except ValueError as error:
            raise InputError(f"{what}: {error}") from None
        return new

    def _restore(
        self, data: bytes, functions: Sequence[Callable[..., Any]], remembers: Sequence[str] = ()
    ) -> None:
        self._restore_from(*unpacked(data, functions, remembers))

    def _restore_from(
        self, prepared: Prepared, states: tuple[str, ...] | None, params: dict[str, float]
    ) -> None:
        self._prepared, self._states, self._params = prepared, states, params
        self._n = prepared.core.n_states
        self._source, self._twin, self._calls, self._outputs = None, None, {}, {}
        core = prepared.core
        self._discrete = tuple(core.discrete()) if isinstance(core, TracedSystem) else ()

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        if self._prepared is None and self._n is not None:
            self._prepared_now()
        prepared = self._prepared
        state["_prepared"], state["_calls"] = None, {}
        if prepared is not None and isinstance(prepared.core, TracedSystem):
            for name in ("_prepared", "_calls", "_source", "_twin", "_params", "_states", "_n"):
                state.pop(name)
            state["_packed"] = packed(prepared, self._params)
        state["_outputs"] = _that_travel(self._outputs)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        data, outputs = state.pop("_packed", None), state.get("_outputs", {})
        self.__dict__.update(state)
        if data is not None:
            try:
                self._restore(*data)
            except ValueError as error:
                raise InputError(f"a pickled system: {error}") from None
            self._outputs = outputs


def _that_travel(outputs: Mapping[str, Callable[..., Any]]) -> dict[str, Callable[..., Any]]:
    """Return the outputs whose functions can be pickled; a warning names the others."""
    kept = {}
    for name, fun in outputs.items():
        try:
            pickle.dumps(fun)
        except (pickle.PicklingError, AttributeError, TypeError):
            continue
        kept[name] = fun
    left = [name for name in outputs if name not in kept]
    if left:
        warn_user(
            [f"the outputs {', '.join(left)} stay behind: their functions cannot be imported elsewhere"]
        )
    return kept


def _path(path: Any) -> Path:
    try:
        return Path(path)
    except TypeError:
        kind = "None" if path is None else type(path).__name__
        raise InputError(f"path: the name of a file is needed, not {kind}") from None


def packed(
    prepared: Prepared, params: Mapping[str, float]
) -> tuple[bytes, tuple[Callable[..., Any], ...], tuple[str, ...]]:
    """Return a system as bytes, the maps of its resets that are functions of Python, and what it `remembers`.

    Parameters
    ----------
    prepared : Prepared
        The system.
    params : dict of str to float
        Names and default values of its parameters.

    Raises
    ------
    ModelError
        If the system is a black box.
    """
    if not isinstance(prepared.core, TracedSystem):
        raise ModelError(
            "the function could not be traced, and only traced expressions are saved: write it with NumPy "
            "functions"
        )
    rows, functions = [], []
    for action in prepared.actions:
        is_traced = isinstance(action.map, TracedSystem)
        rows.append(tuple(action if is_traced else action._replace(map=None)))
        if not is_traced:
            functions.append(action.map)
    pinned = prepared.pinned
    values = None if pinned is None else [pinned[name] for name in params]
    data = save_system(prepared.core, list(params.values()), values, rows)
    return data, tuple(functions), prepared.remembers


def unpacked(
    data: bytes, functions: Sequence[Callable[..., Any]] = (), remembers: Sequence[str] = ()
) -> Loaded:
    """Return what `packed` was given.

    Raises
    ------
    ValueError
        If the bytes are not those of a system.
    ModelError
        If a function is missing.
    """
    core, states, names, defaults, values, rows = load_system(data)
    given = iter(functions)
    actions = []
    for when, numbers, core_map, name in rows:
        found = next(given, None) if core_map is None else core_map
        if found is None:
            raise ModelError(f"the map of the reset {name} is a Python function, which did not travel")
        actions.append(CoreAction(when, numbers, found, name))
    pinned = None if values is None else dict(zip(names, values, strict=True))
    prepared = Prepared(core, None, tuple(core.surfaces()), pinned, "", tuple(actions), tuple(remembers))
    return Loaded(prepared, tuple(states) or None, dict(zip(names, defaults, strict=True)))
