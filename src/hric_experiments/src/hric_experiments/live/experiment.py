"""Experiment node: waits for controllers and recorder, sends setpoints, ends the recording, writes the report."""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import rospy
from std_msgs.msg import Float64MultiArray

from controller_manager_msgs.srv import ListControllers
from hric_bags.text import Steps
from hric_core.errors import FailureError, HricError
from hric_core.parameters import Settings, flag, number, text
from hric_core.ros import RosNode
from hric_experiments.live import node as live_node
from hric_experiments.live.human import LiveHuman
from hric_experiments.live.recording import TRIGGERS, LiveRecording
from hric_experiments.live.sensors import LiveSensors
from hric_run.definition import experiment as experiments
from hric_run.definition import overrides, parameters
from hric_run.definition.experiment import Experiment

RECORDER_GRACE = 5.0
"""Maximum wait for the recorder's subscriptions [s of wall time]; it looks for new topics twice a second."""
SENSORS_GRACE = 20.0
"""Maximum wait for the recorder's subscriptions if all samples of sensors must be recorded [s of wall time]."""


ROBOT_TIMEOUT = 2.0
"""Maximum wait for the response with the list of controllers [s of wall time]; project default, unconfirmed."""


class NotReady(FailureError):
    """Error: controllers, recorder or sensors were not ready in time."""


@dataclass(frozen=True)
class ExperimentSettings(Settings):
    """Parameters of the experiment node."""

    experiment: str = text(empty=False, text="name of the experiment, or path of its YAML file")
    overrides: str = text("", figures=True, text="overrides of the experiment")
    record: bool = flag(True, text="true if a recorder runs; false: no recording and no report")
    html: bool = flag(False, text="also write `report.html` to the run folder, which takes some seconds at the end")
    armed: bool = flag(False, text="true: the experiment waits without time limit until a trigger starts the recording")
    ready_timeout: float = number(
        60.0, minimum=0.0, unit="s", text="maximum wall time until controllers and recorder are ready"
    )


