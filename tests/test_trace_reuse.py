"""A trace kept from an earlier call is used only where tracing again would give the same.

Every change of what a function reads is made between two calls of `solve_ivp`; the second must give what a
first call gives, and what the function itself says.
"""

from __future__ import annotations

import builtins
import functools
import inspect
import math
import sys
import types
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import filippov as fl
import filippov.numpy as fnp
import numpy as np
import pytest
from filippov import prepare
from filippov.trace.fingerprint import fingerprint

SPAN, START = (0.0, 1.0), (1.0, 2.0)

slope = 1.0
table = {"slope": [1.0, 2.0]}
matrix = np.eye(2)
matrix_view = np.arange(4.0).reshape(2, 2)
settings = types.SimpleNamespace(slope=1.0)
parameters = types.ModuleType("parameters")
parameters.slope = 1.0  # type: ignore[attr-defined]
alias_a = [1.0]
alias_b = alias_a


@pytest.fixture(autouse=True)
def nothing_kept() -> Iterator[None]:
    prepare._KEPT.clear()
    yield
    prepare._KEPT.clear()


def final(fun: Any, **options: Any) -> tuple[float, ...]:
    sol = fl.solve_ivp(fun, SPAN, START, **options)
    return tuple(sol.y[:, -1].tolist())


def fresh(fun: Any, **options: Any) -> tuple[float, ...]:
    prepare._KEPT.clear()
    return final(fun, **options)


def is_kept(fun: Any, **options: Any) -> bool:
    """Whether a second call of `solve_ivp` does without tracing."""
    final(fun, **options)
    n_calls = 0

    def count(frame: Any, event: str, arg: Any) -> None:
        nonlocal n_calls
        n_calls += event == "call" and frame.f_code.co_name == "_explore"

    sys.setprofile(count)
    try:
        final(fun, **options)
    finally:
        sys.setprofile(None)
    return n_calls == 0


def check_change(fun: Callable[..., Any], change: Callable[[], Any], **options: Any) -> None:
    """The answer after a change is that of a first call, and differs from the one before."""
    before = [final(fun, **options) for _ in range(3)]
    assert before[0] == before[1] == before[2]
    change()
    after = final(fun, **options)
    assert after == fresh(fun, **options)
    assert after != before[0]


# ------------------------------------------------------------------ what is kept


def reads_nothing(t: Any, x: Any) -> Any:
    return [x[1], -x[0] - 0.1 * np.sign(x[1])]


def reads_global(t: Any, x: Any) -> Any:
    return [x[1], -slope * x[0]]


def helper(x: Any) -> Any:
    return -slope * x


def calls_helper(t: Any, x: Any) -> Any:
    return [x[1], helper(x[0])]


def reads_table(t: Any, x: Any) -> Any:
    return [x[1], -table["slope"][0] * x[0]]


def reads_matrix(t: Any, x: Any) -> Any:
    return -matrix @ x


def reads_matrix_view(t: Any, x: Any) -> Any:
    return -matrix_view @ x


def reads_module(t: Any, x: Any) -> Any:
    return [x[1], -parameters.slope * x[0]]  # type: ignore[attr-defined]


def uses_library(t: Any, x: Any, k: float = math.pi) -> Any:
    dx = np.zeros_like(x)
    dx[0] = fnp.sin(x[1]) * np.linalg.norm(x)
    dx[1] = -math.sqrt(k) * np.clip(x[0], -1.0, 1.0) + sum(v for v in x)
    return dx


def with_default(t: Any, x: Any, k: float = 1.0, *, m: float = 2.0) -> Any:
    return [x[1], -k * m * x[0]]


def recursive(t: Any, x: Any, depth: int = 3) -> Any:
    if depth is None or depth == 0:
        return [x[1], -x[0]]
    return recursive(t, x, depth - 1)


def closure(k: float) -> Callable[..., Any]:
    return lambda t, x: [x[1], -k * x[0]]


KEPT: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in [
        reads_nothing,
        reads_global,
        calls_helper,
        reads_table,
        reads_matrix,
        reads_matrix_view,
        reads_module,
        uses_library,
        with_default,
        recursive,
    ]
}
KEPT |= {
    "closure": closure(2.0),
    "lambda": lambda t, x: np.abs(x) - x,
    "partial": functools.partial(with_default, k=3.0),
}


