"""The straight C loop of ``straight_step.c``, compiled when it is needed."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

__all__ = ["StraightLoop", "compiler"]

_SOURCE = Path(__file__).with_name("straight_step.c")
_DOUBLE, _LONG, _ARRAY = ctypes.c_double, ctypes.c_long, np.ctypeslib.ndpointer(np.float64, flags="C")


def compiler() -> str | None:
    """Return the C compiler, ``None`` if there is none."""
    return shutil.which("gcc") or shutil.which("cc")


class StraightLoop:
    """DOPRI5 steps of the slip phase in C, without events.

    Parameters
    ----------
    flags : sequence of str
        Flags of the compiler.
    y0 : sequence of float
        Initial state.
    force, omega : float
        Parameters of the oscillator.
    """

    def __init__(self, flags: Sequence[str], y0: Sequence[float], force: float, omega: float) -> None:
        found = compiler()
        if found is None:
            raise FileNotFoundError("no C compiler (gcc or cc)")
        with TemporaryDirectory() as folder:
            library = Path(folder) / "straight_step.so"
            subprocess.run(
                [found, *flags, "-std=c11", "-shared", "-fPIC", str(_SOURCE), "-o", str(library), "-lm"],
                check=True,
            )
            self._library = ctypes.CDLL(str(library))
        self._library.fixed_steps.argtypes = [_ARRAY, _DOUBLE, _DOUBLE, _DOUBLE, _LONG, _DOUBLE, _ARRAY]
        self._library.controlled_steps.argtypes = [_ARRAY, *[_DOUBLE] * 4, _ARRAY]
        self._library.fixed_steps.restype = self._library.controlled_steps.restype = _LONG
        self._y0 = np.array(y0, dtype=np.float64)
        self._parameters = (force, omega)
        self.end = np.zeros(3)

    def fixed(self, step: float, n_steps: int, tolerance: float) -> int:
        """Make steps of one length; return the number of evaluations of the field."""
        return int(self._library.fixed_steps(self._y0, *self._parameters, step, n_steps, tolerance, self.end))

    def controlled(self, t_end: float, tolerance: float) -> int:
        """Integrate with PI step control; return the number of steps tried."""
        return int(self._library.controlled_steps(self._y0, *self._parameters, t_end, tolerance, self.end))
