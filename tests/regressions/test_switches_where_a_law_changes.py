"""A surface that vanishes in the instant in which a floor changes unseen is recorded."""

from __future__ import annotations

import filippov as fl
import numpy as np


def test_crossing_and_sliding_halfway_between_whole_numbers_are_recorded() -> None:
    def slope(t: float, x: np.ndarray) -> list[float]:
        return [np.cos(t) - 0.5 * np.sign(x[0] - 0.5) + 0.1 * np.floor(x[0])]

    sol = fl.solve_ivp(slope, (0, 6), [0.1], rtol=1e-10, atol=1e-12)
    of_half = [s for s in sol.switches if sol.switches.surface_text(s) == "x[0] - 0.5"]
    assert [s.kind for s in of_half] == ["crossing", "enter_sliding", "exit_sliding", "crossing"]
    # sin(t) + 0.5 t = 0.4; the motion leaves where cos(t) = -0.5.
    first = of_half[0].t
    assert abs(np.sin(first) + 0.5 * first - 0.4) < 1e-9
    assert abs(of_half[2].t - 2 * np.pi / 3) < 1e-8


def test_the_sign_that_follows_the_discrete_state_is_no_switch() -> None:
    sol = fl.solve_ivp(lambda t, x: [1.0 + 0.1 * np.floor(x[0])], (0, 2), [0.1])
    assert {sol.switches.surface_text(s) for s in sol.switches} == {"x[0] - nearest(x[0])"}
    assert sol.switches.y_before[:, 0].round(12).tolist() == [1.0, 2.0]
