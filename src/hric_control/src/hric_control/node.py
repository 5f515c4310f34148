"""The small face of ROS that controllers and robots see.

Two implementations: `ros_node.RosNode` (rospy, a master) and `local_node.LocalNode` (one process, no master: topics and services are calls).
A controller that uses nothing else runs unchanged in the lab and in ten thousand headless runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable


class _Required:
    """Marker: the parameter has no default."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED = _Required()


class Publisher(Protocol):
    """Sends messages on one topic."""

    def publish(self, message: Any) -> None:
        """Send now, in the caller's thread. The control loop uses `realtime.RealtimePublisher` instead."""

    def subscribers(self) -> int:
        """Number of listeners: what nobody hears need not be made."""

    def unregister(self) -> None:
        """Stop advertising."""


class Registration(Protocol):
    """Something that can be taken back: a subscription, a service, an action server, live parameters."""

    def unregister(self) -> None:
        """Take it back; no callback starts afterwards."""


class GoalHandle(Protocol):
    """One goal of an action, as actionlib's ServerGoalHandle has it."""

    @property
    def goal_id(self) -> str:
        """Unique id of the goal."""

    @property
    def goal(self) -> Any:
        """The goal message."""

    def accept(self) -> None:
        """The goal becomes active."""

    def reject(self, result: Any, text: str) -> None:
        """Refuse a goal that was not accepted."""

    def succeed(self, result: Any, text: str = "") -> None:
        """The goal was reached."""

    def abort(self, result: Any, text: str) -> None:
        """The goal failed."""

    def cancel(self, result: Any, text: str = "") -> None:
        """The goal was cancelled or replaced."""

    def publish_feedback(self, feedback: Any) -> None:
        """Send feedback to the client."""


@dataclass(frozen=True)
class LiveParameter:
    """A parameter that can change while running (dynamic_reconfigure).

    Attributes:
        name: parameter name (letters, digits, underscores).
        default: value at the start; its type (bool, int, float, str) is the parameter's type.
        minimum, maximum: allowed range, for numbers.
        description: what it is, with its unit.
    """

    name: str
    default: bool | int | float | str
    minimum: float = 0.0
    maximum: float = 0.0
    description: str = ""


@runtime_checkable
class Node(Protocol):
    """Parameters, topics, services, actions, log and time below one namespace. Relative names resolve in it, names with a leading "/" are global."""

    @property
    def namespace(self) -> str:
        """Absolute namespace, e.g. "/panda/joint_pd_controller"."""

    def child(self, name: str) -> Node:
        """The same connection, one namespace deeper."""

    def resolve(self, name: str) -> str:
        """Absolute name."""

    def has_param(self, name: str) -> bool:
        """Whether the parameter exists."""

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Value of a parameter (scalar, list or dict).

        Raises:
            ParameterError: it does not exist and no default was given; the message gives the absolute name.
        """

    def search_param(self, name: str, default: Any = REQUIRED) -> Any:
        """Value of the parameter in this namespace or the nearest one above it."""

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> Publisher:
        """Advertise a topic. `queue_size=0` publishes in the calling thread until the transport took the message."""

    def subscribe(self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10) -> Registration:
        """Call `callback(message)` for each message; on RosNode in another thread, on LocalNode inside publish()."""

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> Registration:
        """Serve: `handler(request)` returns the response. A HricError it raises becomes the service error text."""

    def action_server(
        self, name: str, action_type: type, on_goal: Callable[[GoalHandle], None], on_cancel: Callable[[GoalHandle], None]
    ) -> Registration:
        """Serve an action with actionlib's wire interface."""

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: Callable[[dict[str, Any]], dict[str, Any]]) -> Registration:
        """Offer parameters that change while running (dynamic_reconfigure's services and topics in this namespace).

        `on_change` gets all values and returns those that are in force after it (a refused value is put back there).
        """

    def now(self) -> Any:
        """Stamp for messages (genpy.Time): run time in simulation, ROS time otherwise."""

    def log_info(self, text: str) -> None:
        """Log for the user."""

    def log_warn(self, text: str) -> None:
        """Log a warning."""

    def log_error(self, text: str) -> None:
        """Log an error."""
