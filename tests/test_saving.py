"""Systems in files and as bytes: they come back as they were, and what is no system is refused by name."""

from __future__ import annotations

import math
import pickle
import struct
import zlib
from pathlib import Path

import filippov as fl
import numpy as np
import pytest
from untraced import number


def oscillator(t, x, F, omega):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def friction() -> fl.System:
    return fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))


def bouncing() -> fl.System:
    return fl.System(
        lambda t, x, e: [x[1], -9.81],
        n=2,
        params={"e": 0.5},
        resets=[
            fl.Reset(lambda t, x: x[0], lambda t, x, e: [x[0], -e * x[1]], name="bounce"),
            fl.Reset(times=[0.2, 1.4], map=lambda t, x: [x[0], x[1] + 1.0], name="kick"),
            fl.Reset(period=0.7, phase=0.1, map=lambda t, x: [x[0], 0.9 * x[1]], name="tick"),
        ],
    )


def with_memory() -> fl.System:
    relay = fl.Hysteresis(lambda t, x: x[0], -0.5, 0.5)
    return fl.System(
        lambda t, x: [-relay(t, x) + 0.1 * np.floor(3 * t), np.floor(2 * x[0]) - fl.sawtooth(t, 0.3)], n=2
    )


def sticking() -> fl.System:
    return fl.System(lambda t, x, F: [x[1], np.sin(t) - F * fl.stick(x[1], 1.3)], n=2, params={"F": 0.6})


CASES = {
    "friction": (friction, [1.0, 2.0]),
    "bouncing": (bouncing, [1.0, 0.0]),
    "with_memory": (with_memory, [0.2, 0.1]),
    "sticking": (sticking, [0.3, 0.4]),
    "relay": (lambda: fl.System.relay([[0, 1], [-1, 0.1]], [0, 0.5], [0, 1], states=("a", "b")), [1.0, 1.0]),
    "fields": (
        lambda: fl.System.from_fields({+1: [-1.0, 1.0], -1: [2.0, 0.0]}, lambda t, x: x[0], n=2),
        [1.0, 0.0],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_systems_come_back_as_they_were(name: str, tmp_path: Path) -> None:
    make, start = CASES[name]
    system = make()
    path = tmp_path / "system.flp"
    system.save(path)
    for copy in (
        fl.System.load(path),
        fl.System.load(str(path)),
        fl.System.from_bytes(system.to_bytes()),
        pickle.loads(pickle.dumps(system)),
    ):
        assert copy.to_bytes() == system.to_bytes()
        assert (copy.n, copy.params, copy.states) == (system.n, system.params, system.states)
        assert (copy.surfaces, copy.backend) == (system.surfaces, system.backend)
        assert repr(copy) == repr(system)
        first, second = (s.solve((0, 4), start) for s in (system, copy))
        assert len(first.switches) > 0
        assert np.array_equal(first.y, second.y)
        assert np.array_equal(first.switches.t, second.switches.t)
        assert [switch.note for switch in first.switches] == [switch.note for switch in second.switches]


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_a_loaded_system_takes_other_values_and_black_events(tmp_path: Path) -> None:
    friction().save(tmp_path / "a.flp")
    copy = fl.System.load(tmp_path / "a.flp")
    assert copy.params == {"F": 0.4, "omega": 1 / 3}
    event = lambda t, x: x[0] - 0.5  # noqa: E731
    first = friction().solve((0, 9), [1.0, 2.0], F=0.3, events=event)
    second = copy.solve((0, 9), [1.0, 2.0], F=0.3, events=event)
    assert np.array_equal(first.y, second.y)
    assert np.allclose(first.t_events[0], second.t_events[0], rtol=1e-9, atol=1e-12)


def test_a_system_that_branches_on_parameters_holds_for_its_values(tmp_path: Path) -> None:
    system = fl.System(lambda t, x, a: [-1.0 if a > 0 else 2.0], n=1, params={"a": 1.0})
    system.save(tmp_path / "a.flp")
    copy = fl.System.load(tmp_path / "a.flp")
    assert copy.solve((0, 1), [0.0]).y[0, -1] == pytest.approx(-1.0)
    with pytest.raises(fl.ModelError, match="did not travel with the system; this copy is valid for"):
        copy.solve((0, 1), [0.0], a=-1.0)


def test_what_cannot_be_saved_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.flp"
    box = fl.System(lambda t, x: [-math.sin(number(x[0]))], n=1, surfaces=lambda t, x: x[0])
    with pytest.raises(fl.ModelError, match="only traced expressions are saved"):
        box.save(path)
    mapped = fl.System(
        lambda t, x: [x[1], -1.0],
        n=2,
        resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], math.fabs(number(x[1]))], name="wall"),
    )
    with pytest.raises(fl.ModelError, match="the map of the reset wall could not be traced"):
        mapped.save(path)
    with pytest.raises(fl.ModelError, match="give n= to System"):
        fl.System(lambda t, x: [-np.sign(x[0])]).save(path)
    assert not path.exists()


