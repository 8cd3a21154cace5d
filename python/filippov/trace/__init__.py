"""Tracing: a user's function is called with traced values and becomes an expression with switching functions.

``trace`` is the entry; `Scalar`, `Condition` and `TracedArray` are what the user's function sees.
"""

from __future__ import annotations

from filippov.trace.array import TracedArray
from filippov.trace.branching import Guard
from filippov.trace.condition import Condition
from filippov.trace.scalar import Scalar
from filippov.trace.tracer import OWN_LAW, Trace, trace, trace_event

__all__ = ["OWN_LAW", "Condition", "Guard", "Scalar", "Trace", "TracedArray", "trace", "trace_event"]
