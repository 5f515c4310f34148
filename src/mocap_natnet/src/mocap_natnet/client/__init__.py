"""NatNet client: a session without sockets, and the client on UDP around it."""

from mocap_natnet.client.client import ClientHealth, NatNetClient
from mocap_natnet.client.received import Received
from mocap_natnet.client.session import Session
from mocap_natnet.client.settings import ClientSettings

__all__ = ["ClientHealth", "ClientSettings", "NatNetClient", "Received", "Session"]
