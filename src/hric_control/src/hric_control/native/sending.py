"""Write to many sockets in one call: what each write costs is waking its listener, and between two writes the
interpreter would have to be waited for."""

from collections.abc import Callable, Sequence

from hric_control.native import load

send_now: Callable[[list[int], Sequence[bytes | memoryview]], list[int]] = load("hric_sending").send_now
"""(numbers of sockets, what to write to each): write what each takes at once; the number of bytes, or minus the error's
number, for each. Waits for nobody."""
