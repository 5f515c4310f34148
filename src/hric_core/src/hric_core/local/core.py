"""State shared by a LocalNode and its children: parameters, topics, services, actions and clock."""

import copy
from collections.abc import Callable, Mapping
from typing import Any

from hric_core import names
from hric_core.errors import HricError
from hric_core.live import LiveValues
from hric_core.local.action import LocalActionServer

Tap = Callable[[str, Any, float], None]
"""Callback (topic, message, robot time [s]) for every message that is published, e.g. of a recorder."""


class ParameterTree:
    """Parameters as nested dicts, addressed by absolute names. Reading and writing copy the values."""

    def __init__(self, params: Mapping[str, object] | None = None) -> None:
        self._root: dict[str, object] = {}
        for name, value in (params or {}).items():
            self.set(names.resolve("/", name), value)

    def get(self, name: str) -> Any:
        """Return the value or subtree of parameters with an absolute name.

        Raises:
            KeyError: it does not exist.
        """
        value: Any = self._root
        for part in name.split("/"):
            if part:
                if not isinstance(value, dict):
                    raise KeyError(name)
                value = value[part]
        return _copy(value)

    def has(self, name: str) -> bool:
        """Return True if a parameter or subtree with this absolute name exists."""
        try:
            self.get(name)
        except KeyError:
            return False
        return True

    def set(self, name: str, value: Any) -> None:
        """Set a parameter or, from a dict, a subtree; keys of the dict may contain slashes."""
        parts = [part for part in name.split("/") if part]
        if isinstance(value, Mapping):
            value = ParameterTree(value)._root
        if not parts:
            if not isinstance(value, dict):
                raise HricError(f"parameter / (the root of all parameters) must be a dict, not {value!r}")
            self._root = _copy(value)
            return
        node = self._root
        for part in parts[:-1]:
            child = node.get(part)
            if not isinstance(child, dict):
                child = node[part] = {}
            node = child
        node[parts[-1]] = _copy(value)


def _copy(value: Any) -> Any:
    """Return a deep copy; that of plain values is several times as fast as `copy.deepcopy`."""
    kind = type(value)
    if kind is dict:
        return {key: _copy(part) for key, part in value.items()}
    if kind is list:
        return [_copy(part) for part in value]
    return value if kind in (float, str, int, bool) else copy.deepcopy(value)


class LocalTopic:
    """Topic with its type, its subscribers in order of subscription, and the latched message."""

    def __init__(self, name: str, message_type: type) -> None:
        self.name, self.type = name, message_type
        self.callbacks: list[Callable[[Any], None]] = []
        self.publishers: set[str] = set()
        self.latched: Any = None
        self.sequence = 0


class LocalCore:
    """State shared by a LocalNode and its children."""

    def __init__(self, params: Mapping[str, object] | None = None) -> None:
        self.params = ParameterTree(params)
        self.topics: dict[str, LocalTopic] = {}
        self.services: dict[str, tuple[type, Callable[[Any], Any]]] = {}
        self.actions: dict[str, LocalActionServer] = {}
        self.live: dict[str, LiveValues] = {}
        self.taps: list[Tap] = []
        self.clock: Callable[[], float] = lambda: 0.0
        self.goals = 0
        self.raises = False

    def topic(self, name: str, message_type: type) -> LocalTopic:
        """Return the topic with this absolute name; the first call creates it.

        Raises:
            HricError: the topic has another message type.
        """
        topic = self.topics.setdefault(name, LocalTopic(name, message_type))
        if topic.type is not message_type:
            raise HricError(f"topic {name} has type {names.type_name(topic.type)}, not {names.type_name(message_type)}")
        return topic

    def publish(self, topic: LocalTopic, message: Any, latch: bool, header: dict[str, str]) -> None:
        """Call all taps and subscribers with a message; `header`: connection header, as rospy attaches it."""
        if type(message) is not topic.type:
            names.check_message(f"topic {topic.name}", topic.type, message)
        message._connection_header = header
        topic.sequence += 1
        if getattr(topic.type, "_has_header", False):
            message.header.seq = topic.sequence
        if latch:
            topic.latched = message
        if self.taps:
            time = self.clock()
            for tap in tuple(self.taps):
                tap(topic.name, message, time)
        for callback in tuple(topic.callbacks):
            callback(message)
