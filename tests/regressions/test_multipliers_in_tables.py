"""Multipliers of segments: in [-1, 1] also at exits, and of the segment itself if it has no duration."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np


def test_multipliers_at_exits_are_not_beyond_one_by_rounding() -> None:
    for shift in np.linspace(0.1, 0.3, 41):

        def f(t: float, x: Any, shift: float = shift) -> Any:
            return [shift + 1.3 * np.sin(1.7 * t) - np.sign(x[0]) * (1 + 0.1 * np.cos(t))]

        sol = fl.solve_ivp(f, (0.0, 12.0), [0.3])
        slides = [segment for segment in sol.segments if segment.mode.is_sliding]
        assert len(slides) > 1
        for segment in slides:
            assert abs(segment.multipliers_start[0]) <= 1.0
            assert abs(segment.multipliers_end[0]) <= 1.0


def test_a_segment_without_duration_has_its_own_multipliers() -> None:
    kick = fl.Reset(times=[1.0], map=lambda t, x: [0.5])
    sol = fl.solve_ivp(lambda t, x: [0.3 - np.sign(x[0])], (0.0, 1.0), [0.1], resets=kick)
    last = sol.segments[-1]
    assert (last.t_start, last.t_end, str(last.mode)) == (1.0, 1.0, "+")
    assert np.isnan(last.multipliers_start).all()
    assert np.isnan(last.multipliers_end).all()


def test_moves_between_levels_are_not_in_the_table() -> None:
    # It slides on a moving surface, up and down again through the middle between two levels.
    def f(t: float, x: Any) -> Any:
        return [-8.0 * np.sign(x[0] - 0.8 * np.sin(t)) - 0.3 * np.floor(x[0] + 0.021)]

    sol = fl.solve_ivp(f, (0.0, 3.0), [0.0])
    assert sol.success, sol.message
    assert all(switch.surfaces for switch in sol.switches)
