"""`solve_ivp` and `System` as a SciPy user meets them."""

from __future__ import annotations

import inspect
import json
import math
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.options import Options, check_options
from scipy.interpolate import CubicSpline
from untraced import number


def oscillator(t: float, x: Any, F: float, omega: float) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def relay(t: float, x: Any) -> Any:
    return [-np.sign(x[0])]


def first(t: float, x: Any) -> Any:
    return x[0]


def test_smooth_problem_agrees_with_scipy() -> None:
    integrate = pytest.importorskip("scipy.integrate")

    def pendulum(t: float, y: Any, k: float) -> Any:
        return [y[1], -k * np.sin(y[0])]

    def bottom(t: float, y: Any, k: float) -> Any:
        return y[0]

    bottom.terminal = 3  # type: ignore[attr-defined]
    bottom.direction = -1  # type: ignore[attr-defined]
    arguments: dict[str, Any] = {
        "events": [bottom, lambda t, y, k: y[1]],
        "args": (2.0,),
        "rtol": 1e-10,
        "atol": 1e-12,
    }
    theirs = integrate.solve_ivp(pendulum, (0, 50), [1.0, 0.5], dense_output=True, **arguments)
    ours = fl.solve_ivp(pendulum, (0, 50), [1.0, 0.5], **arguments)
    assert (ours.status, ours.success) == (theirs.status, theirs.success) == (1, True)
    assert ours.t_events is not None
    assert ours.y_events is not None
    for k in range(2):
        np.testing.assert_allclose(ours.t_events[k], theirs.t_events[k], rtol=1e-8)
        np.testing.assert_allclose(ours.y_events[k], theirs.y_events[k], rtol=1e-7, atol=1e-8)
    assert ours.y.shape[0] == theirs.y.shape[0]
    times = np.linspace(0, ours.t[-1], 50)
    assert ours.sol is not None
    np.testing.assert_allclose(ours.sol(times), theirs.sol(times), rtol=1e-6, atol=1e-7)


def test_positional_order_is_that_of_scipy() -> None:
    times = [0.0, 0.5, 2.0]
    sol = fl.solve_ivp(oscillator, (0, 2), [1.0, 2.0], "RK45", times, False, None, (0.4, 1 / 3))
    assert sol.t.tolist() == times
    assert sol.sol is None


@pytest.mark.parametrize("args", [2.0, (2.0,), [2.0], np.array([2.0]), np.float64(2.0)])
def test_args_may_be_a_scalar(args: Any) -> None:
    sol = fl.solve_ivp(lambda t, x, k: [-k * np.sign(x[0])], (0, 0.25), [1.0], args=args)
    assert sol.y[0, -1] == pytest.approx(0.5)


def test_parameters_by_name() -> None:
    expected = fl.solve_ivp(oscillator, (0, 20), [1.0, 2.0], args=(0.4, 0.5))
    named = fl.solve_ivp(oscillator, (0, 20), [1.0, 2.0], params={"F": 0.4, "omega": 0.5})
    np.testing.assert_allclose(named.y[:, -1], expected.y[:, -1], rtol=1e-9)


@pytest.mark.parametrize("n_times", [0, 1, 5])
def test_t_eval_of_any_length(n_times: int) -> None:
    times = np.linspace(0.1, 1.9, n_times)
    sol = fl.solve_ivp(relay, (0, 2), [1.0], t_eval=times)
    np.testing.assert_array_equal(sol.t, times)
    np.testing.assert_allclose(sol.y, np.maximum(1.0 - times, 0.0)[None], atol=1e-9)


def test_interval_of_length_zero_is_the_initial_point() -> None:
    sol = fl.solve_ivp(relay, (1, 1), [0.5], events=first)
    assert sol.success
    assert sol.t.tolist() == [1.0]
    assert sol.y.tolist() == [[0.5]]
    assert sol.sol is not None
    assert sol.sol(1.0).tolist() == [0.5]
    assert sol.t_events is not None
    assert len(sol.t_events[0]) == 0


def test_backward_time_without_surfaces() -> None:
    def forced(t: float, x: Any) -> Any:
        return [-x[0] + np.cos(t)]

    there = fl.solve_ivp(forced, (0, 2), [1.0], rtol=1e-11, atol=1e-12)
    times = [2.0, 1.5, 0.5, 0.0]
    back = fl.solve_ivp(
        forced, (2, 0), there.y[:, -1], t_eval=times, rtol=1e-11, atol=1e-12, events=lambda t, x: t - 0.7
    )
    assert there.sol is not None
    assert back.sol is not None
    np.testing.assert_array_equal(back.t, times)
    np.testing.assert_allclose(back.y, there.sol(times), rtol=1e-8)
    np.testing.assert_allclose(back.sol([0.3, 1.1]), there.sol([0.3, 1.1]), rtol=1e-8)
    assert back.t_events is not None
    assert back.t_events[0] == pytest.approx([0.7])
    assert (back.segments[0].t_start, back.segments[-1].t_end) == (2.0, 0.0)


