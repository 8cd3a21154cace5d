"""What is kept from call to call is kept by value: equal arguments, and no others, get the same answer."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov import options
from filippov.analysis.identity import identity_of


def test_equal_options_are_handed_to_the_core_once() -> None:
    def checked(**given: Any) -> Any:
        return options.check_options(given, (0.0, 1.0), 2).for_core()

    assert checked(rtol=1e-7) is checked(rtol=1e-7)
    assert checked(sliding="canopy") is checked() is checked(sliding=fl.SlidingPolicy(kappa=2.0))
    by_kappa = [checked(sliding=fl.SlidingPolicy(kappa=kappa)) for kappa in ([1, 4], (1.0, 4.0), [4, 1])]
    assert by_kappa[0] is by_kappa[1] is not by_kappa[2]
    assert checked(atol=np.array([1e-6, 1e-9])) is not checked(atol=np.array([1e-6, 1e-9]))


def installed(folder: Path, version: str) -> ModuleType:
    """Return a module that is installed, with a function that another one of that version replaces."""
    from importlib.machinery import ModuleSpec

    module = ModuleType("installed_for_this_test")
    module.__spec__ = ModuleSpec(module.__name__, None, origin=str(folder / "site-packages" / "it.py"))
    module.__version__ = version  # type: ignore[attr-defined]
    exec("def gain(x):\n    return -x", module.__dict__)
    return module


def test_a_package_of_another_version_is_another_function(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = []
    for version in ("1.0", "2.0", "1.0"):
        module = installed(tmp_path, version)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        digests.append(identity_of(module.gain, "fun"))
    assert digests[0] == digests[2] != digests[1]


def test_a_module_imported_later_is_recognised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = installed(tmp_path, "1.0")
    module.__name__ = module.gain.__module__ = "imported_later"
    digests = [identity_of(module.gain, "fun")]
    monkeypatch.setitem(sys.modules, "imported_later", module)
    digests += [identity_of(module.gain, "fun"), identity_of(module.gain, "fun")]
    assert digests[0] != digests[1] == digests[2]
