"""Choice of the ROS master for a bring-up: the master at ROS_MASTER_URI if it responds, else a new one."""

import http.client
import random
import socket
import xmlrpc.client
from urllib.parse import urlparse

LOCAL = ("localhost", "127.0.0.1", "::1")
DEFAULT = "http://localhost:11311"
CALLER = "/scripts_bringup"
TIMEOUT = 2.0
"""Timeout for a response of a master [s]."""


class MasterError(Exception):
    """Error of a ROS master that cannot be used; the message states the remedy."""


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host: tuple[str, dict[str, str]] | str) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = TIMEOUT
        return connection


def call(uri: str, method: str, *arguments: str | bool) -> tuple[int, str, object] | None:
    """Return the response (code, text, value) of an XML-RPC server of ROS; None if there is none at `uri`."""
    try:
        response = getattr(xmlrpc.client.ServerProxy(uri, transport=_Transport()), method)(CALLER, *arguments)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error, ValueError):
        return None
    return tuple(response) if isinstance(response, list | tuple) and len(response) == 3 else None


def is_local(uri: str) -> bool:
    """Return True if a master at this address would run on this machine."""
    host = urlparse(uri).hostname or ""
    return host in (*LOCAL, socket.gethostname())


def port_is_taken(port: int) -> bool:
    """Return True if a program on this machine listens on the port."""
    with socket.socket() as probe:
        probe.settimeout(TIMEOUT)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def free_port() -> int:
    """Return a free TCP port below the ephemeral ports (from 32768), which the system could give to other programs."""
    return next(port for port in random.sample(range(20_000, 32_000), 100) if not port_is_taken(port))


def node_is_alive(master: str, node: str) -> bool:
    """Return True if the master knows the node and the node itself responds (a killed one stays registered)."""
    reply = call(master, "lookupNode", node)
    return reply is not None and reply[0] == 1 and call(str(reply[2]), "getPid") is not None


def choose(uri: str, robot_node: str) -> tuple[str, bool]:
    """Return the address of the master to use, and True if this master is already running.

    Args:
        uri: ROS_MASTER_URI of the caller.
        robot_node: name of the robot node; if it is alive, another bring-up is running.

    Raises:
        MasterError: a remote master does not respond, or another bring-up is running on the master.
    """
    if call(uri, "getPid") is not None:
        if node_is_alive(uri, robot_node):
            other = f"ROS_MASTER_URI=http://localhost:{free_port()} scripts/bringup ..."
            raise MasterError(
                f"a bring-up is already running on the master {uri} (node {robot_node}). End it first, or use another "
                f"master:  {other}"
            )
        return uri, True
    if not is_local(uri):
        raise MasterError(
            f"no ROS master responds at ROS_MASTER_URI={uri}. Start a master there, or: unset ROS_MASTER_URI"
        )
    port = urlparse(uri).port or 11311
    if not port_is_taken(port):
        return uri, False
    return f"http://localhost:{free_port()}", False
