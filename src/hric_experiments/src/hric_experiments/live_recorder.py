"""The recorder node: makes the run folder, runs `rosbag record`, closes the bag on request and at shutdown."""

from __future__ import annotations

import re
import threading
import time
import xmlrpc.client
from pathlib import Path
from typing import Any, cast

import rosgraph
import rospy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from hric_control.errors import HricError
from hric_control.ros_node import RosNode
from hric_experiments import experiment as experiments
from hric_experiments import files, limits, live_node, overrides, provenance, rosbag_process
from hric_experiments.rosbag_process import RosbagProcess
from hric_experiments.run_folder import COMPLETED, INTERRUPTED, RUNNING, RunFolder, iso_now, runs_root

RECORDING_TOPIC = "hric/experiment/recording"
STOP_SERVICE = "hric/experiment/stop_recording"
SHUTDOWN_TIMEOUT = 1.8
"""A node must end within 2 s of Ctrl-C; the bag is closed by then [s]."""
FREE_RUN = "bringup"
"""Name of a run that is no experiment."""


class Recorder:
    """One recording, from the start of the node to the stop service or the shutdown.

    Parameters are read from the node's private namespace: experiment, overrides, topics, exclude, runs.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stopped = False
        self._overrides = overrides.separate(str(rospy.get_param("~overrides", "")))
        definition = experiments.load(str(rospy.get_param("~experiment", "") or experiments.NONE), self._overrides)
        self._free = definition.name == experiments.NONE
        name = FREE_RUN if self._free else definition.name
        self.folder = RunFolder.create(runs_root(rospy.get_param("~runs", "") or None), name)
        self.folder.write(self._run(definition, name))
        if urdf := _description():
            files.write_text(self.folder.urdf_path, urdf)
        self._topics = [rospy.resolve_name(str(topic)) for topic in rospy.get_param("~topics", [])]
        self._node_name = rosbag_node(rospy.get_name().rpartition("/")[2])
        self._process = self._start()
        self._publisher = rospy.Publisher(RECORDING_TOPIC, String, queue_size=1, latch=True)
        self._service = rospy.Service(STOP_SERVICE, Trigger, self._on_stop)

    def _run(self, definition: experiments.Experiment, name: str) -> dict[str, Any]:
        return {
            "experiment": name,
            "description": definition.description,
            "status": RUNNING,
            "mode": "live",
            "started": iso_now(),
            "finished": None,
            "arguments": provenance.neutral(self._overrides),
            "bag": self.folder.bag_path.name,
            "definition": provenance.neutral(experiments.to_dict(definition)),
            "parameters": provenance.parameters(rospy.get_param(rospy.get_namespace().rstrip("/") or "/", {}) or {}),
            "limits": self._limits(),
            "versions": provenance.versions(),
            "revision": provenance.revision(),
            "platform": provenance.platform_info(),
        }

    @staticmethod
    def _limits() -> dict[str, dict[str, float]]:
        description = _description()
        return limits.table(description, RosNode(rospy.get_namespace())) if description else {}

    def _start(self) -> RosbagProcess:
        command = rosbag_process.arguments(self.folder.bag_path, self._topics, str(rospy.get_param("~exclude", "")), self._node_name)
        return RosbagProcess(self.folder.bag_path, [rosbag_process.find_record(), *command])

    def announce(self, timeout: float = 20.0) -> None:
        """Wait until the bag is open and the recorder hears what is published now; then say so on `hric/experiment/recording`."""
        self._process.wait_open(timeout, rospy.is_shutdown)
        if rospy.is_shutdown():
            return
        deadline = time.monotonic() + timeout
        name = rospy.resolve_name(self._node_name)
        while not rospy.is_shutdown() and not subscribed(name, self._expected()):
            if time.monotonic() > deadline:
                raise HricError(f"rosbag record did not subscribe to {', '.join(sorted(self._expected()))} within {timeout:g} s")
            live_node.sleep(0.05)
        self._publisher.publish(String(str(self.folder.path)))
        rospy.loginfo("recording into %s", self.folder.path)

    def _expected(self) -> set[str]:
        """What must be heard before the recording counts as begun: the topics given, else the robot's control log."""
        return set(self._topics) or {rospy.resolve_name("control_log")}

    def watch(self) -> None:
        """Return when the node is told to end.

        Raises:
            HricError: rosbag record ended by itself.
        """
        while not rospy.is_shutdown():
            if not self._stopped and not self._process.running:
                raise HricError(f"rosbag record (pid {self._process.pid}) ended by itself; see {self.folder.path}")
            live_node.sleep(0.05)

    def _on_stop(self, _: Any) -> Any:
        try:
            return TriggerResponse(success=True, message=str(self.stop(COMPLETED)))
        except HricError as error:
            rospy.logerr("%s", error)
            return TriggerResponse(success=False, message=str(error))

    def stop(self, status: str, timeout: float = rosbag_process.STOP_TIMEOUT) -> Path:
        """Close the bag and note how the run ended; only the first call does anything.

        Raises:
            HricError: the bag could not be closed.
        """
        with self._lock:
            if not self._stopped:
                self._stopped = True
                path = self._process.stop(timeout)
                self.folder.update(status=status, finished=iso_now())
                rospy.loginfo("recorded %s", path)
            return self._process.bag

    def close(self) -> None:
        """At shutdown: an experiment that is still being recorded was interrupted."""
        self.stop(COMPLETED if self._free else INTERRUPTED, SHUTDOWN_TIMEOUT)


def _description() -> str:
    """URDF on the parameter server, nearest to this node; empty: there is none."""
    return str(rospy.get_param(rospy.search_param("robot_description") or "robot_description", ""))


def subscribed(node: str, topics: set[str]) -> bool:
    """Whether the master knows `node` as a subscriber of each topic."""
    return topics <= _topics_of(node, subscribers=True)


def unrecorded(recorder: str, robot: str) -> set[str]:
    """Topics of the robot node that are to be recorded and that rosbag record does not hear yet: it looks for new ones once a second.

    Args:
        recorder, robot: absolute names of the two nodes.
    """
    wanted = {rospy.resolve_name(str(topic)) for topic in rospy.get_param(f"{recorder}/topics", [])}
    excluded = str(rospy.get_param(f"{recorder}/exclude", ""))
    published = _topics_of(robot, subscribers=False)
    published = published & wanted if wanted else {topic for topic in published if not (excluded and re.search(excluded, topic))}
    return published - _connected(robot, rosbag_node(recorder))


def rosbag_node(recorder: str) -> str:
    """Name of the rosbag record node of a recorder node."""
    return f"{recorder}_rosbag"


def _topics_of(node: str, subscribers: bool) -> set[str]:
    state = rosgraph.Master(rospy.get_name()).getSystemState()
    return {topic for topic, nodes in state[1 if subscribers else 0] if node in nodes}


def _connected(publisher: str, subscriber: str) -> set[str]:
    """Topics on which one node has a connection to the other; the master alone knows only who wants one."""
    api = xmlrpc.client.ServerProxy(rosgraph.Master(rospy.get_name()).lookupNode(publisher))
    _, _, connections = cast(tuple[int, str, list[list[Any]]], api.getBusInfo(rospy.get_name()))
    return {topic for _, other, direction, _, topic, *_ in connections if direction == "o" and other == subscriber}


def run() -> None:
    """Record until the shutdown; the bag is closed whatever happens."""
    recorder = Recorder()
    try:
        recorder.announce()
        recorder.watch()
    finally:
        recorder.close()
