"""Emulated human and motion capture in a run without ROS: in step with the robot, and without sockets."""

import math
from typing import Any

from franka_msgs.msg import FrankaState
from hric_core.local.node import LocalNode
from hric_perception.human import CapturedHuman
from hric_perception.human.truth import Truth
from hric_perception.simulated import follow_events, follow_joints
from hric_run.definition import parameters
from hric_run.definition.sections import STATE_TOPIC
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher


class HeadlessHuman:
    """Emulated human, emulated Motive and its client, with the real NatNet codec but without sockets.

    They advance with robot time; the program of the human begins at the first call of `advance`. For a human in the
    robot's plant, frames and ground truth are published as soon as the human's joint positions are known.

    Args:
        node: node of the robot's namespace, with the parameters of the motion capture nodes.
        seen: the emulated human and the emulated Motive that tracks them.
        announced: True to publish the start time of the human, by which sensors replay a recorded trial in step.

    Raises:
        HricError: a parameter is not possible in a run without a network.
    """

    def __init__(self, node: LocalNode, seen: CapturedHuman, announced: bool = False) -> None:
        self._hand, self._body, self._started = seen.hand, seen.body, seen.body is not None
        publisher = MocapPublisher(node, Publishing.read(node.child(parameters.MOCAP_CLIENT)), robot_time)
        self._mocap = HeadlessMocap(seen.motive, publisher)
        self._truth = Truth(node, seen.hand, node.param(f"{parameters.EMULATED_HUMAN}/base_frame"), announced)
        state_topic = node.param(f"{parameters.EMULATED_HUMAN}/state_topic", STATE_TOPIC)
        node.subscribe(state_topic, FrankaState, self._on_state)
        if self._body is not None:
            follow_joints(node, self._body.states.add)
            follow_events(node, self._on_event)

    def _on_event(self, time: float, kind: str) -> None:
        """Handle an event of the human in the robot's plant; `time`: robot time [s], `kind`: e.g. "started"."""
        assert self._body is not None
        self._body.happened(time, kind)
        if kind == "started":
            self._truth.started(time)

    def _on_state(self, message: Any) -> None:
        x, y, z = message.O_T_EE[12:15]
        self._hand.see(message.header.stamp.to_sec(), (x, y, z))

    def advance(self, time: float) -> None:
        """Advance human and motion capture to a robot time [s]."""
        if not self._started:
            self._started = True
            self._truth.started(self._hand.start(time))
        known = math.inf if self._body is None else self._body.states.known
        self._mocap.advance(time, known)
        if known >= 0.0:
            self._truth.advance(min(time, known))
