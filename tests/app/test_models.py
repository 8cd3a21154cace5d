"""Models of the page: every reference problem comes back from its bytes, and runs as it does in Python."""

from __future__ import annotations

import json
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov._core import PageModel, pack_page, page_of
from filippov.app import Page, make_page
from filippov.app.engine import Engine
from filippov.app.reply import Reply, read_reply


def asked(engine: Any, kind: str, **fields: Any) -> Reply:
    return read_reply(engine.answer(json.dumps({"kind": kind, **fields}).encode()))


def oscillator(t: Any, x: Any, F: float = 0.4, omega: float = 1 / 3) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


FRICTION = fl.System(oscillator, n=2, states=("y", "v"))


@pytest.mark.parametrize("name", fl.problems.names())
def test_every_reference_problem_runs_from_its_bytes_as_in_python(name: str) -> None:
    problem = fl.problems.get(name)
    page = make_page(name)
    model = PageModel(page.to_bytes())
    reply = asked(model, "run")
    expected = problem.solve(rtol=page.rtol, atol=page.atol)
    assert reply.header["ok"], reply.header
    assert reply.header["message"] == expected.message
    assert reply.header["end"] == expected.y[:, -1].tolist()
    found = [(row["t"], row["kind"], row["from"], row["to"]) for row in reply.header["switches"]]
    assert found == [(s.t, s.kind, str(s.mode_before), str(s.mode_after)) for s in expected.switches]
    times = np.linspace(*problem.t_span, 37)
    sampled = asked(model, "sample", times=times.tolist())
    assert expected.sol is not None
    assert (sampled.arrays["y"] == expected.sol(times).T).all()


@pytest.mark.parametrize("name", fl.problems.names())
def test_a_page_comes_back_from_its_bytes(name: str) -> None:
    page = make_page(name)
    data = page.to_bytes()
    copy = Page.from_bytes(data)
    assert copy[1:] == page[1:]
    assert copy.to_bytes() == data
    assert fl.System.from_bytes(data).to_bytes() == page.system.to_bytes()


def test_values_ranges_and_titles_reach_the_page() -> None:
    page = make_page(
        FRICTION,
        {"y": 1.0, "v": 2.0},
        (0, 30),
        {"F": (0, 2), "omega": 0.5, "v": (-3, 3)},
        title="stick",
        axes=("v", "y"),
    )
    section = json.loads(page_of(page.to_bytes()) or "")
    assert section == {
        "title": "stick",
        "y0": [1.0, 2.0],
        "t_span": [0.0, 30.0],
        "rtol": 1e-6,
        "atol": 1e-9,
        "method": "auto",
        "ranges": {"F": [0.0, 2.0], "v": [-3.0, 3.0]},
        "axes": [1, 0],
        "text": None,
        "reference": None,
    }
    described = asked(PageModel(page.to_bytes()), "describe").header
    assert described["params"] == [{"name": "F", "value": 0.4}, {"name": "omega", "value": 0.5}]
    assert described["states"] == ["y", "v"]
    assert described["page"] == section


def test_a_system_without_a_page_has_none_and_gets_one() -> None:
    plain = FRICTION.to_bytes()
    assert page_of(plain) is None
    with pytest.raises(fl.InputError, match=r"^data: a system without a page"):
        Page.from_bytes(plain)
    again = pack_page(pack_page(plain, '{"title": "a"}'), '{"title": "b"}')
    assert page_of(again) == '{"title": "b"}'


