"""Something long in a process of its own, to be interrupted: ``python interrupted_worker.py WHAT STORE``.

Prints ``computing`` once it has used half a second of processor time, and after Ctrl-C what the exception
carries.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from typing import Any

import filippov as fl
import numpy as np
import xarray  # noqa: F401 - else it is imported when the first sweep begins
from untraced import number

LONG = {"F": np.linspace(0.1, 0.9, 200), "omega": np.linspace(0.1, 2.0, 1000)}
ONCE_PER_PERIOD = fl.Phase(lambda omega: 2 * np.pi / omega)


@fl.system(states=("y", "v"))
def friction(t: Any, x: Any, F: float = 0.4, omega: float = 1 / 3) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def bistable(t: Any, x: Any) -> Any:
    return [np.sign(x[0]) - x[0], np.cos(t) - x[1]]


def black_box(t: float, x: Any) -> list[float]:
    push = 0.5 * math.cos(t) - 0.2 * (1 if number(x[1]) > 0 else -1)
    return [number(x[1]), push - math.sin(number(x[0]))]


def run(what: str, store: str) -> Any:
    """Run what would take minutes."""
    section, start = ONCE_PER_PERIOD, [1.0, 2.0]
    span = (0.0, math.inf)
    if what == "poincare":
        return fl.poincare(friction, section, (0.0, 1e9), start)
    if what == "ensemble":
        return friction.ensemble((0, 1e5), np.ones((1000, 2)))
    if what == "ensemble with wrt":
        return friction.ensemble((0, 1e5), np.ones((1000, 2)), wrt=["y0", "F"])
    if what == "basins":
        grid = np.linspace(-2.0, 2.0, 1000)
        return fl.basins(fl.System(bistable, n=2, states=("a", "b")), None, (0, 100), {"a": grid, "b": grid})
    if what == "black_box":
        return fl.solve_ivp(black_box, (0, 1e6), [1.0, 0.0], surfaces=lambda t, x: number(x[1]))
    if what == "sweep of a black box":
        box = fl.System(black_box, n=2, surfaces=lambda t, x: number(x[1]), states=("a", "b"))
        return fl.sweep(box, (0, 10), {"a": np.linspace(-1, 1, 1000), "b": np.linspace(-1, 1, 1000)})
    more: dict[str, Any] = {"sweep": {}, "follow": {"follow": True}, "store": {"store": store}}[what]
    return fl.bifurcation_diagram(friction, section, span, start, LONG, **more)


def told(partial: Any) -> dict[str, Any]:
    """Return what there is of a partial result."""
    if partial is None:
        return {}
    if isinstance(partial, fl.Solution):
        return {"t": float(partial.t[-1]), "reason": partial.message}
    if isinstance(partial, fl.Ensemble):
        derivative = partial.derivative().shape if partial.wrt else None
        return {"t": partial.t.tolist(), "status": partial.status.tolist(), "derivative": derivative}
    if "status" not in partial:
        return {"returns": partial.sizes["obs"], "reason": partial.attrs["reason"]}
    reasons = partial.reason.attrs["flag_meanings"].split()
    found, counts = np.unique(partial.reason.values, return_counts=True)
    return {
        "sizes": list(partial.status.shape),
        "reasons": {reasons[code]: int(n) for code, n in zip(found, counts, strict=True)},
        "first": [float(partial[name].values.flat[0]) for name in ("t_last", "n_steps")],
        "attractors": "attractor" in partial,
    }


def announce(begun: float) -> None:
    """Print that the run has taken half a second of processor time, however long that lasts."""
    while time.process_time() - begun < 0.5:
        time.sleep(0.01)
    print("computing", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "store":
        import zarr  # noqa: F401
    threading.Thread(target=announce, args=(time.process_time(),), daemon=True).start()
    try:
        run(sys.argv[1], sys.argv[2])
    except KeyboardInterrupt as error:
        print(json.dumps({"message": str(error), **told(getattr(error, "partial", None))}))
