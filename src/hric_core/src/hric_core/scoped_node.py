"""Node that records what was created and read through it.

No topic or service of a controller outlives it, and no parameter that it never reads is accepted."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypeVar

from hric_core.node import REQUIRED, GoalHandle, LiveParameter, Node, OnChange, Publisher, Registration
from hric_core.parameters import refuse_unknown

MadeT = TypeVar("MadeT", bound=Publisher | Registration)


class ScopedNode:
    """Wrapper of `node` that records registrations and parameters.

    `close` ends what was advertised, subscribed and served through it and its children; `refuse_unread` refuses
    parameters that were never read through it or them."""

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
        """Unregister everything, the newest first."""
        while self._made:
            self._made.pop().unregister()

    def keep(self, made: MadeT) -> MadeT:
        """Register `made` for `unregister()` at the end; return it."""
        self._made.append(made)
        return made

    def child(self, name: str) -> "ScopedNode":
        """Return a node one namespace deeper with the same scope."""
        return ScopedNode(self._node.child(name), self._made, self._read)

    def also(self, node: Node) -> "ScopedNode":
        """Return another node with the same scope."""
        return ScopedNode(node, self._made, self._read)

    def refuse_unread(self, known: Collection[str] = ()) -> None:
        """Refuse parameters in this namespace that were set, but neither read, looked for nor set through the scope.

        Args:
            known: names that others read.

        Raises:
            ParameterError: lists each, with the names that were looked for.
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