@pytest.mark.parametrize("name", KEPT)
def test_a_function_that_reads_plain_data_is_traced_once(name: str) -> None:
    assert is_kept(KEPT[name])


def test_a_function_of_numpy_that_was_inspected_is_the_same() -> None:
    inspect.signature(np.abs)
    assert is_kept(lambda t, x: np.abs(x) - 2 * x)


def test_reference_problems_are_traced_once() -> None:
    for name in fl.problems.names():
        problem = fl.problems.get(name)
        assert fingerprint(problem.fun, problem.args) is not None, name


def test_parameters_by_name_are_not_part_of_a_trace() -> None:
    final(with_default, params={"k": 1.0})
    assert is_kept(with_default, params={"k": 2.0})
    assert final(with_default, params={"k": 2.0}) == fresh(with_default, params={"k": 2.0})


def test_a_trace_that_was_decided_by_a_parameter_is_for_that_value_only() -> None:
    def fun(t: Any, x: Any, k: float) -> Any:
        return [x[1], -x[0] if k > 0 else x[0]]

    answers = {k: fresh(fun, params={"k": k}) for k in (1.0, -1.0)}
    assert answers[1.0] != answers[-1.0]
    for k in (1.0, -1.0, 1.0, 1.0, -1.0):
        assert final(fun, params={"k": k}) == answers[k]


# --------------------------------------------------------- what changes in between


def test_global_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(reads_global, lambda: monkeypatch.setitem(globals(), "slope", 2.0))


def test_global_of_a_helper_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(calls_helper, lambda: monkeypatch.setitem(globals(), "slope", 2.0))


def test_helper_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(calls_helper, lambda: monkeypatch.setitem(globals(), "helper", lambda x: x))


def test_code_of_a_helper_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(calls_helper, lambda: monkeypatch.setattr(helper, "__code__", (lambda x: x).__code__))


def test_container_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(reads_table, lambda: monkeypatch.setitem(table, "slope", [3.0, 2.0]))
    check_change(reads_table, lambda: table["slope"].__setitem__(0, 4.0))


def test_matrix_changed_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "matrix", np.eye(2))
    check_change(reads_matrix, lambda: matrix.__setitem__((0, 1), 0.5))


def test_attribute_of_a_module_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    check_change(reads_module, lambda: monkeypatch.setattr(parameters, "slope", 2.0))


def test_attribute_of_an_object_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fun(t: Any, x: Any) -> Any:
        return [x[1], -settings.slope * x[0]]

    check_change(fun, lambda: monkeypatch.setattr(settings, "slope", 2.0))


def test_method_of_an_object() -> None:
    class Oscillator:
        slope = 1.0

        def field(self, t: Any, x: Any) -> Any:
            return [x[1], -self.slope * x[0]]

        __call__ = field

    oscillator = Oscillator()
    for fun in (oscillator.field, oscillator):
        oscillator.slope = 1.0
        check_change(fun, lambda: setattr(oscillator, "slope", 2.0))


@dataclass
class Spring:
    stiffness: float
    rest: list[float]

    def force(self, y: Any) -> Any:
        return -self.stiffness * (y - self.rest[0]) * self.scale

    @property
    def scale(self) -> float:
        return 1.0

    def report(self) -> None:
        print(self)


@dataclass(frozen=True)
class Frozen:
    spring: Spring


class Slots:
    __slots__ = ("k",)

    def __init__(self, k: float) -> None:
        self.k = k

    def __mul__(self, other: Any) -> Any:
        return self.k * other


class Soft(Spring):
    def force(self, y: Any) -> Any:
        return -0.1 * y