def test_backward_time_traces_what_forward_time_does() -> None:
    spline, steps = CubicSpline([0, 1, 2, 3.0], [0, 1, 0, 1.0]), [1.0, 2.0, 3.0, 4.0]

    def filled(t: float, x: Any) -> Any:
        rates = np.zeros(1)
        rates[0] = -x[0]
        return rates

    functions: list[Any] = [
        filled,
        lambda t, x: [math.sin(t) - math.exp(-t) * x[0]],
        lambda t, x: [spline(t) - float(x[0])],
        lambda t, x: np.asarray(x, dtype=float) * 0.5,
        lambda t, x: [steps[int(t)] - math.fmod(t, 1.0) * x[0]],
    ]
    for fun in functions:
        there = fl.solve_ivp(fun, (0, 3), [0.3], rtol=1e-11, atol=1e-12)
        back = fl.solve_ivp(fun, (3, 0), there.y[:, -1], rtol=1e-11, atol=1e-12)
        assert back.y[0, -1] == pytest.approx(0.3, abs=1e-8)


def test_messages_of_runs_in_backward_time_have_their_times() -> None:
    ended = fl.solve_ivp(lambda t, x: [np.log(t - 2)], (5, 0), [0.0])
    assert ended.message.startswith("Stopped at t = 2.0000000000 in mode")
    assert "At t = 2.0000000000, x = " in ended.message
    grown = fl.solve_ivp(lambda t, x: [-(x[0] ** 2)], (0, -5), [0.25])
    assert grown.message.startswith("Stopped at t = -4.0000000")


def test_black_box_with_surfaces() -> None:
    table = np.linspace(0.0, 1.0, 50)

    def looked_up(t: float, x: Any) -> Any:
        return [0.3 * float(np.interp(number(t), table, table)) - (1.0 if number(x[0]) > 0 else -1.0)]

    sol = fl.solve_ivp(looked_up, (0, 3), [0.5], surfaces=lambda t, x: number(x[0]))
    assert sol.success
    assert sol.stats["backend"] == "black box"
    assert "black_box_reason" in sol.stats
    assert [switch.kind for switch in sol.switches] == ["enter_sliding"]


def test_declared_surfaces_keep_order_and_sign() -> None:
    def field(t: float, x: Any) -> Any:
        return [-np.sign(x[0]), -0.5 * np.sign(x[1])]

    declared = [lambda t, x: -x[1], first]
    sol = fl.solve_ivp(field, (0, 0.1), [1.0, 1.0], surfaces=declared)
    assert str(sol.segments[0].mode) == "-+"


@pytest.mark.parametrize("direction", ["up", 1, 5.0])
def test_event_directions(direction: Any) -> None:
    event = fl.Event(lambda t, y: y[0], direction=direction, name="zero")
    sol = fl.solve_ivp(lambda t, y: [y[1], -y[0]], (0, 10), [1.0, 0.0], events=event, rtol=1e-10)
    assert sol.t_events is not None
    np.testing.assert_allclose(sol.t_events[0], [1.5 * np.pi], rtol=1e-8)


def test_terminal_event_stops_after_a_number_of_passages() -> None:
    event = fl.Event(lambda t, y: y[0], terminal=2)
    sol = fl.solve_ivp(lambda t, y: [y[1], -y[0]], (0, 10), [1.0, 0.0], events=event, rtol=1e-10)
    assert sol.status == 1
    assert sol.t[-1] == pytest.approx(1.5 * np.pi)
    assert sol.t_events is not None
    assert len(sol.t_events[0]) == 2


def test_event_that_cannot_be_traced_is_called() -> None:
    sol = fl.solve_ivp(relay, (0, 2), [1.0], events=lambda t, y: float(y[0]) - 0.25)
    assert sol.t_events is not None
    assert sol.t_events[0] == pytest.approx([0.75])


