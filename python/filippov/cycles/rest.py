"""Equilibria of regions, and pseudo-equilibria on any number of surfaces, where the sliding motion rests.

A pseudo-equilibrium on h_j = 0 has f(x, lambda) = 0 with the multipliers as unknowns, f linear in each of
them: these equations are regular where a multiplier is -1 or +1, and the equilibrium is one of a region.

References: Filippov (1988), section 19; Kuznetsov, Rinaldi, Gragnani, Int. J. Bifurcation and Chaos 13 (2003)
2157.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import ModeBounds, TracedSystem
from filippov.analysis.observe import check_keywords
from filippov.cycles.cones import Stability, are_alike, stability_in_cones
from filippov.cycles.forcing import depends_on_time
from filippov.cycles.meeting import speed_away
from filippov.cycles.motions import Array, Motions
from filippov.errors import InputError, ModelError, TraceError
from filippov.modes import Mode
from filippov.options import check_y0
from filippov.prepare import parameter_vector
from filippov.system import System

__all__ = [
    "Equilibrium",
    "EquilibriumCurve",
    "at_rest",
    "equilibrium",
    "first_multipliers",
    "refuse_without_equilibria",
    "rest_of",
]

_MOST_STEPS = 50
_TOLERANCE = 1e-13
# Equations of a larger condition say nothing about how far states move with parameters.
_REGULAR = 1e8
# A jump of the field is none below this part of its changes over the size of the states.
_NO_JUMP = 1e-9
# A switching function is zero below this part of its changes over the size of the states.
_AT_SURFACE = 1e-9
# The field is compared in all regions that so many surfaces divide.
_MOST_KINKS = 8
# Real parts of eigenvalues below this part of the largest eigenvalue are rounding.
_ROUNDING = 1e-12
# Differences are exact to this part of a row.
_OF_DIFFERENCES = 1e-9
# By this states are measured that are zero.
_SMALL = 1e-3


class Equilibrium:
    """An equilibrium or a pseudo-equilibrium.

    Attributes
    ----------
    system : System
    params : dict
        Values of all parameters.
    y : ndarray, shape (n,)
        The state.
    mode : Mode
        One entry per surface; 0: the equilibrium is one of the sliding motion there.
    multipliers : ndarray, shape (m,)
        Those of the m surfaces slid on.
    residual : float
        The size of the last step of Newton's method, relative to the state.
    """

    def __init__(self, curve: EquilibriumCurve, w: Array, residual: float) -> None:
        self._curve, self._w = curve, w.copy()
        curve.use(w)
        self.system, self.params = curve.motions.system, curve.motions.params
        self.y, self.multipliers = w[: curve.n].copy(), w[curve.n : curve.n + len(curve.sliding)].copy()
        self.residual = residual
        self._entries = curve.mode

    @property
    def mode(self) -> Mode:
        """One entry per surface."""
        return Mode(self._entries[: len(self._curve.motions.prepared.surfaces)])

    @property
    def codimension(self) -> int:
        """On how many surfaces it is."""
        return len(self._curve.sliding)

    @cached_property
    def switching(self) -> Array:
        """The switching functions, each in the sense of the mode: positive where it is admissible."""
        return self._curve.switching(self._w)

    @cached_property
    def kinks(self) -> tuple[int, ...]:
        """Surfaces on which it lies while the field does not jump there, as with ``v * abs(v)`` at ``v = 0``.

        It is one equilibrium then of the modes on all sides of them.
        """
        return self._curve.kinks(self._w)

    @property
    def is_admissible(self) -> bool:
        """Whether the system is there: in its region, and with multipliers between -1 and 1; else virtual.

        A kink belongs to the regions on both sides. Where the field jumps, an equilibrium of a region that
        lies on its boundary, to rounding, is one of the surface, with a multiplier at its end.
        """
        if np.any(np.abs(self.multipliers) > 1.0) or self._boundaries:
            return False
        outside = [j for j, h in zip(self._curve.surfaces_beside(), self.switching, strict=True) if not h > 0]
        return not outside or set(outside) <= set(self.kinks)

    @cached_property
    def _boundaries(self) -> tuple[int, ...]:
        """Surfaces on which it lies, not as one of the sliding motion, and at which the field jumps."""
        return tuple(j for j in self._curve.surfaces_at(self._w) if j not in self.kinks)

    @cached_property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Those of its motion: n in a region, n - m on m surfaces; the largest real part first.

        They are not a number where no multipliers keep a motion beside the equilibrium on its surfaces.
        """
        try:
            found = np.linalg.eigvals(self._curve.linearisation(self._w)).astype(np.complex128)
        except np.linalg.LinAlgError:
            return np.full(len(self.y) - self.codimension, complex(np.nan, np.nan))
        return found[np.lexsort((-found.imag, -found.real))]

    @cached_property
    def attracts(self) -> bool:
        """Whether the motion comes to the surfaces from beside them, to first order; yes in a region.

        On two surfaces this is what the motions in the regions beside them do, on three or more what
        multipliers do that follow the sides of the surfaces fast (hidden dynamics).
        """
        return self._most_beside < 0

    @cached_property
    def _most_beside(self) -> float:
        """How fast motions beside its surfaces go away from them."""
        return self._curve.speed_away(self._w) if self._curve.sliding else -1.0

    @property
    def is_stable(self) -> bool:
        """Whether it is stable to first order: `stability` is ``"stable"``."""
        return self.stability == "stable"

    @cached_property
    def stability(self) -> Stability:
        """What is known of it to first order.

        ``"stable"``: all eigenvalues have negative real parts, and its surfaces attract. ``"unstable"``: one
        has a positive real part, or a surface repels. ``"neutral"``: neither, as for centres, lines of
        equilibria, and meetings of surfaces that motions circle at a constant distance; terms of higher
        order decide.

        On a kink (`kinks`) the linear parts on its sides may differ. Then eigenvectors in their own regions
        decide, and with two states the growth over a turn. With more states it is ``"neutral"`` if these say
        nothing. On a surface at which the field jumps (a boundary equilibrium) motions come to the field
        beyond: it is ``"unstable"`` if a real eigenvalue is positive, and else ``"neutral"``.
        """
        if self._most_beside > 0:
            return "unstable"
        along = self._along_its_surfaces
        return "neutral" if along == "stable" and not self._most_beside < 0 else along

    @cached_property
    def _along_its_surfaces(self) -> Stability:
        """The stability of its motion in its region or on its surfaces."""
        if self._boundaries:
            size = np.max(np.abs(self.eigenvalues), initial=0.0)
            is_real = np.abs(self.eigenvalues.imag) <= _ROUNDING * size
            return "unstable" if _largest_real_part(self.eigenvalues[is_real]) > 0 else "neutral"
        if self._cones is not None:
            return stability_in_cones(*self._cones)
        most = _largest_real_part(self.eigenvalues)
        return "unstable" if most > 0 else "stable" if most < 0 else "neutral"

    @cached_property
    def _cones(self) -> tuple[dict[tuple[int, ...], Array], Array] | None:
        """The linear parts around kinks, and the normals of these; None if there is one linear part."""
        if not self.kinks or not np.all(np.isfinite(self.eigenvalues)):
            return None
        matrices, normals = self._curve.around_kinks(self.kinks, self._w)
        return None if are_alike(matrices) else (matrices, normals)

    def in_parameters(self, names: Sequence[str], sizes: Sequence[float]) -> tuple[EquilibriumCurve, Array]:
        """Return its equations with some parameters as further unknowns, and the point itself."""
        curve = EquilibriumCurve(self._curve.motions, self._curve.mode, names, sizes)
        w = np.append(self._w[: curve.n_unknowns], [self.params[name] for name in names])
        curve.sizes_of_states = self._curve.sizes_of_states
        if not np.any(curve.sizes_of_states):
            curve.measure_states(w)
        return curve, w

    def __repr__(self) -> str:
        kind = "pseudo-equilibrium" if self.codimension else "equilibrium"
        words = f"{self.stability}{'' if self.is_admissible else ', virtual'}"
        multipliers = f", multipliers {_numbers(self.multipliers)}" if self.codimension else ""
        return (
            f"Equilibrium({words} {kind} at {_numbers(self.y)}, mode {self.mode}{multipliers}, "
            f"eigenvalues {_numbers(self.eigenvalues)})"
        )


