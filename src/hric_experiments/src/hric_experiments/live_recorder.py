"""The recorder node: records into run folders when told to, splits bags, guards the disk, and closes what is open at shutdown."""

from __future__ import annotations

import contextlib
import queue
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import rosgraph
import rospy
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger, TriggerResponse

from hric_control.errors import HricError
from hric_experiments import experiment as experiments
from hric_experiments import free_space, live_node, live_topics, overrides, recorder_process, recorder_settings, run_record
from hric_experiments.recorder_diagnostics import ERROR, OK, WARN, RecorderDiagnostics
from hric_experiments.recorder_process import RecorderProcess, RecordError
from hric_experiments.recorder_settings import NOW, ON_TRIGGER
from hric_experiments.recording import Recording
from hric_experiments.run_folder import COMPLETED, FAILED, INTERRUPTED, RunFolder, runs_root

RECORDING_TOPIC, TRIGGER_TOPIC = "hric/experiment/recording", "hric/experiment/trigger"
START_SERVICE, STOP_SERVICE, SPLIT_SERVICE = (f"hric/experiment/{what}_recording" for what in ("start", "stop", "split"))
SHUTDOWN_TIMEOUT = 1.8
"""A node must end within 2 s of Ctrl-C; the bag is closed by then [s]."""
OPEN_TIMEOUT = 20.0
"""How long the recorder may take to open its bag, and to hear what must be heard [s]."""
RETRY = 30.0
"""After a split that did not work the next is tried so much later [s]."""
FREE_RUN = "bringup"
"""Name of a run that is no experiment."""


