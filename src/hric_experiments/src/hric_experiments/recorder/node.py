"""Recorder node: records into run folders, splits bags, monitors the disk space, closes open bags at shutdown."""

import contextlib
import queue
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any, Unpack

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger, TriggerResponse

from hric_bags import files
from hric_bags.files import MEGABYTE
from hric_bags.run_file import RunFile, RunNotes
from hric_bags.run_folder import COMPLETED, FAILED, INTERRUPTED, RunFolder, runs_root
from hric_core.errors import FailureError, HricError
from hric_core.processes import uninterrupted
from hric_core.ros import RosNode
from hric_experiments.live import node as live_node
from hric_experiments.live import topics as live_topics
from hric_experiments.recorder import process as recorder_process
from hric_experiments.recorder.process import RecorderProcess, RecordError
from hric_experiments.recorder.recording import BagWriting, check_space, free_space
from hric_experiments.recorder.settings import NOW, ON_TRIGGER, RecorderSettings
from hric_run import provenance
from hric_run.definition import experiment as experiments
from hric_run.definition import overrides

RECORDING_TOPIC, TRIGGER_TOPIC = "hric/experiment/recording", "hric/experiment/trigger"
START_SERVICE, STOP_SERVICE, SPLIT_SERVICE = (
    f"hric/experiment/{what}_recording" for what in ("start", "stop", "split")
)
FAILURE_PARAM = "hric/experiment/failure"
"""Parameter in which scripts/bringup reports the node whose exit ended the run, and how it exited."""
SHUTDOWN_TIMEOUT = 100.0
"""Maximum time to close the bag after Ctrl-C [s]; scripts/bringup waits this long for the node."""
OPEN_TIMEOUT = 20.0
"""Maximum time for bag_recorder to open its bag, and to subscribe to the required topics [s]."""
RETRY = 30.0
"""Time after a failed split until the next attempt [s]."""
FREE_RUN = "bringup"
"""Name of the run folders of recordings without experiment."""


