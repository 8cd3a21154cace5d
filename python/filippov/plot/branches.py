"""Branches of cycles and equilibria over a parameter, and curves of special points in two parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.plot.labels import place_labels
from filippov.plot.style import Theme, draw_legend, handle, new_axes, numbered_colour, theme
from filippov.unknown import drawing

if TYPE_CHECKING:
    from filippov.cycles.branch import Branch

__all__ = ["branches"]

Array = npt.NDArray[np.float64]

# The kinds of the parts of a branch: name, line style, width.
_STYLES: dict[str, tuple[Any, float]] = {
    "stable": ("-", 1.8),
    "unstable": ((0, (4, 1.6)), 1.4),
    "not followed by the flow": ((0, (1, 1.6)), 1.2),
}
_VIRTUAL = "not followed by the flow"
# A marker for each kind of special point: smooth bifurcations, boundaries, sliding, resets, monitors.
_MARKERS = {
    "o": ("LP", "PD", "NS", "BP", "HB"),
    "s": ("PSN", "PH", "BE", "TF"),
    "D": ("CS", "GS", "SS", "AS", "CO"),
    "^": ("GR",),
    "x": ("UZ",),
}
_OF_CODE = {code: marker for marker, codes in _MARKERS.items() for code in codes}
_UNMARKED = ("EP",)
# Shares of the ranges of the axes: a change below the first in x with one above the second in y is a jump.
_NO_STEP, _JUMP = 0.005, 0.05


class _Part(NamedTuple):
    """A run of one kind: its name, and its points."""

    kind: str
    x: Array
    y: Array


@drawing
def branches(
    drawn: Branch | Sequence[Branch],
    x: str | None = None,
    y: str | None = None,
    ax: Any = None,
    dark: bool | None = None,
    labels: Sequence[str] | None = None,
    legend: bool | str = True,
) -> Any:
    """Draw branches of cycles and equilibria in one axes: a bifurcation diagram.

    Stable parts are solid, unstable ones dashed, and parts that the flow does not follow dotted and grey.
    Special points have markers and their codes: circles for smooth bifurcations, squares for boundary
    equilibria and pseudo-saddle-nodes, diamonds for sliding bifurcations, triangles for grazing of a reset,
    crosses for zeros of monitors.

    Parameters
    ----------
    drawn : Branch or sequence of Branch
        What `continuation` found.
    x, y : str, optional
        Names as in `Branch.values`. By default the parameter of the first branch, and the period if all are
        branches of cycles, else the first state; the two parameters for curves in two.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    labels : sequence of str, optional
        Names of the branches for the legend.
    legend : bool or str, optional
        As for `time_series`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    InputError
        If a branch has no such quantity.
    TypeError
        If something is no branch.
    ValueError
        If there is nothing to draw, or not one label for each branch.

    Examples
    --------
    >>> axes = fl.plot.branches([cycles, equilibria], "alpha", "x[0]")  # doctest: +SKIP
    """
    given = [drawn] if hasattr(drawn, "points") or not isinstance(drawn, Iterable) else drawn
    every: list[Any] = list(given)
    for branch in every:
        if not hasattr(branch, "points"):
            raise TypeError(f"branches: each is a Branch, as of fl.continuation, not {type(branch).__name__}")
    if not every:
        raise ValueError("branches: there is none to draw")
    if labels is not None and len(labels) != len(every):
        raise ValueError(f"labels: {len(every)} are needed, one for each branch, not {len(labels)}")
    x, y = _names(every, x, y)
    found = [(list(_parts(branch, x, y)), _marks(branch, x, y)) for branch in every]
    ax = new_axes(ax, (6.4, 4.2), dark)
    chosen = theme(dark)
    colours = [numbered_colour(k, chosen) or chosen.faint for k in range(len(every))]
    present: set[str] = set()
    for (parts, _), colour in zip(found, colours, strict=True):
        for part in parts:
            _draw_part(ax, part, colour, chosen)
            present.add(part.kind)
    for (_, marks), colour in zip(found, colours, strict=True):
        _draw_marks(ax, marks, colour, chosen)
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.margins(0.05)
    draw_legend(ax, _handles(present, colours, labels, chosen, every), chosen, legend)
    place_labels(ax, [mark for _, marks in found for mark in marks], _lines(found), chosen)
    return ax


def _names(drawn: Sequence[Branch], x: str | None, y: str | None) -> tuple[str, str]:
    first = drawn[0]
    if len(first.names) == 2:
        default_x, default_y = first.names
    else:
        default_x = first.names[0]
        has_periods = all("period" in branch.quantities for branch in drawn)
        default_y = "period" if has_periods else first.quantities[len(first.names)]
    return default_x if x is None else x, default_y if y is None else y


def _kinds(branch: Branch) -> list[str]:
    if len(branch.names) == 2:
        return ["stable" if inside else _VIRTUAL for inside in branch.admissible]
    return [
        _VIRTUAL if not inside else "stable" if stable else "unstable"
        for inside, stable in zip(branch.admissible, branch.stable, strict=True)
    ]


def _parts(branch: Branch, x: str, y: str) -> Iterator[_Part]:
    """Yield the parts of a branch with one kind each; special points are the ends of parts."""
    own_x, own_y, kinds = branch.values(x), branch.values(y), _kinds(branch)
    rows: list[tuple[float, float, float, str | None]] = [
        (float(k), own_x[k], own_y[k], kinds[k]) for k in range(len(branch))
    ]
    between = [special for special in branch.special if special.code not in _UNMARKED]
    at_x, at_y = _at_special(branch, x), _at_special(branch, y)
    # Those between the same two points stand in the order in which the branch lists them.
    rows += [
        (special.point + 0.5 + 1e-3 * k, at_x[k], at_y[k], None)
        for k, special in enumerate(between)
        if special.point < len(branch) - 1
    ]
    rows.sort(key=lambda row: row[0])
    jumps = _jumps(np.array([row[1:3] for row in rows]), [row[3] is None for row in rows])
    start, kind = 0, kinds[0]
    for k in range(1, len(rows)):
        if jumps[k - 1]:
            yield _part(kind, rows[start:k])
            start = k
            continue
        following = _kind_of(rows[k - 1][3], rows[k][3], kind)
        if k - 1 > start and following != kind:
            yield _part(kind, rows[start:k])
            start = k - 1
        kind = following
    yield _part(kind, rows[start:])


def _jumps(points: Array, is_special: Sequence[bool]) -> npt.NDArray[np.bool_]:
    """Return where a quantity jumps between neighbouring points, a mask of shape (k - 1,).

    Behind a sliding bifurcation a cycle may start at another switch: its start is not continuous there.
    A heuristic: the quantity changes much and the parameter hardly, beside a special point.
    """
    size = np.ptp(points, axis=0)
    changes = np.abs(np.diff(points, axis=0)) / np.where(size > 0.0, size, 1.0)
    beside = np.array([a or b for a, b in pairwise(is_special)], dtype=bool)
    return np.asarray(beside & (changes[:, 0] < _NO_STEP) & (changes[:, 1] > _JUMP))


def _kind_of(before: str | None, after: str | None, latest: str) -> str:
    """Return the kind of the piece between two points; a special point has none of its own."""
    return before or after or latest


def _part(kind: str, rows: Sequence[tuple[float, float, float, str | None]]) -> _Part:
    return _Part(kind, np.array([row[1] for row in rows]), np.array([row[2] for row in rows]))


def _at_special(branch: Branch, name: str) -> Array:
    shown = np.array([special.code not in _UNMARKED for special in branch.special], dtype=bool)
    return np.array(branch.special_values(name)[shown], dtype=np.float64)


def _marks(branch: Branch, x: str, y: str) -> list[tuple[float, float, str]]:
    """Return places and codes of the special points."""
    codes = [special.code for special in branch.special if special.code not in _UNMARKED]
    return list(zip(_at_special(branch, x).tolist(), _at_special(branch, y).tolist(), codes, strict=True))


def _draw_part(ax: Any, part: _Part, colour: str, chosen: Theme) -> None:
    line, width = _STYLES[part.kind]
    ax.plot(
        part.x,
        part.y,
        color=chosen.crossing if part.kind == _VIRTUAL else colour,
        linestyle=line,
        linewidth=width,
        label=part.kind,
        zorder=2.0,
    )


def _draw_marks(ax: Any, marks: Sequence[tuple[float, float, str]], colour: str, chosen: Theme) -> None:
    for marker in _MARKERS:
        places = [(x, y) for x, y, code in marks if _OF_CODE.get(code, "o") == marker]
        if places:
            ax.plot(
                *np.array(places).T,
                marker=marker,
                linestyle="none",
                color=chosen.ink,
                markerfacecolor=chosen.ground if marker != "x" else chosen.ink,
                markeredgewidth=1.2,
                markersize=5.5,
                label="special",
                zorder=3.0,
            )


def _lines(found: Sequence[tuple[list[_Part], Any]]) -> list[Array]:
    return [np.array([part.x, part.y]) for parts, _ in found for part in parts]


def _handles(
    present: set[str], colours: Sequence[str], labels: Sequence[str] | None, chosen: Theme, drawn: Any
) -> list[Any]:
    handles = []
    if labels is not None:
        handles += [
            handle(label, color=colour, linewidth=1.8) for colour, label in zip(colours, labels, strict=True)
        ]
    ink = colours[0] if len(colours) == 1 and labels is None else chosen.ink
    two_parameters = all(len(branch.names) == 2 for branch in drawn)
    for kind in _STYLES:
        if kind not in present or (two_parameters and kind == "stable"):
            continue
        line, width = _STYLES[kind]
        colour = chosen.crossing if kind == _VIRTUAL else ink
        handles.append(handle(kind, color=colour, linestyle=line, linewidth=width))
    return handles
