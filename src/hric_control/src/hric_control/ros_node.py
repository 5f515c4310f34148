"""A node on rospy: the same face as `LocalNode`, with a master. One rospy process may hold many of them, one per namespace."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any
from xmlrpc.client import Error as XmlRpcError

import genpy
import rosgraph
import rospy
from rospy.msg import serialize_message

from hric_control import names, ros_prompt, stamps
from hric_control.errors import HricError, ParameterError
from hric_control.node import REQUIRED, GoalHandle, LiveParameter
from hric_control.ros_action import RosActionServer
from hric_control.ros_live import RosLiveParameters


class RosPublisher:
    """Sends on a rospy topic."""

    def __init__(self, topic: str, message_type: type, queue_size: int, latch: bool) -> None:
        # rospy: None sends in the calling thread, a number queues for a thread of rospy's own. It takes None for an oversight and warns.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            self._publisher = rospy.Publisher(topic, message_type, queue_size=queue_size or None, latch=latch)
        self._what, self._type = f"topic {topic}", message_type

    def publish(self, message: Any) -> None:
        """Send; after the node was shut down nothing is sent.

        Raises:
            HricError: not of the topic's type, or a field holds what its type cannot.
        """
        if type(message) is not self._type:
            names.check_message(self._what, self._type, message)
        publisher = self._publisher
        if publisher is None or rospy.is_shutdown():
            return
        try:
            if not ros_prompt.publish(publisher.impl, message):
                publisher.publish(message)
        except rospy.ROSSerializationException as error:
            raise HricError(f"{self._what}: {error}") from error
        except rospy.ROSException:
            if not rospy.is_shutdown():  # otherwise rospy closed the topic between the test above and here
                raise

    def publish_all(self, messages: Sequence[Any]) -> None:
        """Send several in one write to each listener, which is woken once: a write costs more than what it carries.

        Raises:
            HricError: as `publish`, for the first that could not be sent; the others are sent.
        """
        if len(messages) < 2 or rospy.is_shutdown() or not self.subscribers():
            for message in messages:
                self.publish(message)
            return
        error, last, end, implementation = None, None, 0, self._publisher.impl
        with implementation.publock:  # to the end: a listener that connects would be sent what stands in the buffer
            for message in messages:
                begin = implementation.buff.tell()
                try:
                    names.check_message(self._what, self._type, message)
                    serialize_message(implementation.buff, implementation.seq + 1, message)
                except (HricError, rospy.ROSSerializationException, genpy.SerializationError) as failure:
                    implementation.buff.seek(begin)
                    implementation.buff.truncate()
                    error = error or HricError(f"{self._what}: {failure}")
                else:
                    implementation.seq += 1
                    last, end = message, begin
            if last is not None:
                # rospy sends whatever stands in its buffer when it publishes: all go along with the last of them, which it serialises itself.
                implementation.buff.seek(end)
                implementation.buff.truncate()
                implementation.seq -= 1
                self.publish(last)
        if error is not None:
            raise error

    def subscribers(self) -> int:
        """Number of listeners."""
        publisher = self._publisher
        return 0 if publisher is None or publisher.impl is None else len(publisher.impl.connections)

    def unregister(self) -> None:
        """Stop advertising; a second call does nothing."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.unregister()


class RosRegistration:
    """Takes something back, once."""

    def __init__(self, undo: Callable[[], Any]) -> None:
        self._undo: Callable[[], Any] | None = undo
        self.open = True

    def unregister(self) -> None:
        """Take it back; a second call does nothing."""
        self.open = False
        undo, self._undo = self._undo, None
        if undo is not None:
            undo()


class _Shared:
    """What a node and its children share."""

    def __init__(self) -> None:
        self.clock: Callable[[], float] | None = None


