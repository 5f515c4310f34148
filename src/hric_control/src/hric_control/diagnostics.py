"""Diagnostics of the robot process, published as diagnostic_msgs once per second of wall time (REP 107)."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hric_control.limits import LimitCounts
from hric_control.sim.sim_loop import SimLoop
from hric_core import listeners
from hric_core.node import Node
from hric_core.robot_time.progress import Gate

PERIOD = 1.0
"""Time between two diagnostics messages [s of wall time]."""
SLOW = 0.95
"""Ratio of actual to requested real-time factor below which the simulation loop counts as too slow [1]."""


class Diagnostics:
    """Publisher of the robot's `/diagnostics`, in a thread of its own, also while the simulation is paused.

    Args:
        node: node that advertises; its namespace is the robot's name in the messages.
        hardware: name of the RobotHW.
        loop: loop of a simulated robot, or None.
        counts: function that returns a copy of the limit counts, or None.
        gate: limit of robot time by progress reports, for which a paced simulation waits, or None.
    """

    def __init__(
        self,
        node: Node,
        hardware: str,
        loop: SimLoop | None,
        counts: Callable[[], LimitCounts] | None,
        gate: Gate | None = None,
    ) -> None:
        self._node, self._hardware, self._loop, self._counts, self._gate = node, hardware, loop, counts, gate
        self._publisher = node.advertise("/diagnostics", DiagnosticArray, queue_size=10)
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._missed = self._touched = self._lost = 0
        self._requested = deque[float](maxlen=3)  # requested factors; if all are equal, the statistics are of this one

    def start(self) -> None:
        """Start publishing."""
        self._thread = threading.Thread(target=self._work, name="diagnostics", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop publishing."""
        self._end.set()
        if self._thread is not None:
            self._thread.join(PERIOD)
        self._publisher.unregister()

    def message(self) -> Any:
        """Return the current statuses as a DiagnosticArray."""
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        if self._loop is not None:
            message.status.append(self._loop_status(self._loop))
        if self._counts is not None:
            message.status.append(self._limit_status(self._counts()))
        message.status.append(self._listener_status(listeners.DISPATCHER.status()))
        return message

    def _work(self) -> None:
        while not self._end.wait(PERIOD):
            self._publisher.publish(self.message())

    def _status(self, what: str, level: int, text: str, values: dict[str, object]) -> Any:
        name = f"{self._node.namespace.strip('/') or 'robot'}: {what}"
        return DiagnosticStatus(
            level=level,
            name=name,
            message=text,
            hardware_id=self._hardware,
            values=[KeyValue(key, str(value)) for key, value in values.items()],
        )

    def _loop_status(self, loop: SimLoop) -> Any:
        stats, requested = loop.stats, loop.real_time_factor
        missed, self._missed = stats.missed_deadlines - self._missed, stats.missed_deadlines
        self._requested.append(requested)
        level, text = DiagnosticStatus.OK, "running"
        if not loop.running:
            text = "not running"
        elif loop.paused:
            text = "paused"
        elif requested and len(set(self._requested)) == 1 and stats.rtf < SLOW * requested:
            level, text = DiagnosticStatus.WARN, f"too slow: real-time factor {stats.rtf:.3f} of {requested:g}"
        held, silent = ({}, []) if self._gate is None else (self._gate.held.copy(), self._gate.silent())
        if silent:
            level, text = DiagnosticStatus.WARN, f"no longer waiting for {', '.join(silent)}, which report no progress"
        return self._status("control loop", level, text, {
            "real-time factor": f"{stats.rtf:.4f}",
            "real-time factor requested": f"{requested:g}" if requested else "as fast as possible",
            "cycle time mean [us]": f"{1e6 * stats.cycle_time_mean:.1f}",
            "cycle time max [us]": f"{1e6 * stats.cycle_time_max:.1f}",
            "missed deadlines": stats.missed_deadlines,
            "missed deadlines, last second": missed,
            "schedule slowed": stats.slowed,
            "cycles": loop.cycles,
            **{f"waited for {name} [s]": f"{seconds:.1f}" for name, seconds in held.items()},
            "robot time [s]": f"{loop.time:.3f}",
        })  # fmt: skip

    def _limit_status(self, counts: LimitCounts) -> Any:
        touched, self._touched = counts.total - self._touched, counts.total
        values: dict[str, object] = {"cycles": counts.cycles}
        for kind in ("position", "velocity", "effort", "effort_rate"):
            values[kind] = (
                ", ".join(
                    f"{name}: {count}" for name, count in zip(counts.names, getattr(counts, kind), strict=True) if count
                )
                or "0"
            )
        values["velocity ratio max"] = f"{max(counts.velocity_ratio_max, default=0.0):.3f}"
        values["position excess max"] = f"{max(counts.position_excess_max, default=0.0):.4g}"
        values["started outside"] = (
            ", ".join(name for name, out in zip(counts.names, counts.started_outside, strict=True) if out) or "none"
        )
        text = (
            f"{touched} commands limited in the last second" if touched > 0 else "no command limited in the last second"
        )
        return self._status("joint limits", DiagnosticStatus.WARN if touched > 0 else DiagnosticStatus.OK, text, values)

    def _listener_status(self, status: listeners.Status) -> Any:
        lost, self._lost = status.lost - self._lost, status.lost
        text = f"{lost} messages dropped in the last second for slow listeners" if lost else "all listeners keep up"
        if status.behind and not lost:
            text = f"slow listeners: {', '.join(status.behind)}"
        return self._status("listeners", DiagnosticStatus.WARN if status.behind else DiagnosticStatus.OK, text, {
            "behind": ", ".join(status.behind) or "none",
            "queued for them [bytes]": status.waiting,
            "queue limit for each [bytes]": listeners.LIMIT,
            "messages dropped": status.lost,
            "closed, as they read nothing": status.closed,
        })  # fmt: skip
