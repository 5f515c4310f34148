"""Small interface to ROS for controllers and robots.

Two implementations: `ros.node.RosNode` (rospy, a master) and `local.node.LocalNode` (one process, no master: topics and
services are calls). A controller that uses ROS only through this interface runs unchanged on a real robot and in
simulations without ROS.
"""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from hric_core import names
from hric_core.errors import ParameterError

ParameterValues = dict[str, Any]
"""Checked values of live parameters by name: bool, int, float or str."""
OnChange = Callable[[ParameterValues], ParameterValues]
"""Callback for a change of live parameters: gets all requested values by name, returns all values then in force."""


class _Required:
    """Type of `REQUIRED`, the default of parameters that have no default."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED = _Required()


def publisher_of(message: Any) -> str:
    """Return the name of the node that published a received message; empty if unknown."""
    header = getattr(message, "_connection_header", None)
    return str(header.get("callerid", "")) if header else ""


class Publisher(Protocol):
    """Publisher of one topic."""

    def publish(self, message: Any) -> None:
        """Publish a message now, in the caller's thread. The control loop uses `realtime.RealtimePublisher` instead."""

    def subscribers(self) -> int:
        """Return the number of subscribers; without any, no message needs to be built."""

    def unregister(self) -> None:
        """Stop advertising."""


class Registration(Protocol):
    """Registration that can be undone: a subscription, a service, an action server, live parameters."""

    def unregister(self) -> None:
        """Undo the registration; no callback starts afterwards."""


class Undoable:
    """Registration that is undone by calling the function `undo` once."""

    def __init__(self, undo: Callable[[], Any]) -> None:
        self._undo: Callable[[], Any] | None = undo

    @property
    def open(self) -> bool:
        """True until `unregister` is called."""
        return self._undo is not None

    def unregister(self) -> None:
        """Undo the registration; a second call does nothing."""
        undo, self._undo = self._undo, None
        if undo is not None:
            undo()


LOG_PERIOD = 1.0
"""Shortest time between two lines of a `LogThrottle` [s] (project default, unconfirmed)."""