def _largest_real_part(eigenvalues: Any) -> float:
    """Return the largest real part, 0 within rounding; NaN if one is not known."""
    if len(eigenvalues) == 0:
        return -1.0
    most = float(np.max(eigenvalues.real))
    return 0.0 if abs(most) <= _ROUNDING * float(np.max(np.abs(eigenvalues))) else most


def _numbers(values: Any) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"


class EquilibriumCurve:
    """The equations of an equilibrium in a mode, with some parameters as further unknowns.

    Parameters
    ----------
    motions : Motions
    mode : tuple of int
        One entry per surface.
    names : sequence of str
        The parameters.
    sizes : sequence of float
        The sizes by which they are measured.
    """

    is_exact = False

    def __init__(
        self, motions: Motions, mode: Sequence[int], names: Sequence[str] = (), sizes: Sequence[float] = ()
    ) -> None:
        self.motions = motions.with_derivatives_by(tuple(names))
        self.mode, self.n, self.names = tuple(mode), motions.n, tuple(names)
        self.sizes = np.array(sizes, dtype=np.float64)
        self.sliding = tuple(j for j, entry in enumerate(self.mode) if entry == 0)
        signs = np.array(self.mode, dtype=np.float64)
        corners = itertools.product((-1.0, 1.0), repeat=len(self.sliding))
        self._corners = []
        for corner in corners:
            signs[list(self.sliding)] = corner
            self._corners.append((np.array(corner), signs.copy()))
        self._active = self._core.active(np.array(self.mode, dtype=np.float64))
        self._bounds: tuple[TracedSystem, ModeBounds | None] | None = None
        # The sizes of the states along a branch; 0 where none is known.
        self.sizes_of_states = np.zeros(self.n)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_bounds": None}

    @property
    def _core(self) -> TracedSystem:
        core = self.motions.prepared.core
        assert isinstance(core, TracedSystem)
        return core

    @property
    def n_unknowns(self) -> int:
        """The number of states and multipliers."""
        return self.n + len(self.sliding)

    def use(self, w: Array) -> None:
        """Take the parameters of a point."""
        self.motions.move(w[self.n_unknowns :])

    def residual(self, w: Array) -> Array:
        """Return the field with its multipliers, and the functions of the surfaces slid on."""
        self.use(w)
        n, m = self.n, len(self.sliding)
        x, multipliers = w[:n], w[n : n + m]
        total = np.zeros(n)
        h = np.zeros(m)
        for corner, signs in self._corners:
            weight = float(np.prod(0.5 * (1.0 + corner * multipliers)))
            found = self.motions.right_hand_side(0.0, x, signs)
            total += weight * found[:n]
            h += found[n:][list(self.sliding)] / len(self._corners)
        return np.concatenate([total, h])

    def equations(self, w: Array, may_be_last: bool = False) -> tuple[Array, Array]:
        """Return the equations and their derivatives."""
        k = self.n_unknowns
        by_unknowns = self._by_unknowns(w)
        by_parameters = differences(lambda p: self.residual(np.append(w[:k], p)), w[k:], self.sizes)
        return self.residual(w), np.hstack([by_unknowns, by_parameters])

    def scales(self, w: Array) -> Array:
        """Return the sizes by which states, multipliers and parameters are measured."""
        size, known = np.abs(w[: self.n]), self.sizes_of_states
        least = max(0.1 * float(np.max(size, initial=0.0)), _SMALL)
        size = np.maximum(size, np.where(known > 0, known, least))
        return np.concatenate([size, np.ones(len(self.sliding)), self.sizes])

    def measure_states(self, w: Array) -> None:
        """Take the sizes of the states along a branch from those at a point, and from how far they move."""
        _, jacobian = self.equations(w)
        k = self.n_unknowns
        scaled = jacobian[:, :k] * self.scales(w)[:k]
        moves = np.zeros(self.n)
        if np.isfinite(jacobian).all() and np.linalg.cond(scaled) < _REGULAR:
            inverse = np.linalg.inv(jacobian[:, :k])
            moves = np.max(np.abs(inverse @ (jacobian[:, k:] * self.sizes))[: self.n], axis=1, initial=0.0)
            # The derivatives by parameters are differences.
            noise = np.abs(inverse) @ (_OF_DIFFERENCES * np.max(np.abs(scaled), axis=1))
            moves[moves <= noise[: self.n]] = 0.0
        found = np.maximum(np.abs(w[: self.n]), 0.1 * moves)
        # States that rest at zero have no size of their own.
        self.sizes_of_states = np.where(found > self.motions.negligible, found, _SMALL)

    def switching(self, w: Array) -> Array:
        """Return the functions of the surfaces not slid on, in the sense of the mode."""
        self.use(w)
        _, signs = self._corners[0]
        h = self.motions.right_hand_side(0.0, w[: self.n], signs)[self.n :]
        kept = [j for j, entry in enumerate(self.mode) if entry != 0 and self._active[j]]
        return np.array([h[j] * self.mode[j] for j in kept])

    def kinks(self, w: Array) -> tuple[int, ...]:
        """Return the surfaces not slid on that pass through a point and at which the field does not jump."""
        near = self.surfaces_at(w)[:_MOST_KINKS]
        if not near:
            return ()
        scale = self.scales(w)[: self.n_unknowns]
        least = _NO_JUMP * np.max(np.abs(self._by_unknowns(w)[: self.n] * scale), axis=1)
        sides = itertools.product((-1, 1), repeat=len(near))
        fields = {ends: self._beyond(near, ends).residual(w)[: self.n] for ends in sides}

        def is_kink(k: int) -> bool:
            jumps = (fields[ends] - fields[(*ends[:k], -1, *ends[k + 1 :])] for ends in fields if ends[k] > 0)
            return all(bool(np.all(np.abs(jump) <= least)) for jump in jumps)

        return tuple(j for k, j in enumerate(near) if is_kink(k))

    def around_kinks(self, kinks: Sequence[int], w: Array) -> tuple[dict[tuple[int, ...], Array], Array]:
        """Return the matrices of the motions on the sides of kinks, and the normals of these.

        Both are in the basis of `tangents`.
        """
        sides = itertools.product((-1, 1), repeat=len(kinks))
        matrices = {ends: self._beyond(kinks, ends).linearisation(w) for ends in sides}
        return matrices, self._gradients(w)[list(kinks)] @ self.tangents(w)

    def surfaces_at(self, w: Array) -> list[int]:
        """Return the surfaces not slid on that pass through a point."""
        beside = self.surfaces_beside()
        if not beside:
            return []
        sizes = np.abs(self._gradients(w)) @ self.scales(w)[: self.n]
        values = zip(beside, self.switching(w), strict=True)
        return [j for j, h in values if abs(h) <= _AT_SURFACE * sizes[j]]

    def _gradients(self, w: Array) -> Array:
        """Return the derivatives of all switching functions by the states, a row for each."""
        _, signs = self._corners[0]

        def functions(x: Array) -> Array:
            return self.motions.right_hand_side(0.0, x, signs)[self.n :]

        self.use(w)
        return differences(functions, w[: self.n], self.scales(w)[: self.n], is_fine=True)

    def _beyond(self, surfaces: Sequence[int], ends: Sequence[int]) -> EquilibriumCurve:
        """Return the equations of the mode on other sides of surfaces."""
        mode = list(self.mode)
        for j, end in zip(surfaces, ends, strict=True):
            mode[j] = end
        found = EquilibriumCurve(self.motions, mode, self.names, self.sizes.tolist())
        found.sizes_of_states = self.sizes_of_states
        return found

    def has_kink(self, surface: int, w: Array) -> bool:
        """Whether the field does not jump at one of the surfaces slid on: its multiplier does nothing."""
        scaled = np.abs(self._by_unknowns(w)[: self.n] * self.scales(w)[: self.n_unknowns])
        column = scaled[:, self.n + self.sliding.index(surface)]
        return bool(np.max(column) <= _NO_JUMP * np.max(scaled))

    def surfaces_beside(self) -> list[int]:
        """Return the surfaces that `switching` is about."""
        return [j for j, entry in enumerate(self.mode) if entry != 0 and self._active[j]]

    def linearisation(self, w: Array) -> Array:
        """Return the derivative of the motion on its surfaces, in a basis of their tangent space."""
        n, m = self.n, len(self.sliding)
        jacobian = self._by_unknowns(w)
        a, b, rows = jacobian[:n, :n], jacobian[:n, n:], jacobian[n:, :n]
        if m == 0:
            return np.asarray(a)
        tangents = _tangents(rows)
        # The multipliers keep the motion on the surfaces: rows (a dx + b dlambda) = 0 at rest.
        by_state = -np.linalg.solve(rows @ b, rows @ a)
        return np.asarray(tangents.T @ (a + b @ by_state) @ tangents)

    def tangents(self, w: Array) -> Array:
        """Return the basis, shape (n, n - m), of the tangent space that `linearisation` is in."""
        return _tangents(self.normals(w))

    def normals(self, w: Array) -> Array:
        """Return the gradients of the surfaces slid on, shape (m, n)."""
        return np.asarray(self._by_unknowns(w)[self.n :, : self.n])

    def normal_velocities(self, w: Array) -> dict[tuple[int, ...], Array]:
        """Return the rates of the functions of the surfaces slid on, in each region beside them."""
        normals, found = self.normals(w), {}
        for corner, signs in self._corners:
            velocity = self.motions.right_hand_side(0.0, w[: self.n], signs)[: self.n]
            found[tuple(corner.astype(int).tolist())] = normals @ velocity
        return found

    def speed_away(self, w: Array) -> float:
        """Return how fast motions beside the surfaces slid on go away, as a part of the largest rates.

        Negative: all come to the surfaces.
        """
        multipliers = w[self.n : self.n_unknowns]
        if len(self.sliding) == 2 and np.all(np.abs(multipliers) < 1.0):
            most = speed_away(self.normal_velocities(w))
            return 0.0 if abs(most) <= _ROUNDING else most
        jacobian = self._by_unknowns(w)
        sizes = self.scales(w)[: self.n]
        normals = jacobian[self.n :, : self.n] * sizes
        by_multipliers = jacobian[: self.n, self.n :] / sizes[:, None]
        largest = float(np.linalg.norm(normals) * np.linalg.norm(by_multipliers)) or 1.0
        return _largest_real_part(np.linalg.eigvals(normals @ by_multipliers) / largest)

    def _by_unknowns(self, w: Array) -> Array:
        """Return the derivatives by states and multipliers, (n + m, n + m), exact if the graph has them."""
        self.use(w)
        k = self.n_unknowns
        own = np.ascontiguousarray(w[:k])
        bounds = self._bounds_of_mode()
        if bounds is not None:
            # Those over a box of no size are derivatives but for rounding.
            _, below, above = bounds.over(own, own, parameter_vector(self.motions.params))
            rows = [*range(self.n), *(self.n + j for j in self.sliding)]
            if np.isfinite(below[rows]).all() and np.isfinite(above[rows]).all():
                return np.asarray(0.5 * (below[rows] + above[rows]))

        def residual(v: Array) -> Array:
            return self.residual(np.append(v, w[k:]))

        return differences(residual, own, self.scales(w)[:k], is_fine=True)

    def _bounds_of_mode(self) -> ModeBounds | None:
        core = self._core
        if self._bounds is None or self._bounds[0] is not core:
            try:
                self._bounds = core, ModeBounds(core, list(self.mode))
            except ValueError:
                self._bounds = core, None
        return self._bounds[1]

    def refer_to(self, w: Array) -> None:
        """Take a point as the latest one; nothing depends on it."""

    def state(self, w: Array, error: float) -> Equilibrium:
        """Return the equilibrium there."""
        return Equilibrium(self, w, error)