class RosNode:
    """Parameters, topics, services, actions and time through rospy. Construct it after `rospy.init_node`.

    Args:
        namespace: absolute, or relative to rospy's own namespace; "~" is the process's private one.
    """

    def __init__(self, namespace: str = "") -> None:
        self._namespace = names.normalize(rospy.resolve_name(namespace) if namespace else rospy.get_namespace())
        self._shared = _Shared()

    @property
    def namespace(self) -> str:
        """Absolute namespace."""
        return self._namespace

    @property
    def clock(self) -> Callable[[], float] | None:
        """Run time [s] for `now`, or None for rospy's time; setting it sets it for the children as well."""
        return self._shared.clock

    @clock.setter
    def clock(self, clock: Callable[[], float] | None) -> None:
        self._shared.clock = clock

    def child(self, name: str) -> RosNode:
        """The same connection, one namespace deeper."""
        node = object.__new__(RosNode)
        node._namespace, node._shared = names.resolve(self._namespace, name), self._shared
        return node

    def resolve(self, name: str) -> str:
        """Absolute name, remapped as the command line asks."""
        resolved: str = rospy.names.resolve_name(names.resolve(self._namespace, name))
        return resolved

    def has_param(self, name: str) -> bool:
        """Whether the parameter exists."""
        full = self.resolve(name)
        return bool(_ask(lambda: rospy.has_param(full)))

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Value of a parameter.

        Raises:
            ParameterError: it does not exist and no default was given.
        """
        full = self.resolve(name)
        try:
            return _ask(lambda: rospy.get_param(full))
        except KeyError:
            if default is REQUIRED:
                raise ParameterError(f"parameter {full} is not set") from None
            return default

    def search_param(self, name: str, default: Any = REQUIRED) -> Any:
        """Value of the parameter in this namespace or the nearest one above it."""
        # Not by the master's searchParam, which cannot begin at the root.
        for namespace in names.upwards(self._namespace):
            full = names.resolve(namespace, name)
            if _ask(functools.partial(rospy.has_param, full)):
                return self.param(full, default)
        if default is REQUIRED:
            raise ParameterError(f"parameter {name} is set neither in {self._namespace} nor above it")
        return default

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""
        full = self.resolve(name)
        _ask(lambda: rospy.set_param(full, value))

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> RosPublisher:
        """Advertise a topic. `queue_size=0` sends in the calling thread until the transport took the message."""
        return RosPublisher(self.resolve(topic), message_type, queue_size, latch)

    def subscribe(self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10) -> RosRegistration:
        """Call `callback` for each message, in rospy's thread. A HricError it raises becomes one line of log."""
        full = self.resolve(topic)

        def deliver(message: Any) -> None:
            if not registration.open:
                return
            try:
                callback(message)
            except HricError as error:
                self.log_error(f"{full}: {error}")

        registration = RosRegistration(lambda: subscriber.unregister())
        subscriber = rospy.Subscriber(full, message_type, deliver, queue_size=queue_size or None, tcp_nodelay=True)
        return registration

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> RosRegistration:
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
            raise HricError(f"service {full} cannot be offered: {error}") from error
        return RosRegistration(lambda: service.shutdown("unregistered"))

    def action_server(
        self, name: str, action_type: type, on_goal: Callable[[GoalHandle], None], on_cancel: Callable[[GoalHandle], None]
    ) -> RosRegistration:
        """Serve an action with actionlib's wire interface."""
        server = RosActionServer(self.resolve(name), action_type, on_goal, on_cancel, self.log_error)
        return RosRegistration(server.close)

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: Callable[[dict[str, Any]], dict[str, Any]]) -> RosRegistration:
        """Offer live parameters through dynamic_reconfigure."""
        live = RosLiveParameters(self._namespace, parameters, on_change, self.log_error)
        return RosRegistration(live.close)

    def now(self) -> Any:
        """Stamp: run time where `clock` was given, else rospy's time, which follows /clock when use_sim_time is set."""
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


def _ask(question: Callable[[], Any]) -> Any:
    """Ask the master; one that does not answer is told by its address."""
    try:
        return question()
    except (TimeoutError, OSError, XmlRpcError) as error:
        raise HricError(f"the ROS master at {rosgraph.get_master_uri()} does not answer: {error}") from error
