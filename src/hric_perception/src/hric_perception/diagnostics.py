"""Publishes the health of a stream once a second, and logs when it changes."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hric_control.node import Node
from hric_perception.health import ERROR, OK, WARN, Health


class Reporter:
    """Of one stream.

    Args:
        node: private node; names the status.
        what: what the status is about, e.g. "stream".
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node, self._name = node, f"{node.namespace.strip('/')}: {what}"
        self._publisher = node.advertise("/diagnostics", DiagnosticArray)
        self._told = OK

    def report(self, health: Health) -> None:
        """Publish; log where the level changed."""
        if health.level != self._told:
            self._told = health.level
            {OK: self._node.log_info, WARN: self._node.log_warn, ERROR: self._node.log_error}[health.level](health.text)
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        pairs = [KeyValue(key, value) for key, value in health.values.items()]
        message.status.append(DiagnosticStatus(health.level, self._name, health.text, "", pairs))
        self._publisher.publish(message)
