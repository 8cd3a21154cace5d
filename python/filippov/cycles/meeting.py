"""Whether motions beside a meeting of two surfaces come to it or go away.

To first order the velocity across the surfaces is constant in each of the four regions around the meeting.

References: Guglielmi, Hairer, An efficient algorithm for solving piecewise-smooth dynamical systems, Numer.
Algorithms 89 (2022), formulas (6.1) to (6.3), for motions that circle; Filippov (1988), section 19.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filippov.cycles.motions import Array

__all__ = ["speed_away"]

# The regions in the order of a turn, each by the sides of both surfaces.
_TURN = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def speed_away(velocities: Mapping[tuple[int, ...], Array]) -> float:
    """Return how fast a motion goes away from a meeting of two surfaces, to first order.

    Parameters
    ----------
    velocities : dict
        For the sides of both surfaces, each -1 or 1, the rates of both switching functions there.

    Returns
    -------
    float
        Positive if some motion goes away, as a part of the largest rate: in a region, or sliding on one of
        the surfaces. Negative if all come to the meeting. Where they circle, the logarithm of the distance
        after a turn over that before.

    Examples
    --------
    >>> import numpy as np
    >>> sides = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    >>> speed_away({k: -np.array(k) for k in sides})
    -1.0
    >>> round(speed_away({k: np.array([k[0] - 3 * k[1], k[1] + 3 * k[0]]) for k in sides}), 9)
    2.772588722
    """
    size = max(float(np.max(np.abs(rates))) for rates in velocities.values())
    if size == 0.0:
        return 0.0
    factor = _factor_of_turn(velocities)
    if factor is not None:
        return float(np.log(factor))
    in_regions = [min(k * rates) for k, rates in velocities.items()]
    return float(max(in_regions + _while_sliding(velocities))) / size


def _factor_of_turn(velocities: Mapping[tuple[int, ...], Array]) -> float | None:
    """Return the distance after a turn over that before; nothing if the motions do not circle."""
    rates, factors = [], {1.0: 1.0, -1.0: 1.0}
    for here, following in zip(_TURN, _TURN[1:] + _TURN[:1], strict=True):
        # Between these two regions this surface is crossed.
        crossed = 0 if here[0] != following[0] else 1
        rates += [following[crossed] * velocities[side][crossed] for side in (here, following)]
        for turn, left in ((1.0, here), (-1.0, following)):
            with np.errstate(divide="ignore", invalid="ignore"):
                factors[turn] *= float(abs(velocities[left][1 - crossed] / velocities[left][crossed]))
    turn = float(np.sign(rates[0]))
    return factors[turn] if turn != 0.0 and all(turn * rate > 0 for rate in rates) else None


def _while_sliding(velocities: Mapping[tuple[int, ...], Array]) -> list[float]:
    """Return how fast the motions that slide on one of the surfaces go away from the other one."""
    found = []
    for slid, beside in ((0, 1), (1, 0)):
        for side in (1, -1):
            above, below = (velocities[(own, side) if slid == 0 else (side, own)] for own in (1, -1))
            if above[slid] * below[slid] < 0:
                share = below[slid] / (below[slid] - above[slid])
                found.append(side * float(share * above[beside] + (1 - share) * below[beside]))
    return found