class BagRecorder:
    """Recorder of a live system: recordings start with the node, by trigger or service, and end by service or shutdown.

    Services and triggers only enqueue requests; the thread that calls `work` executes them, as child processes end with
    the thread that started them. Parameters are read from the node's private namespace.
    """

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[tuple[Callable[[], str], Future[str]]] = queue.SimpleQueue()
        self._settings = settings = RecorderSettings.read(RosNode("~"))
        self._overrides = overrides.separate(settings.overrides)
        self._definition = experiments.load(settings.experiment or experiments.NONE, self._overrides)
        self._free = self._definition.name == experiments.NONE
        self._root = runs_root(settings.runs or None)
        if rospy.has_param(FAILURE_PARAM):
            rospy.delete_param(FAILURE_PARAM)  # left by an earlier bring-up on the same master
        self._topics = [rospy.resolve_name(topic) for topic in settings.topics]
        self._node_name = live_topics.recorder_node(rospy.get_name().rpartition("/")[2])
        self._recording: BagWriting | None = None
        self._last: Path | None = None
        self._trouble, self._next_split = "", 0.0
        self._diagnostics = RecorderDiagnostics()
        self._publisher = rospy.Publisher(RECORDING_TOPIC, String, queue_size=1, latch=True)
        services = {
            START_SERVICE: self._on_start,
            STOP_SERVICE: lambda: str(self.stop(COMPLETED)),
            SPLIT_SERVICE: self._on_split,
        }
        self._services = [rospy.Service(name, Trigger, partial(self._serve, work)) for name, work in services.items()]
        self._subscriber = rospy.Subscriber(TRIGGER_TOPIC, Empty, self._on_trigger, queue_size=1)

    def begin(self) -> Path:
        """Start a recording in a new run folder, and publish the folder on `hric/experiment/recording`.

        Waits until bag_recorder has subscribed to the selected topics or, by default, to the control log.

        Returns:
            The run folder.

        Raises:
            HricError: a recording is already running, the disk is full, or bag_recorder does not start.
        """
        if self._recording is not None:
            raise RecordError(
                f"a recording into {self._recording.folder.path} is already running; valid: {STOP_SERVICE}, "
                f"{SPLIT_SERVICE}"
            )
        check_space(self._root, self._settings.min_free)
        name = FREE_RUN if self._free else self._definition.name
        tree, urdf, entries = self._parameters()
        with uninterrupted():  # each run folder has a recording, which the shutdown ends
            folder = RunFolder.create(self._root, name)
            head = provenance.head(folder, self._definition, self._overrides, tree, entries)
            folder.write({**head, "experiment": name})
            if urdf:
                files.write_text(folder.urdf_path, urdf)
            self._trouble, self._last = "", None
            recording = self._recording = BagWriting(folder, self._start, self._unconnected)
        try:
            recording.part.wait_open(OPEN_TIMEOUT, _shutting_down)
            folder.become_latest()
            self._wait_subscribed()
        except HricError as error:
            with contextlib.suppress(HricError):
                recording.stop()
            recording.fail(str(error))
            self._recording = None
            raise
        if not _shutting_down():
            self._publisher.publish(String(str(folder.path)))
            rospy.set_param("~folder", str(folder.path))
            rospy.loginfo("recording into %s", folder.path)
        return folder.path

    def _parameters(self) -> tuple[dict[str, Any], str, RunFile]:
        """Return all parameters, the robot description ("" if there is none) and the first entries of run.yaml."""
        namespace = rospy.get_namespace()
        tree = rospy.get_param(namespace.rstrip("/") or "/", {}) or {}
        # Robot description from the nearest parent namespace of this node; empty: there is none.
        urdf = str(rospy.get_param(rospy.search_param("robot_description") or "robot_description", ""))
        entries: RunFile = {
            "mode": "live",
            "limits": provenance.joint_limits(urdf, RosNode(namespace)) if urdf else {},
        }
        if self._settings.subject:
            entries["subject"] = self._settings.subject
        if self._settings.notes:
            entries["notes"] = provenance.neutral(self._settings.notes)
        return tree, urdf, entries

    def _start(self, bag: Path, number: int) -> RecorderProcess:
        command = recorder_process.arguments(bag, self._topics, self._settings.exclude, self._listener(number))
        return RecorderProcess(bag, [recorder_process.find_recorder(), *command])

    def _listener(self, number: int) -> str:
        return f"{self._node_name}_{number}" if number else self._node_name

    def _unconnected(self, new: int, old: int) -> set[str]:
        return live_topics.unconnected(rospy.resolve_name(self._listener(new)), rospy.resolve_name(self._listener(old)))

    def _wait_subscribed(self) -> None:
        """Wait until bag_recorder has subscribed to the selected topics, by default to the robot's control log."""
        expected = set(self._topics) or {rospy.resolve_name("control_log")}
        deadline, name = time.monotonic() + OPEN_TIMEOUT, rospy.resolve_name(self._node_name)
        while not _shutting_down() and not live_topics.subscribed(name, expected):
            if time.monotonic() > deadline:
                raise FailureError(
                    f"the recorder did not subscribe to {', '.join(sorted(expected))} within {OPEN_TIMEOUT:g} s"
                )
            time.sleep(0.1)  # each look parses the state of the whole ROS graph

    def work(self) -> None:
        """Execute the requests to record until the shutdown of the node.

        Raises:
            HricError: the recording at the start of the node failed, or bag_recorder exited.
        """
        if self._settings.start == NOW:
            self.begin()
        else:
            rospy.loginfo(
                "armed: the recording begins with the trigger or service %s%s",
                f"{TRIGGER_TOPIC} or " * (self._settings.start == ON_TRIGGER),
                START_SERVICE,
            )
        while not rospy.is_shutdown():
            self._look_after()
            self._do_requests()

    def _do_requests(self) -> None:
        """Execute the next request of a service or trigger; wait up to 50 ms for a request."""
        try:
            work, result = self._requests.get(timeout=0.05)
        except queue.Empty:
            live_node.sleep(0.0)
            return
        try:
            result.set_result(work())
        except HricError as error:
            rospy.logerr("%s", error)
            result.set_exception(error)

    def _look_after(self) -> None:
        recording = self._recording
        if recording is None:
            idle = "armed" if self._settings.start == ON_TRIGGER else "not recording"
            self._diagnostics.report(ERROR if self._trouble else OK, self._trouble or idle, {})
            return
        free = free_space(recording.folder.path)
        if not recording.part.running:
            self._recording = None
            full = f"; {free:.0f} MB are free" if free < self._settings.min_free else ""
            recording.fail(recording.part.exit_text + full)
            where = f"the recording failed; see {recording.folder.path}, and check the bag with hric health"
            raise FailureError(f"{recording.part.exit_text}{full}; {where}")
        if free < self._settings.min_free:
            self._end_for_space(free)
            return
        if self._split_is_due(recording):
            self._split_by_itself(recording)
        values = {
            "folder": str(recording.folder.path),
            "part": str(recording.parts - 1),
            "part size [MB]": f"{recording.part_size / MEGABYTE:.1f}",
            "free [MB]": f"{free:.0f}",
            "limit [MB]": f"{self._settings.min_free:.0f}",
        }
        self._diagnostics.report(WARN if self._trouble else OK, self._trouble or "recording", values)

    def _end_for_space(self, free: float) -> None:
        trouble = (
            f"the recording was ended: {free:.0f} MB are free on the disk, less than the limit min_free of "
            f"{self._settings.min_free:.0f} MB"
        )
        bag = self.stop(INTERRUPTED, reason=trouble)
        self._trouble = f"{trouble}; the bag is complete: {bag}"
        rospy.logerr("%s", self._trouble)
        self._diagnostics.report(ERROR, self._trouble, {}, now=True)

    def _split_is_due(self, recording: BagWriting) -> bool:
        size, duration = self._settings.split_size, self._settings.split_duration
        due = (0.0 < duration <= recording.part_age) or (0.0 < size * MEGABYTE <= recording.part_size)
        return due and time.monotonic() >= self._next_split

    def _split_by_itself(self, recording: BagWriting) -> None:
        try:
            rospy.loginfo("split the bag; closed the part %s", recording.split(give_up=_shutting_down))
            self._trouble = ""
        except RecordError as error:
            self._trouble, self._next_split = str(error), time.monotonic() + RETRY
            rospy.logwarn("%s", error)

    def _request(self, work: Callable[[], str]) -> Future[str]:
        result: Future[str] = Future()
        self._requests.put((work, result))
        return result

    def _serve(self, work: Callable[[], str], _: Any) -> Any:
        result = self._request(work)
        while not _shutting_down():
            with contextlib.suppress(TimeoutError):
                error = result.exception(0.1)
                return TriggerResponse(success=error is None, message=str(error or result.result()))
        return TriggerResponse(success=False, message="the recorder is shutting down")

    def _on_start(self) -> str:
        return str(self.begin())

    def _on_split(self) -> str:
        if self._recording is None:
            raise RecordError(f"no recording is running that could be split; valid: {START_SERVICE}")
        path = self._recording.split(give_up=_shutting_down)
        rospy.loginfo("split the bag; closed the part %s", path)
        return str(path)

    def _on_trigger(self, _: Any) -> None:
        if self._settings.start != ON_TRIGGER:
            rospy.logwarn(
                "trigger ignored: the recorder is not armed (parameter start is %s, not %s)",
                self._settings.start,
                ON_TRIGGER,
            )
            return
        self._request(self._on_start)

    def stop(self, status: str, timeout: float = recorder_process.STOP_TIMEOUT, **notes: Unpack[RunNotes]) -> Path:
        """Close the bag and write the status to run.yaml; return the path of the bag or its first part.

        If the bag is already closed, only return its path.


        Args:
            status: status of the run.
            timeout: maximum time to close the bag [s].
            notes: further entries for run.yaml, such as the reason or the error.

        Raises:
            HricError: there was no recording, or the bag could not be closed.
        """
        recording = self._recording
        if recording is None:
            if self._last is None:
                raise RecordError(f"no recording is running; valid: {START_SERVICE}")
            return self._last
        with contextlib.suppress(
            rospy.ROSException
        ):  # the publisher is already closed if the master requested the shutdown
            self._publisher.publish(String(""))
        try:
            path = self._last = recording.stop(timeout)
        except HricError as error:
            self._recording = None
            if status != INTERRUPTED or recording.bag.exists() or recording.part.active.exists():
                recording.fail(f"{notes['error']}; {error}" if "error" in notes else str(error))
                raise
            recording.finish(status, reason="ended before the recording began")
            return recording.bag
        recording.finish(status, **notes)
        self._recording = (
            None  # reset last, so that after an interruption before this line `close` still closes the recording
        )
        rospy.loginfo("recorded %s%s", path, f" and {recording.parts - 1} more parts" if recording.parts > 1 else "")
        return path

    def close(self) -> None:
        """Close an open recording at shutdown; the run is then interrupted, or failed if the robot or a node failed."""
        if self._recording is None:
            return
        if failure := _failure():
            self.stop(FAILED, SHUTDOWN_TIMEOUT, error=failure)
        else:
            self.stop(COMPLETED if self._free else INTERRUPTED, SHUTDOWN_TIMEOUT)


