"""Writes to many sockets in one call: what each write costs is waking its listener, and between two writes the
interpreter would have to be waited for."""

from collections.abc import Callable

from hric_control.native import load

send_all: Callable[[list[int], list[bytes]], list[int]] = load("hric_sending").send_all
"""(numbers of sockets, what to write to each): write all of it; 0 or the error's number for each. Waits for a listener
that takes nothing, at most a minute."""