def _tangents(rows: Array) -> Array:
    """Return a basis of the space that the gradients are at right angles to, shape (n, n - m)."""
    m, n = rows.shape
    if m == 0:
        return np.eye(n)
    return np.asarray(np.linalg.svd(rows)[2][m:].T)


def differences(function: Callable[[Array], Array], w: Array, scale: Array, is_fine: bool = False) -> Array:
    """Return the derivative of a smooth function, by central differences of second or sixth order."""
    columns = []
    for i in range(len(w)):
        d = (1e-3 if is_fine else 6e-6) * scale[i]

        def at(k: int, i: int = i, d: float = d) -> Array:
            moved = w.copy()
            moved[i] += k * d
            return function(moved)

        if is_fine:
            near, middle, far = ((at(k) - at(-k)) / (2 * k * d) for k in (1, 2, 3))
            columns.append(1.5 * near - 0.6 * middle + 0.1 * far)
        else:
            columns.append((at(1) - at(-1)) / (2 * d))
    if not columns:
        return np.zeros((len(function(w)), 0))
    return np.asarray(np.array(columns).T, dtype=np.float64)


def equilibrium(
    system: System,
    y0: npt.ArrayLike,
    params: Mapping[str, float] | None = None,
    mode: Any = None,
    **options: Any,
) -> Equilibrium:
    """Return the equilibrium of a mode near a point.

    Parameters
    ----------
    system : System
        A traced system that does not depend on the time.
    y0 : array_like, shape (n,)
        A point near it.
    params : dict, optional
        Values of parameters; the others have their defaults.
    mode : Mode, tuple of int, or str, optional
        The mode, one entry per surface: with a 0 the equilibrium is a pseudo-equilibrium, where the sliding
        motion rests. Default: the mode of the motion from `y0`.
    **options
        Options of `solve_ivp`, for the motion from `y0`.

    Returns
    -------
    Equilibrium
        Also a virtual one, which the system does not have: `is_admissible` says so.

    Raises
    ------
    InputError
        If an argument is wrong, the system depends on the time, or has laws with a memory.
    ModelError
        If Newton's method does not converge.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.2 * x[0] * (x[0] > a)], n=1)
    >>> fl.equilibrium(fish, [0.7])
    Equilibrium(stable equilibrium at (0.8), mode +, eigenvalues (-0.8+0j))
    """
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    check_keywords(options, system, equilibrium)
    start = check_y0(y0, states=system._states)
    values = system.parameter_values(params)
    motions = Motions(at_rest(system, len(start), values), len(start), values, (), options)
    refuse_without_equilibria(motions, start[None])
    entries = _mode_of(motions, start, mode)
    curve = EquilibriumCurve(motions, entries)
    w = np.append(start, first_multipliers(curve, start))
    found = rest_of(curve, w)
    refuse_without_equilibria(motions, found.y[None])
    smooth = [motions.prepared.surfaces[j] for j in curve.sliding if curve.has_kink(j, found._w)]
    if smooth:
        raise ModelError(
            f"no pseudo-equilibrium in mode {found.mode} was found: the field does not jump at "
            f"{', '.join(smooth)} = 0. There is an equilibrium of both sides at {_numbers(found.y)}"
        )
    return found


