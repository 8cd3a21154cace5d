"""The hidden dynamics where two surfaces meet, its scaling, and its picture."""

from __future__ import annotations

import itertools
import json
from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from matplotlib import colors, pyplot

SQUARE = list(itertools.product((-1, 1), repeat=2))


def constant(fields: dict[tuple[int, ...], Any]) -> fl.System:
    full = {signs: [*map(float, field), 1.0] for signs, field in fields.items()}
    return fl.System.from_fields(full, [lambda t, x: x[0], lambda t, x: x[1]], n=3)


def table() -> list[dict[str, Any]]:
    """Arrivals at two surfaces, with what the hidden dynamics tends to for several scalings."""
    cases = json.loads((reference.DATA / "switching_cases.json").read_text())["cases"]
    return [case for case in cases if case["situation"] == "codim1-enter" and len(case["incoming"]) == 2]


def of_case(case: dict[str, Any]) -> fl.System:
    return constant({tuple(map(int, key.split(","))): field for key, field in case["fields"].items()})


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
def test_scaling_decides_as_in_the_table() -> None:
    """Motions that slide onto the intersection, for all scalings of the table."""
    runs = changes = 0
    for case in table():
        system, incoming = of_case(case), case["incoming"]
        found = set()
        for entry in case["reference"]:
            run = system.solve(
                (0.0, 1e5),
                [0.0 if k == 0 else float(k) for k in incoming] + [0.0],
                sliding=fl.SlidingPolicy(kappa=entry["kappa"]),
                max_events=2,
                nonunique="regularize",
            )
            assert run.switches[0].mode_before == tuple(incoming)
            assert list(run.switches[0].mode_after) == entry["mode"], (case["id"], entry["kappa"])
            found.add(run.switches[0].mode_after)
            runs += 1
        changes += len(found) > 1
        ambiguous = "/amb/" in case["leaf"]
        assert ambiguous or len(found) == 1
    assert runs > 100
    assert changes >= 5


def test_start_of_a_sliding_motion_on_both_surfaces() -> None:
    relays = fl.System(lambda t, x: [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])], n=2)
    hidden = fl.hidden_dynamics(relays, 0.0, [0.0, 0.0], before="0-")
    assert hidden.incoming == (0.5, -1.0)
    assert (hidden.outcome, hidden.mode) == ("sliding", (0, 0))
    (rest,) = hidden.rest_points
    assert rest.stable
    np.testing.assert_allclose(rest.lam, [0.5, -0.2], rtol=0, atol=1e-14)
    np.testing.assert_allclose(hidden.trajectory[:, 0], [0.5, -1.5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(hidden.trajectory[:, -1], rest.lam, rtol=0, atol=1e-6)
    assert fl.hidden_dynamics(relays, 0.0, [0.0, 0.0]).incoming == (0.0, 0.0)
    away = fl.hidden_dynamics(fl.System(lambda t, x: np.sign(x) + 0 * x, n=2), 0.0, [0.0, 0.0], before="--")
    assert (away.incoming, away.outcome, away.mode) == (None, "not arriving", None)
    assert away.trajectory.shape == (2, 0)


def test_motion_ends_where_the_decision_says() -> None:
    """The drawn motion is integrated; the decision has a proof. 100 random arrivals and starts."""
    rng = np.random.default_rng(5)
    compared = 0
    while compared < 100:
        system = constant({signs: rng.normal(size=2) for signs in SQUARE})
        for before in (None, "0-", "--", "+0"):
            hidden = fl.hidden_dynamics(system, 0.0, [0.0, 0.0, 0.0], before=before)
            if hidden.incoming is None or hidden.outcome not in ("region", "sliding"):
                continue
            assert hidden.mode is not None
            end = hidden.trajectory[:, -1]
            farthest = np.abs(end).max()
            # The faster component ends the motion: the slower one is where it goes, or on the way.
            for value, rate, entry in zip(end, hidden.rates(*end), hidden.mode, strict=True):
                if entry == 0:
                    assert abs(value) < 1.0 or value * rate < 0.0
                else:
                    assert np.sign(rate) == entry
            assert (farthest > 1.0) == (hidden.mode != (0, 0))
            compared += 1


def test_rates_are_bilinear_and_stay_beyond_the_square() -> None:
    rng = np.random.default_rng(6)
    values = {signs: rng.normal(size=2) for signs in SQUARE}
    hidden = fl.hidden_dynamics(constant(values), 0.0, [0.0, 0.0, 0.0])
    for signs, value in values.items():
        np.testing.assert_allclose(hidden.rates(*signs), value, rtol=0, atol=1e-15)
        np.testing.assert_allclose(hidden.rates(3.0 * signs[0], 2.0 * signs[1]), value, rtol=0, atol=1e-15)
    np.testing.assert_allclose(hidden.rates(0.0, 0.0), np.mean(list(values.values()), axis=0), atol=1e-15)
    assert hidden.rates(np.zeros((4, 5)), 0.0)[1].shape == (4, 5)


def test_other_points_are_refused() -> None:
    system = constant({signs: (-signs[0], -signs[1]) for signs in SQUARE})
    with pytest.raises(fl.ModelError, match=r"two surfaces are needed, here 1 meet: x\[0\]"):
        fl.hidden_dynamics(system, 0.0, [0.0, 1.0, 0.0])
    with pytest.raises(fl.InputError, match=r"^before: one entry per surface"):
        fl.hidden_dynamics(system, 0.0, [0.0, 0.0, 0.0], before="0")


def two_rest_points() -> fl.System:
    """Case `entry_nonunique_to_codim2_a` of the reference."""
    return constant({(-1, -1): (1, 3), (1, -1): (-2, -3), (-1, 1): (-1, -2), (1, 1): (3, -1)})


@pytest.mark.parametrize("dark", [False, True])
def test_picture(dark: bool) -> None:
    """A stable rest point is filled, a saddle open; both curves are there, and the motion."""
    hidden = fl.hidden_dynamics(two_rest_points(), 0.0, [0.0, 0.0, 0.0], before="0-")
    assert sorted(point.stable for point in hidden.rest_points) == [False, True]
    axes = fl.plot.hidden_dynamics(hidden, dark=dark)
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    assert len(dots) == 2
    for line, point in zip(dots, hidden.rest_points, strict=True):
        np.testing.assert_array_equal(line.get_xydata()[0], point.lam)
        ground = colors.to_rgba(axes.get_facecolor())
        filled = colors.to_rgba(line.get_markerfacecolor()) != ground
        assert filled == point.stable
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["$g_1 = 0$", "$g_2 = 0$", "motion, to 00"]
    assert axes.get_xlabel() == r"$\lambda$ of x[0]"
    assert len(axes.collections) == 3  # arrows, and two curves
    axes.figure.canvas.draw()
    pyplot.close(axes.figure)


def test_picture_on_given_axes() -> None:
    figure, ax = pyplot.subplots()
    policy = fl.SlidingPolicy(kappa=[1.0, 2.0])
    assert fl.plot.hidden_dynamics(two_rest_points(), 0.0, [0.0, 0.0, 0.0], sliding=policy, ax=ax) is ax
    with pytest.raises(TypeError, match=r"^x: "):
        fl.plot.hidden_dynamics(two_rest_points())
    pyplot.close(figure)