def test_discrete_states_and_resets_travel() -> None:
    shift = fl.Reset(lambda t, x: x[0] - 0.5, direction="down", set={"gear": 3.0}, name="shift")
    box = fl.System(lambda t, x, gear: [-gear * x[0]], n=1, discrete={"gear": 1.0}, resets=shift)
    page = make_page(box, [1.0], (0, 2))
    model = PageModel(page.to_bytes())
    described = asked(model, "describe").header
    assert (described["discrete"], described["actions"]) == (["gear"], ["shift"])
    expected = box.solve((0, 2), [1.0])
    found = asked(model, "run").header
    assert found["end"] == expected.y[:, -1].tolist()
    assert [row["kind"] for row in found["switches"]] == expected.switches.kind.tolist() == ["reset"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"y0": None}, "^y0: the initial state is needed"),
        ({"y0": [1.0]}, "^y0: the system has 2 states, y0 has 1"),
        ({"t_span": (0, np.inf)}, "^t_span: two finite"),
        ({"params": {"G": 1}}, "^params: neither a parameter nor a state 'G'.*; there are F, omega, y, v"),
        ({"params": {"F": (2, 0)}}, r"^params: the range of 'F' is a pair of numbers \(low, high\)"),
        ({"params": {"F": (0, 1, 2)}}, "^params: the range of 'F'"),
        ({"params": {"F": np.nan}}, "^params: 'F'"),
        ({"params": {"v": 1.0}}, "^params: 'v' is a state: its start belongs into y0"),
        ({"params": [1]}, "^params: a dict of names and values"),
        ({"rtol": -1.0}, "^rtol"),
        ({"atol": [1e-9, 1e-9]}, "^atol: one number"),
        ({"method": "Radau"}, "^method"),
        ({"axes": ("y", "w")}, "^axes: no state 'w'; there are y, v"),
        ({"axes": (0, 0)}, "^axes: two different states"),
        ({"title": 3}, "^title: a text"),
    ],
)
def test_wrong_arguments_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        make_page(**{"shown": FRICTION, "y0": [1.0, 2.0], **given})


@pytest.mark.parametrize(
    ("shown", "message"),
    [("dry_frict", "no reference problem 'dry_frict'.*dry_friction"), (3, "is needed, not int")],
)
def test_what_is_no_system_is_named(shown: Any, message: str) -> None:
    with pytest.raises(fl.InputError, match=f"^system: .*{message}"):
        make_page(shown, [1.0])


def lookup(t: Any, x: Any) -> Any:
    return [float(str(float(-x[0]))) - (1.0 if x[0] > 0 else -1.0)]


def branches(t: Any, x: Any, gain: float = 1.0) -> Any:
    return [-gain * x[0] if gain > 0.5 else -np.sign(x[0])]


def thrown(t: Any, x: Any) -> Any:
    return [0.0, float(str(-0.5 * float(x[1])))]


BALL = fl.System(
    lambda t, x: [x[1], -9.81],
    n=2,
    resets=fl.Reset(lambda t, x: x[0], thrown, direction="down"),
    states=("h", "v"),
)
STAYING = {
    "black box": (fl.System(lookup, n=1, surfaces=lambda t, x: x[0]), [1.0], "could not be traced"),
    "branching on a parameter": (fl.System(branches, n=1), [1.0], "branches on values of parameters"),
    "a reset in Python": (BALL, [1.0, 0.0], "the map of the reset thrown"),
}


@pytest.mark.parametrize("case", STAYING)
def test_what_needs_python_is_computed_by_the_kernel(case: str) -> None:
    system, y0, why = STAYING[case]
    page = make_page(system, y0, (0, 2))
    assert why in page.why_it_stays()
    with pytest.raises(fl.ModelError, match=f"^the system cannot leave Python: .*{why}"):
        page.to_bytes()
    engine = Engine(page)
    assert engine.model == b""
    described = asked(engine, "describe").header
    assert described["n"] == len(y0)
    assert "cycle" not in described["kinds"]
    assert described["surfaces"] == list(system.surfaces)
    for params in [{}] if case != "branching on a parameter" else [{"gain": 1.0}, {"gain": 0.2}]:
        expected = system.solve((0, 2), y0, params)
        reply = asked(engine, "run", params=params)
        assert reply.header["ok"], reply.header
        assert reply.header["end"] == expected.y[:, -1].tolist()
        kinds = [row["kind"] for row in reply.header["switches"]]
        assert kinds == expected.switches.kind.tolist()
        assert len(kinds) > 0 or params == {"gain": 1.0}


def test_an_exception_of_a_function_is_a_sentence() -> None:
    def bad(t: Any, x: Any) -> Any:
        if float(str(float(t))) > 0.5:
            raise RuntimeError("no value there")
        return [1.0]

    engine = Engine(make_page(fl.System(bad, n=1, surfaces=lambda t, x: x[0] - 9), [0.0], (0, 1)))
    reply = asked(engine, "run")
    text = reply.header["error"] if not reply.header["ok"] else reply.header["message"]
    assert "no value there" in text or "raised" in text
    assert not reply.header.get("success", False)