def at_rest(system: System, n: int, values: dict[str, float]) -> System:
    """Return the system in which equilibria are looked for: with the knots of tables as surfaces."""
    core = system.prepare(n, 0.0, None, values).core
    switching = system.with_switching_tables() if isinstance(core, TracedSystem) and core.n_laws else None
    if switching is None:
        return system
    try:
        other = switching.prepare(n, 0.0, None, values).core
    except (ModelError, TraceError):
        return system
    return switching if isinstance(other, TracedSystem) and not other.n_laws else system


def refuse_without_equilibria(motions: Motions, states: Array) -> None:
    """Refuse a system whose motion is not that of one field for all times, at states of shape (k, n).

    Raises
    ------
    InputError
        If it has laws or clocks, or depends on the time.
    """
    core = motions.prepared.core
    if isinstance(core, TracedSystem) and core.n_laws:
        raise InputError(
            f"system: it has quantisers, clocks or laws with a memory ({', '.join(core.laws())}), and its "
            "equilibria are not those of a field with finitely many surfaces"
        )
    motions.see(states)
    if depends_on_time(motions, 1.0):
        raise InputError("system: it depends on the time: it has cycles (fl.limit_cycle), and no equilibria")
    if any(action.when in ("clock", "times") for action in motions.prepared.actions):
        raise InputError("system: it has resets at known times: it has cycles, and no equilibria")


