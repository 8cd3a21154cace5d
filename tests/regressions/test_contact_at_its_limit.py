"""A contact that starts at its limit and is loaded beyond it at once lets go there, and not a step later."""

from __future__ import annotations

import numpy as np
from test_train_of_masses import train


def test_contact_loaded_beyond_its_limit_from_the_start_of_a_motion() -> None:
    """The second contact is at its limit when the third lets go; the load grows like the time cubed."""
    sol = train(3, 0.1, 7.1).solve((0, 12), np.r_[np.zeros(3), np.full(3, 0.05)], rtol=1e-9, atol=1e-9)
    third = next(s.t for s in sol.switches if str(s.mode_after) == "00+")
    second = next(s.t for s in sol.switches if str(s.mode_after) == "0++")
    assert 0 <= second - third < 0.01  # measured: 7e-5, where the load is a part in 1e12 beyond
