"""Checks in the ROS graph if a recorder has subscribed to all topics, before a motion or a split of the bag."""

import http.client
import re
import xmlrpc.client
from collections.abc import Iterable
from typing import Any

import rosgraph
import rospy

NODE_TIMEOUT = 1.0
"""Maximum wait for the response of a node with its list of connections [s]."""


def subscribed(node: str, topics: set[str]) -> bool:
    """Return True if the master lists `node` as a subscriber of each topic."""
    return topics <= _topics_of(node, subscribers=True)


def unrecorded(recorder: str, robot: str) -> set[str]:
    """Return the topics of a robot or sensor node to which the recorder has not subscribed yet.

    The recorder looks for new topics twice a second.

    Args:
        recorder: absolute name of the recorder node.
        robot: absolute name of the publishing node.
    """
    chosen = {rospy.resolve_name(str(topic)) for topic in rospy.get_param(f"{recorder}/topics", [])}
    excluded = str(rospy.get_param(f"{recorder}/exclude", ""))
    published = _topics_of(robot, subscribers=False)
    # As in the recorder, the regular expression must match the complete name.
    published = (
        published & chosen
        if chosen
        else {topic for topic in published if not (excluded and re.fullmatch(excluded, topic))}
    )
    return published - {topic for topic, listener in _connections(robot) if listener == recorder_node(recorder)}


def unconnected(new: str, old: str) -> set[str]:
    """Return the topics that are sent to the subscriber `old`, but not yet to the subscriber `new`.

    This is determined from the publishers' lists of connections: a publisher sends to all subscribers in its list.
    """
    publishers = rosgraph.Master(rospy.get_name()).getSystemState()[0]
    missing: set[str] = set()
    for node in {node for _, nodes in publishers for node in nodes} - {old, new}:
        connections = _connections(node)
        missing |= {topic for topic, listener in connections if listener == old and (topic, new) not in connections}
    return missing


def recorder_node(recorder: str) -> str:
    """Return the name of the node that writes the bag of a recorder node."""
    return f"{recorder}_bag"


def _topics_of(node: str, subscribers: bool) -> set[str]:
    state = rosgraph.Master(rospy.get_name()).getSystemState()
    return {topic for topic, nodes in state[1 if subscribers else 0] if node in nodes}


def _connections(node: str) -> set[tuple[str, str]]:
    """Return (topic, subscriber) of each connection of a publishing node; empty: the node does not respond.

    The request goes to the node itself, because the master knows only requested connections.
    """
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
