"""The names under which PlotJuggler 3 with its ROS plugins lists the numbers of a bag, as its parser of ROS messages
forms them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from rosbags.highlevel import AnyReader

LARGEST_ARRAY = 100
"""Longer arrays are left out, unless its settings say otherwise."""


def names(bag: Path) -> set[str]:
    """Of all messages of a bag."""
    found: set[str] = set()
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found |= set(
                _joints(connection.topic, message)
                if connection.msgtype == "sensor_msgs/msg/JointState"
                else _fields(connection.topic, message)
            )
    return found


def curves(layout: Path) -> list[str]:
    """The names that a layout refers to."""
    return [str(curve.get("name")) for curve in ElementTree.parse(layout).getroot().iter("curve")]


def _joints(topic: str, message: Any) -> Iterator[str]:
    for field in ("position", "velocity", "effort"):
        for joint, _ in zip(message.name, getattr(message, field), strict=False):
            yield f"{topic}/{joint}/{field}"


def _fields(prefix: str, value: Any) -> Iterator[str]:
    if isinstance(value, list | tuple | np.ndarray):
        if len(value) <= LARGEST_ARRAY:
            for number, part in enumerate(value):
                yield from _fields(f"{prefix}[{number}]", part)
    elif hasattr(value, "__dataclass_fields__"):
        for field in value.__dataclass_fields__:
            if not field.startswith("__"):
                yield from _fields(f"{prefix}/{field}", getattr(value, field))
    elif not isinstance(value, str):
        yield prefix
