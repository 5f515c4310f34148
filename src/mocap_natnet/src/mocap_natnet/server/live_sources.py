"""Bodies that follow something of the running system: a topic, or a link of the robot or the simulation."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Any

import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped

from gazebo_msgs.msg import LinkStates
from gazebo_msgs.srv import GetLinkState
from hric_control.ros_node import RosNode
from mocap_natnet.poses import Pose, normalized
from mocap_natnet.run_time import RunTime
from mocap_natnet.server.history import History
from mocap_natnet.server.sources import Source

LOOK = 0.02
"""Between two looks at a link [s of wall time]. The constants of this file are our choice."""
ASK = 0.1
"""Between two requests for a link that tf does not know [s of wall time]."""
STATES, SERVICE = "sim/link_states", "sim/get_link_state"


class LiveSources:
    """Makes sources that hear the running system.

    Args:
        node: private node.
        run_time: the time of the run.

    Attributes:
        run_of: time of the stream [s] -> time of the run [s], None while that is not known; of the server that asks the sources.
    """

    def __init__(self, node: RosNode, run_time: RunTime) -> None:
        self._node, self._run_time = node, run_time
        self.run_of: Callable[[float], float | None] = lambda stream: None
        self._ended = threading.Event()
        self._links: list[_Link] = []

    def close(self) -> None:
        """Look no more."""
        self._ended.set()

    def topic(self, name: str) -> Source:
        """Follows geometry_msgs/PoseStamped by its stamps; a stamp of 0 counts as the time of arrival."""
        history = History()

        def hear(message: Any) -> None:
            stamp = message.header.stamp.to_sec() or self._run_time.now()
            if stamp is not None:
                history.add(stamp, _pose(message.pose))

        self._node.subscribe(rospy.resolve_name(name), PoseStamped, hear, queue_size=0)
        return self._in_stream(history)

    def link(self, name: str, frame: str) -> Source:
        """Follows a link: by `sim/link_states` where somebody publishes it, by tf, or by asking `sim/get_link_state`.

        Args:
            name: of the link; `model::link` of another model of the simulation.
            frame: in which it is told.
        """
        if not self._links:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
            self._ask = rospy.ServiceProxy(rospy.resolve_name(SERVICE), GetLinkState)
            self._node.subscribe(rospy.resolve_name(STATES), LinkStates, self._on_states, queue_size=1)
            threading.Thread(target=self._look, name="links", daemon=True).start()
        link = _Link(name, frame)
        self._links.append(link)
        return self._in_stream(link.history)

    def _in_stream(self, history: History) -> Source:
        def source(stream: float) -> Pose | None:
            run = self.run_of(stream)
            return None if run is None else history(run)

        return source

    def _on_states(self, message: Any) -> None:
        now = self._run_time.now()
        for link in self._links:
            if now is not None and link.name in message.name:
                link.told = True
                link.history.add(now, _pose(message.pose[message.name.index(link.name)]))

    def _look(self) -> None:
        looks, every = 0, round(ASK / LOOK)
        while not self._ended.wait(LOOK) and not rospy.is_shutdown():
            looks += 1
            for link in self._links:
                if not link.told and not self._transformed(link) and looks % every == 0:
                    self._answered(link)

    def _transformed(self, link: _Link) -> bool:
        try:
            found = self._buffer.lookup_transform(link.frame, link.name, rospy.Time(0))
        except tf2_ros.TransformException:
            return False
        t, r = found.transform.translation, found.transform.rotation
        stamp = found.header.stamp.to_sec() or self._run_time.now()  # 0: it never moves
        if stamp is not None and stamp > link.history.last:
            link.history.add(stamp, Pose((t.x, t.y, t.z), normalized((r.x, r.y, r.z, r.w))))
        return True

    def _answered(self, link: _Link) -> None:
        with contextlib.suppress(rospy.ServiceException, rospy.ROSException):
            answer, now = self._ask(link.name, link.frame), self._run_time.now()
            if answer.success and now is not None and now > link.history.last:
                link.history.add(now, _pose(answer.link_state.pose))


class _Link:
    def __init__(self, name: str, frame: str) -> None:
        self.name, self.frame, self.history, self.told = name, frame, History(), False


def _pose(pose: Any) -> Pose:
    p, q = pose.position, pose.orientation
    return Pose((p.x, p.y, p.z), normalized((q.x, q.y, q.z, q.w)))
