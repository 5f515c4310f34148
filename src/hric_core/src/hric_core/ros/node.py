"""Node on rospy, which needs a ROS master; its methods are those of `LocalNode`.

A process may have several such nodes, one per namespace."""

import time
from collections.abc import Callable, Sequence
from typing import Any
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy
from rospy.msg import serialize_message

from hric_core import names
from hric_core.errors import FailureError, HricError, ParameterError
from hric_core.listeners import DISPATCHER, NOTHING, Parcel
from hric_core.node import REQUIRED, GoalHandle, LiveParameter, LogThrottle, Namespaced, OnChange, Undoable
from hric_core.publishing import OnError
from hric_core.robot_time import stamps
from hric_core.ros.action import RosActionServer
from hric_core.ros.live import RosLiveParameters
from hric_core.ros.prompt import prompt_connections, send_promptly

LAST = 0.5
"""Longest wait, before a topic is closed, for its subscribers to read the published messages [s].

Project default, unconfirmed."""


class RosPublisher:
    """Publisher on a rospy topic.

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
        """Publish a message; after the shutdown of the node do nothing.

        Raises:
            HricError: the message is not of the topic's type, or a field has a value that its type does not allow.
        """
        self.publish_all((message,))

    def publish_all(self, messages: Sequence[Any]) -> None:
        """Publish several messages with one write per subscriber, which is faster, as each write wakes the subscriber.

        Raises:
            HricError: a message could not be sent, for a reason as in `publish`; the others were sent.
        """
        errors: list[Exception] = []
        DISPATCHER.send((self.pack(messages, errors.append),))
        if errors:
            error = errors[0]
            raise error if isinstance(error, HricError) else HricError(f"{self._what}: {error}") from error

    def pack(self, messages: Sequence[Any], on_error: OnError) -> Parcel:
        """Serialise messages as rospy does, without sending them; `on_error`: callback for the error of a message."""
        publisher = self._publisher
        if publisher is None or rospy.is_shutdown():
            return NOTHING
        try:
            return self._pack(publisher.impl, messages, on_error)
        except (AttributeError, ValueError):  # rospy deletes lock and buffer when it closes the topic
            if not rospy.is_shutdown():
                raise
            return NOTHING

    def _pack(self, topic: Any, messages: Sequence[Any], on_error: OnError) -> Parcel:
        """Serialise messages into the buffer of `topic`, rospy's implementation object of a topic."""
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
                except Exception as error:  # a bad field must not stop the other messages
                    topic.buff.seek(begin)
                    topic.buff.truncate()
                    on_error(error)
            data = topic.buff.getvalue()
            topic.buff.seek(0)
            topic.buff.truncate()
            topic.message_data_sent += len(data)
            return Parcel(prompt_connections(topic), data, count)

    def subscribers(self) -> int:
        """Return the number of connected subscribers."""
        publisher = self._publisher
        return 0 if publisher is None or publisher.impl is None else len(publisher.impl.connections)

    def unregister(self) -> None:
        """Send the queued messages, then stop advertising; a second call does nothing."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            DISPATCHER.flush(LAST)
            publisher.unregister()


class _Shared:
    """State shared by a RosNode and its children."""

    def __init__(self) -> None:
        self.clock: Callable[[], float] | None = None


class RosNode(Namespaced):
    """Node with parameters, topics, services, actions and time through rospy; created after `rospy.init_node`.

    Args:
        namespace: absolute, or relative to the process's namespace; "~" is the private namespace of the process.
    """

    publishes_inline = False
    """False: a RealtimePublisher on this node sends in a thread of its own, as callbacks and loop run in parallel."""

    def __init__(self, namespace: str = "") -> None:
        self._namespace = names.normalize(rospy.resolve_name(namespace) if namespace else rospy.get_namespace())
        self._shared = _Shared()

    @property
    def clock(self) -> Callable[[], float] | None:
        """Function that returns the robot time [s], used by `now`; None: rospy's time. Shared with the children."""
        return self._shared.clock

    @clock.setter
    def clock(self, clock: Callable[[], float] | None) -> None:
        self._shared.clock = clock

    def child(self, name: str) -> "RosNode":
        """Return a node for the child namespace `name`."""
        node = object.__new__(RosNode)
        node._namespace, node._shared = names.resolve(self._namespace, name), self._shared
        return node

    def resolve(self, name: str) -> str:
        """Return the absolute form of a name that is relative to this namespace, with the command line's remappings."""
        resolved: str = rospy.names.resolve_name(names.resolve(self._namespace, name))
        return resolved

    def has_param(self, name: str) -> bool:
        """Return True if the parameter exists."""
        full = self.resolve(name)
        return bool(_query(lambda: rospy.has_param(full)))

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of a parameter.

        Raises:
            ParameterError: the parameter does not exist and no default is given.
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
        """Advertise a topic. Publishing never waits for subscribers, whatever `queue_size` is.

        Data that a subscriber does not read is queued for this subscriber, up to `listeners.LIMIT` bytes."""
        return RosPublisher(self.resolve(topic), message_type, queue_size, latch)

    def subscribe(
        self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10
    ) -> Undoable:
        """Subscribe to a topic: `callback(message)` is called in rospy's thread.

        A HricError of the callback is logged, at most one per second."""
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
        """Offer a service; `handler(request)` returns the response. The text of its HricError is sent to the client."""
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
        """Offer an action with actionlib's topics."""
        server = RosActionServer(self.resolve(name), action_type, on_goal, on_cancel, self.log_error)
        return Undoable(server.close)

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: OnChange) -> Undoable:
        """Offer live parameters through dynamic_reconfigure."""
        return Undoable(RosLiveParameters(self._namespace, parameters, on_change, self.log_error).close)

    def now(self) -> Any:
        """Return the present time as a message stamp: robot time if `clock` is set, else `rospy.Time.now()`."""
        clock = self._shared.clock
        return rospy.Time.now() if clock is None else stamps.to_time(clock())

    def log_info(self, text: str) -> None:
        """Log a message for the user."""
        rospy.loginfo("%s: %s", self._namespace, text)

    def log_warn(self, text: str) -> None:
        """Log a warning."""
        rospy.logwarn("%s: %s", self._namespace, text)

    def log_error(self, text: str) -> None:
        """Log an error."""
        rospy.logerr("%s: %s", self._namespace, text)


def _query(request: Callable[[], Any]) -> Any:
    """Call a function that queries the ROS master; raise FailureError with its address if it does not respond."""
    try:
        return request()
    except (TimeoutError, OSError, XmlRpcError) as error:
        raise FailureError(f"the ROS master at {rosgraph.get_master_uri()} does not respond: {error}") from error
