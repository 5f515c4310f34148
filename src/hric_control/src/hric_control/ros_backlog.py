"""How many listeners may connect to a rospy node at the same moment."""

from __future__ import annotations

from rospy.impl import tcpros_base

BACKLOG = 128
"""Connections that may wait to be accepted; our choice, above the number of topics of any node here."""


def widen() -> None:
    """Let many listeners connect at once. After `rospy.init_node`.

    rospy lets 5 connections wait. A recorder connects to all topics of a node within a millisecond: the kernel turns away what is beyond that and
    tries again a second later. Until then the recorder hears nothing of these topics.
    """
    tcpros_base.start_tcpros_server()
    tcpros_base._tcpros_server.tcp_ros_server.server_sock.listen(BACKLOG)