def test_objects_of_plain_classes_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    spring = Spring(1.0, [0.0])
    holder, slots, plain = Frozen(spring), Slots(1.0), types.SimpleNamespace(k=1.0)

    def fun(t: Any, x: Any) -> Any:
        return [slots * x[1] * plain.k, holder.spring.force(x[0])]

    assert is_kept(fun)
    for change in (
        lambda: setattr(spring, "stiffness", 2.0),
        lambda: spring.rest.append(0.0),
        lambda: spring.rest.__setitem__(0, 0.5),
        lambda: setattr(slots, "k", 2.0),
        lambda: setattr(plain, "k", 2.0),
        lambda: setattr(spring, "force", lambda y: -3.0 * y),
        lambda: delattr(spring, "force"),
        lambda: setattr(spring, "__class__", Soft),
    ):
        final(fun)
        change()
        assert final(fun) == fresh(fun)
    spring.__class__ = Spring
    check_change(fun, lambda: monkeypatch.setattr(Spring, "scale", 5.0))
    monkeypatch.undo()
    check_change(fun, lambda: monkeypatch.setattr(Spring, "force", lambda self, y: -7.0 * y))
    monkeypatch.undo()
    check_change(fun, lambda: monkeypatch.setattr(Slots, "__mul__", lambda self, other: 9.0 * other))


def test_methods_and_callable_objects_are_traced_once() -> None:
    class Oscillator:
        def __init__(self, k: float) -> None:
            self.k = k
            self.calls: list[int] = []

        def field(self, t: Any, x: Any) -> Any:
            return [x[1], -self.k * x[0] - self.push(x)]

        def push(self, x: Any) -> Any:
            return 0.1 * np.sign(x[1])

        __call__ = field

        def counted(self, t: Any, x: Any) -> Any:
            self.calls.append(1)
            return self.field(t, x)

    for fun in (Oscillator(1.0).field, Oscillator(1.0)):
        assert is_kept(fun)
    oscillator = Oscillator(1.0)
    final(oscillator.counted)
    n = len(oscillator.calls)
    final(oscillator.counted)  # what it changes itself is not lost
    assert len(oscillator.calls) > n


@pytest.mark.parametrize(
    "make",
    [
        lambda: __import__("random").Random(1),
        lambda: np.random.default_rng(1),
        lambda: __import__("itertools").count(),
        lambda: __import__("decimal").Decimal(1),
        lambda: __import__("operator").itemgetter(0),
        lambda: type("Meta", (type,), {})("Of", (), {})(),
        lambda: type("Of", (dict,), {})(),
        lambda: type("Of", (), {"cached": functools.cached_property(lambda self: 1.0)})(),
        lambda: type("Of", (), {"__call__": lambda self, x: print(x)})(),
    ],
)
def test_objects_with_more_than_attributes_are_unknown(make: Any) -> None:
    thing = make()
    assert fingerprint(lambda t, x: thing) is None


def test_interpolants_and_sparse_matrices_are_read() -> None:
    interpolate, sparse = pytest.importorskip("scipy.interpolate"), pytest.importorskip("scipy.sparse")
    places, values = np.linspace(0, 2, 9), np.sin(np.linspace(0, 2, 9))
    for make in (
        interpolate.CubicSpline,
        interpolate.PchipInterpolator,
        interpolate.Akima1DInterpolator,
        interpolate.make_interp_spline,
        interpolate.interp1d,
        lambda x, y: interpolate.interp1d(x, y, kind="cubic"),
        lambda x, y: interpolate.interp1d(x, y, kind="previous"),
        lambda x, y: interpolate.UnivariateSpline(x, y, s=0),
    ):
        one, same, other = make(places, values), make(places, values), make(places, 2 * values)
        read = [fingerprint(lambda t, x, s=s: [x[1], s(t)]) for s in (one, one, same, other)]
        assert None not in read
        assert read[0] == read[1] != read[3]
        if not isinstance(one, interpolate.UnivariateSpline):  # that keeps room which was never written to
            assert read[0] == read[2]
    spline = interpolate.CubicSpline(places, values)

    def fun(t: Any, x: Any) -> Any:
        return [x[1], spline(t)]

    assert is_kept(fun)
    check_change(fun, lambda: spline.c.__setitem__((3, 2), 5.0))
    matrix = sparse.csr_array(np.array([[0.0, 1.0], [-1.0, 0.0]]))

    def product(t: Any, x: Any) -> Any:
        return matrix @ x

    assert is_kept(product)
    check_change(product, lambda: matrix.data.__setitem__(1, -2.0))
    with_hidden_state = interpolate.LinearNDInterpolator([[0, 0], [1, 0], [0, 1]], [0.0, 1.0, 2.0])
    assert fingerprint(lambda t, x: with_hidden_state) is None
    subclass = type("Own", (interpolate.CubicSpline,), {})(places, values)
    assert fingerprint(lambda t, x: subclass(t)) is None


