"""What a continuation finds: points, special points, and why it ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, overload

import numpy as np

from filippov.analysis.optional import need
from filippov.cycles.codimension_two import CODIMENSION_TWO
from filippov.cycles.cycle import Cycle
from filippov.cycles.rest import Equilibrium
from filippov.errors import InputError

__all__ = ["CHANGES", "CODES", "Branch", "Point", "Special", "SpecialPoints"]

State = Cycle | Equilibrium

# What the codes of special points mean.
CODES = {
    "LP": "fold",
    "PD": "period doubling",
    "NS": "Neimark-Sacker: a torus begins",
    "BP": "branch point",
    "HB": "Hopf",
    "PSN": "pseudo-saddle-node",
    "PH": "pseudo-Hopf: its surfaces turn from attracting to repelling",
    "BE": "boundary equilibrium",
    "CS": "crossing-sliding",
    "GS": "grazing-sliding",
    "SS": "switching-sliding",
    "AS": "adding-sliding",
    "GR": "grazing of a reset",
    "CO": "corner: two boundaries at once",
    "TF": "two-fold",
    **CODIMENSION_TWO,
    "UZ": "a monitor vanishes",
    "EP": "end",
}


# At these the flow takes another itinerary.
CHANGES = ("CS", "SS", "GS", "AS", "GR", "CO", "TF", "BE")


class Point(NamedTuple):
    """A point of a branch.

    Attributes
    ----------
    params : dict
        Values of the parameters that vary.
    state : Cycle or Equilibrium
    tests : dict
        Values of test functions.
    """

    params: dict[str, float]
    state: State
    tests: dict[Any, float]

    @property
    def is_admissible(self) -> bool:
        """Whether the flow follows the itinerary there: all its test functions are positive."""
        if isinstance(self.state, Equilibrium):
            return self.state.is_admissible
        return all(value > 0 for key, value in self.tests.items() if key[0] in CHANGES)


class Special(NamedTuple):
    """A special point.

    Attributes
    ----------
    code : str
        One of `CODES`.
    kind : str
        What that means.
    surface : str
        The surface concerned, printed; empty if there is none.
    t : float
        When it happens in the cycle; NaN if that has no meaning.
    params : dict
        Values of the parameters that vary.
    point : int
        The place on the branch: behind this point.
    state : Cycle or Equilibrium
    test : object
        Which test function vanishes.
    tangent : tuple of float
        At BP: the direction of the branch, by its unknowns and the parameter.
    """

    code: str
    kind: str
    surface: str
    t: float
    params: dict[str, float]
    point: int
    state: State
    test: Any = None
    tangent: tuple[float, ...] = ()

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.12g}" for name, value in self.params.items())
        about = f" at {self.surface} = 0" if self.surface else ""
        when = "" if np.isnan(self.t) else f", t = {self.t:.6g}"
        return f"{self.code} ({self.kind}{about}) {values}{when}"


class SpecialPoints(Sequence[Special]):
    """The special points of a branch; those of one code by ``special["CS"]``."""

    def __init__(self, points: Sequence[Special]) -> None:
        self._points = list(points)

    @overload
    def __getitem__(self, key: int) -> Special: ...

    @overload
    def __getitem__(self, key: str | slice) -> list[Special]: ...

    def __getitem__(self, key: int | str | slice) -> Special | list[Special]:
        if isinstance(key, str):
            if key not in CODES:
                raise InputError(f"special: the codes are {', '.join(CODES)}, not {key!r}")
            return [point for point in self._points if point.code == key]
        return self._points[key]

    def __len__(self) -> int:
        return len(self._points)

    def __iter__(self) -> Iterator[Special]:
        return iter(self._points)

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._points)) or "no special points"

    def to_pandas(self) -> Any:
        """Return the table as a pandas DataFrame, a row for each point."""
        rows = [
            {"code": p.code, "kind": p.kind, "surface": p.surface, "t": p.t, "point": p.point, **p.params}
            for p in self._points
        ]
        return need("pandas", "a table").DataFrame(rows)


class Branch:
    """A branch of cycles or equilibria, or a curve of special points in two parameters.

    Attributes
    ----------
    points : list of Point
        In their order along the branch.
    special : SpecialPoints
    reason : str
        Why it ended, at both ends.
    names : tuple of str
        The parameters that vary.
    """

    def __init__(
        self,
        points: Sequence[Point],
        special: Sequence[Special],
        reasons: Mapping[str, str],
        names: Sequence[str],
        monitors: Sequence[str] = (),
        at_value: Callable[[State, str, float], State] | None = None,
    ) -> None:
        self._at_value = at_value
        self.points, self.special = list(points), SpecialPoints(special)
        self.reasons, self.names, self.monitors = dict(reasons), tuple(names), tuple(monitors)

    @property
    def reason(self) -> str:
        """Why the branch ended, at both ends, in words."""
        return "; ".join(f"{side}: {text}" for side, text in self.reasons.items())

    def __len__(self) -> int:
        return len(self.points)

    @property
    def quantities(self) -> list[str]:
        """The names that `values` takes: parameters, states, monitors, and ``"period"`` for cycles."""
        first = self.points[0].state
        states = first.system.state_names(len(_start(first)))
        return [*self.names, *states, *self.monitors, *(["period"] if isinstance(first, Cycle) else [])]

    def values(self, name: str) -> Any:
        """Return a quantity along the branch: a parameter, a state, a monitor, or ``"period"``, an array."""
        if name in self.names:
            return np.array([point.params[name] for point in self.points])
        if name in self.monitors:
            return np.array([point.tests[("UZ", name)] for point in self.points])
        first = self.points[0].state
        if name == "period" and isinstance(first, Cycle):
            return np.array([_period(point.state) for point in self.points])
        states = first.system.state_names(len(_start(first)))
        if name in states:
            i = states.index(name)
            return np.array([_start(point.state)[i] for point in self.points])
        raise InputError(f"the branch has {', '.join(map(repr, self.quantities))}, and no {name!r}")

    def special_values(self, name: str) -> Any:
        """Return a quantity at the special points, an array.

        A monitor is interpolated between the points beside a special point.
        """
        if name in self.monitors:
            along, values, first = self.values(self.names[0]), self.values(name), self.names[0]
            found = []
            for special in self.special:
                i, j = special.point, min(special.point + 1, len(self) - 1)
                width = along[j] - along[i]
                share = (special.params[first] - along[i]) / width if width else 0.0
                found.append(values[i] + min(max(share, 0.0), 1.0) * (values[j] - values[i]))
            return np.array(found)
        if not len(self.special):
            self.values(name)
            return np.zeros(0)
        points = [Point(special.params, special.state, {}) for special in self.special]
        return Branch(points, (), {}, self.names).values(name)

    @property
    def stable(self) -> Any:
        """Whether each point is stable, an array of bool."""
        return np.array([point.state.is_stable for point in self.points])

    @property
    def multipliers(self) -> Any:
        """The multipliers of the cycles, complex, of shape (points, n).

        Raises
        ------
        InputError
            If the branch is one of equilibria.
        """
        self._refuse_kind(Cycle, "multipliers")
        return np.array([_multipliers(point.state) for point in self.points])

    @property
    def eigenvalues(self) -> Any:
        """The eigenvalues of the equilibria, complex, of shape (points, n); NaN where sliding takes some.

        Raises
        ------
        InputError
            If the branch is one of cycles.
        """
        self._refuse_kind(Equilibrium, "eigenvalues")
        return _padded([_eigenvalues(point.state) for point in self.points])

    def _refuse_kind(self, wanted: type, name: str) -> None:
        if not isinstance(self.points[0].state, wanted):
            what = "cycles" if wanted is Cycle else "equilibria"
            raise InputError(f"{name}: only branches of {what} have them")

    @property
    def admissible(self) -> Any:
        """Whether the flow follows each point, an array of bool."""
        return np.array([point.is_admissible for point in self.points])

    def at(self, **params: float) -> State:
        """Return the cycle or equilibrium at the value of a parameter; the first one along the branch.

        Raises
        ------
        InputError
            If the branch does not come there.
        """
        if len(params) != 1 or next(iter(params)) not in self.names:
            raise InputError(f"at: the value of one of {', '.join(self.names)} is needed")
        ((name, value),) = params.items()
        along = self.values(name) - float(value)
        places = np.flatnonzero(along[:-1] * along[1:] <= 0)
        if not len(places):
            raise InputError(f"{name}: the branch does not come to {value:g}")
        k = int(places[0])
        nearer = k if abs(along[k]) <= abs(along[k + 1]) else k + 1
        for special in self.special:
            # Between two points at which the flow takes different itineraries the special point decides.
            if special.point == k and special.code in CHANGES:
                change = special.params[name] - float(value)
                nearer = k if change * along[k + 1] >= 0 else k + 1
        assert self._at_value is not None
        return self._at_value(self.points[nearer].state, name, float(value))

    @property
    def data(self) -> Any:
        """The branch as an xarray Dataset with the dimension `point`.

        Files of NetCDF have no complex numbers: `multipliers` and `eigenvalues` have the dimension `part`,
        for the real and the imaginary part. As complex arrays they are `Branch.multipliers` and
        `Branch.eigenvalues`.
        """
        xarray = need("xarray", "a branch as a Dataset")
        first = self.points[0].state
        variables: dict[str, Any] = {name: ("point", self.values(name)) for name in self.names}
        for name in first.system.state_names(len(_start(first))):
            variables[name] = ("point", self.values(name))
        for name in self.monitors:
            variables[name] = ("point", self.values(name))
        states = [point.state for point in self.points]
        if isinstance(first, Cycle):
            variables["period"] = ("point", self.values("period"))
            variables["multipliers"] = (("point", "multiplier", "part"), _parts(self.multipliers))
            variables["n_zero"] = ("point", np.array([_n_zero(s) for s in states]))
        else:
            variables["eigenvalues"] = (("point", "eigenvalue", "part"), _parts(self.eigenvalues))
        variables["stable"] = ("point", self.stable)
        variables["itinerary"] = ("point", np.array([_itinerary_text(s) for s in states]))
        variables["admissible"] = ("point", self.admissible)
        variables["residual"] = ("point", np.array([s.residual for s in states]))
        return xarray.Dataset(variables, {"part": ["real", "imag"]}, {"reason": self.reason})

    def plot(self, x: str | None = None, y: str | None = None, ax: Any = None, **options: Any) -> Any:
        """Draw one quantity over another, stable parts as lines, unstable ones dashed, special points named.

        Parameters
        ----------
        x, y : str, optional
            Names as in `values`. Default: the parameter, and the period or the first state; for a curve in
            two parameters these.
        ax : matplotlib Axes, optional
        **options
            `dark`, `labels`, `legend` of `filippov.plot.branches`.

        Returns
        -------
        matplotlib Axes
        """
        from filippov.plot.branches import branches

        return branches(self, x, y, ax, **options)

    def __repr__(self) -> str:
        what = "cycles" if isinstance(self.points[0].state, Cycle) else "equilibria"
        ranges = ", ".join(
            f"{name} from {np.min(self.values(name)):.6g} to {np.max(self.values(name)):.6g}"
            for name in self.names
        )
        n = len(self.special)
        return f"Branch({len(self)} {what}, {ranges}; {n} special point{'s' * (n != 1)}; {self.reason})"


def _start(state: State) -> Any:
    """Return the state at the start: with forcing that at time 0 modulo the period, else that at a switch."""
    if isinstance(state, Cycle):
        return state.at(0.0) if state.is_forced else state.y0
    return state.y


def _period(state: State) -> float:
    return state.period if isinstance(state, Cycle) else np.nan


def _multipliers(state: State) -> Any:
    assert isinstance(state, Cycle)
    return state.multipliers


def _n_zero(state: State) -> int:
    assert isinstance(state, Cycle)
    return state.n_zero


def _eigenvalues(state: State) -> Any:
    assert isinstance(state, Equilibrium)
    return state.eigenvalues


def _padded(rows: Sequence[Any]) -> Any:
    width = max(len(row) for row in rows)
    found = np.full((len(rows), width), np.nan + 0j)
    for out, row in zip(found, rows, strict=True):
        out[: len(row)] = row
    return found


def _parts(values: Any) -> Any:
    """Return real and imaginary parts along a last dimension."""
    return np.stack([values.real, values.imag], axis=-1)


def _itinerary_text(state: State) -> str:
    return " ".join(map(str, state.modes)) if isinstance(state, Cycle) else str(state.mode)
