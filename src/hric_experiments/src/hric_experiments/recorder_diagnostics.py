"""Tells on /diagnostics, once a second, what the recorder does (REP 107)."""

from __future__ import annotations

import time
from collections.abc import Mapping

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

PERIOD = 1.0
"""[s of wall time]."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class RecorderDiagnostics:
    """Publishes the status of this node."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self._name = f"{rospy.get_name().strip('/')}: recording"
        self._due = 0.0

    def report(self, level: int, text: str, values: Mapping[str, str], now: bool = False) -> None:
        """Publish when a second has passed, or now."""
        if not now and time.monotonic() < self._due:
            return
        self._due = time.monotonic() + PERIOD
        message = DiagnosticArray()
        message.header.stamp = rospy.get_rostime()
        message.status.append(DiagnosticStatus(level, self._name, text, "", [KeyValue(key, value) for key, value in values.items()]))
        self._publisher.publish(message)
