"""Node without a ROS master: publishing and calling a service are function calls within the process.

A controller class runs on a `LocalNode` as on a `RosNode`."""

import itertools
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hric_core import names
from hric_core.errors import HricError, ParameterError, check_known
from hric_core.live import LiveValues
from hric_core.local.action import LocalActionServer, LocalGoal
from hric_core.local.core import LocalCore, LocalTopic, Tap
from hric_core.node import REQUIRED, GoalHandle, LiveParameter, LogThrottle, Namespaced, OnChange, Undoable
from hric_core.robot_time import stamps

_log = logging.getLogger("hric")


class LocalPublisher:
    """Publisher of a LocalNode: it calls the subscribers itself.

    Args:
        core: state shared by the nodes.
        topic: topic to publish on.
        latch: True if later subscribers get the last message.
        namespace: namespace of the node. It is the sender's name in messages (`publisher_of`), followed by a number if
            another publisher of the topic has this name already.
    """

    def __init__(self, core: LocalCore, topic: LocalTopic, latch: bool, namespace: str) -> None:
        self._core, self._topic, self._latch = core, topic, latch
        self._open = True
        names_left = (f"{namespace}#{k}" if k else namespace for k in itertools.count())
        name = next(name for name in names_left if name not in topic.publishers)
        topic.publishers.add(name)
        self._header = {"callerid": name}

    def publish(self, message: Any) -> None:
        """Call every tap and subscriber with the message.

        Raises:
            HricError: the message does not have the topic's type.
        """
        if self._open:
            self._core.publish(self._topic, message, self._latch, self._header)

    def subscribers(self) -> int:
        """Return the number of subscribers and taps, which get a copy of every message."""
        return len(self._topic.callbacks) + len(self._core.taps)

    def unregister(self) -> None:
        """Stop advertising; messages published afterwards are discarded."""
        if self._open:
            self._open = False
            self._topic.publishers.remove(self._header["callerid"])
            if self._latch:
                self._topic.latched = None