def kick(t, x):
    return [x[0], math.fabs(number(x[1]))]


def test_functions_of_modules_travel_with_a_pickle() -> None:
    system = fl.System(lambda t, x: [x[1], -1.0], n=2, resets=fl.Reset(lambda t, x: x[0], kick))
    system.solve((0, 1), [1.0, 0.0])
    data = pickle.dumps(system)
    assert np.array_equal(pickle.loads(data).solve((0, 3), [1.0, 0.0]).y, system.solve((0, 3), [1.0, 0.0]).y)


def sealed(data: bytes) -> bytes:
    """Return a container with its checksum written again."""
    return data[:-4] + struct.pack("<I", zlib.crc32(data[:-4]))


WRONG = {
    "empty": (lambda data: b"", "not a file of filippov"),
    "text": (lambda data: b"y, v = x\n", "not a file of filippov"),
    "pickle": (lambda data: pickle.dumps([1, 2]), "not a file of filippov"),
    "old": (lambda data: b"FILEXPR\x02" + data[8:], "not a file of filippov"),
    "newlines": (lambda data: data.replace(b"\r\n", b"\n"), "not a file of filippov"),
    "version": (lambda data: data[:8] + b"\x07" + data[9:], "version 7 of the format, this is version 1"),
    "cut": (lambda data: data[:-9], r"incomplete.*: \d+ bytes of \d+"),
    "header": (lambda data: data[:11], "incomplete.*: 11 bytes"),
    "longer": (lambda data: data + b"\0", "with something behind its end"),
    "flipped": (lambda data: data[:60] + bytes([data[60] ^ 4]) + data[61:], "the checksum is wrong"),
    "content": (lambda data: sealed(data[:12] + b"GRPH" + data[16:]), "holds GRPH, SYST is needed"),
    "payload": (lambda data: sealed(data[:44] + b"\xff" + data[45:]), "damaged in section NODE"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_saved_system_is_refused(name: str, tmp_path: Path) -> None:
    change, message = WRONG[name]
    path = tmp_path / "wrong.flp"
    path.write_bytes(change(friction().to_bytes()))
    with pytest.raises(fl.InputError, match=message) as caught:
        fl.System.load(path)
    assert "wrong.flp" in str(caught.value)
    with pytest.raises(fl.InputError, match=f"^data: .*{message}"):
        fl.System.from_bytes(path.read_bytes())


def test_arguments_are_checked(tmp_path: Path) -> None:
    with pytest.raises(fl.InputError, match="data: bytes are needed, not str"):
        fl.System.from_bytes("FLP")  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        fl.System.load(tmp_path / "missing.flp")
    with pytest.raises(fl.InputError, match=r"path: .* not int"):
        fl.System.load(3)  # type: ignore[arg-type]
    with pytest.raises(fl.InputError, match=r"path: .* not None"):
        friction().save(None)  # type: ignore[arg-type]


def test_a_damaged_pickle_is_refused() -> None:
    data = bytearray(pickle.dumps(friction()))
    data[data.index(b"FLP\r\n") + 50] ^= 1
    with pytest.raises(fl.InputError, match="a pickled system: damaged: the checksum is wrong"):
        pickle.loads(bytes(data))


def test_attributes_of_subclasses_travel() -> None:
    class Labelled(fl.System):
        label = ""

    system = Labelled(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3})
    assert isinstance(Labelled.from_bytes(system.to_bytes()), Labelled)
    plain = friction()
    plain.label = "dry"  # type: ignore[attr-defined]
    assert pickle.loads(pickle.dumps(plain)).label == "dry"


def test_nothing_python_is_in_the_bytes() -> None:
    """Bytes follow from the expressions: the same for equal functions, and for a copy of a copy."""
    one, two = friction(), friction()
    assert one.to_bytes() == two.to_bytes()
    assert fl.System.from_bytes(one.to_bytes()).to_bytes() == one.to_bytes()
    assert b"oscillator" not in one.to_bytes()
    assert len(one.to_bytes()) < 500


def test_forged_bytes_are_refused_or_can_be_solved() -> None:
    """Right checksums. The Rust tests do this by the thousand; here messages and tables are made too."""
    rng = np.random.default_rng(7)
    sources = [make().to_bytes() for make, _ in CASES.values()]
    used = 0
    for _ in range(500):
        data = bytearray(sources[rng.integers(len(sources))])
        for place in rng.integers(28, len(data) - 4, size=rng.integers(1, 3)):
            data[place] = (
                (data[place] + rng.integers(1, 3)) % 256 if rng.random() < 0.7 else rng.integers(256)
            )
        try:
            system = fl.System.from_bytes(sealed(bytes(data)))
        except fl.InputError:
            continue
        assert repr(system)
        with np.errstate(all="ignore"):
            sol = system.solve((0, 1), np.linspace(0.9, 0.3, system.n), max_steps=50, max_events=20)
        assert sol.message
        assert str(sol.switches)
        assert len(sol.switches.kind) == len(sol.switches)
        assert sol.surfaces == tuple(system.surfaces)
        used += 1
    assert used > 50


def test_a_function_that_reads_comparisons_of_a_floor_travels() -> None:
    """The surfaces of these comparisons come after that of the function, as no motion crosses them."""
    system = fl.System(
        lambda t, x: [1.0, -0.5 * np.sign(x[1] - np.where(np.floor(x[0]) == 2, 1.0, 0.0))], n=2
    )
    # The function jumps with the floor: its values on both sides switch apart.
    assert system.surfaces == ["x[0] - nearest(x[0])", "x[1]", "x[1] - 1"]
    copy = fl.System.from_bytes(system.to_bytes())
    assert copy.to_bytes() == system.to_bytes()
    end = copy.solve((0, 3.7), [0.1, 0.0]).y[:, -1]
    # Slides at zero, rises for a unit of time, and falls for 0.8.
    np.testing.assert_allclose(end, [3.8, 0.1], atol=1e-9)
    assert np.array_equal(system.solve((0, 3.7), [0.1, 0.0]).y[:, -1], end)


def test_nodes_that_simplify_further_when_they_are_read_keep_their_meaning():
    """The product of a sign with itself is known to be 1 only once its surface is known."""

    def fun(t, x):
        h = -0.8 * x[0] + 0.115 * x[1] - -0.08
        pull = -1.82 * np.clip(h, -0.66, 0.3) * np.sqrt(1 + x[0] ** 2)
        return [
            0.5 * x[1] - 0.12 * x[0] + pull + 0.157 * np.sign(h) * np.sign(h),
            -0.634 * x[1] - 0.5 * x[0] + 1.0,
        ]

    system = fl.System(fun, n=2)
    ends = [system.solve((0, 3), [-0.44, 1.013]).y[:, -1]]
    copy = pickle.loads(pickle.dumps(system))
    ends.append(copy.solve((0, 3), [-0.44, 1.013]).y[:, -1])
    np.testing.assert_allclose(*ends, rtol=1e-12)