def test_functions_of_scipy_special_are_known() -> None:
    special = pytest.importorskip("scipy.special")
    expit = special.expit
    assert is_kept(lambda t, x: [x[1], -expit(x[0])])
    own = np.frompyfunc(lambda x: -x, 1, 1)
    assert fingerprint(lambda t, x: own(x)) is None


def test_attribute_of_a_function_changed() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [x[1], -reads_nothing.slope * x[0]]  # type: ignore[attr-defined]

    reads_nothing.slope = 1.0  # type: ignore[attr-defined]
    try:
        check_change(fun, lambda: setattr(reads_nothing, "slope", 2.0))
    finally:
        del reads_nothing.slope  # type: ignore[attr-defined]


def test_closure_changed() -> None:
    k = 1.0

    def change() -> None:
        nonlocal k
        k = 2.0

    check_change(lambda t, x: [x[1], -k * x[0]], change)


def test_closure_of_a_closure_changed() -> None:
    k = 1.0

    def inner(x: Any) -> Any:
        return -k * x

    def fun(t: Any, x: Any) -> Any:
        return [x[1], *(inner(v) for v in x[:1])]

    def change() -> None:
        nonlocal k
        k = 2.0

    check_change(fun, change)


@pytest.mark.parametrize("attribute", ["__defaults__", "__kwdefaults__", "__code__"])
def test_defaults_and_code_changed(attribute: str) -> None:
    def fun(t: Any, x: Any, k: float = 1.0, *, m: float = 1.0) -> Any:
        return [x[1], -k * m * x[0]]

    def other(t: Any, x: Any, k: float = 2.0, *, m: float = 3.0) -> Any:
        return [x[1], k * m * x[0]]

    check_change(fun, lambda: setattr(fun, attribute, getattr(other, attribute)))


def test_mutable_default_changed() -> None:
    def fun(t: Any, x: Any, k: list[float] = [1.0]) -> Any:  # noqa: B006
        return [x[1], -k[0] * x[0]]

    check_change(fun, lambda: fun.__defaults__[0].__setitem__(0, 2.0))  # type: ignore[index]


def test_lambda_made_again_in_a_loop() -> None:
    kept = [final(lambda t, x, k=k: [x[1], -k * x[0]]) for k in (1.0, 2.0, 1.0, 3.0)]
    assert kept == [fresh(closure(k)) for k in (1.0, 2.0, 1.0, 3.0)]
    assert [final(closure(k)) for k in (1.0, 2.0, 1.0, 3.0)] == kept