def test_the_kernel_finds_the_cycle_on_the_screen() -> None:
    page = make_page(FRICTION, [1.0, 2.0], (0, 40), {"omega": 0.4})
    reply = asked(Engine(page), "cycle")
    expected = fl.limit_cycle(FRICTION, [1.0, 2.0], {"omega": 0.4})
    assert reply.header["ok"], reply.header
    assert reply.header["period"] == expected.period
    assert reply.header["multipliers"] == [[z.real, z.imag] for z in expected.multipliers]
    assert reply.header["stable"] is True
    y = reply.arrays["y"]
    assert np.max(np.abs(y[-1] - y[0])) < 1e-6
    assert {piece["mode"] for piece in reply.header["pieces"]} == {str(mode) for mode in expected.modes}
    modes = ", ".join(str(mode) for mode in expected.modes)
    assert reply.header["text"] == f"A stable forced cycle of period 15.708 through the modes {modes}."


@pytest.mark.parametrize("initial", [1, -1])
def test_the_cycle_on_the_screen_keeps_the_memory_of_a_relay(initial: int) -> None:
    relay = fl.Hysteresis(lambda t, x: x[0], -0.3, 0.3, initial=initial)
    system = fl.System(lambda t, x: [x[1], -x[0] - 0.2 * relay(t, x) - 0.3 * x[1]], n=2)
    reply = asked(Engine(make_page(system, [1.0, 0.5])), "cycle")
    y = reply.arrays["y"]
    np.testing.assert_allclose(y[-1], y[0], atol=1e-6)
    assert np.ptp(y[:, 0]) > 0.8


def test_the_kernel_continues_the_cycle() -> None:
    page = make_page(FRICTION, [1.0, 2.0], (0, 40), {"omega": 0.4})
    reply = asked(Engine(page), "continuation", parameter="omega", range=[0.38, 0.42])
    assert reply.header["ok"], reply.header
    value = reply.arrays["value"]
    assert (value.min(), value.max()) == pytest.approx((0.38, 0.42))
    assert np.allclose(reply.arrays["period"], 2 * np.pi / value, rtol=1e-9)
    assert (reply.arrays["low"] <= reply.arrays["y"] + 1e-9).all()
    assert (reply.arrays["y"] <= reply.arrays["high"] + 1e-9).all()
    assert (reply.arrays["low"] < reply.arrays["high"]).all()
    assert {row["code"] for row in reply.header["special"]} >= {"EP"}
    text = reply.header["text"]
    assert text.startswith(
        f"{len(value)} cycles for omega from 0.38 to 0.42. Below: omega = 0.38 is the end"
    ), text
    assert {row["text"] for row in reply.header["special"] if row["code"] == "EP"} == {"end"}


def test_the_kernel_continues_an_equilibrium() -> None:
    lever = fl.System(lambda t, x, a=0.5: [a - x[0] - 0.2 * np.sign(x[0])], n=1)
    reply = asked(
        Engine(make_page(lever, [0.3])), "continuation", of="equilibrium", parameter="a", range=[0.3, 0.8]
    )
    assert reply.header["ok"], reply.header
    assert np.allclose(reply.arrays["y"][:, 0], reply.arrays["value"] - 0.2)
    assert (reply.arrays["stable"] == 1).all()


def test_the_kernel_finds_the_grazing_of_an_oscillator_at_a_wall() -> None:
    def rates(
        t: float, x: Any, zeta: float = 0.05, omega: float = 1.9, r: float = 0.8, s: float = -0.5
    ) -> Any:
        return [x[1], np.cos(omega * t) - 2 * zeta * x[1] - x[0]]

    wall = fl.Reset(
        lambda t, x, s: x[0] - s, lambda t, x, r: [x[0], -r * x[1]], direction="down", name="wall"
    )
    oscillator = fl.System(rates, states=("x", "v"), resets=wall)
    page = make_page(oscillator, [0.2, -0.6], (0, 60))
    reply = asked(Engine(page), "continuation", parameter="omega", range=[1.6, 2.0])
    (grazing,) = (row for row in reply.header["special"] if row["code"] == "GR")
    b = 1 - 2 * 0.05**2
    amplitude_is_the_gap = np.sqrt(b + np.sqrt(b**2 - 1 + 4.0))
    assert grazing["value"] == pytest.approx(amplitude_is_the_gap, rel=1e-8)
    assert grazing["text"].startswith("grazing of a reset at x - s = 0, at t = ")


