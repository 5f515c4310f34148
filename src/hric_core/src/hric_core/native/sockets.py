"""Socket functions in C: writing to many sockets in one call, and restricting libraries to loopback.

Each write wakes its listener, which takes time. One call from Python per write would have to wait for the interpreter
lock in between; one call for all writes does not.
"""

from collections.abc import Callable, Sequence

from hric_core.native import load

send_now: Callable[[list[int], Sequence[bytes | memoryview]], list[int]] = load("hric_sending").send_now
"""Function (file descriptors, data for each) that writes as much to each socket as it accepts without waiting.

It returns for each socket the number of bytes written, or -errno."""
confine: Callable[[str], int] = load("hric_loopback").confine
"""Function (part of a loaded library's path) that binds this library's sockets to loopback, not to all interfaces.

It covers IPv4 and IPv6. It returns the number of replaced calls of bind(); 0: none was found, nothing changed."""