class LogThrottle:
    """Throttle for log lines that may come a thousand times a second. May be called from any thread.

    The first line is logged at once. Within `LOG_PERIOD` after a logged line, lines are only counted; the next one
    after that is logged with their number.

    Args:
        log: function that logs a line.
        clock: function that returns the time [s].
    """

    def __init__(self, log: Callable[[str], None], clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._lock = threading.Lock()
        self._logged_at: float | None = None
        self._left_out, self._last = 0, ""

    def __call__(self, text: str) -> None:
        """Log a line, or only count it if the last one was logged less than `LOG_PERIOD` ago."""
        with self._lock:
            now, before = self._clock(), self._logged_at
            if before is not None and 0.0 <= now - before < LOG_PERIOD:  # restart after a time that jumped back
                self._left_out, self._last = self._left_out + 1, text
                return
            count, self._left_out, self._logged_at = self._left_out, 0, now
        self._log(f"{text} ({count} more since the last line)" if count else text)

    def finish(self) -> None:
        """Log the newest line that was only counted, with the number of counted lines; nothing if there is none."""
        with self._lock:
            count, self._left_out = self._left_out, 0
        if count:
            self._log(f"{self._last} ({count} times since the last line)")


class GoalHandle(ABC):
    """Server side of an action goal, like actionlib's ServerGoalHandle.

    Attributes:
        goal_id: unique id of the goal.
        goal: the goal message.
    """

    goal_id: str
    goal: Any

    @property
    @abstractmethod
    def status(self) -> str:
        """State of the goal, by actionlib's name, e.g. "ACTIVE"."""

    @abstractmethod
    def accept(self) -> None:
        """Accept the goal: set its state to ACTIVE."""

    def reject(self, result: Any, text: str) -> None:
        """End a goal that was not accepted with the state REJECTED."""
        self._finish("reject", result, text)

    def succeed(self, result: Any, text: str = "") -> None:
        """End the goal with the state SUCCEEDED."""
        self._finish("succeed", result, text)

    def abort(self, result: Any, text: str) -> None:
        """End the goal with the state ABORTED, as it failed."""
        self._finish("abort", result, text)

    def cancel(self, result: Any, text: str = "") -> None:
        """End the goal with the state PREEMPTED or RECALLED, as it was cancelled or replaced by another goal."""
        self._finish("cancel", result, text)

    @abstractmethod
    def _finish(self, event: str, result: Any, text: str) -> None:
        """End the goal; `event`: "reject", "succeed", "abort" or "cancel"."""

    @abstractmethod
    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""

    def fail(self, text: str) -> None:
        """Reject the goal if it was not accepted yet, or abort it if it is active; otherwise do nothing."""
        if self.status in ("PENDING", "RECALLING"):
            self.reject(None, text)
        elif self.status in ("ACTIVE", "PREEMPTING"):
            self.abort(None, text)


@dataclass(frozen=True)
class LiveParameter:
    """Parameter that can change while running (dynamic_reconfigure).

    Attributes:
        name: parameter name (letters, digits, underscores).
        default: value at the start; its type (bool, int, float, str) is the parameter's type.
        minimum, maximum: allowed range of a number; no range if `minimum` is not below `maximum`.
        description: description with unit.
    """

    name: str
    default: bool | int | float | str
    minimum: float = 0.0
    maximum: float = 0.0
    description: str = ""


@runtime_checkable
class Node(Protocol):
    """Interface to the parameters, topics, services, actions, log and time of ROS, in one namespace.

    Relative names are resolved in this namespace; names with a leading "/" are global."""

    @property
    def namespace(self) -> str:
        """Absolute namespace, e.g. "/panda/joint_pd_controller"."""

    @property
    def publishes_inline(self) -> bool:
        """True if publishing calls the subscribers at once, in the caller's thread, which makes runs reproducible."""

    def child(self, name: str) -> "Node":
        """Return a node for the child namespace `name`, with the same connection."""

    def resolve(self, name: str) -> str:
        """Return the absolute form of a name that is relative to this namespace."""

    def beside(self, name: str) -> str:
        """Return the absolute form of a name that is relative to the parent namespace.

        The parent namespace of a controller is the robot's; that of a private node is the namespace of its process.
        Topics of the whole robot, such as those of motion capture, are in this parent namespace."""

    def has_param(self, name: str) -> bool:
        """Return True if the parameter exists."""

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of a parameter (scalar, list or dict).

        Raises:
            ParameterError: the parameter does not exist and no default is given; the message has the absolute name.
        """

    def search_param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of a parameter, searched for in this namespace and then upwards to the root."""

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> Publisher:
        """Advertise a topic. Publishing never waits for subscribers; `queue_size` exists for rospy's sake only."""

    def subscribe(
        self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10
    ) -> Registration:
        """Subscribe to a topic: `callback(message)` is called for each message.

        On a RosNode it is called in another thread, on a LocalNode within publish()."""

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> Registration:
        """Offer a service; `handler(request)` returns the response. The text of its HricError is sent to the client."""

    def action_server(
        self,
        name: str,
        action_type: type,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
    ) -> Registration:
        """Offer an action with actionlib's topics."""

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: OnChange) -> Registration:
        """Offer parameters that can change while the program runs, like a dynamic_reconfigure server in this namespace.

        `on_change` gets all requested values and returns those in force afterwards: for a refused one the old value.
        """

    def now(self) -> Any:
        """Return the stamp for messages (genpy.Time): robot time in simulation, ROS time otherwise."""

    def log_info(self, text: str) -> None:
        """Log a message for the user."""

    def log_warn(self, text: str) -> None:
        """Log a warning."""

    def log_error(self, text: str) -> None:
        """Log an error."""


class Namespaced:
    """Base class of nodes: methods that need only the namespace, `has_param` and `param`."""

    _namespace: str

    @property
    def namespace(self) -> str:
        """Absolute namespace."""
        return self._namespace

    def beside(self, name: str) -> str:
        """Return the absolute form of a name that is relative to the parent namespace."""
        return names.resolve(self._namespace.rpartition("/")[0], name)

    def search_param(self: Any, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of the parameter in this namespace or the nearest one above it."""
        # The ROS master's searchParam is not used, as it cannot begin its search at the root.
        for namespace in names.upwards(self._namespace):
            if self.has_param(full := names.resolve(namespace, name)):
                return self.param(full, default)
        if default is REQUIRED:
            raise ParameterError(f"parameter {name} is set neither in {self._namespace} nor above it")
        return default
