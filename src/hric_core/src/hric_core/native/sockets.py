"""Sockets in C: writes to many of them in one call, and confinement of libraries to loopback.

The cost of a write is waking its listener; between two writes from Python the interpreter would have to be waited for.
"""

from collections.abc import Callable, Sequence

from hric_core.native import load

send_now: Callable[[list[int], Sequence[bytes | memoryview]], list[int]] = load("hric_sending").send_now
"""Function (socket numbers, data for each) that writes what each socket takes at once, without waiting.

It returns the number of bytes, or minus the error's number, for each."""
confine: Callable[[str], int] = load("hric_loopback").confine
"""Function (part of a loaded library's path) that binds its sockets to loopback instead of all interfaces.

For both IPv4 and IPv6. It returns the number of calls replaced; 0: none was found, and nothing changed."""
