"""Figures of solutions. Plotting draws and never computes.

Needs Matplotlib: ``pip install filippov[plot]``.
"""

from __future__ import annotations

from filippov.plot.hidden_dynamics import hidden_dynamics
from filippov.plot.phase import phase
from filippov.plot.time_series import time_series

__all__ = ["hidden_dynamics", "phase", "time_series"]
