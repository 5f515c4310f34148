"""Node that records which topics and services were created and which parameters were read through it.

So all topics and services of a controller can be closed with it, and parameters that it never reads can be refused."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypeVar

from hric_core.node import REQUIRED, GoalHandle, LiveParameter, Node, OnChange, Publisher, Registration
from hric_core.parameters import refuse_unknown

MadeT = TypeVar("MadeT", bound=Publisher | Registration)


class ScopedNode:
    """Wrapper of a node that records registrations and parameters.

    `close` unregisters all topics, services and actions that were created through this node and its children;
    `refuse_unread` refuses parameters that were never read through them."""

    def __init__(
        self, node: Node, made: list[Publisher | Registration] | None = None, read: set[str] | None = None
    ) -> None:
        self._node = node
        self._made: list[Publisher | Registration] = [] if made is None else made
        self._read: set[str] = set() if read is None else read
        self.namespace, self.publishes_inline = node.namespace, node.publishes_inline
        self.resolve, self.beside, self.now = node.resolve, node.beside, node.now
        self.log_info, self.log_warn, self.log_error = node.log_info, node.log_warn, node.log_error

    def close(self) -> None:
        """Unregister everything that was created through this node, the newest first."""
        while self._made:
            self._made.pop().unregister()

    def keep(self, made: MadeT) -> MadeT:
        """Record a publisher or registration, so that `close` unregisters it; return it."""
        self._made.append(made)
        return made

    def child(self, name: str) -> "ScopedNode":
        """Return a node of the child namespace `name`; `close` and `refuse_unread` of this node cover its use, too."""
        return ScopedNode(self._node.child(name), self._made, self._read)

    def also(self, node: Node) -> "ScopedNode":
        """Return a wrapper of another node; `close` and `refuse_unread` of this one cover its use, too."""
        return ScopedNode(node, self._made, self._read)

    def refuse_unread(self, known: Collection[str] = ()) -> None:
        """Refuse parameters of this namespace that were never read, looked for or set through this node.

        Args:
            known: names of further parameters, which are read in another way.

        Raises:
            ParameterError: there are such parameters; the message lists them, and the names that were looked for.
        """
        parameters = self._node.param(self.namespace, {})
        if isinstance(parameters, Mapping) and self.namespace not in self._read:
            prefix = f"{self.namespace.rstrip('/')}/"
            read = {full[len(prefix) :] for full in self._read if full.startswith(prefix)}
            refuse_unknown(parameters, read.union(known), self.namespace)

    def has_param(self, name: str) -> bool:
        """Return True if the parameter exists."""
        self._read.add(self.resolve(name))
        return self._node.has_param(name)

    def param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of a parameter."""
        self._read.add(self.resolve(name))
        return self._node.param(name, default)

    def search_param(self, name: str, default: Any = REQUIRED) -> Any:
        """Return the value of the parameter in this namespace or the nearest one above it."""
        self._read.add(self.resolve(name))
        return self._node.search_param(name, default)

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""
        self._read.add(self.resolve(name))
        self._node.set_param(name, value)

    def advertise(self, topic: str, message_type: type, *, queue_size: int = 10, latch: bool = False) -> Publisher:
        """Advertise a topic."""
        return self.keep(self._node.advertise(topic, message_type, queue_size=queue_size, latch=latch))

    def subscribe(
        self, topic: str, message_type: type, callback: Callable[[Any], None], *, queue_size: int = 10
    ) -> Registration:
        """Subscribe to a topic."""
        return self.keep(self._node.subscribe(topic, message_type, callback, queue_size=queue_size))

    def service(self, name: str, service_type: type, handler: Callable[[Any], Any]) -> Registration:
        """Offer a service."""
        return self.keep(self._node.service(name, service_type, handler))

    def action_server(
        self,
        name: str,
        action_type: type,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
    ) -> Registration:
        """Offer an action."""
        return self.keep(self._node.action_server(name, action_type, on_goal, on_cancel))

    def live_parameters(self, parameters: Sequence[LiveParameter], on_change: OnChange) -> Registration:
        """Offer live parameters."""
        self._read.update(self.resolve(parameter.name) for parameter in parameters)
        return self.keep(self._node.live_parameters(parameters, on_change))
