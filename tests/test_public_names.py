"""The names at the top of the package: few, and those that have moved say where they are."""

from __future__ import annotations

import filippov as fl
import filippov.numpy as fnp
import numpy as np
import pytest


def test_the_top_level_has_few_names() -> None:
    assert len(fl.__all__) <= 65
    assert fl.__all__ == sorted(set(fl.__all__))
    assert all(getattr(fl, name) is not None for name in fl.__all__)


def test_the_functions_of_numpy_are_in_a_module_of_their_own() -> None:
    assert len(fnp.__all__) == 36
    assert set(fnp.__all__) & set(fl.__all__) == {"square"}  # at the top it is a wave
    assert all(hasattr(np, name) for name in fnp.__all__)


@pytest.mark.parametrize("name", sorted({*fnp.__all__} - {"square"}))
def test_a_function_of_numpy_at_the_top_says_where_it_is(name: str) -> None:
    with pytest.raises(AttributeError, match=rf"'{name}'; it is in filippov\.numpy: .*`fnp\.{name}`"):
        getattr(fl, name)


def test_an_unknown_name_is_an_ordinary_error() -> None:
    with pytest.raises(AttributeError, match=r"^module 'filippov' has no attribute 'solve_ode'$"):
        fl.solve_ode  # noqa: B018


def test_importing_everything_leaves_numpy_alone() -> None:
    names: dict[str, object] = {"numpy": np}
    exec("from filippov import *", names)
    assert names["numpy"] is np
    assert names["solve_ivp"] is fl.solve_ivp


def test_every_exception_is_raised_somewhere() -> None:
    """Each public exception is named after `raise`, or made and raised, in the package."""
    from pathlib import Path

    package = Path(fl.__file__).parent
    text = "\n".join(path.read_text(encoding="utf-8") for path in package.rglob("*.py"))
    abstract = {"FilippovError"}
    missing = [name for name in fl.errors.__all__ if f" {name}(" not in text.replace(f"class {name}(", "")]
    assert set(missing) == abstract