def rest_of(curve: EquilibriumCurve, w: Array) -> Equilibrium:
    """Return the equilibrium near a guess, by Newton's method.

    Raises
    ------
    ModelError
        If that does not converge.
    """
    before = np.inf
    for _ in range(_MOST_STEPS):
        residual, jacobian = curve.equations(w)
        own = jacobian[:, : curve.n_unknowns]
        if not (np.isfinite(residual).all() and np.isfinite(own).all()):
            break
        change = -np.linalg.lstsq(own, residual, rcond=None)[0]
        size = float(np.max(np.abs(change) / curve.scales(w)[: curve.n_unknowns]))
        if not np.isfinite(size):
            break
        # Far away a step is no longer than the state itself.
        w = w.copy()
        w[: curve.n_unknowns] += change * min(1.0, 2.0 / max(size, 1e-300))
        if size < _TOLERANCE or (size < 1e-9 and size >= 0.5 * before):
            # With a singular Jacobian the least squares may come to a point that is no zero.
            if np.any(np.abs(residual) > 1e-8 * (np.abs(own) @ curve.scales(w)[: curve.n_unknowns])):
                break
            return Equilibrium(curve, w, size)
        before = size
    raise ModelError(
        f"no equilibrium in mode {Mode(curve.mode)} was found near {_numbers(w[: curve.n])}: Newton's method "
        "does not converge"
    )


