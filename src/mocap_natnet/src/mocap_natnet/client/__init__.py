"""NatNet client: a session without sockets, and the client on UDP around it."""

from mocap_natnet.client.client import Health, NatNetClient
from mocap_natnet.client.received import Received
from mocap_natnet.client.session import Session
from mocap_natnet.client.settings import Settings

__all__ = ["Health", "NatNetClient", "Received", "Session", "Settings"]
