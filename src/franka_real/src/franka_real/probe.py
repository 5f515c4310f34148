"""Check whether an arm responds at all, before libfranka connects.

libfranka would wait a minute for a missing arm, and block all Python threads meanwhile.
"""

import socket
import threading
import time

from franka_real.backend import ArmLostError

PORT = 1337
"""TCP port of the control interface; fixed in libfranka."""
RETRY = 0.1
"""Time between two attempts while an arm refuses the connection [s]."""


class RefusedError(ArmLostError):
    """Error of a machine that responds but refuses the connection: its control interface is not running, or not yet."""


def wait(address: str, timeout: float, patience: float, port: int = PORT) -> None:
    """Check whether an arm responds, and retry while it refuses the connection.

    Args:
        address: host name or IP of the arm's control box.
        timeout: maximum time for name resolution and connection in one attempt [s of wall time].
        patience: maximum time for retries [s of wall time]; 0: no retries.
        port: TCP port.

    Raises:
        ArmLostError: no arm responds; the message says what to check.
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
    """Check whether an arm responds: connect once and disconnect.

    Args:
        address: host name or IP of the arm's control box.
        timeout: maximum time for name resolution and connection [s of wall time].
        port: TCP port.

    Raises:
        ArmLostError: no arm responds; the message says what to check.
    """
    outcome: list[OSError | None] = []

    def connect() -> None:
        try:
            socket.create_connection((address, port), timeout).close()
            outcome.append(None)
        except OSError as error:
            outcome.append(error)

    # A thread, since name resolution has no time-out.
    thread = threading.Thread(target=connect, name="probe", daemon=True)
    thread.start()
    thread.join(timeout + 0.1)
    failure = outcome[0] if outcome else TimeoutError()
    if failure is not None:
        kind = RefusedError if isinstance(failure, ConnectionRefusedError) else ArmLostError
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
            f"the machine there refuses TCP port {port}. Is the FCI activated in Desk? (For an emulated arm, start: "
            f"hric control_box --ip {address})"
        )
    return f"{error.strerror or error}"
