"""Numbers beside their references: a table, and a failure where they differ."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["compare"]


def compare(numbers: Mapping[str, tuple[float, float]], within: float = 1e-9) -> str:
    """Return a table of numbers, their references and the differences.

    Parameters
    ----------
    numbers : dict
        For every name the number found and the one expected.
    within : float, optional
        The largest difference, relative to the reference where that is larger than one.

    Returns
    -------
    str

    Raises
    ------
    AssertionError
        If a number is further off; the message is the table.

    Examples
    --------
    >>> import filippov as fl
    >>> found = fl.problems.get("biased_relay").solve().switches.t[0]
    >>> fl.problems.compare({"time of rest": (found, 1 / 0.7)}).split()[-4:-1]
    ['rest', '1.428571428571', '1.428571428571']
    """
    width = max(map(len, numbers))
    lines = [f"{'':{width}s}  {'found':>18s}  {'reference':>18s}  difference"]
    far = []
    for name, (found, expected) in numbers.items():
        difference = abs(found - expected)
        lines.append(f"{name:{width}s}  {found:18.12f}  {expected:18.12f}  {difference:.1e}")
        if not difference <= within * max(1.0, abs(expected)):
            far.append(name)
    table = "\n".join(lines)
    if far:
        raise AssertionError(f"further than {within:g} from the reference: {', '.join(far)}\n{table}")
    return table