class LocalNode(Namespaced):
    """Node whose parameters, topics, services, actions and time exist in one process; single-threaded, deterministic.

    Args:
        params: nested dict below the root namespace; keys may have slashes.
        namespace: namespace of this node.
    """

    publishes_inline = True
    """True: a RealtimePublisher on this node builds and publishes within the call, so that runs are reproducible."""

    def __init__(self, params: Mapping[str, object] | None = None, namespace: str = "/") -> None:
        self._core = LocalCore(params)
        self._namespace = names.normalize(namespace)

    @property
    def clock(self) -> Callable[[], float]:
        """Function that returns the robot time [s]; shared with the node's parent and children, also when it is set."""
        return self._core.clock

    @clock.setter
    def clock(self, clock: Callable[[], float]) -> None:
        self._core.clock = clock

    @property
    def raises(self) -> bool:
        """True if a HricError of a subscriber is raised in the publisher instead of logged; shared like `clock`."""
        return self._core.raises

    @raises.setter
    def raises(self, value: bool) -> None:
        self._core.raises = value

    def child(self, name: str) -> "LocalNode":
        """Return a node for the child namespace `name`, with the same parameters, topics and clock."""
        node = object.__new__(LocalNode)
        node._core, node._namespace = self._core, self.resolve(name)
        return node

    def resolve(self, name: str) -> str:
        """Return the absolute form of a name that is relative to this node's namespace."""
        return names.resolve(self._namespace, name)

    def has_param(self, name: str) -> bool:
        """Return True if the parameter exists."""
        return self._core.params.has(self.resolve(name))

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return a copy of the value of a parameter.

        Raises:
            ParameterError: the parameter does not exist and no default is given.
        """
        try:
            return self._core.params.get(self.resolve(name))
        except KeyError:
            if default is REQUIRED:
                raise ParameterError(f"parameter {self.resolve(name)} is not set") from None
            return default

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""
        self._core.params.set(self.resolve(name), value)

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> LocalPublisher:
        """Advertise a topic; `queue_size` has no effect, as every message is delivered within publish()."""
        return LocalPublisher(self._core, self._core.topic(self.resolve(topic), message_type), latch, self._namespace)

    def subscribe(
        self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10
    ) -> Undoable:
        """Subscribe to a topic: `publish` of any node of the process calls `callback(message)`.

        A HricError of the callback is logged, as on RosNode, at most one per second of robot time, unless `raises` is
        True; any other error is raised in the publisher."""
        entry = self._core.topic(self.resolve(topic), message_type)
        refused = LogThrottle(self.log_error, lambda: self._core.clock())

        def deliver(message: Any) -> None:
            try:
                callback(message)
            except HricError as error:
                if self._core.raises:
                    raise
                refused(f"{entry.name}: {error}")

        entry.callbacks.append(deliver)
        if entry.latched is not None:
            deliver(entry.latched)

        def undo() -> None:
            entry.callbacks.remove(deliver)
            refused.finish()

        return Undoable(undo)

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> Undoable:
        """Offer a service; `call` calls its handler with the request."""
        full = self.resolve(name)
        if full in self._core.services:
            raise HricError(f"service {full} is offered already")
        self._core.services[full] = (service_type, handler)
        return Undoable(lambda: self._core.services.pop(full))

    def call(self, service: str, request: Any) -> Any:
        """Call a service and return its response.

        Raises:
            UnknownNameError: no such service.
            HricError: the type of request or response is wrong, or the handler raised this error.
        """
        full = self.resolve(service)
        check_known("service", [full], self._core.services)
        service_type: Any
        service_type, handler = self._core.services[full]
        names.check_message(f"service {full}", service_type._request_class, request)
        response = handler(request)
        names.check_message(f"response of service {full}", service_type._response_class, response)
        return response

    def action_server(
        self,
        name: str,
        action_type: type,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
    ) -> Undoable:
        """Offer an action; goals arrive by `send_goal`, or as messages on the action's goal topic."""
        full = self.resolve(name)
        if full in self._core.actions:
            raise HricError(f"action {full} is offered already")
        server = LocalActionServer(self, full, action_type, on_goal, on_cancel)
        self._core.actions[full] = server

        def undo() -> None:
            server.close()
            del self._core.actions[full]

        return Undoable(undo)

    def send_goal(self, action: str, goal: Any) -> LocalGoal:
        """Send a goal to an action server of this process.

        Raises:
            UnknownNameError: no such action.
            HricError: wrong goal type.
        """
        full = self.resolve(action)
        check_known("action", [full], self._core.actions)
        self._core.goals += 1
        return self._core.actions[full].send(goal, f"local-{self._core.goals}")

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: OnChange) -> Undoable:
        """Offer parameters that `set_live` can change while the program runs.

        Existing values in the parameter tree replace the defaults."""
        if self._namespace in self._core.live:
            raise HricError(f"{self._namespace} offers live parameters already")
        initial = {p.name: self.param(p.name) for p in parameters if self.has_param(p.name)}
        live = LiveValues(self._namespace, parameters, on_change, initial)
        self._core.live[self._namespace] = live
        for name, value in live.values.items():
            self.set_param(name, value)
        return Undoable(lambda: self._core.live.pop(self._namespace))

    def set_live(self, namespace: str, changes: Mapping[str, object]) -> dict[str, object]:
        """Change live parameters of a namespace and return all values that are then in force.

        Raises:
            UnknownNameError: the namespace has no live parameters, or none of this name.
            HricError: a value was refused; nothing was changed.
        """
        full = self.resolve(namespace)
        check_known("namespace with live parameters", [full], self._core.live)
        live = self._core.live[full]
        before, values = live.values, live.change(changes)
        for name, value in values.items():
            if name in changes or value != before[name]:
                self._core.params.set(f"{full}/{name}", value)
        return values

    def tap(self, callback: Tap) -> Undoable:
        """Call `callback(topic, message, robot_time)` for every message that this node, its parent or children publish.

        Robot time is in seconds."""
        self._core.taps.append(callback)
        return Undoable(lambda: self._core.taps.remove(callback))

    def topics(self) -> dict[str, str]:
        """Return the type name of every topic that is advertised or subscribed to, by absolute name."""
        used = (topic for topic in self._core.topics.values() if topic.publishers or topic.callbacks)
        return {topic.name: names.type_name(topic.type) for topic in used}

    def services(self) -> dict[str, str]:
        """Return the type name of every service, by absolute name."""
        return {name: names.type_name(kind) for name, (kind, _) in self._core.services.items()}

    def now(self) -> Any:
        """Return the present robot time as a message stamp (genpy.Time)."""
        return stamps.to_time(self._core.clock())

    def log_info(self, text: str) -> None:
        """Log a message to Python's logger "hric"."""
        _log.info("%s: %s", self._namespace, text)

    def log_warn(self, text: str) -> None:
        """Log a warning."""
        _log.warning("%s: %s", self._namespace, text)

    def log_error(self, text: str) -> None:
        """Log an error."""
        _log.error("%s: %s", self._namespace, text)
