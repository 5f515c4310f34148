"""The experiment node: waits for controllers and recorder, sends the set points in run time, ends the recording, reports."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from controller_manager_msgs.srv import ListControllers
from hric_control.errors import HricError
from hric_experiments import experiment as experiments
from hric_experiments import live_node, overrides, parameters
from hric_experiments.experiment import Experiment
from hric_experiments.live_human import LiveHuman
from hric_experiments.live_recorder import RECORDING_TOPIC, START_SERVICE, STOP_SERVICE, TRIGGER_TOPIC
from hric_experiments.live_sensors import LiveSensors
from hric_experiments.live_topics import unrecorded
from hric_experiments.run_folder import RunFolder

POLL = 0.01
"""Between two looks at the clock [s of wall time]."""
RECORDER_GRACE = 5.0
"""The recorder looks for new topics twice a second; what it does not hear after this it is not waited for [s of wall time]."""
SENSORS_GRACE = 20.0
"""The same where every sample is to be recorded [s of wall time]."""


class NotReady(HricError):
    """The system did not become ready in time."""


class LiveExperiment:
    """Runs one experiment against the robot in this node's namespace.

    Parameters, private: experiment, overrides, record (whether a recorder runs), armed (whether it waits for a trigger), ready_timeout
    [s of wall time], html (leave report.html, too).
    """

    def __init__(self) -> None:
        self.experiment: Experiment = experiments.load(
            str(rospy.get_param("~experiment")), overrides.separate(str(rospy.get_param("~overrides", "")))
        )
        self._recorded = bool(rospy.get_param("~record", True))
        self._armed = bool(rospy.get_param("~armed", False))
        self._timeout = float(rospy.get_param("~ready_timeout", 60.0))
        self._html = bool(rospy.get_param("~html", False))
        controllers = dict.fromkeys(setpoint.controller for setpoint in self.experiment.setpoints)
        self._publishers = {name: rospy.Publisher(f"{name}/command", Float64MultiArray, queue_size=10) for name in controllers}
        self._folder = ""
        self._human = LiveHuman(self.experiment.mocap) if self.experiment.mocap is not None else None
        self._sensors = LiveSensors(self.experiment)
        if self._recorded:
            rospy.Subscriber(RECORDING_TOPIC, String, self._on_recording)

    def _on_recording(self, message: Any) -> None:
        self._folder = message.data

    def run(self) -> str:
        """The whole experiment; answers the report, empty when nothing was recorded.

        Raises:
            HricError: not ready in time, the robot went away, or the bag cannot be used.
        """
        self._wait_ready()
        rospy.loginfo("experiment %s: %d set points, %g s", self.experiment.name, len(self._publishers), self.experiment.duration)
        interval, factor = self._send()
        if not self._recorded:
            rospy.loginfo("experiment %s ended; nothing was recorded", self.experiment.name)
            return ""
        if behind := self._sensors.drain(interval[1]):
            rospy.logwarn("what was measured last on %s has not come: the bag will lack it", ", ".join(behind))
        folder = self._stop_recording()
        folder.update(real_time_factor=factor, interval=interval)
        return self._report(folder)

    def _report(self, folder: RunFolder) -> str:
        # Loaded here, since at the start the robot waits for the processors that this would take.
        from hric_experiments import analysis, report_html

        report = str(analysis.analyse(folder)["report"]) + f"\nrun folder: {folder.path}\n"
        return report + (f"page: {report_html.write(folder)}\n" if self._html else "")

    def _wait_ready(self) -> None:
        self._wait(self._missing_controllers, "controllers that do not run: {}")
        if self._recorded:
            self._wait_recording()
        self._wait(lambda: self._unheard(1), "controllers that do not hear their command topic: {}")
        limits = RunFolder(Path(self._folder)).read().get("limits", {}) if self._recorded else {}
        for setpoint in self.experiment.setpoints:
            joints = rospy.get_param(f"{setpoint.controller}/joints", None)
            parameters.check_setpoint(setpoint, joints or [""] * len(setpoint.positions), limits)
        self._wait(lambda: [] if rospy.get_time() > 0.0 else ["/clock"], "run time does not move: nothing on {}")
        if self._human is not None:
            self._wait(self._human.missing, "no motion capture: {}")
        self._wait(self._sensors.missing, "sensors do not speak: {}")
        if self._recorded:
            self._wait_heard()

    def _wait_recording(self) -> None:
        if self._armed:
            rospy.loginfo("experiment %s waits for the trigger of the recording: %s or %s", self.experiment.name, TRIGGER_TOPIC, START_SERVICE)
            while not self._folder:
                live_node.sleep(5 * POLL)
        self._wait(lambda: [] if self._folder else [RECORDING_TOPIC], "no recorder: nothing on {}")

    def _wait_heard(self) -> None:
        """The move begins when the recorder hears all that the robot says, and the set points."""
        recorder, robot = rospy.resolve_name("recorder"), rospy.resolve_name("robot")
        others = {*(self._human.nodes() if self._human is not None else []), *self._sensors.nodes()}
        commands = {publisher.resolved_name for publisher in self._publishers.values()}
        deadline = time.monotonic() + (SENSORS_GRACE if self._sensors.sampled else RECORDER_GRACE)
        while unheard := set().union(*(unrecorded(recorder, node) for node in (robot, *others))) | (commands if self._unheard(2) else set()):
            if time.monotonic() > deadline:
                rospy.logwarn("the recorder does not hear %s yet: the bag will lack their beginning", ", ".join(sorted(unheard)))
                return
            live_node.sleep(5 * POLL)

    def _unheard(self, listeners: int) -> list[str]:
        return [name for name, publisher in self._publishers.items() if publisher.get_num_connections() < listeners]

    def _wait(self, missing: Callable[[], Sequence[str]], text: str) -> None:
        deadline = time.monotonic() + self._timeout
        while left := missing():
            if time.monotonic() > deadline:
                raise NotReady(f"experiment {self.experiment.name}: after {self._timeout:g} s {text.format(', '.join(left))}")
            live_node.sleep(5 * POLL)

    def _missing_controllers(self) -> list[str]:
        service = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)
        try:
            running = {controller.name for controller in service().controller if controller.state == "running"}
        except (rospy.ServiceException, rospy.ROSException):
            return ["controller_manager/list_controllers"]
        return [name for name in self.experiment.controllers if name not in running]

    def _send(self) -> tuple[list[float], float]:
        """Send the set points at their run times and wait for the end; answers begin and end [s of run time], and the real time factor."""
        if self._human is not None:
            self._human.start()
        begin, wall = rospy.get_time(), time.monotonic()
        for setpoint in self.experiment.setpoints:
            self._sleep_until(begin + setpoint.time)
            self._publishers[setpoint.controller].publish(Float64MultiArray(data=list(setpoint.positions)))
        self._sleep_until(begin + self.experiment.duration)
        end = rospy.get_time()
        return [float(begin), float(end)], float((end - begin) / max(time.monotonic() - wall, 1e-9))

    def _sleep_until(self, when: float) -> None:
        """Wait until run time `when`; a paused simulation pauses the experiment, a robot that went away ends it."""
        last = (rospy.get_time(), time.monotonic())
        while (now := rospy.get_time()) < when:
            if now != last[0]:
                last = (now, time.monotonic())
            elif time.monotonic() - last[1] > 5.0 and self._missing_controllers():
                raise HricError(f"experiment {self.experiment.name}: run time stands at {now:.3f} s and the robot does not answer")
            live_node.sleep(POLL)

    def _stop_recording(self) -> RunFolder:
        try:
            answer = rospy.ServiceProxy(STOP_SERVICE, Trigger)()
        except rospy.ServiceException as error:
            raise HricError(f"the recorder does not answer: {error}") from error
        if not answer.success:
            raise HricError(f"the recording could not be ended: {answer.message}")
        return RunFolder(Path(answer.message).parent)


def run() -> None:
    """Run the experiment that the parameters name and print the report."""
    report = LiveExperiment().run()
    if report:
        print(f"\n{report}", flush=True)