# What a function may do with a number that it reads; traced values see only some of it.
USES = [
    "-k * x[0]",
    "x[0] / k - k**2 * x[1]",
    "-x[0] + k * np.sign(x[1] - k)",
    "np.where(x[0] > k, -k, x[1])",
    "-(abs(x[0] - 1.5) ** k)",
    "np.clip(x[0], -abs(k), abs(k))",
    "x[0] if k > 1.0 else -x[0]",
    "x[0] if k == 2.0 else -x[1]",
    "sum(x[0] for _ in range(int(k + 2)))",
    "[x[0], x[1], 2.0 * x[0]][int(k) % 3]",
    "float(f'{k:.0f}') * x[0]",
    "{1.0: x[0]}.get(k, x[1])",
    "x[0] if k in (1.0, 2.0) else x[1]",
    "math.sin(k) * x[0]",
    "np.sin(k) * x[0]",
    "sum([0.1, k, k, 1e-17]) * x[0]",
    "np.array([k, 0.1, 0.3]).sum() * x[0]",
    "(np.array([[k, 1.0], [0.0, k]]) @ x)[0]",
    "round(k) * x[0]",
    "bool(k - 1.0) * x[0]",
]
PLACES = {
    "a variable of an outer function": "def make(k):\n    return lambda t, x: [x[1], {use}]",
    "a default": "def make(k):\n    return lambda t, x, k=k: [x[1], {use}]",
    "a global": (
        "def fun(t, x):\n    return [x[1], {use}]\n"
        "def make(value):\n    global k\n    k = value\n    return fun"
    ),
    "an argument of a helper": (
        "def helper(x, k):\n    return {use}\ndef make(k):\n    return lambda t, x: [x[1], helper(x, k)]"
    ),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("use", USES)
def test_a_number_that_changes_from_call_to_call(use: str, place: str) -> None:
    names: dict[str, Any] = {"np": np, "math": math}
    exec(PLACES[place].format(use=use), names)
    make = names["make"]

    def answer(k: Any) -> Any:
        try:
            sol = fl.solve_ivp(make(k), SPAN, [1.3, 1.7])
        except (ValueError, TypeError) as error:
            return type(error), str(error)
        return sol.t.tobytes(), sol.y.tobytes(), sol.surfaces, sol.message

    values = (0.5, 0.75, 1.0, 2.0, 2.5, -1.0, 2, np.float64(0.75), 0.0, 0.5)
    in_a_loop = [answer(k) for k in values]
    alone = []
    for k in values:
        prepare._KEPT.clear()
        alone.append(answer(k))
    assert in_a_loop == alone


def test_functions_of_numpy_and_python_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def fun(t: Any, x: Any) -> Any:
        return [np.sin(x[1]), -abs(x[0])]

    check_change(fun, lambda: monkeypatch.setattr(np, "sin", np.cos))
    check_change(fun, lambda: monkeypatch.setattr(np, "sin", lambda v: v))
    check_change(fun, lambda: monkeypatch.setattr(builtins, "abs", lambda v: 2.0 * v))
    check_change(fun, lambda: monkeypatch.setitem(globals(), "abs", lambda v: 3.0 * v))


def defined(body: str, file: str = "<cell>", line: int = 1) -> Callable[..., Any]:
    """Return the function of a text, defined anew."""
    names: dict[str, Any] = {"np": np}
    text = "\n" * (line - 1) + f"def fun(t, x):\n    return {body}\n"
    exec(compile(text, file, "exec"), names)
    fun: Callable[..., Any] = names["fun"]
    return fun


@pytest.mark.parametrize("other", ["[x[1], -3.0 * x[0]]", "[x[1], -2 * x[0]]", "[x[1], --2.0 * x[0]]"])
def test_a_function_that_is_defined_again(other: str) -> None:
    body = "[x[1], -2.0 * x[0]]"
    first, again = fingerprint(defined(body)), fingerprint(defined(body))
    assert first is not None
    assert first == again
    assert fingerprint(defined(other)) != first
    assert final(defined(body)) == final(defined(body)) == fresh(defined(body))
    assert final(defined(other)) == fresh(defined(other))


@pytest.mark.parametrize(
    ("one", "other"), [("0.0", "-0.0"), ("1", "1.0"), ("1", "True"), ("(0, 1)", "(False, 1)")]
)
def test_constants_that_are_equal_and_not_the_same(one: str, other: str) -> None:
    bodies = [f"[x[1], {value} or x[0]]" for value in (one, other)]
    assert fingerprint(defined(bodies[0])) != fingerprint(defined(bodies[1]))


def test_the_same_text_elsewhere_is_another_function() -> None:
    """Messages name file and line."""
    body = "[x[1], -x[0]]"
    places = [defined(body), defined(body, file="<other cell>"), defined(body, line=7)]
    assert len({fingerprint(fun) for fun in places}) == 3


def test_a_function_that_is_defined_again_reads_its_own_names() -> None:
    def reading(k: float) -> Callable[..., Any]:
        fun = defined("[x[1], -k * x[0]]")
        fun.__globals__["k"] = k
        return fun

    assert final(reading(1.0)) == final(reading(1.0)) != final(reading(2.0))


def test_function_of_the_package_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def fun(t: Any, x: Any) -> Any:
        return [fnp.sin(x[1]), -x[0]]

    check_change(fun, lambda: monkeypatch.setattr(fnp, "sin", lambda v: v))


def test_partial() -> None:
    kept = [final(functools.partial(with_default, k=k)) for k in (1.0, 2.0, 1.0)]
    assert kept == [fresh(with_default, args=(k,)) for k in (1.0, 2.0, 1.0)]
    values = {"slope": 1.0}
    held = functools.partial(lambda t, x, values: [x[1], -values["slope"] * x[0]], values=values)
    check_change(held, lambda: values.update(slope=2.0))


@pytest.mark.parametrize(
    "args",
    [(2.0,), (2,), (np.float32(0.1),), (-0.0,), (True,), (np.array([1.0, 3.0]),), ([1.0, 3.0],), (1.0,)],
    ids=str,
)
def test_arguments_of_other_value_or_type(args: tuple[Any, ...]) -> None:
    def fun(t: Any, x: Any, k: Any) -> Any:
        if isinstance(k, list):
            k = k[1]
        return np.array([x[1], -x[0]]) * np.copysign(1.0, k) - k / 3

    others: list[tuple[Any, ...]] = [(1.0,), (1,), (0.1,), (0.0,), (np.array([1.0, 2.0]),), ([1.0, 2.0],)]
    for other in others:
        final(fun, args=other)
    assert final(fun, args=args) == fresh(fun, args=args)


def test_array_argument_changed_in_place() -> None:
    k = np.array([1.0, 2.0])
    check_change(lambda t, x, k: -k * x, lambda: k.__setitem__(0, 3.0), args=(k,))


def test_function_as_argument() -> None:
    answers = [final(lambda t, x, f: f(x), args=(f,)) for f in (np.sin, np.cos, lambda v: v, lambda v: -v)]
    assert len(set(answers)) == 4


def test_surfaces_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    def solve() -> tuple[str, ...]:
        return fl.solve_ivp(reads_nothing, SPAN, START, surfaces=lambda t, x: slope * x[0] + x[1]).surfaces

    assert solve() == solve()
    first = solve()
    monkeypatch.setitem(globals(), "slope", 2.0)
    assert solve() != first


def test_names_that_lead_out_of_a_function(monkeypatch: pytest.MonkeyPatch) -> None:
    def imports(t: Any, x: Any) -> Any:
        from math import tau

        return [x[1], -tau * x[0]]

    def looks_up(t: Any, x: Any) -> Any:
        return [x[1], -globals()["slope"] * x[0]]

    def evaluates(t: Any, x: Any) -> Any:
        return [x[1], eval("-slope") * x[0]]

    def gets(t: Any, x: Any) -> Any:
        return [x[1], -getattr(parameters, "slo" + "pe") * x[0]]

    def formats(t: Any, x: Any) -> Any:
        return [x[1], -float("{0.slope}".format(parameters)) * x[0]]  # noqa: UP030, UP032

    def underscores(t: Any, x: Any) -> Any:
        return [x[1], -parameters.__dict__["slope"] * x[0]]

    monkeypatch.setattr(math, "tau", math.tau)
    check_change(imports, lambda: monkeypatch.setattr(math, "tau", 1.0))
    for fun in (looks_up, evaluates):
        monkeypatch.setitem(globals(), "slope", 1.0)
        check_change(fun, lambda: monkeypatch.setitem(globals(), "slope", 2.0))
    for fun in (gets, formats, underscores):
        monkeypatch.setattr(parameters, "slope", 1.0)
        check_change(fun, lambda: monkeypatch.setattr(parameters, "slope", 2.0))


def test_module_under_another_name(monkeypatch: pytest.MonkeyPatch) -> None:
    def take(module: Any) -> Any:
        return module.slope

    def fun(t: Any, x: Any) -> Any:
        other = parameters
        return [x[1], -take(other) * x[0]]

    check_change(fun, lambda: monkeypatch.setattr(parameters, "slope", 2.0))


def test_module_that_supplies_names(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("supplier")
    values = {"k": 1.0}
    module.__getattr__ = values.__getitem__  # type: ignore[method-assign]
    check_change(lambda t, x: [x[1], -module.k * x[0]], lambda: values.update(k=2.0))


def test_two_names_of_one_list(monkeypatch: pytest.MonkeyPatch) -> None:
    def fun(t: Any, x: Any) -> Any:
        alias_a[0] = 2.0
        k = alias_b[0]
        alias_a[0] = 1.0
        return [x[1], -k * x[0]]

    check_change(fun, lambda: monkeypatch.setitem(globals(), "alias_b", [1.0]))


def test_effects_of_a_function_are_not_lost() -> None:
    calls: list[int] = []

    def fun(t: Any, x: Any) -> Any:
        calls.append(1)
        return [x[1], -x[0]]

    final(fun)
    n_calls = len(calls)
    final(fun)
    assert len(calls) == 2 * n_calls


def test_random_numbers_are_noticed_at_every_call() -> None:
    rng = np.random.default_rng(0)
    for _ in range(2):
        with pytest.raises(fl.TraceError):
            final(lambda t, x: [x[1], -rng.random() * x[0]])


def test_a_new_initial_state_is_compared_again() -> None:
    def seen_only_far_out(t: Any, x: Any) -> Any:
        if x.dtype == float and x[0] > 100.0:
            return [1.0, 1.0]
        return -x

    assert is_kept(seen_only_far_out)
    with pytest.raises(fl.TraceError):
        fl.solve_ivp(seen_only_far_out, SPAN, [200.0, 0.0])


# ----------------------------------------------------------------- how it is kept


def test_nothing_is_kept_beyond_the_limit() -> None:
    for k in range(50):
        fl.solve_ivp(lambda t, x, k=k: -k * x, SPAN, [1.0])
    assert len(prepare._KEPT._values) == prepare._KEPT._size


def test_large_data_count_by_a_digest() -> None:
    for data in (np.zeros(100_000), [0.0] * 100_000, (0.0,) * 100_000):
        fun = lambda t, x, data=data: -x  # noqa: E731
        read = fingerprint(fun)
        assert read is not None
        assert read == fingerprint(fun)
        assert len(str(read)) < 4000
    for data in ({k: 0.0 for k in range(100_000)}, [[0.0]] * 100_000):
        assert fingerprint(lambda t, x, data=data: -x) is None


def test_an_entry_of_a_large_table_changed() -> None:
    places, values = np.linspace(0.0, 2.0, 20_001), np.ones(20_001)
    as_list = [1.0] * 20_001

    def fun(t: Any, x: Any) -> Any:
        return [x[1] + as_list[int(1e4 * t)], np.interp(t, places, values)]

    assert is_kept(fun)
    check_change(fun, lambda: values.__setitem__(slice(5000, 6000), 2.0))
    check_change(fun, lambda: as_list.__setitem__(5000, 3.0))


def test_threads() -> None:
    expected = {k: fresh(closure(k)) for k in (1.0, 2.0, 3.0)}

    def solve(index: int) -> bool:
        k = 1.0 + index % 3
        return final(closure(k), events=lambda t, x: x[0]) == expected[k]

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(solve, range(60)))


def test_a_repeated_call_with_an_event_finds_what_a_first_one_does() -> None:
    level = [0.3]
    event = lambda t, x: x[0] - level[0]  # noqa: E731
    oscillator = lambda t, x: [x[1], -x[0]]  # noqa: E731
    system = fl.System(oscillator, n=2)
    for level[0] in (0.3, 0.5):
        for start in ([1.0, 0.0], [0.0, 1.0]):
            for direction in ("up", "both"):
                found = fl.Event(event, direction=direction, terminal=3)
                runs = [system.solve((0.0, 10.0), start, events=found, wrt="y0") for _ in range(2)]
                first = fl.solve_ivp(oscillator, (0.0, 10.0), start, events=found, wrt="y0")
                for sol in runs:
                    assert sol.status == first.status
                    assert sol.t_events[0].tolist() == first.t_events[0].tolist()
                    assert sol.dt_events[0].tolist() == first.dt_events[0].tolist()
    assert system._calls  # the second of two equal calls was one that is kept
    assert system.solve((0.0, 10.0), [1.0, 0.0], events=[]).t_events == []
    assert system.solve((0.0, 10.0), [1.0, 0.0], events=None).t_events is None
