"""A friction law is identified from the displacement of a block that sticks and slips on a moving belt.

    m x'' = -k x - c x' + sign(w) F(w),   w = v_belt - x',   F(w) = Fc + (Fs - Fc) exp(-(w / vs)^2)

A sensor measures x every 20 ms, with noise. Least squares estimate the Coulomb force Fc, the static force Fs
and the speed vs. The Jacobian comes from `sol.derivative`: it is exact through sticking and slipping.

Static friction is a jump, and its value at w = 0 is a set. While the block sticks, the force is the number
between -Fs and Fs that balances the spring. The record therefore does not show a force law at w = 0. It shows
Fs through the times of release, and the rest of the law through the slips.

The sum of squares has wrong minima, in which model and record slip at different times. The fit therefore
starts with the first slip, continues with two slips, and ends with the whole record. The intervals are those
of the linearised model. The exact Jacobian needs fewer runs than differences do, but a run with derivatives
takes longer than a plain run. Both counts and both times are printed.

Run it with ``python examples/25_stribeck_identification/stribeck_identification.py [picture.png]``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot
from scipy.optimize import OptimizeResult, least_squares
from scipy.stats import t as student

MASS, STIFFNESS, DAMPING, V_BELT = 1.0, 100.0, 1.0, 0.1  # kg, N/m, N s/m, m/s
NAMES, UNITS = ("Fc", "Fs", "vs"), ("N", "N", "m/s")
TRUE, GUESS = np.array([3.0, 5.0, 0.08]), np.array([2.0, 6.0, 0.05])
TIMES, NOISE = 0.02 * np.arange(1, 226), 1.5e-3  # s, m
SAMPLES = (45, 100, len(TIMES))  # to the end of the first slip, of the second one, and all
COLOURS, STYLES = [fl.plot.theme().colours[k] for k in (0, 5, 2)], ("-", "--", "-.")


def law(slip, Fc, Fs, vs):
    return Fc + (Fs - Fc) * np.exp(-((slip / vs) ** 2))


@fl.system(states=("x", "v"))
def block(t, state, Fc=3.0, Fs=5.0, vs=0.08):
    x, v = state
    slip = V_BELT - v
    return v, (-STIFFNESS * x - DAMPING * v + np.sign(slip) * law(slip, Fc, Fs, vs)) / MASS


runs: Counter[str] = Counter()


def run(p: np.ndarray, wrt: tuple[str, ...] | None = None) -> fl.Solution:
    """Return the motion from rest with the parameters `p`, and count the run."""
    runs["without derivatives" if wrt is None else "with derivatives"] += 1
    params = dict(zip(NAMES, p, strict=True))
    return block.solve((0.0, TIMES[-1]), [0.0, 0.0], params, wrt=wrt, rtol=1e-10, atol=1e-12)


def sensitivities(p: np.ndarray) -> np.ndarray:
    """Return the derivatives of the displacement by the parameters, shape (times, 3)."""
    return run(p, wrt=NAMES).derivative(TIMES)[0].T


def fit(measured: np.ndarray, *, exact: bool) -> OptimizeResult:
    """Return the fit to the record, which starts from fits to its first parts; print the cost."""
    runs.clear()
    began, p = time.perf_counter(), GUESS
    for n in SAMPLES:
        jacobian = (lambda p, n=n: sensitivities(p)[:n]) if exact else "2-point"
        residuals = lambda p, n=n: run(p).sol(TIMES[:n])[0] - measured[:n]  # noqa: E731
        bounds = ([0.1, 0.1, 0.01], [20.0, 20.0, 1.0])
        found = least_squares(residuals, p, jacobian, bounds, x_scale=(1.0, 1.0, 0.02), xtol=1e-10)
        p = found.x
    counted = ", ".join(f"{count} runs {kind}" for kind, count in runs.items())
    print(f"{'exact Jacobian' if exact else 'differences'}: {time.perf_counter() - began:.2f} s, {counted}")
    return found


def error_of_jacobian(p: np.ndarray) -> float:
    """Return the largest distance from central differences, relative to the largest sensitivity."""
    exact, steps = sensitivities(p), np.diag(1e-5 * p)
    found = [(run(p + step).sol(TIMES)[0] - run(p - step).sol(TIMES)[0]) / (2 * step.sum()) for step in steps]
    return (np.abs(np.transpose(found) - exact) / np.abs(exact).max(axis=0)).max()


@fl.plot.style()
def draw(path: Path, measured: np.ndarray, p: np.ndarray, covariance: np.ndarray, quantile: float) -> None:
    panels = [["record", "law"], ["residuals", "law"], ["part", "width"]]
    ratios = {"width_ratios": (1.6, 1.0), "height_ratios": (2.0, 1.0, 2.0)}
    figure, axes = pyplot.subplot_mosaic(panels, figsize=(11.0, 7.2), layout="constrained", **ratios)
    fitted, scaled = run(p), sensitivities(p) * p  # by relative changes of the parameters
    t = np.linspace(0.0, TIMES[-1], 2000)
    axes["record"].plot(t, 1e3 * fitted.sol(t)[0], color=COLOURS[0], linewidth=1.2, label="fit")
    axes["record"].plot(TIMES, 1e3 * measured, ".", color="k", markersize=3.5, label="measured")
    axes["residuals"].plot(TIMES, 1e3 * (measured - fitted.sol(TIMES)[0]), ".", color="k", markersize=3.5)
    for k, (name, colour, style) in enumerate(zip(NAMES, COLOURS, STYLES, strict=True)):
        line = {"color": colour, "linestyle": style, "linewidth": 1.5, "label": name}
        axes["part"].plot(TIMES, 10.0 * scaled[:, k], **line)
        counts = np.arange(40, len(TIMES) + 1)
        inverses = [np.linalg.inv(scaled[:n].T @ scaled[:n])[k, k] for n in counts]
        axes["width"].semilogy(TIMES[counts - 1], 100 * quantile * NOISE * np.sqrt(inverses), **line)
    for ax, label in (("record", "x [mm]"), ("residuals", "residual [mm]"), ("part", "change [mm]")):
        for piece in fitted.segments:
            if piece.mode.is_sliding:
                axes[ax].axvspan(piece.t_start, piece.t_end, color="0.9", linewidth=0.0, zorder=0)
        axes[ax].set(ylabel=label, xlim=(0.0, TIMES[-1]))
    axes["record"].set_title("measured displacement and fit; grey: the block sticks", fontsize="medium")
    axes["part"].set_title("change of x if a parameter grows by 1 %", fontsize="medium")
    axes["law"].set_title("friction law", fontsize="medium")
    slip = np.linspace(0.0, 0.4, 300)
    value, share = law(slip, *p), law(slip, 0.0, 1.0, p[2])
    gradient = np.array([1 - share, share, (p[1] - p[0]) * share * 2 * slip**2 / p[2] ** 3])
    band = quantile * np.sqrt(np.einsum("is,ij,js->s", gradient, covariance, gradient))
    axes["law"].fill_between(slip, value - band, value + band, color="0.8", label="95 % interval")
    axes["law"].plot(slip, value, color=COLOURS[0], linewidth=1.5, label="estimate")
    axes["law"].plot(slip, law(slip, *TRUE), "--", color="k", linewidth=1.2, label="true")
    axes["law"].plot([0.0, 0.0], [0.0, p[1]], color="0.5", linewidth=3.0, label="sticking: 0 to Fs")
    axes["law"].set(xlabel="slip speed w [m/s]", ylabel="friction force [N]", ylim=(0.0, 6.0))
    axes["width"].set(xlabel="length of the record [s]", ylabel="half width [%]")
    axes["width"].set_title("half width of the 95 % interval", fontsize="medium")
    axes["part"].set_xlabel("t [s]")
    for name in ("record", "part", "law"):
        axes[name].legend(fontsize="small")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


def main(path: Path) -> None:
    noise = NOISE * np.random.default_rng(2).standard_normal(len(TIMES))
    measured = run(TRUE).sol(TIMES)[0] + noise
    best, other = fit(measured, exact=True), fit(measured, exact=False)
    np.testing.assert_allclose(other.x, best.x, rtol=1e-4)
    freedom = len(TIMES) - len(TRUE)
    covariance = np.linalg.inv(best.jac.T @ best.jac) * 2 * best.cost / freedom
    quantile = student.ppf(0.975, freedom)
    widths = quantile * np.sqrt(np.diag(covariance))
    for name, unit, value, width, true in zip(NAMES, UNITS, best.x, widths, TRUE, strict=True):
        print(f"{name} = {value:.4f} +- {width:.4f} {unit} (95 %), true: {true:g} {unit}")
        assert abs(value - true) < width
    error = error_of_jacobian(best.x)
    print(f"largest relative error of central differences: {error:.1e}")
    assert error < 1e-6
    draw(path, measured, best.x, covariance, quantile)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "stribeck_identification.png"))
