"""The kind of socket that client and server use."""

from __future__ import annotations

import socket


def datagram_socket() -> socket.socket:
    """A UDP socket without time-out.

    rospy sets a time-out of 60 s for all new sockets of its process (`socket.setdefaulttimeout`); with one, Python waits for a datagram even where
    MSG_DONTWAIT asks it not to.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.settimeout(None)
    return made