class Recorder:
    """Recordings one after the other, from the start of the node, a trigger or the start service to the stop service or the shutdown.

    All work is done in the thread that calls `work`, services and triggers only ask for it: the children of a thread end with it.

    Parameters are read from the node's private namespace: experiment, overrides, topics, exclude, runs, and those of `recorder_settings`.
    """

    def __init__(self) -> None:
        self._asked: queue.SimpleQueue[tuple[Callable[[], str], Future[str]]] = queue.SimpleQueue()
        self._settings = recorder_settings.read(lambda name, default: rospy.get_param(f"~{name}", default))
        self._overrides = overrides.separate(str(rospy.get_param("~overrides", "")))
        self._definition = experiments.load(str(rospy.get_param("~experiment", "") or experiments.NONE), self._overrides)
        self._free = self._definition.name == experiments.NONE
        self._root = runs_root(rospy.get_param("~runs", "") or None)
        self._topics = [rospy.resolve_name(str(topic)) for topic in rospy.get_param("~topics", [])]
        self._node_name = live_topics.recorder_node(rospy.get_name().rpartition("/")[2])
        self._recording: Recording | None = None
        self._last: Path | None = None
        self._trouble, self._next_split = "", 0.0
        self._diagnostics = RecorderDiagnostics()
        self._publisher = rospy.Publisher(RECORDING_TOPIC, String, queue_size=1, latch=True)
        answers = {START_SERVICE: self._on_start, STOP_SERVICE: self._on_stop, SPLIT_SERVICE: self._on_split}
        self._services = [rospy.Service(name, Trigger, partial(self._answer, work)) for name, work in answers.items()]
        self._subscriber = rospy.Subscriber(TRIGGER_TOPIC, Empty, self._on_trigger, queue_size=1)

    def begin(self) -> Path:
        """Make a run folder, start the recorder, wait until it hears what is published now, say so on `hric/experiment/recording`.

        Returns:
            the run folder.

        Raises:
            HricError: a recording goes on already, the disk is full, or the recorder does not come up.
        """
        if self._recording is not None:
            raise RecordError(f"a recording goes on already, into {self._recording.folder.path}; valid: {STOP_SERVICE}, {SPLIT_SERVICE}")
        free_space.check(self._root, self._settings.min_free)
        name = FREE_RUN if self._free else self._definition.name
        folder = RunFolder.create(self._root, name)
        run_record.write(folder, self._definition, name, self._overrides, self._settings)
        self._trouble, self._last = "", None
        recording = self._recording = Recording(folder, self._start, self._unheard)
        try:
            recording.part.wait_open(OPEN_TIMEOUT, _ending)
            self._wait_subscribed()
        except HricError:
            self._fail(recording)
            raise
        if not _ending():
            self._publisher.publish(String(str(folder.path)))
            rospy.loginfo("recording into %s", folder.path)
        return folder.path

    def _start(self, bag: Path, number: int) -> RecorderProcess:
        command = recorder_process.arguments(bag, self._topics, str(rospy.get_param("~exclude", "")), self._listener(number))
        return RecorderProcess(bag, [recorder_process.find_recorder(), *command])

    def _listener(self, number: int) -> str:
        return f"{self._node_name}_{number}" if number else self._node_name

    def _unheard(self, new: int, old: int) -> set[str]:
        return live_topics.unheard(rospy.resolve_name(self._listener(new)), rospy.resolve_name(self._listener(old)))

    def _wait_subscribed(self) -> None:
        """The recording counts as begun when it hears the topics given, else the robot's control log."""
        expected = set(self._topics) or {rospy.resolve_name("control_log")}
        deadline, name = time.monotonic() + OPEN_TIMEOUT, rospy.resolve_name(self._node_name)
        while not _ending() and not live_topics.subscribed(name, expected):
            if time.monotonic() > deadline:
                raise HricError(f"the recorder did not subscribe to {', '.join(sorted(expected))} within {OPEN_TIMEOUT:g} s")
            time.sleep(0.05)

    def _fail(self, recording: Recording) -> None:
        with contextlib.suppress(HricError):
            recording.stop()
        recording.finish(FAILED)
        self._recording = None

    def work(self) -> None:
        """Record until the node is told to end.

        Raises:
            HricError: the recording that begins with the node does not, or the recorder ended by itself.
        """
        if self._settings.start == NOW:
            self.begin()
        else:
            rospy.loginfo("armed: recording begins with %s%s", f"{TRIGGER_TOPIC} or " * (self._settings.start == ON_TRIGGER), START_SERVICE)
        while not rospy.is_shutdown():
            self._look_after()
            self._serve()

    def _serve(self, pause: float = 0.05) -> None:
        """Do what a service or a trigger asks for; wait for it so long [s]."""
        try:
            work, answer = self._asked.get(timeout=pause)
        except queue.Empty:
            live_node.sleep(0.0)
            return
        try:
            answer.set_result(work())
        except HricError as error:
            rospy.logerr("%s", error)
            answer.set_exception(error)

    def _look_after(self) -> None:
        recording = self._recording
        if recording is None:
            self._diagnostics.report(*self._idle())
            return
        free = free_space.free(recording.folder.path)
        if not recording.part.running:
            self._recording = None
            recording.finish(FAILED)
            full = f"; {free:.0f} MB are free" if free < self._settings.min_free else ""
            where = f"see {recording.folder.path}, and rosrun hric_experiments health"
            raise HricError(f"the recorder (pid {recording.part.pid}) ended by itself{full}; {where}")
        if free < self._settings.min_free:
            self._end_for_space(free)
            return
        if self._split_is_due(recording):
            self._split_by_itself(recording)
        told = {"folder": str(recording.folder.path), "part": str(recording.parts - 1), "part size [MB]": f"{recording.part_size / 1e6:.1f}"}
        level, text = (WARN, self._trouble) if self._trouble else (OK, "recording")
        self._diagnostics.report(level, text, told | {"free [MB]": f"{free:.0f}", "limit [MB]": f"{self._settings.min_free:.0f}"})

    def _idle(self) -> tuple[int, str, dict[str, str]]:
        if self._trouble:
            return ERROR, self._trouble, {}
        return OK, "armed" if self._settings.start == ON_TRIGGER else "not recording", {}

    def _end_for_space(self, free: float) -> None:
        trouble = f"the recording was ended: {free:.0f} MB are free on its disk, fewer than the limit min_free of {self._settings.min_free:.0f} MB"
        bag = self.stop(INTERRUPTED, reason=trouble)
        self._trouble = f"{trouble}; the bag is whole: {bag}"
        rospy.logerr("%s", self._trouble)
        self._diagnostics.report(ERROR, self._trouble, {}, now=True)

    def _split_is_due(self, recording: Recording) -> bool:
        size, duration = self._settings.split_size, self._settings.split_duration
        due = (0.0 < duration <= recording.part_age) or (0.0 < size * free_space.MEGABYTE <= recording.part_size)
        return due and time.monotonic() >= self._next_split

    def _split_by_itself(self, recording: Recording) -> None:
        try:
            rospy.loginfo("closed %s", recording.split(give_up=_ending))
            self._trouble = ""
        except RecordError as error:
            self._trouble, self._next_split = str(error), time.monotonic() + RETRY
            rospy.logwarn("%s", error)

    def _ask(self, work: Callable[[], str]) -> Future[str]:
        answer: Future[str] = Future()
        self._asked.put((work, answer))
        return answer

    def _answer(self, work: Callable[[], str], _: Any) -> Any:
        answer = self._ask(work)
        while not _ending():
            with contextlib.suppress(TimeoutError):
                error = answer.exception(0.1)
                return TriggerResponse(success=error is None, message=str(error or answer.result()))
        return TriggerResponse(success=False, message="the recorder ends")

    def _on_start(self) -> str:
        return str(self.begin())

    def _on_stop(self) -> str:
        return str(self.stop(COMPLETED))

    def _on_split(self) -> str:
        if self._recording is None:
            raise RecordError(f"nothing is being recorded that could be split; valid: {START_SERVICE}")
        path = self._recording.split(give_up=_ending)
        rospy.loginfo("closed %s", path)
        return str(path)

    def _on_trigger(self, _: Any) -> None:
        if self._settings.start != ON_TRIGGER:
            rospy.logwarn("a trigger came, but the recorder is not armed: parameter start is %s, not %s", self._settings.start, ON_TRIGGER)
            return
        self._ask(self._on_start)

    def stop(self, status: str, timeout: float = recorder_process.STOP_TIMEOUT, **told: object) -> Path:
        """Close the bag and note how the run ended; answers the bag, or its first part, also when it was closed before.

        Raises:
            HricError: there was no recording, or the bag could not be closed.
        """
        recording = self._recording
        if recording is None:
            if self._last is None:
                raise RecordError(f"nothing is being recorded; valid: {START_SERVICE}")
            return self._last
        with contextlib.suppress(rospy.ROSException):  # closed already, where the master asked for the end
            self._publisher.publish(String(""))
        try:
            path = self._last = recording.stop(timeout)
        except HricError:
            self._recording = None
            recording.finish(FAILED)
            raise
        recording.finish(status, **told)
        self._recording = None  # from now on: an interrupt before it is answered by closing again what is open
        rospy.loginfo("recorded %s%s", path, f" and {recording.parts - 1} more" if recording.parts > 1 else "")
        return path

    def close(self) -> None:
        """At shutdown: an experiment that is still being recorded was interrupted, or failed with its robot."""
        if self._recording is None:
            return
        if failure := _robot_failure():
            self.stop(FAILED, SHUTDOWN_TIMEOUT, error=failure)
        else:
            self.stop(COMPLETED if self._free else INTERRUPTED, SHUTDOWN_TIMEOUT)


def _robot_failure() -> str:
    """Why the robot has ended; empty: it has not, or as it was told to."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        return str(rospy.get_param(f"{rospy.resolve_name('robot')}/failure", ""))
    return ""


def _ending() -> bool:
    return bool(rospy.is_shutdown()) or live_node.interrupted()


def run() -> None:
    """Record until the shutdown; the bag is closed whatever happens."""
    recorder = Recorder()
    try:
        recorder.work()
    finally:
        recorder.close()
