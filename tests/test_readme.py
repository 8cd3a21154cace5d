"""The README: its Python blocks run, its numbers are true, and its Rust example is the compiled one."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
PNG_SIGNATURE = b"\x89PNG"


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Everything that the blocks of the README define; they run once."""
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("scipy")
    matplotlib.use("Agg")
    sys.path.insert(0, str(ROOT / "scripts"))
    from readme_blocks import run_blocks

    folder = tmp_path_factory.mktemp("readme")
    found = run_blocks(README, folder)
    found["folder"] = folder
    return found


def test_the_picture_is_drawn_and_kept(names: dict[str, Any]) -> None:
    assert (names["folder"] / "stick_slip.png").read_bytes().startswith(PNG_SIGNATURE)
    for link in re.findall(r"!\[[^]]*\]\(([^)]*)\)", README.read_text(encoding="utf-8")):
        assert (ROOT / link).read_bytes().startswith(PNG_SIGNATURE)


def test_the_comparison_with_scipy_is_true(names: dict[str, Any]) -> None:
    assert names["ordinary"].success
    assert names["ordinary"].y[:, -1] == pytest.approx([27.666666667, 0.0], abs=1e-8)
    assert names["exact"].y[:, -1] == pytest.approx([49.255067419, 1.348824242], abs=1e-8)
    assert names["exact"].switches.t == pytest.approx([11.000275475, 11.270040324], abs=1e-8)


def test_the_table_of_the_comparison_is_true(names: dict[str, Any]) -> None:
    integrate = pytest.importorskip("scipy.integrate")
    table = re.findall(r"^\| (.*`\w+`|\*\*filippov\*\*).*$", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert table == ["SciPy `RK45`", "SciPy `DOP853`", "SciPy `Radau`", "**filippov**"]
    problem = {key: value for key, value in names["problem"].items() if key not in ("rtol", "atol")}
    for method in ("RK45", "DOP853", "Radau"):
        found = integrate.solve_ivp(names["layer"], method=method, rtol=1e-10, atol=1e-10, **problem)
        assert found.success
        assert found.y[:, -1] == pytest.approx([27.667, 0.0], abs=5e-4)
    ours = names["fl"].solve_ivp(names["layer"], **problem)
    row = re.search(r"^\| \*\*filippov\*\*.*$", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert row is not None
    assert f"| {ours.nfev} |" in row[0]
    assert f"**{ours.y[0, -1]:.6f}** | **{ours.y[1, -1]:.6f}**" in row[0]


def test_the_numbers_in_the_text_are_true(names: dict[str, Any]) -> None:
    assert names["rest"].nfev < 100
    assert names["rest"].switches.t == pytest.approx([1 / 0.7])
    assert names["rest"].sol.multipliers(5.0) == pytest.approx([0.3])
    assert names["box"].stats["backend"] == "black box"
    assert not names["part"].success


@pytest.mark.slow
def test_scipy_is_as_slow_as_the_text_says() -> None:
    integrate = pytest.importorskip("scipy.integrate")
    reached = [0.0]

    class Enough(Exception):
        pass

    def rest(t: float, x: Any) -> list[float]:
        reached.append(t)
        if len(reached) > 200_000:
            raise Enough
        return [0.3 - float(np.sign(x[0]))]

    with pytest.raises(Enough):
        integrate.solve_ivp(rest, (0, 10), [1.0], rtol=1e-6, atol=1e-9)
    # The chatter depends on the last bits; 6.77 here.
    assert max(reached) == pytest.approx(6.8, abs=0.5)


def test_links_lead_somewhere() -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", README.read_text(encoding="utf-8"))
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_rust_example_is_the_one_that_is_compiled() -> None:
    shown = re.search(r"^```rust\n(.*?)^```$", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert shown
    compiled = (ROOT / "crates/filippov/examples/dry_friction.rs").read_text(encoding="utf-8")
    code = compiled.split("\n\n", maxsplit=1)[1].replace("#![allow(clippy::print_stdout)]\n\n", "")
    assert code == shown[1]