def test_a_branch_has_the_extents_of_its_cycles_wherever_the_run_ended() -> None:
    def rates(t: float, x: Any, zeta: float = 0.1, omega: float = 1.5) -> Any:
        return [x[1], np.cos(omega * t) - 2 * zeta * x[1] - x[0]]

    page = make_page(fl.System(rates, states=("y", "v")), [0.2, -0.6], (0, 60))
    t0 = 2e3 * np.pi / 1.5
    reply = asked(Engine(page), "continuation", parameter="omega", range=[1.4, 2.0], t0=t0)
    omega = reply.arrays["value"]
    assert (omega.min(), omega.max()) == pytest.approx((1.4, 2.0)), "with the points that there are"
    amplitude = 1 / np.hypot(1 - omega**2, 0.2 * omega)
    assert np.allclose(reply.arrays["high"][:, 0], amplitude, rtol=1e-4)  # samples of a sine: 3e-5
    assert np.allclose(reply.arrays["low"][:, 1], -omega * amplitude, rtol=1e-4)


def test_a_request_that_fails_is_answered_too(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("filippov.app.engine.limit_cycle", fails)
    reply = read_reply(Engine(make_page(FRICTION, [1.0, 2.0])).answer(b'{"kind": "cycle"}'))
    assert reply.header["ok"] is False
    assert reply.header["error"] == "The kernel failed at this: ZeroDivisionError: by zero"
    assert "Traceback" in caplog.text, "where it failed stands in the terminal"


def test_the_script_has_the_method_that_was_chosen() -> None:
    engine = Engine(make_page(FRICTION, [1.0, 2.0]))
    assert "method='DOP853'" in asked(engine, "script", method="DOP853").header["text"]
    refused = read_reply(engine.answer(b'{"kind": "script", "method": "x\'); import os"}'))
    assert refused.header["ok"] is False


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (b"run", "^the request is no JSON"),
        (b"[" * 100_000, "^the request is no JSON"),
        (b"\xff\xfe", "^the request is no JSON"),
        (b"[1]", "^kind: None is none of describe, run"),
        (b'{"kind": "exec"}', "^kind: 'exec' is none of"),
        (b'{"kind": "run", "y0": [1]}', "y0"),
        (b'{"kind": "continuation", "parameter": "G", "range": [0, 1]}', "^parameter: one of F, omega"),
        (b'{"kind": "continuation", "parameter": "F", "range": 1}', "^range: a list of 2 numbers"),
        (b'{"kind": "continuation", "parameter": "F", "range": [0, 1], "of": "x"}', '^of: "cycle" or'),
        (b'{"kind": "cycle", "params": {"G": 1}}', "^params: the system has no parameter 'G'"),
        (b'{"kind": "cycle", "period": "long"}', "^period: a finite number"),
        (b'{"kind": "script", "y0": [1]}', "^y0: a list of 2 numbers"),
    ],
)
def test_wrong_requests_are_answered_with_a_sentence(request_: bytes, message: str) -> None:
    reply = read_reply(Engine(make_page(FRICTION, [1.0, 2.0])).answer(request_))
    assert reply.header["ok"] is False
    with pytest.raises(ValueError, match=message):
        raise ValueError(reply.header["error"])


def test_replies_come_back_from_their_bytes() -> None:
    reply = Reply(
        {"ok": True, "text": "ü"}, {"t": np.arange(3.0), "y": np.array([[1.0, np.nan], [2.0, np.inf]])}
    )
    copy = read_reply(reply.to_bytes())
    assert copy.header == reply.header
    assert all(
        np.array_equal(copy.arrays[name], array, equal_nan=True) for name, array in reply.arrays.items()
    )
    with pytest.raises(fl.InputError, match=r"^reply: "):
        read_reply(reply.to_bytes()[:-8])
