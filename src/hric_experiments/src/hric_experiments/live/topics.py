"""Subscriptions on the ROS graph: what a recorder must be connected to before a move begins, or before another recorder
follows it."""

import http.client
import re
import xmlrpc.client
from collections.abc import Iterable
from typing import Any

import rosgraph
import rospy

NODE_TIMEOUT = 1.0
"""Longest wait for the connections of a node [s]."""


def subscribed(node: str, topics: set[str]) -> bool:
    """Whether the master knows `node` as a subscriber of each topic."""
    return topics <= _topics_of(node, subscribers=True)


def unrecorded(recorder: str, robot: str) -> set[str]:
    """Topics of the robot node that are to be recorded and to which the recorder has not subscribed yet: it looks for
    new ones twice a second.

    Args:
        recorder, robot: absolute names of the two nodes.
    """
    chosen = {rospy.resolve_name(str(topic)) for topic in rospy.get_param(f"{recorder}/topics", [])}
    excluded = str(rospy.get_param(f"{recorder}/exclude", ""))
    published = _topics_of(robot, subscribers=False)
    # As the recorder takes the expression: it must fit the whole name.
    published = (
        published & chosen
        if chosen
        else {topic for topic in published if not (excluded and re.fullmatch(excluded, topic))}
    )
    return published - {topic for topic, listener in _connections(robot) if listener == recorder_node(recorder)}


def unconnected(new: str, old: str) -> set[str]:
    """Topics that some node sends to the listener `old` and not to the listener `new`.

    By the connections of the publishers: what one of them sends from now on reaches the listeners that it names.
    """
    publishers = rosgraph.Master(rospy.get_name()).getSystemState()[0]
    missing: set[str] = set()
    for node in {node for _, nodes in publishers for node in nodes} - {old, new}:
        connections = _connections(node)
        missing |= {topic for topic, listener in connections if listener == old and (topic, new) not in connections}
    return missing


def recorder_node(recorder: str) -> str:
    """Name of the node that writes the bag of a recorder node."""
    return f"{recorder}_bag"


def _topics_of(node: str, subscribers: bool) -> set[str]:
    state = rosgraph.Master(rospy.get_name()).getSystemState()
    return {topic for topic, nodes in state[1 if subscribers else 0] if node in nodes}


def _connections(node: str) -> set[tuple[str, str]]:
    """(topic, listener) of each connection that a publisher has; the master alone knows only who requests one. Empty:
    it does not respond."""
    try:
        address = rosgraph.Master(rospy.get_name()).lookupNode(node)
        response: Any = xmlrpc.client.ServerProxy(address, transport=_Transport()).getBusInfo(rospy.get_name())
    except (OSError, http.client.HTTPException, xmlrpc.client.Error, rosgraph.MasterException):
        return set()
    return set(_outgoing(response[2]))


def _outgoing(connections: Iterable[Any]) -> Iterable[tuple[str, str]]:
    for _, listener, direction, _, topic, *_ in connections:
        if direction == "o":
            yield topic, listener


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = NODE_TIMEOUT
        return connection
