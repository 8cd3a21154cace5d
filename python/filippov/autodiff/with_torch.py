"""Runs in PyTorch: `solve` is differentiated by autograd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy.typing as npt

from filippov.autodiff.differentiated_run import DifferentiatedRun, differentiated_run
from filippov.errors import InputError
from filippov.system import System

try:
    import torch
    from torch.autograd.function import once_differentiable
except ImportError as error:
    raise ImportError("filippov.autodiff.with_torch needs PyTorch: pip install torch") from error

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
    """Return the states at given times as a tensor that is differentiable by initial state and parameters.

    One run gives the states and their derivatives by the tensors that require a gradient; the backward pass
    multiplies these by the cotangent.

    Parameters
    ----------
    system : System
        The system. Its functions are traced by `filippov` and never see a tensor.
    t : array_like, shape (k,)
        Times, in any order. They are plain numbers: nothing is differentiated by them.
    y0 : torch.Tensor or array_like, shape (n,), or dict
        Initial state, or its components by the names of the states.
    params : dict of str to scalar, optional
        Parameter values other than the defaults: numbers, or tensors of shape ().
    t0 : float, optional
        Initial time, in the units of the model; by default the smallest of `t`.
    **options
        Options of `solve_ivp`, such as `rtol`, `atol` and `method`.

    Returns
    -------
    torch.Tensor, shape (n, k)
        The states at `t`, float64, on the device of `y0`; the right limit where the state jumps. The run is
        computed on the CPU.

    Raises
    ------
    InputError
        If an argument is wrong.
    ModelError
        If the run fails.

    Notes
    -----
    Derivatives are of first order and in reverse mode. The transforms of `torch.func` do not pass.

    A derivative is NaN where there is none. A state that the cost does not depend on adds nothing to the
    gradient, also if its own derivative is NaN.

    Examples
    --------
    >>> import numpy as np, torch, filippov as fl
    >>> from filippov.autodiff import with_torch
    >>> stops = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 0.5})
    >>> a = torch.tensor(0.25, dtype=torch.float64, requires_grad=True)
    >>> at_one = with_torch.solve(stops, [0.0, 1.0], [1.0], {"a": a})[0, -1]
    >>> at_one.backward()
    >>> round(at_one.item(), 12), round(a.grad.item(), 12)
    (0.75, -1.0)
    """
    given = {} if params is None else params
    run = differentiated_run(system, _plain(t, "t"), _plain(t0, "t0"), given, options)
    start = _float64(run.initial_state(y0), "y0", 1)
    values = {name: _float64(value, name, 0) for name, value in given.items()}
    if torch.is_grad_enabled():
        run = replace(run, wrt=tuple(n for n, v in {"y0": start, **values}.items() if v.requires_grad))
    device = y0.device if torch.is_tensor(y0) else start.device
    return _Run.apply(run, tuple(values), start, *values.values()).to(device)


def _plain(times: Any, name: str) -> Any:
    """Return times without tensors; refuse those that would be differentiated by."""
    if isinstance(times, (list, tuple)):
        return [_plain(time, name) for time in times]
    if not torch.is_tensor(times):
        return times
    if times.requires_grad:
        raise InputError(f"{name}: times are plain numbers: nothing is differentiated by them; use detach()")
    return times.cpu().numpy()


def _float64(value: Any, name: str, ndim: int) -> Any:
    """Return a tensor on the CPU; a sequence may have tensors in it."""
    if isinstance(value, Sequence) and any(map(torch.is_tensor, value)):
        value = torch.stack([torch.as_tensor(entry, dtype=torch.float64, device="cpu") for entry in value])
    tensor = torch.as_tensor(value, dtype=torch.float64, device="cpu")
    if tensor.ndim != ndim:
        needed = "a one-dimensional array" if ndim else "a scalar"
        raise InputError(f"{name}: {needed} is needed, not shape {tuple(tensor.shape)}")
    return tensor


class _Run(torch.autograd.Function):
    """One run; the residual is its derivatives."""

    @staticmethod
    def forward(ctx: Any, run: DifferentiatedRun, names: Sequence[str], y0: Any, *values: Any) -> Any:
        params = {name: value.item() for name, value in zip(names, values, strict=True)}
        states, derivatives = run(y0.detach().numpy(), params)
        ctx.names = "y0", *names
        ctx.wrt = tuple(derivatives)
        ctx.save_for_backward(*map(torch.from_numpy, derivatives.values()))
        return torch.from_numpy(states)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, cotangent: Any) -> Any:
        derivatives = dict(zip(ctx.wrt, ctx.saved_tensors, strict=True))
        found = {name: _gradient(cotangent, by) for name, by in derivatives.items()}
        return None, None, *(found.get(name) for name in ctx.names)


def _gradient(cotangent: Any, derivatives: Any) -> Any:
    return (cotangent * derivatives).masked_fill(cotangent == 0.0, 0.0).sum((-2, -1))
