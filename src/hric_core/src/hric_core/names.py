"""ROS graph names: resolution in a namespace, and the check that a message has the type of its topic."""

from typing import Any

from hric_core.errors import HricError


def normalize(name: str) -> str:
    """Return the absolute name with single slashes and no slash at the end; the root is "/"."""
    return "/" + "/".join(part for part in name.split("/") if part)


def resolve(namespace: str, name: str) -> str:
    """Return the absolute name of `name`, which is relative to `namespace` unless it begins with "/".

    Raises:
        HricError: the name is empty or private ("~x"); a private name belongs to a process, not to a namespace.
    """
    if not name or name.startswith("~"):
        raise HricError(
            f"{name!r} is not a name that can be resolved in {namespace}: give a relative name or one beginning "
            "with '/'"
        )
    return normalize(name) if name.startswith("/") else normalize(f"{namespace}/{name}")


def upwards(namespace: str) -> list[str]:
    """Return the namespace and all namespaces above it, from the namespace itself to the root "/"."""
    parts = [part for part in namespace.split("/") if part]
    return [normalize("/".join(parts[:n])) for n in range(len(parts), -1, -1)]


def type_name(message_type: type) -> str:
    """Return the ROS name of a message, service or action class, e.g. "std_msgs/Float64"."""
    return str(getattr(message_type, "_type", message_type.__name__))


def check_message(what: str, expected: type, message: Any) -> None:
    """Refuse a message that is not of the expected class.

    Args:
        what: destination of the message, e.g. "topic /a/command".
        expected: class of the destination.
        message: message to check.

    Raises:
        HricError: the class is another one; the message names the destination and both types.
    """
    if type(message) is not expected:
        raise HricError(f"{what} has type {type_name(expected)}, not {type_name(type(message))}")
