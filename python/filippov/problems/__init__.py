"""Reference problems in ordinary NumPy code, used by tests, examples, benchmarks and the command line.

>>> import filippov as fl
>>> problem = fl.problems.get("dry_friction")
>>> fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args).success
True
"""

from __future__ import annotations

from filippov.problems.comparison import compare
from filippov.problems.problem import Problem
from filippov.problems.registry import get, names

__all__ = ["Problem", "compare", "get", "names"]
