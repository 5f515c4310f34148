"""Keep a library on loopback that listens on all interfaces and has no option for it."""

from collections.abc import Callable

from hric_control.native import load

confine: Callable[[str], int] = load("hric_loopback").confine
"""(part of the path of a loaded library): from now on its sockets are bound to loopback in place of all interfaces,
both of IPv4 and IPv6. Returns how many of its calls that concerns; 0: none was found, and nothing changed."""
