"""The interactive page: in a notebook by `explore`, in a browser by ``filippov app``.

The page is one front for all places. What it draws is computed by the core of this package: compiled to
WebAssembly inside of the page, or by the kernel where there is no WebAssembly or a function of the system is
called as a Python function.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from filippov.app.page import Page, make_page
from filippov.app.script import write_script

if TYPE_CHECKING:
    from filippov.app.widget import Explorer

__all__ = ["Page", "explore", "make_page", "write_script"]


def explore(
    system: Any,
    y0: Any = None,
    t_span: Any = None,
    params: Mapping[str, Any] | None = None,
    *,
    title: str | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    method: str = "auto",
    axes: Sequence[int | str] | None = None,
) -> Explorer:
    """Show a system with sliders, phase portrait and diagrams in a notebook.

    Parameters
    ----------
    system : System, callable, Problem or str
        The system; a function ``f(t, x, a=1.0)``; a reference problem, or its name.
    y0 : array_like, shape (n,), or dict, optional
        Initial state; that of a reference problem by default.
    t_span : (float, float), optional
        Interval of integration, in the units of the model; by default that of a reference problem, else
        ``(0, 20)``.
    params : dict, optional
        By the name of a parameter a number, its value at the start, or a pair ``(low, high)``, the range of
        its slider. Pairs may be given by the names of states too.
    title : str, optional
    rtol, atol, method : optional
        As for `solve_ivp`.
    axes : pair of int or str, optional
        The states on the axes of the phase portrait; the first two by default.

    Returns
    -------
    Explorer
        A widget. Its `params`, `y0` and `t_span` are those of the sliders, in both directions, `sol` is the
        solution for them, and ``script()`` a Python script that repeats it.

    Raises
    ------
    ImportError
        If anywidget is not installed; ``pip install "filippov[app]"``.
    NotBuilt
        If the page was not built into this installation.
    InputError
        If an argument is wrong; the message names it.
    ModelError, TraceError
        If the system cannot be made or run.

    Examples
    --------
    >>> import filippov as fl
    >>> w = fl.explore("dry_friction", params={"F": (0, 2)})  # doctest: +SKIP
    >>> w.params["F"], w.sol.success  # doctest: +SKIP
    (0.4, True)
    """
    from filippov.app.widget import Explorer

    page = make_page(system, y0, t_span, params, title=title, rtol=rtol, atol=atol, method=method, axes=axes)
    return Explorer(page)