def test_system_solves_with_other_parameters() -> None:
    system = fl.System(oscillator, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
    assert (system.n, system.surfaces, system.states) == (2, ["v"], ("y", "v"))
    by_keyword = system.solve((0, 20), [1.0, 2.0], F=0.7)
    by_dict = system.solve((0, 20), [1.0, 2.0], params={"F": 0.7})
    outside = fl.solve_ivp(system, (0, 20), [1.0, 2.0], params={"F": 0.7})
    np.testing.assert_array_equal(by_keyword.y, by_dict.y)
    np.testing.assert_array_equal(by_keyword.y, outside.y)
    assert not np.array_equal(by_keyword.y[:, -1], system.solve((0, 20), [1.0, 2.0]).y[:, -1])
    assert "F=0.4" in repr(system)
    assert "n not known yet" in repr(fl.System(lambda t, x: [-x[0]]))


def test_decorator() -> None:
    @fl.system
    def plain(t: float, x: Any, k: float = 2.0) -> Any:
        return [-k * np.sign(x[0])]

    @fl.system(n=1, states=("height",))
    def named(t: float, x: Any, k: float = 2.0, label: str = "constant") -> Any:
        return [-k * np.sign(x[0])]

    assert plain.params == {"k": 2.0}
    assert plain.solve((0, 0.25), [1.0]).y[0, -1] == pytest.approx(0.5)
    assert (plain.n, named.surfaces, named.params) == (1, ["height"], {"k": 2.0})


def test_branch_on_a_parameter_is_traced_again() -> None:
    @fl.system(n=1)
    def guarded(t: float, x: Any, k: float = 1.0) -> Any:
        if k > 0:
            return [-k * np.sign(x[0])]
        return [k * x[0]]

    assert guarded.solve((0, 1), [1.0]).surfaces == ("x[0]",)
    assert guarded.solve((0, 1), [1.0], k=-1.0).surfaces == ()
    copy = pickle.loads(pickle.dumps(guarded))
    with pytest.raises(fl.ModelError, match="parameter values"):
        copy.solve((0, 1), [1.0], k=2.0)


def test_unpickled_system_agrees_to_the_bit() -> None:
    system = fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
    copy = pickle.loads(pickle.dumps(system))
    ours, theirs = system.solve((0, 50), [1.0, 2.0], F=0.5), copy.solve((0, 50), [1.0, 2.0], F=0.5)
    np.testing.assert_array_equal(ours.y, theirs.y)
    np.testing.assert_array_equal(ours.switches.t, theirs.switches.t)
    assert (copy.surfaces, copy.states, copy.params) == (system.surfaces, system.states, system.params)


def test_system_travels_to_another_process() -> None:
    system = fl.System(
        lambda t, x, k: [-k * np.sign(x[0])], n=1, params={"k": 1.0}
    )  # a lambda cannot be pickled
    code = (
        "import pickle, sys; system = pickle.load(sys.stdin.buffer); "
        "print(system.solve((0, 2), [1.0], k=2.0).switches.t[0])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(system), capture_output=True, check=True
    )
    assert float(done.stdout) == pytest.approx(0.5)


def test_field_of_a_mode() -> None:
    system = fl.System(oscillator, n=2, args=(0.4, 1 / 3))
    assert system.field(0.0, [0.1, 0.0], "+").tolist() == [0.0, -0.5]
    assert system.field(0.0, [0.1, 0.0], (-1,)).tolist() == pytest.approx([0.0, 0.3])
    np.testing.assert_allclose(system.field(0.0, [0.1, 0.0], "0"), [0.0, 0.0], atol=1e-10)
    with pytest.raises(fl.ModelError, match="no sliding motion") as info:
        system.field(0.0, [0.6, 0.0], "0")
    assert info.value.surface == "x[1]"


FORMS = {
    "table": lambda: fl.System.from_fields({(1,): [-1.0, 1.0], (-1,): lambda t, x: [2.0, 0.0 * x[1]]}, first),
    "integer keys": lambda: fl.System.from_fields({1: [-1.0, 1.0], -1: [2.0, 0.0]}, [first]),
    "function of s": lambda: fl.System.from_fields(
        lambda t, x, s: [0.5 - 1.5 * s[0], 0.5 + 0.5 * s[0]], first, n=2
    ),
    "function of s with if": lambda: fl.System.from_fields(
        lambda t, x, s: [-1.0, 1.0] if s[0] > 0 else [2.0, 0.0], first, n=2
    ),
    "base": lambda: fl.System.from_base([-1.0, 1.0], [lambda t, x: [3.0, -1.0]], [first], n=2),
    "black box": lambda: fl.System.from_fields(
        {1: lambda t, x: [-1.0 + 0.0 * number(x[0]), 1.0], -1: lambda t, x: [2.0, 0.0 * number(x[0])]}, first
    ),
}


@pytest.mark.parametrize("form", sorted(FORMS))
def test_explicit_forms_agree(form: str) -> None:
    system = FORMS[form]()
    sol = system.solve((0, 2), [0.5, 0.0])
    assert [switch.kind for switch in sol.switches] == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(0.5)
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.5 + 1.5 * 2 / 3], atol=1e-9)
    assert (system.backend == "black box") == (form == "black box")


def test_parameters_in_explicit_forms() -> None:
    system = fl.System.from_fields(
        {1: lambda t, x, a: [-a], -1: [1.0]}, lambda t, x, c: x[0] - c, n=1, params={"a": 1.0, "c": 0.0}
    )
    sol = system.solve((0, 1), [1.0], a=2.0, c=0.5)
    assert sol.switches.t[0] == pytest.approx(0.25)


def test_field_is_never_called_beyond_its_region() -> None:
    def above(t: float, x: Any) -> Any:
        return [-1.0 - np.sqrt(x[0])]

    def below(t: float, x: Any) -> Any:
        return [-1.0 - np.sqrt(-x[0])]

    sol = fl.System.from_fields({1: above, -1: below}, first, n=1).solve(
        (0, 1.5), [1.0], rtol=1e-9, atol=1e-12
    )
    assert sol.success
    assert [switch.kind for switch in sol.switches] == ["crossing"]
    assert np.isfinite(sol.y).all()


def test_relay_form() -> None:
    A, B, C = [[0.0, 1.0], [-1.0, 0.0]], [0.0, 0.5], [0.0, 1.0]
    system = fl.System.relay(A, B, C)
    assert system.surfaces == ["x[1]"]
    written = fl.solve_ivp(lambda t, x: [x[1], -x[0] - 0.5 * np.sign(x[1])], (0, 10), [2.0, 0.0])
    np.testing.assert_allclose(system.solve((0, 10), [2.0, 0.0]).y[:, -1], written.y[:, -1], atol=1e-8)
    assert fl.System.relay(np.zeros((2, 2)), np.eye(2), np.eye(2)).n_surfaces == 2


def constant_cases() -> list[Any]:
    data = json.loads((Path(__file__).parent / "data" / "I_gh_cases.json").read_text())
    ids = ("crossing", "enter_codim1", "exit_codim1_plus", "exit_codim1_minus", "codim1_crossing_surface2")
    return [pytest.param(run, id=run["id"]) for run in data["runs"] if run["id"] in ids]


@pytest.mark.parametrize("run", constant_cases())
def test_fields_of_the_reference_cases(run: dict[str, Any]) -> None:
    names = run["statement"]["state"]

    def component(text: str) -> Any:
        return lambda t, x: eval(text, {}, dict(zip(names, x, strict=True)))

    def field(texts: list[str]) -> Any:
        parts = [component(text) for text in texts]
        return lambda t, x: [part(t, x) for part in parts]

    fields = {
        tuple(int(sign) for sign in key.split(",")): field(texts)
        for key, texts in run["statement"]["fields"].items()
    }
    surfaces = [component(text) for text in run["statement"]["surfaces"]]
    system = fl.System.from_fields(fields, surfaces, n=len(names))
    y0 = [float(value) for value in run["initial"]["y"]]
    sol = system.solve((0.0, float(run["final"]["t"])), y0, rtol=1e-10, atol=1e-12)
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], [float(value) for value in run["final"]["y"]], atol=1e-8)
    assert sol.segments[-1].mode == tuple(run["final"]["mode"])


def test_progress_is_reported() -> None:
    reached: list[float] = []
    fl.solve_ivp(relay, (0, 2), [1.0], progress=reached.append)
    assert reached[-1] == 2.0


class Raising:
    """Raises at the first call, at every call, or at the one with the end."""

    def __init__(self, error: BaseException, when: str) -> None:
        self.error, self.when, self.n_calls = error, when, 0

    def __call__(self, t: float) -> None:
        self.n_calls += 1
        if {"once": self.n_calls == 1, "always": True, "at the end": t == 2.0}[self.when]:
            raise self.error


@pytest.mark.parametrize("when", ["once", "always"])
def test_what_progress_raises_during_a_run_is_raised(when: str) -> None:
    def forced(t: float, x: Any) -> Any:
        return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]

    error = ValueError("mine")
    with pytest.raises(ValueError, match="mine") as caught:
        fl.solve_ivp(forced, (0, 1e6), [1.0, 2.0], progress=Raising(error, when))
    assert caught.value is error
    assert 0.0 < error.partial.t[-1] < 1e6  # type: ignore[attr-defined]
    stop = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt) as stopped:
        fl.solve_ivp(forced, (0, 1e6), [1.0, 2.0], progress=Raising(stop, when))
    assert stopped.value.__cause__ is stop
    assert 0.0 < stopped.value.partial.t[-1] < 1e6  # type: ignore[attr-defined]


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_what_progress_raises_at_the_end_has_the_solution(kind: Any) -> None:
    expected = fl.solve_ivp(relay, (0, 2), [1.0])
    with pytest.raises(kind) as caught:
        fl.solve_ivp(relay, (0, 2), [1.0], progress=Raising(kind("mine"), "at the end"))
    assert caught.value.partial.success  # type: ignore[attr-defined]
    np.testing.assert_array_equal(caught.value.partial.y, expected.y)  # type: ignore[attr-defined]


def test_progress_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    fl.solve_ivp(relay, (0, 2), [1.0], progress=True)
    shown = capsys.readouterr().err
    assert "100%" in shown.replace(".0 %", "%")
    assert shown.endswith("\n")


def test_import_is_light() -> None:
    heavy = ("matplotlib", "pandas", "scipy", "xarray")
    code = f"import sys, filippov; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert done.stdout.strip() == "[]"


def test_lazy_packages() -> None:
    assert fl.plot.__name__ == "filippov.plot"
    assert fl.problems.__name__ == "filippov.problems"
    assert "plot" in dir(fl)
    with pytest.raises(AttributeError, match="nothing"):
        _ = fl.nothing  # type: ignore[attr-defined]


def test_defaults_given_explicitly_are_the_defaults() -> None:
    defaults = {
        name: parameter.default
        for name, parameter in inspect.signature(fl.solve_ivp).parameters.items()
        if name in Options._fields
    }
    # The clock of `max_wall_time` is no argument: that of the computer, but for tests.
    assert {*defaults, "clock"} == set(Options._fields)
    assert check_options(defaults, (0.0, 1.0), 1) == check_options({}, (0.0, 1.0), 1)


def test_calls_that_repeat_their_options_are_those_of_solve_ivp() -> None:
    """What such a call needs is kept with the system, and with nothing that may differ from call to call."""
    system = fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3})
    options = {"rtol": 1e-8, "atol": 1e-9, "dense_output": False}
    for y0, t_span in (([1.0, 2.0], (0, 20)), ((3, -1), (0.5, 9.0)), (np.array([0.0, 0.1]), [0.0, 7.0])):
        for F in (None, 0.4, 0.7):
            given = {} if F is None else {"F": F}
            again = [system.solve(t_span, y0, **given, **options) for _ in range(3)]
            fresh = fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3})
            alone = fl.solve_ivp(fresh, t_span, y0, params=given, **options)
            for sol in again:
                assert sol.t.tolist() == alone.t.tolist()
                assert sol.y.tolist() == alone.y.tolist()
                assert sol.sol is None
    assert system.solve((0, 20), [1.0, 2.0], rtol=1e-8, atol=1e-9).sol is not None
    copy = pickle.loads(pickle.dumps(system))
    assert (
        copy.solve((0, 20), [1, 2], **options).y.tolist()
        == system.solve((0, 20), [1, 2], **options).y.tolist()
    )
    for wrong in ([1.0], [1.0, 2.0, 3.0], [1.0, np.nan], "ab"):
        with pytest.raises(fl.InputError, match="y0"):
            system.solve((0, 20), wrong, **options)
    with pytest.raises(fl.InputError, match="t_span"):
        system.solve((0, np.inf), [1.0, 2.0], **options)
    with pytest.raises(fl.InputError, match="t1 < t0"):
        system.solve((20, 0), [1.0, 2.0], **options)
    assert system.solve((3, 3), [1.0, 2.0], **options).t.tolist() == [3.0]
    with pytest.raises(fl.InputError, match="rtol"):
        system.solve((0, 20), [1.0, 2.0], rtol=True, atol=1e-9, dense_output=False)


def test_a_repeated_call_names_the_line_that_is_not_finite() -> None:
    system = fl.System(lambda t, x: [np.sqrt(0.5 - t)], n=1)
    first, second = (system.solve((0, 5), [0.5], rtol=1e-6) for _ in range(2))
    assert not second.success
    assert "sqrt" in second.message
    assert first.message == second.message
