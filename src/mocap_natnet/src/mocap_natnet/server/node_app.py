"""Node `emulated_motive`: the command `hric emulated_motive`, in robot time if a ROS master runs."""

import argparse
import contextlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped

from gazebo_msgs.msg import LinkStates
from gazebo_msgs.srv import GetLinkState
from hric_core.geometry import Pose, normalized
from hric_core.geometry.messages import pose_of
from hric_core.processes import run_server
from hric_core.robot_time.follower import RobotTime
from hric_core.robot_time.progress import ProgressReport
from hric_core.ros import RosNode, forward_to_ros, shut_down
from hric_core.ros.process import check_private, end_with_roslaunch
from mocap_natnet.server import app
from mocap_natnet.server.server import LOG
from mocap_natnet.server.sources import PoseHistory, Source

LOOK = 0.02
"""Time between two look-ups of a link's pose in tf [s of wall time].

The constants of this file are project defaults, unconfirmed.
"""
REQUEST_PERIOD = 0.1
"""Time between two service requests for the pose of a link that tf does not know [s of wall time]."""
STATES, SERVICE = "sim/link_states", "sim/get_link_state"
NAME = "emulated_motive"


class LiveSources:
    """Factory of motion sources that follow topics and links of the running system.

    Args:
        node: private node.
        robot_time: clock of robot time.

    Attributes:
        run_of: function from stream time [s] to robot time [s] of the server that calls the sources; it returns None
            while that is not known.
    """

    def __init__(self, node: RosNode, robot_time: RobotTime) -> None:
        self._node, self._robot_time = node, robot_time
        self.run_of: Callable[[float], float | None] = lambda stream: None
        self._ended = threading.Event()
        self._links: list[_Link] = []

    def close(self) -> None:
        """Stop following links."""
        self._ended.set()

    def topic(self, name: str) -> Source:
        """Return a source that follows a topic of geometry_msgs/PoseStamped; a stamp of 0 means the time of arrival."""
        history = PoseHistory()

        def add(message: Any) -> None:
            stamp = message.header.stamp.to_sec() or self._robot_time.now()
            if stamp is not None:
                history.add(stamp, pose_of(message.pose))

        self._node.subscribe(rospy.resolve_name(name), PoseStamped, add, queue_size=0)
        return self._in_stream(history)

    def link(self, name: str, frame: str) -> Source:
        """Return a source that follows a link: by `sim/link_states` if published, by tf, or by `sim/get_link_state`.

        Args:
            name: name of the link; `model::link` of another model of the simulation.
            frame: frame in which its poses are given.
        """
        if not self._links:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
            self._get_link_state = rospy.ServiceProxy(rospy.resolve_name(SERVICE), GetLinkState)
            self._node.subscribe(rospy.resolve_name(STATES), LinkStates, self._on_states, queue_size=1)
            threading.Thread(target=self._look, name="links", daemon=True).start()
        link = _Link(name, frame)
        self._links.append(link)
        return self._in_stream(link.history)

    def _in_stream(self, history: PoseHistory) -> Source:
        def source(stream: float) -> Pose | None:
            run = self.run_of(stream)
            return None if run is None else history(run)

        return source

    def _on_states(self, message: Any) -> None:
        now = self._robot_time.now()
        for link in self._links:
            if now is not None and link.name in message.name:
                link.published = True
                link.history.add(now, pose_of(message.pose[message.name.index(link.name)]))

    def _look(self) -> None:
        looks, interval = 0, round(REQUEST_PERIOD / LOOK)
        while not self._ended.wait(LOOK) and not rospy.is_shutdown():
            looks += 1
            for link in self._links:
                if not link.published and not self._transformed(link) and looks % interval == 0:
                    self._requested(link)

    def _transformed(self, link: "_Link") -> bool:
        try:
            transform = self._buffer.lookup_transform(link.frame, link.name, rospy.Time(0))
        except tf2_ros.TransformException:
            return False
        t, r = transform.transform.translation, transform.transform.rotation
        stamp = transform.header.stamp.to_sec() or self._robot_time.now()  # 0: a static transform
        if stamp is not None and stamp > link.history.last:
            link.history.add(stamp, Pose((t.x, t.y, t.z), normalized((r.x, r.y, r.z, r.w))))
        return True

    def _requested(self, link: "_Link") -> None:
        with contextlib.suppress(rospy.ServiceException, rospy.ROSException):
            response, now = self._get_link_state(link.name, link.frame), self._robot_time.now()
            if response.success and now is not None and now > link.history.last:
                link.history.add(now, pose_of(response.link_state.pose))


class _Link:
    def __init__(self, name: str, frame: str) -> None:
        self.name, self.frame, self.history, self.published = name, frame, PoseHistory(), False


class EmulatedMotiveNode(app.EmulatedMotiveCommand):
    """Emulate a Motive (OptiTrack) that streams by NatNet to any client, in robot time if a ROS master runs."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Serve until the node shuts down; without a ROS master, or with --clock wall, serve without ROS."""
        check_private(NAME)
        end_with_roslaunch()
        if arguments.clock == "wall" or not rosgraph.is_master_online():
            return super().run(arguments)
        return run_server(NAME, lambda: _serve(arguments), LOG.critical)


def _serve(arguments: argparse.Namespace) -> None:
    rospy.init_node(NAME, argv=sys.argv, disable_signals=True)
    forward_to_ros(logging.getLogger("hric"))
    node, serving = RosNode("~"), threading.Event()
    robot_time = RobotTime(node)
    live, progress = LiveSources(node, robot_time), ProgressReport(node)
    rospy.on_shutdown(lambda: os.kill(os.getpid(), signal.SIGTERM) if serving.is_set() else None)  # `rosnode kill`
    try:
        serving.set()
        app.serve(arguments, robot_time, robot_time.tick, live, progress.reached)
    finally:
        serving.clear()
        live.close()
        progress.close()
        robot_time.close()
        shut_down("shutdown requested")
