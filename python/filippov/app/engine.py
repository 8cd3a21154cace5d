"""The kernel as the engine of a page: the core answers; cycles and branches come from the package."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import PageModel
from filippov.app.page import Page
from filippov.app.reply import Reply, failure, read_reply
from filippov.app.script import write_script
from filippov.app.sentences import branch_sentence, cycle_sentence, special_phrase
from filippov.cycles import Branch, Cycle, continuation, equilibrium, limit_cycle
from filippov.cycles.branch import State
from filippov.errors import FilippovError, InputError
from filippov.options import check_options
from filippov.scalars import real

__all__ = ["Engine"]

Array = npt.NDArray[np.float64]

_CORE_KINDS = ("describe", "run", "section", "diagram", "portrait", "ends", "basins", "sample")
_MOST_POINTS = 300
_SAMPLES = 401  # of a cycle, for its extent: to 3e-5 of the amplitude of a sine
_LOG = logging.getLogger(__name__)


class Engine:
    """Answers the requests of a page.

    Parameters
    ----------
    page : Page

    Notes
    -----
    A request is data: a JSON object whose field ``kind`` is one of `kinds`. Nothing in it is executed, no
    file is read or written for it. What is wrong with it comes back as a reply with ``ok: false`` and a
    sentence. Requests may come from several threads.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        why = page.why_it_stays()
        self.model = b"" if why else page.to_bytes()
        self._core = self._called() if why else PageModel(self.model)
        self._is_called = bool(why)
        # Functions of Python, and what a system keeps for its next run, are used by one request at a time.
        self._turn = threading.Lock()
        self._own: dict[str, Callable[[Mapping[str, Any]], Reply]] = {
            "cycle": self._cycle,
            "continuation": self._continuation,
            "script": self._script,
        }

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of requests that are answered."""
        own = ("script",) if self._is_called else tuple(self._own)
        return (*_CORE_KINDS, *own)

    def answer(self, request: bytes) -> bytes:
        """Return the reply to a request, both as bytes."""
        try:
            given = json.loads(request)
        except (ValueError, RecursionError) as error:
            return failure(f"the request is no JSON: {error}", "request")
        kind = given.get("kind") if isinstance(given, dict) else None
        if not isinstance(kind, str) or kind not in self.kinds:
            return failure(f"kind: {kind!r} is none of {', '.join(self.kinds)}", "request")
        if kind not in self._own:
            if not self._is_called:
                return self._with_kinds(kind, self._core.answer(request))
            with self._turn:
                return self._with_kinds(kind, self._core.answer(request))
        try:
            with self._turn:
                return self._own[kind](given).to_bytes()
        except (FilippovError, ValueError) as error:
            return failure(str(error), "argument")
        except (
            Exception
        ) as error:  # a request is answered, whatever happens; a page would wait for the answer
            _LOG.exception("the request %r failed", kind)
            return failure(f"The kernel failed at this: {type(error).__name__}: {error}", "failed")

    def _with_kinds(self, kind: str, data: bytes) -> bytes:
        if kind != "describe":
            return data
        reply = read_reply(data)
        return reply._replace(header={**reply.header, "kinds": list(self.kinds)}).to_bytes()

    def _make(self, values: list[float], t0: float, y0: list[float]) -> Any:
        params = dict(zip(self.page.params, values, strict=True))
        prepared = self.page.system.prepare(len(y0), t0, np.array(y0, dtype=np.float64), params)
        return prepared.core, list(prepared.actions)

    def _called(self) -> PageModel:
        page, prepared = self.page, self.page.prepared()
        return PageModel.of_calls(
            self._make,
            list(page.states),
            page.params,
            list(prepared.surfaces),
            page.section(),
            [action.name for action in prepared.actions],
            list(page.system.discrete),
        )

    def _script(self, given: Mapping[str, Any]) -> Reply:
        rtol, atol = _number(given, "rtol", self.page.rtol), _number(given, "atol", self.page.atol)
        start, (t0, t1) = self._start(given), self._span(given)
        method = given.get("method") or self.page.method
        checked = check_options({"rtol": rtol, "atol": atol, "method": method}, (t0, t1), len(start))
        page = self.page._replace(rtol=rtol, atol=atol, method=checked.method)
        text = write_script(page, start, (t0, t1), self._params(given))
        return Reply({"ok": True, "kind": "script", "text": text}, {})

    def _cycle(self, given: Mapping[str, Any]) -> Reply:
        found = self._found_cycle(given)
        motions, t0, start = found._from_inside()
        request = {
            "kind": "run",
            "y0": start.tolist(),
            "t_span": [t0, t0 + found.period],
            "params": found.params,
            "memory": list(motions.before or ()),
            "rtol": min(self.page.rtol, 1e-8),
            "atol": min(self.page.atol, 1e-10),
        }
        reply = read_reply(self._core.answer(json.dumps(request).encode()))
        if not reply.header.get("ok"):
            return reply
        header = {
            **reply.header,
            "kind": "cycle",
            "period": found.period,
            "multipliers": _pairs(found.multipliers),
            "stable": found.is_stable,
            "forced": found.is_forced,
            "text": cycle_sentence(found),
        }
        return reply._replace(header=header)

    def _continuation(self, given: Mapping[str, Any]) -> Reply:
        name, bounds = given.get("parameter"), given.get("range")
        if not isinstance(name, str) or name not in self.page.params:
            raise InputError(
                f"parameter: one of {', '.join(self.page.params) or 'none'} is needed, not {name!r}"
            )
        low, high = _numbers({"range": bounds}, "range", 2)
        of = given.get("of", "cycle")
        start: State
        if of == "cycle":
            start = self._found_cycle(given)
        elif of == "equilibrium":
            start = equilibrium(self.page.system, self._start(given), self._params(given))
        else:
            raise InputError(f'of: "cycle" or "equilibrium" is needed, not {of!r}')
        most = min(_MOST_POINTS, max(1, int(_number(given, "max_points", _MOST_POINTS))))
        branch = continuation(start, name, (min(low, high), max(low, high)), max_points=most)
        return _branch_reply(branch, name)

    def _found_cycle(self, given: Mapping[str, Any]) -> Cycle:
        period = None if given.get("period") is None else _number(given, "period", 0.0)
        t0 = _number(given, "t0", self._span(given)[0])
        return limit_cycle(self.page.system, self._start(given), self._params(given), period=period, t0=t0)

    def _start(self, given: Mapping[str, Any]) -> list[float]:
        if given.get("y0") is None:
            return list(self.page.y0)
        return _numbers(given, "y0", len(self.page.y0))

    def _span(self, given: Mapping[str, Any]) -> list[float]:
        return list(self.page.t_span) if given.get("t_span") is None else _numbers(given, "t_span", 2)

    def _params(self, given: Mapping[str, Any]) -> dict[str, float]:
        values = given.get("params") or {}
        if not isinstance(values, dict):
            raise InputError("params: an object of names and numbers is needed")
        changed = self.page.system.parameter_values(values)
        return {name: changed[name] if name in values else value for name, value in self.page.params.items()}


def _branch_reply(branch: Branch, name: str) -> Reply:
    """Return a branch as a reply: at every point the parameter, the state, and the extent of a cycle."""
    states = [point.state for point in branch.points]
    extents = [_extent(state) for state in states]
    special = [
        {
            "index": found.point,
            "value": found.params[name],
            "code": found.code,
            "text": special_phrase(found),
            "y": _place(found.state).tolist(),
        }
        for found in branch.special
    ]
    header = {
        "ok": True,
        "kind": "continuation",
        "parameter": name,
        "special": special,
        "text": branch_sentence(branch),
    }
    arrays = {
        "value": np.array([point.params[name] for point in branch.points]),
        "y": np.array([_place(state) for state in states]),
        "low": np.array([low for low, _ in extents]),
        "high": np.array([high for _, high in extents]),
        "period": np.array([state.period if isinstance(state, Cycle) else np.nan for state in states]),
        "stable": np.array([float(state.is_stable) for state in states]),
        "admissible": np.array([float(point.is_admissible) for point in branch.points]),
    }
    return Reply(header, arrays)


def _place(state: State) -> Array:
    place: Array = state.y0 if isinstance(state, Cycle) else state.y
    return place


def _extent(state: State) -> tuple[Array, Array]:
    if not isinstance(state, Cycle):
        return state.y, state.y
    run = state.solution
    assert run.sol is not None  # a run over one period keeps its steps
    # Steps are long: their ends alone would miss the extremes. Both sides of a jump are ends of steps.
    between = run.sol(np.linspace(run.t[0], run.t[-1], _SAMPLES))
    y = np.concatenate([run.y, between], axis=1)
    return y.min(axis=1), y.max(axis=1)


def _pairs(values: Any) -> list[list[float]]:
    return [[float(value.real), float(value.imag)] for value in values]


def _number(given: Mapping[str, Any], name: str, default: float) -> float:
    value = given.get(name)
    if value is None:
        return default
    try:
        found = real(value)
    except (TypeError, ValueError):
        found = np.nan
    if not np.isfinite(found):
        raise InputError(f"{name}: a finite number is needed, not {value!r}")
    return found


def _numbers(given: Mapping[str, Any], name: str, count: int) -> list[float]:
    values = given.get(name)
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{name}: a list of {count} numbers is needed, not {values!r}")
    return [_number({name: value}, name, 0.0) for value in values]