class LiveExperiment:
    """Live run of one experiment, with the robot in the namespace of this node."""

    def __init__(self) -> None:
        self._settings = settings = ExperimentSettings.read(RosNode("~"))
        self.experiment: Experiment = experiments.load(settings.experiment, overrides.separate(settings.overrides))
        if added := self.experiment.added_sections:
            raise HricError(
                f"sections not available in a live run: {', '.join(added)}; valid: hric run {settings.experiment}"
            )
        controllers = dict.fromkeys(setpoint.controller for setpoint in self.experiment.all_setpoints)
        self._publishers = {
            name: rospy.Publisher(f"{name}/command", Float64MultiArray, queue_size=10) for name in controllers
        }
        self._human = LiveHuman(self.experiment.mocap.body) if self.experiment.mocap is not None else None
        self._sensors = LiveSensors(self.experiment)
        self._recording = LiveRecording() if settings.record else None

    def run(self) -> str:
        """Run the complete experiment; return the report, empty without a recording.

        Raises:
            HricError: the system is not ready in time, the robot stops responding, or the bag cannot be read.
        """
        if self._recording is not None and self.experiment.human is not None:
            # Imported only for runs with a person: it is slow to import.
            from hric_assessment.verdict.conclusions import unknown_beforehand

            if lacking := unknown_beforehand(self.experiment.human):
                rospy.loginfo("%s", lacking)
        self._wait_ready()
        rospy.loginfo(
            "experiment %s: %d setpoints, %g s",
            self.experiment.name,
            len(self.experiment.all_setpoints),
            self.experiment.duration,
        )
        interval, factor = self._send()
        if self._recording is None:
            rospy.loginfo("experiment %s ended; nothing was recorded", self.experiment.name)
            return ""
        if behind := self._sensors.drain(interval[1]):
            rospy.logwarn("the last samples on %s were not received, so the bag lacks them", ", ".join(behind))
        self._recording.stop().update(real_time_factor=factor, interval=interval)
        return self._report(self._recording)

    def _report(self, recording: LiveRecording) -> str:
        # Imported here, as an import at the start would take processor time that the robot needs.
        from hric_report import html as report_html
        from hric_report import run as analysis

        html, folder = self._settings.html, recording.folder
        with contextlib.closing(Steps(analysis.STEPS + analysis.FIGURE_STEPS + html)) as step:
            try:
                report = str(analysis.analyse(folder, step=step)["report"]) + f"\nrun folder: {folder.path}\n"
                if html:
                    step("writing report.html")
                    report += f"page: {report_html.write(folder)}\n"
            except live_node.LiveInterrupted:
                later = f"hric report {folder.path}" + " --html" * html
                rospy.logwarn("interrupted: the bag is complete, but there is no report; to write it: %s", later)
                raise
        return report

    def _wait_ready(self) -> None:
        self._wait(self._missing_controllers, "controllers are not running: {}")
        if self._recording is not None:
            self._wait_recording(self._recording)
        self._wait(lambda: self._unconnected(1), "controllers have not subscribed to their command topics: {}")
        limits = {} if self._recording is None else self._recording.folder.read().get("limits", {})
        for setpoint in self.experiment.all_setpoints:
            joints = rospy.get_param(f"{setpoint.controller}/joints", None)
            setpoint.check_reachable(joints or [""] * len(setpoint.positions), limits)
        self._wait(
            lambda: [] if rospy.get_time() > 0.0 else ["/clock"], "robot time does not advance: no messages on {}"
        )
        if self._human is not None:
            self._wait(self._human.missing, "motion capture is not ready: {}")
        self._wait(self._sensors.missing, "sensors do not publish: {}")
        if self._recording is not None:
            self._wait_subscribed(self._recording)

    def _wait_recording(self, recording: LiveRecording) -> None:
        if self._settings.armed:
            rospy.loginfo("experiment %s waits until the recording is triggered by %s", self.experiment.name, TRIGGERS)
            while recording.missing():
                live_node.sleep(5 * live_node.POLL)
        self._wait(recording.missing, "no recorder is recording: no message on {}")

    def _wait_subscribed(self, recording: LiveRecording) -> None:
        """Wait until the recorder has subscribed to all topics of robot, sensors, setpoints; warn after a timeout."""
        others = self._human.nodes() if self._human is not None else []
        nodes = {rospy.resolve_name("robot"), *others, *self._sensors.nodes()}
        commands = {publisher.resolved_name for publisher in self._publishers.values()}
        deadline = time.monotonic() + (SENSORS_GRACE if self._sensors.sampled else RECORDER_GRACE)
        while missing := recording.unrecorded(nodes) | (commands if self._unconnected(2) else set()):
            if time.monotonic() > deadline:
                rospy.logwarn(
                    "the recorder has not subscribed to %s yet; the bag will lack the beginning of these topics",
                    ", ".join(sorted(missing)),
                )
                return
            live_node.sleep(5 * live_node.POLL)

    def _unconnected(self, listeners: int) -> list[str]:
        return [name for name, publisher in self._publishers.items() if publisher.get_num_connections() < listeners]

    def _wait(self, missing: Callable[[], Sequence[str]], text: str) -> None:
        timeout = self._settings.ready_timeout
        deadline = time.monotonic() + timeout
        while left := missing():
            if time.monotonic() > deadline:
                raise NotReady(
                    f"experiment {self.experiment.name} not started: after {timeout:g} s {text.format(', '.join(left))}"
                )
            live_node.sleep(5 * live_node.POLL)

    def _missing_controllers(self) -> list[str]:
        missing: list[str] = []
        for prefix, part in self.experiment.robots().items():
            service = f"{prefix}controller_manager/list_controllers"
            try:
                listed = live_node.call(service, ListControllers, ROBOT_TIMEOUT).controller
            except (rospy.ServiceException, rospy.ROSException, TimeoutError):
                return [service]
            running = {controller.name for controller in listed if controller.state == "running"}
            missing += [f"{prefix}{name}" for name in part.controllers if name not in running]
        return missing

    def _send(self) -> tuple[list[float], float]:
        """Send the setpoints at their times; return begin and end in robot time [s], and the real-time factor."""
        if self._human is not None:
            self._human.start()
        if self.experiment.human is not None:
            silent = f"the simulated human does not respond (service {parameters.HUMAN_START})"
            live_node.trigger(parameters.HUMAN_START, silent, "the simulated human cannot start its motion")
        begin, wall = rospy.get_time(), time.monotonic()
        for setpoint in self.experiment.all_setpoints:
            self._sleep_until(begin + setpoint.time)
            self._publishers[setpoint.controller].publish(Float64MultiArray(data=list(setpoint.positions)))
        self._sleep_until(begin + self.experiment.duration)
        end = rospy.get_time()
        return [float(begin), float(end)], float((end - begin) / max(time.monotonic() - wall, 1e-9))

    def _sleep_until(self, when: float) -> None:
        """Wait until robot time `when` [s]; a paused simulation extends the wait.

        Raises:
            FailureError: robot time does not advance and the robot does not respond.
        """
        last = (rospy.get_time(), time.monotonic())
        while (now := rospy.get_time()) < when:
            if now != last[0]:
                last = (now, time.monotonic())
            elif time.monotonic() - last[1] > 5.0 and self._missing_controllers():
                raise FailureError(
                    f"experiment {self.experiment.name} ended: robot time stands at {now:.3f} s and the robot does "
                    "not respond"
                )
            live_node.sleep(live_node.POLL)


def run() -> None:
    """Run the experiment that the private parameters of the node select, and print the report."""
    report = LiveExperiment().run()
    if report:
        print(f"\n{report}", flush=True)