def _mode_of(motions: Motions, x: Array, mode: Any) -> tuple[int, ...]:
    """Return the entries of a mode; surfaces that it does not name have their side at the point."""
    record = motions.record((0.0, 1e-9), x)
    own = record.mode
    if record.instants and record.instants[0].times[0] == 0.0:
        own = record.instants[0].modes[1]
    if mode is None:
        return own
    try:
        given = tuple(Mode(mode))
    except (TypeError, ValueError, InputError):
        raise InputError(
            f"mode: entries over -1, 0, +1 are needed, as '+0' or (1, 0), not {mode!r}"
        ) from None
    visible = len(motions.prepared.surfaces)
    if len(given) != visible:
        raise InputError(f"mode: the system has {visible} surfaces, {mode!r} has {len(given)} entries")
    return given + own[visible:]


def first_multipliers(curve: EquilibriumCurve, x: Array) -> Array:
    """Return multipliers that make the field small at a point."""
    m = len(curve.sliding)
    if m == 0:
        return np.zeros(0)
    w = np.append(x, np.zeros(m))
    rows = differences(curve.residual, w, curve.scales(w))[: curve.n, curve.n :]
    found = -np.linalg.lstsq(rows, curve.residual(w)[: curve.n], rcond=None)[0]
    return np.clip(found, -2.0, 2.0)
