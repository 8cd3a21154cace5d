"""Runs in JAX: `solve` is a function that `jax.jit`, `jax.grad`, `jax.jacrev` and `jax.vmap` transform."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy.typing as npt

from filippov.autodiff.differentiated_run import DifferentiatedRun, differentiated_run
from filippov.errors import InputError
from filippov.system import System

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:
    raise ImportError("filippov.autodiff.with_jax needs JAX: pip install jax") from error

__all__ = ["solve"]


def solve(
    system: System,
    t: npt.ArrayLike,
    y0: Any,
    params: Mapping[str, Any] | None = None,
    *,
    t0: float | None = None,
    **options: Any,
) -> Any:
    """Return the states at given times as a JAX array that is differentiable by initial state and parameters.

    One run gives the states and their derivatives; the backward pass multiplies these by the cotangent.

    Parameters
    ----------
    system : System
        The system. Its functions are traced by `filippov`, not by JAX.
    t : array_like, shape (k,)
        Times, in any order. They are plain numbers: nothing is differentiated by them.
    y0 : array_like, shape (n,), or dict
        Initial state, or its components by the names of the states.
    params : dict of str to scalar, optional
        Parameter values other than the defaults.
    t0 : float, optional
        Initial time, in the units of the model; by default the smallest of `t`.
    **options
        Options of `solve_ivp`, such as `rtol`, `atol` and `method`.

    Returns
    -------
    jax.Array, shape (n, k)
        The states at `t`, float64; the right limit where the state jumps.

    Raises
    ------
    InputError
        If an argument is wrong, or if JAX computes with 32 bits.
    ModelError
        If the run fails.

    Notes
    -----
    Derivatives are of first order and in reverse mode: `jax.grad`, `jax.vjp`, `jax.jacrev`. `jax.vmap` runs
    one member after the other. Inside of `jax.jit` a run that fails raises an error of JAX, with the text of
    the `ModelError` in it.

    A derivative is NaN where there is none. A state that the cost does not depend on adds nothing to the
    gradient, also if its own derivative is NaN.

    Examples
    --------
    >>> import jax, numpy as np, filippov as fl
    >>> from filippov.autodiff import with_jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> stops = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 0.5})
    >>> at_one = lambda a: with_jax.solve(stops, [0.0, 1.0], [1.0], {"a": a})[0, -1]
    >>> value, slope = jax.value_and_grad(at_one)(0.25)
    >>> round(float(value), 12), round(float(slope), 12)
    (0.75, -1.0)
    """
    if not jax.config.jax_enable_x64:
        raise InputError('jax: 64 bits are needed: jax.config.update("jax_enable_x64", True)')
    given = {} if params is None else params
    for name, times in (("t", t), ("t0", t0)):
        if any(isinstance(time, jax.core.Tracer) for time in jax.tree.leaves(times)):
            raise InputError(f"{name}: times are plain numbers: JAX neither traces nor differentiates them")
    run = differentiated_run(system, t, t0, given, options)
    start = _float64(run.initial_state(y0), "y0", 1)
    return _states(run, start, {name: _float64(value, name, 0) for name, value in given.items()})


def _float64(value: Any, name: str, ndim: int) -> Any:
    array = jnp.asarray(value, dtype=jnp.float64)
    if array.ndim != ndim:
        needed = "a one-dimensional array" if ndim else "a scalar"
        raise InputError(f"{name}: {needed} is needed, not shape {array.shape}")
    return array


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _states(run: DifferentiatedRun, y0: Any, params: dict[str, Any]) -> Any:
    return _solved(run, y0, params)[0]


def _forward(run: DifferentiatedRun, y0: Any, params: dict[str, Any]) -> tuple[Any, Any]:
    """Run once, with the derivatives by what JAX differentiates by; these are the residual."""
    perturbed = {"y0": y0.perturbed, **{name: value.perturbed for name, value in params.items()}}
    wrt = tuple(name for name, is_perturbed in perturbed.items() if is_perturbed)
    values = {name: value.value for name, value in params.items()}
    states, derivatives = _solved(replace(run, wrt=wrt), y0.value, values)
    return states, (derivatives.get("y0"), {name: derivatives.get(name) for name in params})


def _backward(run: DifferentiatedRun, derivatives: tuple[Any, Any], cotangent: Any) -> tuple[Any, Any]:
    by_y0, by_params = derivatives
    return _gradient(cotangent, by_y0), {name: _gradient(cotangent, by) for name, by in by_params.items()}


def _gradient(cotangent: Any, derivatives: Any) -> Any:
    if derivatives is None:
        return None
    return jnp.where(cotangent == 0.0, 0.0, cotangent * derivatives).sum((-2, -1))


_states.defvjp(_forward, _backward, symbolic_zeros=True)


def _solved(run: DifferentiatedRun, y0: Any, params: dict[str, Any]) -> Any:
    """Run: by a callback if JAX traces the values, else at once, so that exceptions arrive as they are."""
    if not any(isinstance(value, jax.core.Tracer) for value in (y0, *params.values())):
        return jax.tree.map(jnp.asarray, run(y0, params))
    n, k = len(y0), len(run.times)
    states = jax.ShapeDtypeStruct((n, k), jnp.float64)
    by_state = jax.ShapeDtypeStruct((n, n, k), jnp.float64)
    results = states, {name: by_state if name == "y0" else states for name in run.wrt}
    return jax.pure_callback(run, results, y0, params, vmap_method="sequential")
