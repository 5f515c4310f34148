"""Nodes, actions, live parameters, time and processes on rospy, with a ROS master; rospy is imported here only."""

from hric_core.ros.inbound import widen
from hric_core.ros.node import RosNode
from hric_core.ros.process import forward_to_ros, run, shut_down

__all__ = ["RosNode", "forward_to_ros", "run", "shut_down", "widen"]