def _failure() -> str:
    """Return the reason why the run failed; empty: robot, nodes and master are running or were shut down normally."""
    try:
        return next(filter(None, (str(rospy.get_param(name, "")) for name in _failure_params())), "")
    except (OSError, rosgraph.MasterException):
        return f"the ROS master at {rosgraph.get_master_uri()} does not respond"


def _failure_params() -> tuple[str, str]:
    """Return the names of the parameters that contain the robot's failure, and the node whose exit ended the run."""
    return f"{rospy.resolve_name('robot')}/failure", rospy.resolve_name(FAILURE_PARAM)


def _shutting_down() -> bool:
    return bool(rospy.is_shutdown()) or live_node.interrupted()


def run() -> None:
    """Record until the shutdown of the node; close the bag in any case."""
    recorder = BagRecorder()
    try:
        recorder.work()
    finally:
        recorder.close()


PERIOD = 1.0
"""Period of the diagnostics [s of wall time]."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class RecorderDiagnostics:
    """Publisher of the recorder's status on /diagnostics."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self._name = f"{rospy.get_name().strip('/')}: recording"
        self._due = 0.0

    def report(self, level: int, text: str, values: Mapping[str, str], now: bool = False) -> None:
        """Publish level, text and values, at most once per PERIOD unless `now` is set."""
        if not now and time.monotonic() < self._due:
            return
        self._due = time.monotonic() + PERIOD
        pairs = [KeyValue(key, value) for key, value in values.items()]
        message = DiagnosticArray(status=[DiagnosticStatus(level, self._name, text, "", pairs)])
        message.header.stamp = rospy.get_rostime()
        self._publisher.publish(message)
