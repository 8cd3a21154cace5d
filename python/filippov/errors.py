"""Exceptions and warnings of the package.

Every message names the cause, the place (time, state, surface, mode, as far as known) and what to try.

During a run nothing is raised for numerical reasons: the partial solution comes back with ``status``,
``message`` and ``success = False``. The exceptions here report bad input, models that cannot be used, and
the outcomes for which the caller asked to have an exception (`nonunique="error"`) or has pressed Ctrl-C.
"""

from __future__ import annotations

from typing import Any

__all__ = [
    "FilippovError",
    "FilippovWarning",
    "InputError",
    "Interrupted",
    "ModelError",
    "NonUniqueError",
    "ToleranceError",
    "TraceError",
]


class FilippovError(Exception):
    """Base class of every error of this package.

    Parameters
    ----------
    message : str
        What happened and what to try.
    t : float, optional
        Time of the event, in the units of the model.
    state : array_like, shape (n,), optional
        State at that time.
    surface : str, optional
        Printed switching function concerned.
    mode : tuple of int, optional
        Mode at that time, over {-1, 0, +1}.
    partial : Solution, optional
        What was computed before the error.
    """

    def __init__(
        self,
        message: str = "",
        *,
        t: float | None = None,
        state: Any = None,
        surface: str | None = None,
        mode: tuple[int, ...] | None = None,
        partial: Any = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.t = t
        self.state = state
        self.surface = surface
        self.mode = mode
        self.partial = partial

    def __reduce__(self) -> tuple[Any, ...]:
        # The default protocol loses keyword-only attributes; worker processes send errors back by pickle.
        return type(self), (self.message,), self.__dict__.copy()


class TraceError(FilippovError):
    """A user's function cannot be turned into an expression.

    Declare the surfaces (``surfaces=``) to run such a function as a black box, or write it with NumPy
    functions.
    """


class ModelError(FilippovError):
    """The functions of a model do not fit together (number of components, surfaces, signs)."""


class InputError(FilippovError, ValueError):
    """An argument has a wrong value or shape. The message starts with the name of the argument."""


class ToleranceError(InputError):
    """A tolerance is not a positive finite number, or has the wrong shape."""


class NonUniqueError(FilippovError):
    """The solution is not unique at a point, with ``nonunique="error"``.

    `partial` is the solution up to that point, `candidates` are the modes (tuples of int) in which a solution
    can go on.
    """

    candidates: tuple[tuple[int, ...], ...] = ()


class FilippovWarning(UserWarning):
    """A result may not be the one that was intended.

    The text starts with the code of the warning, so that ``warnings.filterwarnings("ignore", code,
    fl.FilippovWarning)`` silences one kind. `Solution.warnings` keeps all of them.

    Parameters
    ----------
    message : str
        Code, and what was found.
    code : str
        Short name of the kind, as in `RunWarning`; of a sweep or an ensemble all kinds, separated by ", ".
    t : float, optional
        Time at which it was first noticed.
    surfaces : tuple of str, optional
        The printed switching functions that it is about.
    result : Solution, Ensemble or xarray.Dataset, optional
        What the call returns. Where warnings are errors, it is found here and not lost.
    """

    def __init__(
        self,
        message: str = "",
        *,
        code: str = "",
        t: float | None = None,
        surfaces: tuple[str, ...] = (),
        result: Any = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.t = t
        self.surfaces = surfaces
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.message,), self.__dict__.copy()


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run. It is a `KeyboardInterrupt` with the part that was computed.

    Parameters
    ----------
    message : str
        Where the run was interrupted.
    partial : Solution, Ensemble, xarray.Dataset or None
        Of a run, the solution up to the last accepted step. Of an ensemble, the members that were begun, the
        last ones up to where they came. Of `poincare` the returns until then. Of a sweep the whole Dataset:
        points that were cut short have the reason ``interrupted``, those not begun ``not_run``. None for a
        sweep with a store, which has what is finished on disk.
    """

    def __init__(self, message: str = "", partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial
