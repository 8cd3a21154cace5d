"""Runs as parts of differentiable programs: gradients against central differences, transforms, refusals."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import pytest
from filippov.autodiff.differentiated_run import differentiated_run

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "derivatives.md"
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-11}
# Gradient of a function of the states with weights on them: its value, its derivatives by name.
Gradient = Callable[..., tuple[float, dict[str, Any]]]


def oscillator(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


def clocked(t: float, x: Any, T: float = 0.37, a: float = 1.0) -> list[Any]:
    return [x[1], -x[0] + a * (1 - 2 * (np.floor(t / T) % 2))]


class Case(NamedTuple):
    """A system, with what a run of it needs."""

    system: fl.System
    times: Any
    y0: list[float]
    params: dict[str, float]
    kinds: set[str]


def cases() -> dict[str, Case]:
    bounce = fl.Reset(
        lambda t, x, wall: x[0] - wall, lambda t, x, r: [x[0], -r * x[1]], direction="down", name="floor"
    )
    ball = {"g": 9.8, "r": 0.8, "wall": 0.1}
    times = np.linspace(0, 14, 23)
    return {
        "stick_slip": Case(
            fl.System(oscillator, states=("y", "v")),
            times,
            [1.0, 2.0],
            {"F": 0.4, "omega": 1 / 3},
            {"enter_sliding", "exit_sliding", "crossing"},
        ),
        "reset": Case(
            fl.System(lambda t, x, g, r, wall: [x[1], -g], n=2, params=ball, resets=bounce),
            np.linspace(0, 1.5, 9),
            [1.0, 0.5],
            ball,
            {"reset"},
        ),
        "clock": Case(
            fl.System(clocked, n=2), np.linspace(0, 3, 7), [0.3, -0.2], {"T": 0.37, "a": 1.0}, {"clock"}
        ),
    }


CASES = cases()


@pytest.fixture
def jax() -> Iterator[Any]:
    """JAX, which computes with 64 bits until the test ends."""
    found = pytest.importorskip("jax")
    before = found.config.jax_enable_x64
    found.config.update("jax_enable_x64", True)
    yield found
    found.config.update("jax_enable_x64", before)


@pytest.fixture(params=["jax", "torch"])
def framework(request: pytest.FixtureRequest) -> Any:
    """The wrapper of each framework."""
    pytest.importorskip(request.param)
    if request.param == "jax":
        request.getfixturevalue("jax")
        from filippov.autodiff import with_jax

        return with_jax
    from filippov.autodiff import with_torch

    return with_torch


@pytest.fixture
def gradient(framework: Any) -> Gradient:
    return gradient_of_jax if framework.__name__.endswith("jax") else gradient_of_torch


def gradient_of_jax(case: Case, weights: Any, by: tuple[str, ...], **options: Any) -> Any:
    import jax
    from filippov.autodiff import with_jax

    def cost(moved: dict[str, Any]) -> Any:
        y0, params = moved.get("y0", case.y0), {**case.params, **moved}
        params.pop("y0", None)
        return (weights * with_jax.solve(case.system, case.times, y0, params, **options)).sum()

    given = {"y0": np.array(case.y0), **case.params}
    value, found = jax.value_and_grad(cost)({name: given[name] for name in by})
    return float(value), {name: np.asarray(found[name]) for name in by}


def gradient_of_torch(case: Case, weights: Any, by: tuple[str, ...], **options: Any) -> Any:
    import torch
    from filippov.autodiff import with_torch

    given = {"y0": np.array(case.y0), **case.params}
    moved = {
        name: torch.tensor(value, dtype=torch.float64, requires_grad=name in by)
        for name, value in given.items()
    }
    params = {name: moved[name] for name in case.params}
    cost = (
        torch.as_tensor(weights) * with_torch.solve(case.system, case.times, moved["y0"], params, **options)
    ).sum()
    cost.backward()
    assert all(moved[name].grad is None for name in given if name not in by)
    return cost.item(), {name: moved[name].grad.numpy() for name in by}


def by_differences(case: Case, weights: Any, name: str, d: float = 1e-6) -> Any:
    """Return central differences of the weighted states."""

    def cost(y0: Any, params: dict[str, float]) -> Any:
        span = (float(min(case.times)), float(max(case.times)))
        return (weights * case.system.solve(span, y0, params, **TIGHT).sol(case.times)).sum()

    if name != "y0":
        sides = [cost(case.y0, {**case.params, name: case.params[name] + s * d}) for s in (1, -1)]
        return (sides[0] - sides[1]) / (2 * d)
    y0, found = np.array(case.y0), []
    for unit in np.eye(len(y0)):
        found.append((cost(y0 + d * unit, case.params) - cost(y0 - d * unit, case.params)) / (2 * d))
    return np.array(found)


def weights_of(case: Case) -> Any:
    return np.random.default_rng(3).standard_normal((len(case.y0), len(case.times)))


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What runs are differentiated by, in the order in which they are made."""
    found: list[Any] = []
    solve = fl.System.solve

    def noted(self: fl.System, *args: Any, **options: Any) -> fl.Solution:
        found.append(options.get("wrt"))
        return solve(self, *args, **options)

    monkeypatch.setattr(fl.System, "solve", noted)
    return found


@pytest.mark.parametrize("name", CASES)
def test_gradients_are_those_of_central_differences(name: str, gradient: Gradient) -> None:
    case = CASES[name]
    weights = weights_of(case)
    value, found = gradient(case, weights, ("y0", *case.params), **TIGHT)
    sol = case.system.solve((case.times[0], case.times[-1]), case.y0, case.params, **TIGHT)
    assert case.kinds <= set(sol.switches.kind)
    assert value == pytest.approx((weights * sol.sol(case.times)).sum(), abs=1e-10)
    for key, slope in found.items():
        expected = by_differences(case, weights, key)
        # A central difference with d = 1e-6 of numbers that are exact to 1e-11 is so to some 1e-5.
        np.testing.assert_allclose(slope, expected, rtol=1e-5, atol=1e-4, err_msg=key)


def test_one_run_is_differentiated_by_what_needs_it(gradient: Gradient, calls: list[Any]) -> None:
    case = CASES["stick_slip"]
    weights = weights_of(case)
    _, every = gradient(case, weights, ("y0", "F", "omega"))
    _, one = gradient(case, weights, ("omega",))
    _, start = gradient(case, weights, ("y0",))
    assert calls == [["y0", "F", "omega"], ["omega"], ["y0"]]
    assert one["omega"] == pytest.approx(every["omega"], abs=1e-12)
    assert start["y0"] == pytest.approx(every["y0"], abs=1e-12)


def test_values_alone_need_no_derivatives(framework: Any, calls: list[Any]) -> None:
    case = CASES["stick_slip"]
    states = framework.solve(case.system, case.times, case.y0, case.params)
    assert calls == [None]
    exact = case.system.solve((0, 14), case.y0, case.params).sol(case.times)
    assert np.array_equal(np.asarray(states), exact)


def test_times_in_any_order_and_states_by_name(framework: Any) -> None:
    case = CASES["stick_slip"]
    times = [3.0, 1.0, 2.0, 1.0]
    states = framework.solve(case.system, times, {"v": 2.0, "y": 1.0}, t0=0.5)
    exact = case.system.solve((0.5, 3), case.y0).sol(times)
    assert np.array_equal(np.asarray(states), exact)


def touch(t: float, x: Any, a: float = 0.0) -> Any:
    """Comes to y = 0 from above as (t - 1)^2 / 2; below it is drawn back. The last state is independent."""
    rates = np.where(x[1] > 0, [1.0, x[0], 0.0], [1.0, 1.0, 0.0])
    return [rates[0], rates[1], a * x[2]]


@pytest.mark.filterwarnings("ignore:no_derivative:filippov.FilippovWarning")
def test_derivatives_that_do_not_exist_stay_nan(gradient: Gradient) -> None:
    """States that the cost does not depend on add nothing to the gradient."""
    case = Case(fl.System(touch, n=3), np.array([0.0, 0.5, 2.0]), [-1.0, 0.5, 1.0], {"a": 0.0}, set())
    weights = np.zeros((3, 3))
    weights[1, 1] = 1.0
    _, found = gradient(case, weights, ("y0", "a"), t0=0.0)
    np.testing.assert_allclose(found["y0"], [0.5, 1.0, 0.0], atol=1e-12)
    weights[1, 2] = 1.0
    _, found = gradient(case, weights, ("y0", "a"), t0=0.0)
    assert np.isnan(found["y0"]).all()


def test_a_run_that_fails_raises(framework: Any) -> None:
    case = CASES["stick_slip"]
    with pytest.raises(fl.ModelError, match="max_steps was reached") as caught:
        framework.solve(case.system, case.times, case.y0, case.params, max_steps=3)
    assert 0 < caught.value.partial.t[-1] < 14


def test_wrong_arguments_are_refused(framework: Any) -> None:
    system, times, y0 = CASES["stick_slip"].system, [0.0, 1.0], [1.0, 2.0]
    for arguments, options, text in (
        ((oscillator, times, y0), {}, "system: a filippov.System is needed, not function"),
        ((system, times, y0, {"G": 1.0}), {}, "params: the system has no parameter 'G'"),
        ((system, times, y0, {"F": [0.4, 0.5]}), {}, r"F: a scalar is needed, not shape \(2,\)"),
        ((system, times, [y0]), {}, r"y0: a one-dimensional array is needed, not shape \(1, 2\)"),
        ((system, times, {"y": 1.0}), {}, "y0: 'v' is missing"),
        (
            (system, [[0.0, 1.0]], y0),
            {},
            r"t: a one-dimensional array of times is needed, not shape \(1, 2\)",
        ),
        ((system, [], y0), {}, "t: a one-dimensional array of times is needed"),
        ((system, [0.0, np.nan], y0), {}, "t: must be finite"),
        ((system, [1.0], y0), {}, "t: a time after the initial time 1.0 is needed"),
        ((system, times, y0), {"t0": 0.5}, "t: 0.0 is before the initial time 0.5"),
        ((system, times, y0), {"t0": "0"}, "t0: a number is needed"),
        ((system, times, y0), {"wrt": ["F"]}, "wrt: this option cannot be given here"),
        ((system, times, y0), {"events": oscillator}, "events: this option cannot be given here"),
        ((system, times, y0), {"rtol": -1.0}, "rtol"),
    ):
        with pytest.raises(fl.InputError, match=text):
            framework.solve(*arguments, **options)


def test_names_that_wrt_takes_for_something_else_are_refused() -> None:
    system = fl.System(lambda t, x, v: [x[1], -v], states=("y", "v"), params={"v": 1.0})
    with pytest.raises(fl.InputError, match="params: the parameter 'v' needs another name"):
        differentiated_run(system, [0.0, 1.0], None, ["v"], {})


# JAX


def states_at(jax: Any, case: Case, **options: Any) -> Callable[..., Any]:
    from filippov.autodiff import with_jax

    def states(y0: Any, params: dict[str, Any]) -> Any:
        return with_jax.solve(case.system, case.times, y0, params, **options)

    return states


@pytest.mark.parametrize("name", CASES)
def test_jit_and_jacrev(name: str, jax: Any, calls: list[Any]) -> None:
    case = CASES[name]
    states = states_at(jax, case, **TIGHT)
    y0, params = np.array(case.y0), case.params
    assert np.array_equal(jax.jit(states)(y0, params), states(y0, params))
    calls.clear()
    by_y0, by_params = jax.block_until_ready(jax.jit(jax.jacrev(states, (0, 1)))(y0, params))
    assert calls == [["y0", *params]]
    sol = case.system.solve((0, case.times[-1]), y0, params, wrt=["y0", *params], **TIGHT)
    exact = sol.derivative(case.times)
    np.testing.assert_allclose(np.moveaxis(by_y0, 2, 1), exact[:, : len(y0)], rtol=0, atol=1e-12)
    for column, key in enumerate(params, len(y0)):
        np.testing.assert_allclose(by_params[key], exact[:, column], rtol=0, atol=1e-12)
    eager = jax.jacrev(states)(y0, params)
    np.testing.assert_allclose(eager, by_y0, rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:no_derivative:filippov.FilippovWarning")
def test_jacrev_is_nan_only_where_there_is_no_derivative(jax: Any) -> None:
    case = Case(fl.System(touch, n=3), np.array([0.5, 2.0]), [-1.0, 0.5, 1.0], {"a": 0.0}, set())
    found = jax.jacrev(states_at(jax, case, t0=0.0))(np.array(case.y0), case.params)
    assert np.isfinite(found[:, 0]).all()
    assert np.isnan(found[:, 1]).all()


def test_vmap_of_values_and_of_gradients(jax: Any) -> None:
    case = CASES["stick_slip"]
    states = states_at(jax, case)
    y0, forces = np.array(case.y0), np.array([0.3, 0.4, 0.5])

    def cost(y0: Any, F: Any) -> Any:
        return (states(y0, {"F": F}) ** 2).sum()

    many = jax.vmap(states, (None, {"F": 0}))(y0, {"F": forces})
    slopes = jax.vmap(jax.grad(cost, (0, 1)), (None, 0))(y0, forces)
    for k, F in enumerate(forces):
        assert np.array_equal(many[k], states(y0, {"F": F}))
        one = jax.grad(cost, (0, 1))(y0, F)
        for found, exact in zip(slopes, one, strict=True):
            np.testing.assert_allclose(found[k], exact, rtol=1e-12)
    starts = np.array([[1.0, 2.0], [0.5, 1.0]])
    summed = jax.jit(jax.grad(lambda y: jax.vmap(cost, (0, None))(y, 0.4).sum()))(starts)
    np.testing.assert_allclose(summed[1], jax.grad(cost)(starts[1], 0.4), rtol=1e-12)


def test_many_states_under_jit(jax: Any) -> None:
    n = 300
    system = fl.System(lambda t, x: -x, n=n)
    case = Case(system, np.array([0.0, 0.5]), [1.0] * n, {}, set())
    states = states_at(jax, case)
    slope = jax.jit(jax.grad(lambda y: states(y, {})[:, -1].sum()))(np.array(case.y0))
    np.testing.assert_allclose(slope, np.exp(-0.5), rtol=1e-5)


def test_jax_finds_the_parameters_in_a_loop(jax: Any) -> None:
    """Newton's method with the Jacobian of a residual: the same function compiled once, called often."""
    case = CASES["stick_slip"]
    states = states_at(jax, case, rtol=1e-9, atol=1e-9)
    measured = states(case.y0, case.params)[0]

    @jax.jit
    def residual_and_jacobian(p: Any) -> Any:
        def residual(p: Any) -> Any:
            return states(case.y0, {"F": p[0], "omega": p[1]})[0] - measured

        return residual(p), jax.jacrev(residual)(p)

    p = np.array([0.35, 0.36])
    for _ in range(8):
        r, jacobian = residual_and_jacobian(p)
        p = p - np.linalg.lstsq(jacobian, r, rcond=None)[0]
    np.testing.assert_allclose(p, list(case.params.values()), atol=1e-7)


def test_jax_with_32_bits_is_refused(jax: Any) -> None:
    from filippov.autodiff import with_jax

    jax.config.update("jax_enable_x64", False)
    with pytest.raises(
        fl.InputError, match=r'64 bits are needed: jax\.config\.update\("jax_enable_x64", True\)'
    ):
        with_jax.solve(CASES["clock"].system, [0.0, 1.0], [1.0, 0.0])


def test_what_jax_cannot_differentiate_is_refused(jax: Any) -> None:
    from filippov.autodiff import with_jax

    case = CASES["stick_slip"]
    states = states_at(jax, case)
    with pytest.raises(fl.InputError, match="t: times are plain numbers: JAX"):
        jax.grad(lambda t: with_jax.solve(case.system, [0.0, t], case.y0)[0, -1])(1.0)
    with pytest.raises(fl.InputError, match="t0: times are plain numbers: JAX"):
        jax.grad(lambda t: with_jax.solve(case.system, [1.0], case.y0, t0=t)[0, -1])(0.0)
    with pytest.raises(TypeError, match="forward-mode"):
        jax.jacfwd(states)(np.array(case.y0), case.params)
    with pytest.raises(ValueError, match="do not support JVP"):
        jax.hessian(lambda y0: states(y0, case.params).sum())(np.array(case.y0))


def test_a_run_that_fails_under_jit_has_its_message(jax: Any) -> None:
    case = CASES["stick_slip"]
    states = states_at(jax, case, max_steps=3)
    with pytest.raises(jax.errors.JaxRuntimeError, match=r"ModelError: Stopped at .* max_steps was reached"):
        jax.block_until_ready(jax.jit(states)(np.array(case.y0), case.params))
    with pytest.raises(fl.ModelError, match="max_steps was reached"):
        jax.grad(lambda F: states(case.y0, {"F": F}).sum())(0.4)


# PyTorch


def test_gradcheck_of_torch() -> None:
    torch = pytest.importorskip("torch")
    from filippov.autodiff import with_torch

    case = CASES["stick_slip"]
    y0 = torch.tensor(case.y0, dtype=torch.float64, requires_grad=True)
    F = torch.tensor(0.4, dtype=torch.float64, requires_grad=True)

    def states(y0: Any, F: Any) -> Any:
        return with_torch.solve(case.system, case.times[:12], y0, {"F": F}, **TIGHT)

    assert torch.autograd.gradcheck(states, (y0, F), eps=1e-6, atol=1e-4)


def test_torch_takes_what_its_programs_have(calls: list[Any]) -> None:
    torch = pytest.importorskip("torch")
    from filippov.autodiff import with_torch

    case = CASES["stick_slip"]
    v = torch.tensor(2.0, requires_grad=True)
    states = with_torch.solve(case.system, torch.tensor(case.times), [1.0, v], {"F": 0.4})
    states[0, 10].backward()
    exact = case.system.solve((0, 14), case.y0, wrt="y0").derivative(case.times)
    assert states.dtype == torch.float64
    assert v.grad.dtype == torch.float32
    assert v.grad.item() == pytest.approx(exact[0, 1, 10], rel=1e-6)  # float32
    named = with_torch.solve(case.system, case.times, {"y": 1.0, "v": v})
    assert named.requires_grad
    calls.clear()
    with torch.no_grad():
        assert not with_torch.solve(case.system, case.times, [1.0, v]).requires_grad
    assert calls == [None]


def test_what_torch_cannot_differentiate_is_refused() -> None:
    torch = pytest.importorskip("torch")
    from filippov.autodiff import with_torch

    case = CASES["stick_slip"]
    t = torch.tensor([0.0, 1.0], requires_grad=True)
    with pytest.raises(fl.InputError, match="t: times are plain numbers"):
        with_torch.solve(case.system, t, case.y0)
    with pytest.raises(fl.InputError, match="t: times are plain numbers"):
        with_torch.solve(case.system, [0.0, t[1]], case.y0)
    with pytest.raises(fl.InputError, match="t0: times are plain numbers"):
        with_torch.solve(case.system, [1.0], case.y0, t0=t[0])
    F = torch.tensor(0.4, requires_grad=True)
    cost = (with_torch.solve(case.system, case.times, case.y0, {"F": F}) ** 2).sum()
    (slope,) = torch.autograd.grad(cost, F, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        slope.backward()


def test_torch_finds_the_parameters_in_a_loop() -> None:
    torch = pytest.importorskip("torch")
    from filippov.autodiff import with_torch

    case = CASES["stick_slip"]
    options = {"rtol": 1e-9, "atol": 1e-9}
    measured = with_torch.solve(case.system, case.times, case.y0, case.params, **options)[0]
    start = {"F": 0.35, "omega": 0.36}
    p = {name: torch.tensor(value, dtype=torch.float64, requires_grad=True) for name, value in start.items()}
    optimizer = torch.optim.LBFGS(
        p.values(), max_iter=60, line_search_fn="strong_wolfe", tolerance_grad=1e-12
    )

    def closure() -> Any:
        optimizer.zero_grad()
        cost = ((with_torch.solve(case.system, case.times, case.y0, p, **options)[0] - measured) ** 2).sum()
        cost.backward()
        return cost

    for _ in range(2):
        optimizer.step(closure)
    found = [value.item() for value in p.values()]
    np.testing.assert_allclose(found, list(case.params.values()), atol=1e-5)


def test_the_block_of_the_page_with_torch_prints_what_stands_there() -> None:
    """The page is run without PyTorch by `test_docs`."""
    pytest.importorskip("torch")
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL)
    (place,) = (k for k, (code, _) in enumerate(blocks) if "import torch" in code)
    names: dict[str, Any] = {"__name__": "__main__"}
    for code, printed in (blocks[0], blocks[1], blocks[place]):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            exec(code, names)
        assert output.getvalue().strip() == printed.strip()
