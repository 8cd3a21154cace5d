"""Replies to a page: a header in JSON, then arrays of numbers.

Four bytes with the length of the header, the header, zeros up to a multiple of eight, and the arrays one
after another as little-endian numbers of eight bytes. ``header["arrays"]`` has, by name, where each begins,
counted in numbers, and its shape. The core writes the same (``crates/filippov-web/src/reply.rs``).
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError

__all__ = ["Reply", "failure", "read_reply"]

Array = npt.NDArray[np.float64]


class Reply(NamedTuple):
    """A reply: its header without the places of the arrays, and the arrays by name.

    Examples
    --------
    >>> import numpy as np
    >>> from filippov.app.reply import Reply, read_reply
    >>> read_reply(Reply({"ok": True}, {"t": np.arange(2.0)}).to_bytes()).arrays["t"].tolist()
    [0.0, 1.0]
    """

    header: dict[str, Any]
    arrays: dict[str, Array]

    def to_bytes(self) -> bytes:
        """Return the reply as bytes. Numbers of the header that are not finite become null."""
        places: dict[str, Any] = {}
        parts, begin = [], 0
        for name, array in self.arrays.items():
            places[name] = [begin, list(np.shape(array))]
            parts.append(np.ascontiguousarray(array, dtype="<f8").tobytes())
            begin += int(np.size(array))
        text = json.dumps({**_finite(self.header), "arrays": places}, allow_nan=False).encode()
        padding = -(4 + len(text)) % 8
        return b"".join([struct.pack("<I", len(text)), text, bytes(padding), *parts])


def failure(error: str, code: str) -> bytes:
    """Return a reply that carries an error message."""
    return Reply({"ok": False, "error": error, "code": code}, {}).to_bytes()


def read_reply(data: bytes) -> Reply:
    """Return a reply from its bytes.

    Raises
    ------
    InputError
        If they are not those of a reply.
    """
    try:
        (length,) = struct.unpack_from("<I", data)
        header = json.loads(data[4 : 4 + length])
        places = header.pop("arrays", {})
        numbers = np.frombuffer(data, dtype="<f8", offset=4 + length + -(4 + length) % 8)
        arrays = {}
        for name, (begin, shape) in places.items():
            arrays[name] = numbers[begin : begin + math.prod(shape)].reshape(shape).astype(np.float64)
    except (struct.error, ValueError, TypeError, AttributeError) as error:
        raise InputError(f"reply: {error}") from None
    return Reply(header, arrays)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
