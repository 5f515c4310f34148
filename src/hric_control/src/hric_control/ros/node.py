"""A node on rospy: the same face as `LocalNode`, with a master. One rospy process may hold many of them, one per
namespace."""

import time
from collections.abc import Callable, Sequence
from typing import Any
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy
from rospy.msg import serialize_message

from hric_control import names
from hric_control.errors import FailureError, HricError, ParameterError
from hric_control.listeners import DISPATCHER, NOTHING, Parcel
from hric_control.node import REQUIRED, GoalHandle, LiveParameter, LogThrottle, Namespaced, Undoable
from hric_control.publishing import OnError
from hric_control.robot_time import stamps
from hric_control.ros.action import RosActionServer
from hric_control.ros.live import RosLiveParameters
from hric_control.ros.prompt import prompt_connections, send_promptly

LAST = 0.5
"""Longest wait for listeners to take what was published before a topic is closed [s] (project default, unconfirmed)."""


class RosPublisher:
    """Sends on a rospy topic.

    Raises:
        HricError: the topic cannot be advertised.
    """

    def __init__(self, topic: str, message_type: type, queue_size: int, latch: bool) -> None:
        send_promptly()
        try:
            self._publisher = rospy.Publisher(topic, message_type, queue_size=queue_size or 1, latch=latch)
        except (ValueError, rospy.ROSException) as error:
            raise FailureError(f"topic {topic} cannot be advertised: {error}") from error
        self._what, self._type = f"topic {topic}", message_type

    def publish(self, message: Any) -> None:
        """Send; after the node was shut down nothing is sent.

        Raises:
            HricError: not of the topic's type, or a field holds what its type cannot.
        """
        self.publish_all((message,))

    def publish_all(self, messages: Sequence[Any]) -> None:
        """Send several in one write to each listener, which is woken once: a write costs more than what it carries.

        Raises:
            HricError: as `publish`, for the first that could not be sent; the others are sent.
        """
        errors: list[Exception] = []
        DISPATCHER.send((self.pack(messages, errors.append),))
        if errors:
            error = errors[0]
            raise error if isinstance(error, HricError) else HricError(f"{self._what}: {error}") from error

    def pack(self, messages: Sequence[Any], on_error: OnError) -> Parcel:
        """Do what rospy does to publish, up to the write; on_error: takes what is wrong with one of them."""
        publisher = self._publisher
        if publisher is None or rospy.is_shutdown():
            return NOTHING
        try:
            return self._pack(publisher.impl, messages, on_error)
        except (AttributeError, ValueError):  # rospy takes lock and buffer away while it closes the topic
            if not rospy.is_shutdown():
                raise
            return NOTHING

    def _pack(self, topic: Any, messages: Sequence[Any], on_error: OnError) -> Parcel:
        """Serialise; topic: rospy's implementation."""
        count = 0
        with topic.publock:
            for message in messages:
                begin = topic.buff.tell()
                try:
                    names.check_message(self._what, self._type, message)
                    if topic.connections:
                        serialize_message(topic.buff, topic.seq + 1, message)
                        topic.seq += 1
                        count += 1
                    if topic.is_latch:
                        topic.latch = message
                except Exception as error:  # whatever a field holds, the others go out
                    topic.buff.seek(begin)
                    topic.buff.truncate()
                    on_error(error)
            data = topic.buff.getvalue()
            topic.buff.seek(0)
            topic.buff.truncate()
            topic.message_data_sent += len(data)
            return Parcel(prompt_connections(topic), data, count)

    def subscribers(self) -> int:
        """Number of listeners."""
        publisher = self._publisher
        return 0 if publisher is None or publisher.impl is None else len(publisher.impl.connections)

    def unregister(self) -> None:
        """Send what waits, then stop advertising; a second call does nothing."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            DISPATCHER.flush(LAST)
            publisher.unregister()


class _Shared:
    """What a node and its children share."""

    def __init__(self) -> None:
        self.clock: Callable[[], float] | None = None


class RosNode(Namespaced):
    """Parameters, topics, services, actions and time through rospy. Construct it after `rospy.init_node`.

    Args:
        namespace: absolute, or relative to rospy's own namespace; "~" is the process's private one.
    """

    publishes_inline = False
    """Callbacks and the control loop have threads of their own."""

    def __init__(self, namespace: str = "") -> None:
        self._namespace = names.normalize(rospy.resolve_name(namespace) if namespace else rospy.get_namespace())
        self._shared = _Shared()

    @property
    def clock(self) -> Callable[[], float] | None:
        """Robot time [s] for `now`, or None for rospy's time; setting it sets it for the children as well."""
        return self._shared.clock

    @clock.setter
    def clock(self, clock: Callable[[], float] | None) -> None:
        self._shared.clock = clock

    def child(self, name: str) -> "RosNode":
        """The same connection, one namespace deeper."""
        node = object.__new__(RosNode)
        node._namespace, node._shared = names.resolve(self._namespace, name), self._shared
        return node

    def resolve(self, name: str) -> str:
        """Absolute name, remapped by the command line."""
        resolved: str = rospy.names.resolve_name(names.resolve(self._namespace, name))
        return resolved

    def has_param(self, name: str) -> bool:
        """Whether the parameter exists."""
        full = self.resolve(name)
        return bool(_query(lambda: rospy.has_param(full)))

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Value of a parameter.

        Raises:
            ParameterError: it does not exist and no default was given.
        """
        full = self.resolve(name)
        try:
            return _query(lambda: rospy.get_param(full))
        except KeyError:
            if default is REQUIRED:
                raise ParameterError(f"parameter {full} is not set") from None
            return default

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""
        full = self.resolve(name)
        _query(lambda: rospy.set_param(full, value))

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> RosPublisher:
        """Advertise a topic. No listener is waited for: what it does not take waits for it alone, bounded in bytes
        (`listeners.LIMIT`), whatever `queue_size` says."""
        return RosPublisher(self.resolve(topic), message_type, queue_size, latch)

    def subscribe(
        self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10
    ) -> Undoable:
        """Call `callback` for each message, in rospy's thread. HricErrors it raises are logged, at most one a
        second."""
        full = self.resolve(topic)
        refused = LogThrottle(self.log_error, time.monotonic)

        def deliver(message: Any) -> None:
            if not registration.open:
                return
            try:
                callback(message)
            except HricError as error:
                refused(f"{full}: {error}")

        def undo() -> None:
            subscriber.unregister()
            refused.finish()

        registration = Undoable(undo)
        subscriber = rospy.Subscriber(full, message_type, deliver, queue_size=queue_size or None, tcp_nodelay=True)
        return registration

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> Undoable:
        """Serve. A HricError of the handler becomes the service's error text."""
        full = self.resolve(name)
        response_type: type = service_type._response_class  # type: ignore[attr-defined]  # generated

        def handle(request: Any) -> Any:
            try:
                response = handler(request)
                names.check_message(f"response of service {full}", response_type, response)
            except HricError as error:
                raise rospy.ServiceException(str(error)) from error
            return response

        try:
            service = rospy.Service(full, service_type, handle)
        except rospy.ServiceException as error:
            raise FailureError(f"service {full} cannot be offered: {error}") from error
        return Undoable(lambda: service.shutdown("unregistered"))

    def action_server(
        self,
        name: str,
        action_type: type,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
    ) -> Undoable:
        """Serve an action with actionlib's wire interface."""
        server = RosActionServer(self.resolve(name), action_type, on_goal, on_cancel, self.log_error)
        return Undoable(server.close)

    def live_parameters(
        self, parameters: Sequence[LiveParameter], on_change: Callable[[dict[str, Any]], dict[str, Any]]
    ) -> Undoable:
        """Offer live parameters through dynamic_reconfigure."""
        live = RosLiveParameters(self._namespace, parameters, on_change, self.log_error)
        return Undoable(live.close)

    def now(self) -> Any:
        """Stamp: robot time where `clock` was given, else rospy's time, which follows /clock when use_sim_time is
        set."""
        clock = self._shared.clock
        return rospy.Time.now() if clock is None else stamps.to_time(clock())

    def log_info(self, text: str) -> None:
        """Log for the user."""
        rospy.loginfo("%s: %s", self._namespace, text)

    def log_warn(self, text: str) -> None:
        """Log a warning."""
        rospy.logwarn("%s: %s", self._namespace, text)

    def log_error(self, text: str) -> None:
        """Log an error."""
        rospy.logerr("%s: %s", self._namespace, text)


def _query(request: Callable[[], Any]) -> Any:
    """Query the master; where it does not respond, the error names its address."""
    try:
        return request()
    except (TimeoutError, OSError, XmlRpcError) as error:
        raise FailureError(f"the ROS master at {rosgraph.get_master_uri()} does not respond: {error}") from error
