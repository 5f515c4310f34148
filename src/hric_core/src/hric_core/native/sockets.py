"""Sockets in C: writes to many of them in one call, and libraries that are kept on loopback.

What a write costs is waking its listener, and between two writes the interpreter would have to be waited for.
"""

from collections.abc import Callable, Sequence

from hric_core.native import load

send_now: Callable[[list[int], Sequence[bytes | memoryview]], list[int]] = load("hric_sending").send_now
"""(numbers of sockets, what to write to each): write what each takes at once; the number of bytes, or minus the error's
number, for each. Waits for nobody."""
confine: Callable[[str], int] = load("hric_loopback").confine
"""(part of the path of a loaded library): from now on its sockets are bound to loopback in place of all interfaces,
both of IPv4 and IPv6. Returns how many of its calls that concerns; 0: none was found, and nothing changed."""
