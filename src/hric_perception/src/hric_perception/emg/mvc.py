"""Finds the envelope of the maximum voluntary contraction while a person is told to contract."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from std_srvs.srv import SetBool, SetBoolResponse

from hric_control.node import Node
from hric_perception.chunk import Chunk, FloatArray


class MvcService:
    """Service `record_mvc`: true begins, false ends, sets the parameter `measured_mvc` and answers with the largest envelope of each channel.

    Args:
        node: private node.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._lock = node, threading.Lock()
        self._recording = False
        self._names: tuple[str, ...] = ()
        self._largest: FloatArray | None = None
        node.service("record_mvc", SetBool, self._serve)

    def take(self, chunk: Chunk) -> None:
        """Look at some of the envelope."""
        with self._lock:
            if self._recording and len(chunk.data):
                largest = np.nan_to_num(chunk.data, nan=0.0).max(axis=0)
                before = self._largest if self._names == chunk.layout.channels else None
                self._largest = largest if before is None else np.maximum(before, largest)
                self._names = chunk.layout.channels

    def _serve(self, request: Any) -> Any:
        with self._lock:
            was, self._recording = self._recording, bool(request.data)
            largest, names = self._largest, self._names
            if request.data:
                self._largest = None
        if request.data:
            return SetBoolResponse(True, "contract as hard as you can; call again with false")
        if not was or largest is None:
            return SetBoolResponse(False, "no envelope was recorded; call with true first, while samples come")
        found = {name: float(value) for name, value in zip(names, largest, strict=True)}
        self._node.set_param("measured_mvc", found)
        return SetBoolResponse(True, "envelope/mvc: {" + ", ".join(f"{name}: {value:.4g}" for name, value in found.items()) + "}")
