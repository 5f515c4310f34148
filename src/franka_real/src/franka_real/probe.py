"""Checks that an arm responds at an address before libfranka connects, which waits a minute with the interpreter's lock
held."""

import socket
import threading
import time

from franka_real.backend import ConnectionLostError

PORT = 1337
"""TCP port of the control interface; fixed in libfranka."""
RETRY = 0.1
"""Between two tries of an arm that refuses the connection [s]."""


class RefusedError(ConnectionLostError):
    """The machine is there, the control interface is not, or not yet."""


def wait(address: str, timeout: float, patience: float, port: int = PORT) -> None:
    """As `check`, but an arm that refuses the connection is tried again.

    Args:
        address, timeout, port: as of `check`.
        patience: for how long [s of wall time]; 0: not at all.

    Raises:
        ConnectionLostError: as `check`.
    """
    deadline = time.monotonic() + patience
    while True:
        try:
            return check(address, timeout, port)
        except RefusedError:
            if time.monotonic() >= deadline:
                raise
        time.sleep(RETRY)


def check(address: str, timeout: float, port: int = PORT) -> None:
    """Connect once and close again.

    Args:
        address: host name or IP of the arm's control box.
        timeout: how long name and connection together may take [s of wall time].

    Raises:
        ConnectionLostError: nobody is there; the message says what to look at.
    """
    outcome: list[OSError | None] = []

    def connect() -> None:
        try:
            socket.create_connection((address, port), timeout).close()
            outcome.append(None)
        except OSError as error:
            outcome.append(error)

    # A thread, since looking up a name has no time-out.
    thread = threading.Thread(target=connect, name="probe", daemon=True)
    thread.start()
    thread.join(timeout + 0.1)
    failure = outcome[0] if outcome else TimeoutError()
    if failure is not None:
        kind = RefusedError if isinstance(failure, ConnectionRefusedError) else ConnectionLostError
        raise kind(f"no Franka arm at {address}: {_reason(failure, address, port, timeout)}")


def _reason(error: OSError, address: str, port: int, timeout: float) -> str:
    if isinstance(error, socket.gaierror):
        return f"{address!r} is neither an IP address nor a host name that this machine knows"
    if isinstance(error, TimeoutError):
        return (
            f"no response within {timeout:g} s. Is robot_ip right, the control box on, and this machine on its network?"
        )
    if isinstance(error, ConnectionRefusedError):
        return (
            f"the machine there refuses TCP port {port}. Is the FCI activated in Desk? (Emulated: rosrun "
            f"franka_sim control_box --ip {address})"
        )
    return f"{error.strerror or error}"
