"""Numbers of a page: arrays laid one behind the other, as base64 in one element of the page, and found again by offset."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import numpy.typing as npt

KINDS = {"f8": "<f8", "f4": "<f4", "u4": "<u4"}
"""What `data.js` reads, little-endian."""
ALIGNMENT = 8
"""A typed array of the browser begins at a multiple of its element's size [bytes]."""


class Blob:
    """Arrays of one page; the same array object is stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        # The array itself is kept, so that its id stays its own.
        self._known: dict[tuple[int, str], tuple[Any, dict[str, Any]]] = {}

    def add(self, values: npt.NDArray[Any], kind: str) -> dict[str, Any]:
        """Store an array, row by row; answers where it lies: kind, offset [bytes], number of values."""
        found = self._known.get((id(values), kind))
        if found is None:
            raw = np.ascontiguousarray(values, dtype=KINDS[kind]).tobytes()
            place = {"kind": kind, "offset": self._size, "count": int(values.size)}
            padding = -len(raw) % ALIGNMENT
            self._parts.append(raw + bytes(padding))
            self._size += len(raw) + padding
            found = self._known[id(values), kind] = (values, place)
        return found[1]

    def text(self) -> str:
        """All of it, as base64."""
        return base64.b64encode(b"".join(self._parts)).decode()
